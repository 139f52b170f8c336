/* environment.h, fill.h, visibility.h, relight/environment.h: the sky behind a window is found in the photographs,
 * whatever their exposures and faults; samples go where its light finds a way in. */
#include "common/rng.h"
#include "common/sha256.h"
#include "server/capture/distant/environment_gather.h"
#include "server/relight/environment.h"
#include "tests/render/open_room.h"

static void digest(const struct environment *e, char hex[SHA256_HEX_SIZE]) {
    struct sha256 sha;
    size_t cells = (size_t)e->map.width * e->map.height;
    sha256_init(&sha);
    sha256_update(&sha, e->map.pixel, cells * 3 * sizeof(float));
    sha256_update(&sha, e->confidence.pixel, cells * 2 * sizeof(float));
    sha256_hex(&sha, hex);
}

/* Relative error of the luminance where the sky was seen: the median, and of the mean. Cells at the
 * sun's rim are left out of the first: a pixel there holds both. */
static void compare_with_sky(const struct environment *e, double *median, double *mean) {
    size_t count = 0, cells = (size_t)e->map.width * e->map.height;
    float *error = mem_array(cells, sizeof *error);
    double found = 0.0, wanted = 0.0;
    for (uint32_t i = 0; i < cells; i++) {
        if (e->confidence.pixel[2 * i] == 0.0f)
            continue;
        const float *p = e->map.pixel + 3 * i;
        vec3 d = direction_of(&e->map, i % e->map.width, i / e->map.width);
        float ours = rgb_luminance((rgb){p[0], p[1], p[2]}), truth = rgb_luminance(sky_at(d));
        double angle = sqrt(1.0 - (double)(d.y * d.y));
        found += angle * (double)ours;
        wanted += angle * (double)truth;
        error[count++] = fabsf(ours / truth - 1.0f);
    }
    for (size_t i = 1; i < count; i++) /* insertion: few cells */
        for (size_t k = i; k > 0 && error[k] < error[k - 1]; k--) {
            float swap = error[k];
            error[k] = error[k - 1];
            error[k - 1] = swap;
        }
    *median = count ? (double)error[count / 2] : 1.0;
    *mean = found / wanted - 1.0;
    mem_free(error);
}

/* What was filled in is finite, smooth, around the seam too, and within the range of what was seen. */
static void check_fill(const struct environment *e) {
    uint32_t w = e->map.width, h = e->map.height;
    float worst = 0.0f;
    for (uint32_t y = 0; y < h; y++) {
        for (uint32_t x = 0; x < w; x++) {
            size_t at = (size_t)y * w + x, beside = (size_t)y * w + (x + 1) % w;
            float a = e->map.pixel[3 * at + 1], b = e->map.pixel[3 * beside + 1];
            CHECK(isfinite(a) && a >= 0.0f);
            if (e->confidence.pixel[2 * at] > 0.0f || e->confidence.pixel[2 * beside] > 0.0f)
                continue;
            CHECK(a > 0.5f && a < 40.0f); /* the sun does not spread */
            worst = fmaxf(worst, fabsf(a - b) / fmaxf(a, b));
            if (y == 0 || y == h - 1)
                CHECK(a == b);
        }
    }
    CHECK_THAT(worst < 0.3f, "filled neighbours differ by %g", (double)worst);
    printf("fill: neighbours differ by %.3f at most\n", (double)worst);
}

static void test_recovers_sky(struct scene *scene) {
    struct environment e;
    char first[SHA256_HEX_SIZE], hex[SHA256_HEX_SIZE];
    const int threads[] = {1, 2, 5};
    for (int i = 0; i < 3; i++) {
        struct rig rig;
        rig_init(&rig, scene, threads[i]);
        CHECK(environment_gather(&e, &rig.views, 0.0f, rig.pool));
        digest(&e, i == 0 ? first : hex);
        if (i > 0)
            CHECK_STRING(hex, first);
        if (i < 2)
            environment_release(&e);
        rig_release(&rig);
    }
    double median, mean;
    compare_with_sky(&e, &median, &mean);
    printf("sky: %u x %u, %.1f %% of the sphere by %zu photographs, median error %.4f, mean %+.4f, "
           "spread %.4f\n",
           e.map.width, e.map.height, 100.0 * e.seen_share, e.photograph_count, median, mean, e.median_spread);
    CHECK(e.map.width == 128 && e.map.height == 64); /* 2 pi 30 pixels around */
    CHECK(e.seen_share > 0.05 && e.seen_share < 0.5 && e.saturated_share == 0.0);
    CHECK_THAT(median < 0.01, "median error %g", median);
    CHECK_THAT(fabs(mean) < 0.05, "mean error %g", mean);
    CHECK_THAT(e.median_spread < 0.05, "spread %g", e.median_spread);
    check_fill(&e);
    environment_release(&e);
}

/* Exposures of a capture, by frame. */
enum exposures { CYCLING, ONLY_LONG, PARTED };

static float exposure_of(enum exposures how, size_t frame) {
    bool is_short = how == CYCLING ? frame / 2 % 2 == 1 : how == PARTED && frame % 3 == 0;
    return is_short ? 0.09f / 16.66f : how == PARTED ? 9.0f : 0.09f;
}

/* Exposures that cycle, clipped at 1: a saturated value is a lower bound, not a value. Where only
 * long exposures look the sun is known from below, and the figures say so. Where those are so long that even the
 * darkest sky saturates, while others tell of it, such directions count as unseen. */
static void test_exposures(const struct scene *scene, enum exposures how) {
    static const char *const name[] = {"cycling", "long", "parted"};
    struct scene sdr = *scene;
    struct rig rig;
    struct environment e;
    sdr.photograph = mem_array(scene->photograph_count, sizeof *sdr.photograph);
    for (size_t f = 0; f < scene->photograph_count; f++) {
        struct photograph *photo = &sdr.photograph[f];
        *photo = scene->photograph[f];
        size_t pixels = (size_t)photo->camera.width * photo->camera.height;
        photo->is_hdr = false;
        photo->clip = 1.0f;
        photo->exposure = exposure_of(how, f);
        photo->pixel = mem_array(pixels, sizeof *photo->pixel);
        for (size_t i = 0; i < 3 * pixels; i++) {
            float value = photo->exposure * image_float_from_half(scene->photograph[f].pixel[i / 3][i % 3]);
            float code = roundf(255.0f * image_linear_to_srgb(fminf(value, 1.0f)));
            photo->pixel[i / 3][i % 3] = image_half_from_float(image_srgb_to_linear(code / 255.0f));
        }
    }
    rig_init(&rig, &sdr, 2);
    CHECK(environment_gather(&e, &rig.views, 0.0f, rig.pool));
    double median, mean;
    compare_with_sky(&e, &median, &mean);
    printf("%s exposures: median error %.4f, mean %+.4f, saturated %.3f of it, %.3f of the sphere seen\n", name[how],
           median, mean, e.saturated_share, e.seen_share);
    CHECK_THAT(median < 0.03, "median error %g", median);
    if (how == ONLY_LONG) {
        CHECK(e.saturated_share > 0.001 && mean < -0.2);
    } else if (how == PARTED) {
        CHECK(e.saturated_share == 0.0 && e.seen_share < 0.17 && fabs(mean) < 0.12);
    } else {
        CHECK_THAT(fabs(mean) < 0.12, "mean error %g", mean);
    }
    environment_release(&e);
    rig_release(&rig);
    for (size_t f = 0; f < scene->photograph_count; f++)
        mem_free(sdr.photograph[f].pixel);
    mem_free(sdr.photograph);
}

/* The same pixels under photographs of their own, whose claims a test may change; photograph[] is the
 * caller's (mem_free). */
static struct scene altered(const struct scene *scene) {
    struct scene other = *scene;
    other.photograph = mem_array(scene->photograph_count, sizeof *other.photograph);
    memcpy(other.photograph, scene->photograph, scene->photograph_count * sizeof *other.photograph);
    return other;
}

/* A night sky of noise about black: what black pixels read below 0 makes up for the others, and no direction is darker
 * than black. */
static void test_night(const struct scene *scene) {
    struct scene other = altered(scene);
    struct rig rig;
    struct environment e;
    double stored = 0.0, count = 0.0;
    for (size_t f = 0; f < scene->photograph_count; f++) {
        struct photograph *photo = &other.photograph[f];
        size_t pixels = (size_t)photo->camera.width * photo->camera.height;
        photo->is_hdr = false;
        photo->clip = 1.0f;
        photo->black = 0.3f;
        photo->pixel = mem_array(pixels, sizeof *photo->pixel);
        for (size_t i = 0; i < 3 * pixels; i++) {
            float value = rng_key(5, f, i) % 3 == 0 ? 0.6f : 0.0f;
            photo->pixel[i / 3][i % 3] = image_half_from_float(value);
            stored += (double)value;
            count += 1.0;
        }
    }
    rig_init(&rig, &other, 2);
    CHECK(environment_gather(&e, &rig.views, 0.0f, rig.pool));
    for (size_t i = 0; i < 3 * (size_t)e.map.width * e.map.height; i++)
        CHECK(e.map.pixel[i] >= 0.0f);
    CHECK_THAT(e.seen_luminance < 0.6 * stored / count, "%g of %g", e.seen_luminance, stored / count);
    environment_release(&e);
    rig_release(&rig);
    for (size_t f = 0; f < scene->photograph_count; f++)
        mem_free(other.photograph[f].pixel);
    mem_free(other.photograph);
}

/* A few frames show something else in the same directions, brighter or darker: it changes little. */
static void test_outliers(const struct scene *scene) {
    struct scene other = altered(scene);
    struct rig rig;
    struct environment e;
    for (size_t f = 0; f < scene->photograph_count; f += 6)
        other.photograph[f].gain = rgb_gray(f % 12 == 0 ? 0.1f : 5.0f);
    rig_init(&rig, &other, 2);
    CHECK(environment_gather(&e, &rig.views, 0.0f, rig.pool));
    double median, mean;
    compare_with_sky(&e, &median, &mean);
    printf("with outliers: median error %.4f, spread %.3f\n", median, e.median_spread);
    CHECK_THAT(median < 0.03, "median error %g", median);
    CHECK(e.median_spread > 0.1);
    environment_release(&e);
    rig_release(&rig);
    mem_free(other.photograph);
}

/* Cameras turned by up to a pixel: light and frame mix at the window's rim, which speaks softly. */
static void test_wrong_poses(const struct scene *scene) {
    struct scene other = altered(scene);
    struct rig rig;
    struct environment e;
    for (size_t f = 0; f < scene->photograph_count; f++) {
        struct camera *c = &other.photograph[f].camera;
        c->cx += 2.0f * fmodf((float)f * 0.618f, 1.0f) - 1.0f; /* as good as a turn by as many pixels */
        c->cy += 2.0f * fmodf((float)f * 0.755f, 1.0f) - 1.0f;
    }
    rig_init(&rig, &other, 2);
    CHECK(environment_gather(&e, &rig.views, 0.0f, rig.pool));
    double median, mean;
    compare_with_sky(&e, &median, &mean);
    printf("with wrong poses: median error %.4f, mean %+.4f\n", median, mean);
    CHECK_THAT(median < 0.01, "median error %g", median);
    CHECK_THAT(fabs(mean) < 0.1, "mean error %g", mean);
    environment_release(&e);
    rig_release(&rig);
    mem_free(other.photograph);
}

/* A closed room has none, and neither has one whose openings are masked. */
static void test_nothing(struct scene *masked, struct parallel *pool) {
    struct scene closed;
    struct environment e;
    struct rig rig;
    make_scene(&closed, pool);
    rig_init(&rig, &closed, 1);
    CHECK(!environment_gather(&e, &rig.views, 0.0f, rig.pool) && e.map.pixel == NULL);
    rig_release(&rig);
    scene_release(&closed);
    rig_init(&rig, masked, 1);
    CHECK(!environment_gather(&e, &rig.views, 0.0f, rig.pool));
    environment_release(&e);
    rig_release(&rig);
}

static double mean_variance(const struct world *world, const struct camera *camera, struct parallel *pool) {
    struct path_settings path = {.max_depth = 6, .roulette_depth = 99, .seed = 3};
    struct image film;
    double sum = 0.0;
    film_render(world, camera, 64, &path, 0, pool, &film);
    size_t pixels = (size_t)film.width * film.height;
    for (size_t i = 0; i < pixels; i++)
        sum += pow((double)film.pixel[film.channel_count * i + 4], 2.0) / (double)pixels;
    image_release(&film);
    return sum;
}

/* Samples that go where light finds a way in are less noisy than samples by luminance alone, and
 * the lamp keeps its share. */
static void test_reach(struct parallel *pool, const struct image *sky) {
    struct mesh mesh;
    struct model model;
    make_open_mesh(&mesh, 0.8f);
    model_init(&model, &mesh, 64, 0.6f, pool);
    model_light(&model, &mesh, rgb_gray(2.0f), sky, pool);
    struct camera camera = look((vec3){3.5f, 1.5f, 2.8f}, (vec3){1, 1, 1.5f});
    double with = mean_variance(&model.world, &camera, pool);
    float chance = model.world.lights->environment_chance;
    lights_set_environment(model.world.lights, sky, NULL);
    double without = mean_variance(&model.world, &camera, pool);
    printf("variance with the reach over without: %.3f; chance of the environment %.3f\n", with / without,
           (double)chance);
    CHECK_THAT(with < 0.7 * without, "%g of the variance", with / without);
    CHECK(model.world.lights->environment_chance == 0.5f && chance > 0.05f && chance < 0.95f);
    model_release(&model);
    mesh_release(&mesh);
}

/* A single bright patch, looked for in the room's frame. */
static vec3 brightest(const struct image *map) {
    size_t best = 0;
    for (size_t i = 0; i < (size_t)map->width * map->height; i++)
        if (map->pixel[3 * i] > map->pixel[3 * best])
            best = i;
    return direction_of(map, (uint32_t)(best % map->width), (uint32_t)(best / map->width));
}

static void test_orient(void) {
    struct image picture, out;
    image_init_rgb(&picture, 64, 33);
    picture.pixel[3 * (16 * 64)] = 1.0f; /* half a cell from -z, on the horizon */
    const struct {
        vec3 up;
        float turn;
        vec3 wanted;
    } cases[] = {{{0, 1, 0}, 0, {0, 0, -1}},  {{0, 1, 0}, 90, {-1, 0, 0}}, {{0, 0, 1}, 0, {0, 1, 0}},
                 {{0, 0, 1}, 90, {-1, 0, 0}}, {{1, 0, 0}, 0, {0, 0, -1}},  {{1, 0, 0}, 90, {0, 1, 0}},
                 {{0, -1, 0}, 0, {0, 0, 1}},  {{0, 0, -1}, 0, {0, -1, 0}}};
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        struct compass compass = compass_of(cases[i].up);
        environment_orient(&picture, ENVIRONMENT_OF_FILE, &compass, cases[i].turn, 2.0f, &out);
        float cosine = vec3_dot(brightest(&out), cases[i].wanted);
        CHECK_THAT(cosine > 0.98f, "up %g %g %g, turned by %g: cosine %g", (double)cases[i].up.x, (double)cases[i].up.y,
                   (double)cases[i].up.z, (double)cases[i].turn, (double)cosine);
        image_release(&out);
    }
    image_release(&picture);
}

int main(void) {
    struct open_room room;
    open_room_init(&room);
    test_orient();
    test_recovers_sky(&room.scene);
    test_exposures(&room.scene, CYCLING);
    test_exposures(&room.scene, ONLY_LONG);
    test_exposures(&room.scene, PARTED);
    test_night(&room.scene);
    test_outliers(&room.scene);
    test_wrong_poses(&room.scene);
    test_nothing(&room.masked, room.pool);
    test_reach(room.pool, &room.sky);
    open_room_release(&room);
    return check_result();
}
