/* Closed forms: a plate under a uniform sky reflects its directional albedo whatever the sampling
 * strategy; inside a closed room that emits everywhere alike, every depth adds its share; and the
 * same bits come out for any number of threads. */
#include "common/mem.h"
#include "server/render/bsdf.h"
#include "server/render/film.h"
#include "tests/render/box.h"

/* Integral of f cos over the hemisphere by midpoints. */
static double albedo(float base, float roughness, float specular, float cosine) {
    struct bsdf b = bsdf_make(rgb_gray(base), roughness, specular, cosine);
    vec3 wo = {sqrtf(1.0f - cosine * cosine), 0.0f, cosine};
    enum { N = 600 };
    double sum = 0.0;
    for (int i = 0; i < N; i++) {
        for (int j = 0; j < N; j++) {
            double z = (i + 0.5) / N, turn = PI * (j + 0.5) / N, r = sqrt(1.0 - z * z);
            vec3 wi = {(float)(r * cos(turn)), (float)(r * sin(turn)), (float)z};
            struct bsdf_value v = bsdf_eval(&b, wo, wi);
            sum += (double)(base * v.diffuse + v.specular);
        }
    }
    return sum * 2.0 * PI / (N * N);
}

/* Mean and standard error of `count` paths along one ray. */
static double shoot(const struct box *b, struct ray ray, int depth, uint32_t count, double *error) {
    struct path_settings settings = {.max_depth = depth, .roulette_depth = 99, .seed = 31};
    struct path_batch *batch = path_batch_new(256, depth);
    struct ray rays[256];
    struct path_key key[256];
    rgb radiance[256];
    double sum = 0.0, square = 0.0;
    uint32_t groups = count / 256;
    for (uint32_t g = 0; g < groups; g++) {
        for (uint32_t i = 0; i < 256; i++) {
            rays[i] = ray;
            key[i] = (struct path_key){g, 0, i};
        }
        path_batch_trace(batch, &b->world, &settings, 256, rays, key, radiance);
        double mean = 0.0;
        for (int i = 0; i < 256; i++)
            mean += (double)radiance[i].g / 256.0;
        sum += mean / groups;
        square += mean * mean / groups;
    }
    path_batch_free(batch);
    *error = sqrt(fmax(0.0, square - sum * sum) / (groups - 1));
    return sum;
}

static void check_plate(float base, float roughness, float specular, float cosine) {
    struct box b;
    box_init(&b);
    b.mesh.triangle_count = 2; /* the floor alone */
    b.materials.emission[2] = (rgb){0.0f, 0.0f, 0.0f};
    for (uint32_t i = 0; i < BOX_SIDE * BOX_SIDE; i++)
        for (int c = 0; c < 3; c++)
            b.materials.base_color.texel[i][c] = base;
    b.materials.roughness[0] = roughness;
    b.materials.specular[0] = specular;
    struct image sky = {.width = 8, .height = 5, .channel_count = 3};
    sky.pixel = mem_array(8 * 5 * 3, sizeof(float));
    for (int i = 0; i < 8 * 5 * 3; i++)
        sky.pixel[i] = 2.0f;
    struct parallel *pool = parallel_new(1);
    struct error err;
    CHECK(world_init(&b.world, &b.mesh, &b.segments, &b.atlas, &b.materials, &sky, pool, &err) == STATUS_OK);
    float sine = sqrtf(1.0f - cosine * cosine);
    vec3 away = {sine, cosine, 0.0f}, middle = {0.5f, 0.0f, 0.5f};
    struct ray ray = {vec3_mad(middle, 0.3f, away), vec3_neg(away)};
    double error, found = shoot(&b, ray, 2, 1 << 15, &error);
    double wanted = 2.0 * albedo(base, roughness, specular, cosine);
    CHECK_THAT(fabs(found - wanted) < 4.0 * error + 2e-3 * wanted,
               "base %g roughness %g specular %g cosine %g: %g +- %g, wanted %g", (double)base, (double)roughness,
               (double)specular, (double)cosine, found, error, wanted);
    /* From below the plate is the same: materials are two-sided. */
    ray.origin.y = -ray.origin.y;
    ray.direction.y = -ray.direction.y;
    double under_error, under = shoot(&b, ray, 2, 1 << 15, &under_error);
    CHECK(fabs(under - wanted) < 4.0 * under_error + 2e-3 * wanted);
    parallel_free(pool);
    mem_free(sky.pixel);
    box_release(&b);
}

/* Roulette leaves the mean alone; `found` was made without it. */
static void check_roulette(const struct box *b, double found, double error, bool derivatives) {
    struct path_settings settings = {.max_depth = 12, .roulette_depth = 2, .derivatives = derivatives, .seed = 5};
    struct path_batch *batch = path_batch_new(256, 12);
    struct ray rays[256];
    struct path_key key[256];
    rgb radiance[256];
    double sum = 0.0, square = 0.0;
    for (uint32_t g = 0; g < 200; g++) {
        double mean = 0.0;
        for (uint32_t i = 0; i < 256; i++) {
            rays[i] = box_ray(3);
            key[i] = (struct path_key){g, 1, i};
        }
        path_batch_trace(batch, &b->world, &settings, 256, rays, key, radiance);
        for (int i = 0; i < 256; i++)
            mean += (double)radiance[i].g / 256.0;
        sum += mean / 200.0;
        square += mean * mean / 200.0;
    }
    double roulette_error = sqrt((square - sum * sum) / 199.0);
    CHECK_THAT(fabs(sum - found) < 4.0 * (error + roulette_error), "roulette: %g, without %g +- %g", sum, found,
               error + roulette_error);
    uint64_t rays_traced, dropped;
    path_batch_counts(batch, &rays_traced, &dropped);
    CHECK(rays_traced > 0 && dropped == 0);
    path_batch_free(batch);
}

/* Black walls that all shine: exactly their radiance at any depth. */
static void check_glow(void) {
    struct box b;
    box_init(&b);
    b.mesh.triangle_count = 12;
    b.materials.emission[0] = (rgb){1.0f, 0.5f, 0.25f};
    b.materials.emission[2] = (rgb){0.0f, 0.0f, 0.0f};
    for (uint32_t i = 0; i < BOX_SIDE * BOX_SIDE; i++)
        for (int c = 0; c < 3; c++)
            b.materials.base_color.texel[i][c] = 0.0f;
    box_build(&b);
    double error, found = shoot(&b, box_ray(3), 5, 1024, &error);
    CHECK_NEAR(found, 0.5, 1e-6);
    /* Grey walls: for this reflection model the albedo towards a view is near the base colour; with
     * base 0.5 the sum over depths lies between what albedos 0.45 and 0.6 give. */
    for (uint32_t i = 0; i < BOX_SIDE * BOX_SIDE; i++)
        for (int c = 0; c < 3; c++)
            b.materials.base_color.texel[i][c] = 0.5f;
    found = shoot(&b, box_ray(3), 12, 1 << 15, &error);
    CHECK_THAT(found > 0.5 / 0.55 && found < 0.5 / 0.4, "glowing room: %g", found);
    check_roulette(&b, found, error, false);
    check_roulette(&b, found, error, true);
    box_release(&b);
}

/* The gradient of a batch of chunks, and a picture, from pools of 1, 2, 3 and 7 threads. */
struct work {
    const struct box *box;
    struct path_batch **batch; /* [threads] */
    struct gradient_log **log; /* [CHUNKS] */
};

enum { CHUNKS = 13, CHUNK_PATHS = 200 };

static void work_chunk(void *user, size_t index, int thread) {
    struct work *w = user;
    struct path_settings settings = {.max_depth = 6, .roulette_depth = 3, .seed = 41};
    struct ray ray[CHUNK_PATHS];
    struct path_key key[CHUNK_PATHS];
    rgb radiance[CHUNK_PATHS];
    for (uint32_t i = 0; i < CHUNK_PATHS; i++) {
        key[i] = (struct path_key){(uint32_t)index * CHUNK_PATHS + i, 7, 0};
        ray[i] = box_ray(key[i].index);
    }
    path_batch_trace(w->batch[thread], &w->box->world, &settings, CHUNK_PATHS, ray, key, radiance);
    gradient_log_clear(w->log[index]);
    path_batch_backward(w->batch[thread], radiance, w->log[index]);
}

static void check_threads(void) {
    struct box b;
    box_init(&b);
    b.materials.specular[1] = 0.8f;
    b.materials.roughness[1] = 0.2f;
    box_build(&b);
    struct gradient *first = NULL;
    struct image first_picture = {0};
    struct camera camera = {.width = 20, .height = 15, .fx = 12, .fy = 12, .cx = 10, .cy = 7.5f};
    /* Looks along -z from the front wall, y up. */
    const float rotation[3][3] = {{1, 0, 0}, {0, -1, 0}, {0, 0, -1}};
    memcpy(camera.world_from_camera.rotation, rotation, sizeof rotation);
    camera.world_from_camera.translation = (vec3){0.5f, 0.5f, 0.97f};
    camera.camera_from_world = rigid_inverse(&camera.world_from_camera);
    const int threads[] = {1, 2, 3, 7};
    for (int t = 0; t < 4; t++) {
        struct parallel *pool = parallel_new(threads[t]);
        struct path_batch *batch[7];
        struct gradient_log *log[CHUNKS];
        for (int i = 0; i < 7; i++)
            batch[i] = path_batch_new(CHUNK_PATHS, 6);
        for (int i = 0; i < CHUNKS; i++)
            log[i] = gradient_log_new(3);
        struct work work = {&b, batch, log};
        parallel_for(pool, CHUNKS, work_chunk, &work);
        struct gradient *g = gradient_new(BOX_SIDE, BOX_SIDE, 3);
        gradient_reduce(g, log, CHUNKS, pool);
        struct path_settings settings = {.max_depth = 6, .roulette_depth = 3, .seed = 42};
        struct image picture;
        CHECK(film_render(&b.world, &camera, 8, &settings, 0, pool, &picture) == 0);
        size_t bytes = (size_t)picture.width * picture.height * picture.channel_count * sizeof(float);
        if (t == 0) {
            first = g;
            first_picture = picture;
            CHECK(g->texel_count > 100);
        } else {
            CHECK(g->texel_count == first->texel_count);
            CHECK(memcmp(g->texel, first->texel, g->texel_count * sizeof *g->texel) == 0);
            CHECK(memcmp(g->d_base_color, first->d_base_color, g->texel_count * sizeof(rgb)) == 0);
            CHECK(memcmp(g->d_roughness, first->d_roughness, 3 * sizeof(double)) == 0);
            CHECK(memcmp(g->d_specular, first->d_specular, 3 * sizeof(double)) == 0);
            CHECK(memcmp(g->d_emission, first->d_emission, 9 * sizeof(double)) == 0);
            CHECK(memcmp(picture.pixel, first_picture.pixel, bytes) == 0);
            gradient_free(g);
            image_release(&picture);
        }
        for (int i = 0; i < 7; i++)
            path_batch_free(batch[i]);
        for (int i = 0; i < CHUNKS; i++)
            gradient_log_free(log[i]);
        parallel_free(pool);
    }
    gradient_free(first);
    image_release(&first_picture);
    box_release(&b);
}

int main(void) {
    check_plate(0.6f, 0.5f, 0.0f, 0.7f);
    check_plate(0.6f, 0.3f, 0.8f, 0.7f);
    check_plate(0.0f, 0.25f, 1.0f, 0.3f);
    check_plate(1.0f, 1.0f, 0.5f, 0.9f);
    check_glow();
    check_threads();
    return check_result();
}
