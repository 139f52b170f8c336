/* film.h, light.h: what is no number goes nowhere. Non-finite samples count as black, are counted, and spoil no other
 * pixel; pixels of the environment that are not finite, or negative, are black to what looks at it and to what samples
 * it. A camera that looks in sees no backs. */
#include "server/render/film.h"
#include "server/scene/latlong.h"
#include "tests/unit/plane_rig.h"

#define MAP_WIDTH 16
#define MAP_HEIGHT 8
#define RADIANCE 2.0f

static void make_sky(struct image *sky) {
    image_init_rgb(sky, MAP_WIDTH, MAP_HEIGHT);
    for (size_t i = 0; i < 3 * MAP_WIDTH * MAP_HEIGHT; i++)
        sky->pixel[i] = RADIANCE;
}

/* Half of the plane has a base colour that is none. */
static void test_dropped(void) {
    struct plane_rig rig;
    struct image sky, image;
    vec3 from = {0.0f, 0.0f, 3.0f};
    rgb black = {0.0f, 0.0f, 0.0f};
    plane_rig_init(&rig, 1, 1);
    make_sky(&sky);
    world_set_environment(&rig.r.world, &sky, rig.pool);
    rig.r.materials.roughness[0] = 1.0f;
    for (size_t i = 0; i < PLANE_TEXELS; i++)
        rig.r.materials.base_color.texel[i][1] = i % PLANE_SIDE < PLANE_SIDE / 2 ? NAN : 0.5f;
    const struct camera *camera = &plane_rig_add(&rig, from, (vec3){0, 0, 0}, 0.2f, plane_paint_one, &black)->camera;
    struct path_settings path = {.max_depth = 3, .roulette_depth = 3, .seed = 1};
    uint64_t dropped = film_render(&rig.r.world, camera, 16, &path, 0, rig.pool, &image);
    size_t spoilt = 0, sound = 0;
    for (size_t i = 0; i < PLANE_PIXELS * PLANE_PIXELS; i++) {
        const float *p = image.pixel + image.channel_count * i;
        vec3 d;
        CHECK(isfinite(p[0]) && isfinite(p[1]) && isfinite(p[2]));
        CHECK(camera_direction(camera, (float)(i % PLANE_PIXELS) + 0.5f, (float)(i / PLANE_PIXELS) + 0.5f, &d));
        float x = from.x + from.z * d.x / -d.z;
        if (x < -0.5f) {
            CHECK(p[0] == 0.0f && p[1] == 0.0f);
            spoilt++;
        } else if (x > 0.5f) {
            CHECK_NEAR(p[1], 0.5f * RADIANCE, 0.15f * RADIANCE);
            sound++;
        }
    }
    CHECK(spoilt > 50 && sound > 50);
    CHECK_THAT(dropped >= spoilt * 16, "%llu of %zu", (unsigned long long)dropped, spoilt * 16);
    image_release(&image);
    image_release(&sky);
    views_init(&rig.views, &rig.scene, &rig.r.segments, rig.r.world.accel, rig.pool);
    plane_rig_release(&rig);
}

/* Two halves of the same paths: their mean is the whole, and they are as far apart as its standard error says. */
static void test_halves(void) {
    struct plane_rig rig;
    struct image sky, whole, halves;
    rgb grey = {0.5f, 0.5f, 0.5f};
    plane_rig_init(&rig, 1, 1);
    make_sky(&sky);
    sky.pixel[3 * (2 * MAP_WIDTH + 3)] = 300.0f; /* makes noise */
    world_set_environment(&rig.r.world, &sky, rig.pool);
    const struct camera *camera =
        &plane_rig_add(&rig, (vec3){0, 0, 3}, (vec3){0, 0, 0}, 0.2f, plane_paint_one, &grey)->camera;
    struct path_settings path = {.max_depth = 3, .roulette_depth = 3, .seed = 1};
    film_render(&rig.r.world, camera, 16, &path, 5, rig.pool, &whole);
    film_render_halves(&rig.r.world, camera, 16, &path, 5, rig.pool, &halves);
    double apart = 0.0, error = 0.0;
    for (size_t i = 0; i < PLANE_PIXELS * PLANE_PIXELS; i++)
        for (size_t c = 0; c < 3; c++) {
            double a = (double)halves.pixel[6 * i + c], b = (double)halves.pixel[6 * i + 3 + c];
            CHECK_NEAR(0.5 * (a + b), whole.pixel[6 * i + c], 1e-5 * fabs(a + b));
            apart += 0.25 * (a - b) * (a - b);
            error += (double)whole.pixel[6 * i + 3 + c] * (double)whole.pixel[6 * i + 3 + c];
        }
    CHECK(image_channel(&halves, "b.B") == 5 && halves.channel_count == 6);
    CHECK_THAT(apart > 0.0 && fabs(apart / error - 1.0) < 0.3, "%g, standard error %g", apart, error);
    image_release(&whole);
    image_release(&halves);
    image_release(&sky);
    views_init(&rig.views, &rig.scene, &rig.r.segments, rig.r.world.accel, rig.pool);
    plane_rig_release(&rig);
}

/* The share of a camera's pixels that the plane covers, and its picture's mean. */
static void look(const struct plane_rig *rig, const struct camera *camera, double *covered, double *mean) {
    struct path_settings path = {.max_depth = 3, .roulette_depth = 3, .seed = 1};
    struct image image, first;
    film_render(&rig->r.world, camera, 4, &path, 0, rig->pool, &image);
    film_render_first_hits(&rig->r.world, camera, 4, 1, rig->pool, &first);
    int coverage = image_channel(&first, "coverage");
    *covered = *mean = 0.0;
    for (size_t i = 0; i < PLANE_PIXELS * PLANE_PIXELS; i++) {
        *covered += (double)first.pixel[i * first.channel_count + (size_t)coverage] / (PLANE_PIXELS * PLANE_PIXELS);
        *mean += (double)image.pixel[i * image.channel_count] / (PLANE_PIXELS * PLANE_PIXELS);
    }
    image_release(&image);
    image_release(&first);
}

/* What looks in sees fronts as before, and through the backs of surfaces. */
static void test_looks_in(void) {
    struct plane_rig rig;
    struct image sky;
    rgb black = {0.0f, 0.0f, 0.0f};
    plane_rig_init(&rig, 2, 1);
    make_sky(&sky);
    world_set_environment(&rig.r.world, &sky, rig.pool);
    for (int side = -1; side <= 1; side += 2) {
        vec3 from = {0.0f, 0.0f, 3.0f * (float)side};
        struct camera camera = plane_rig_add(&rig, from, (vec3){0, 0, 0}, 0.2f, plane_paint_one, &black)->camera;
        double covered[2], mean[2];
        for (int k = 0; k < 2; k++) {
            camera.looks_in = k == 1;
            look(&rig, &camera, &covered[k], &mean[k]);
        }
        CHECK(covered[0] > 0.2);
        CHECK(side > 0 ? covered[1] == covered[0] && mean[1] == mean[0] : covered[1] == 0.0);
        if (side < 0)
            CHECK_NEAR(mean[1], (double)RADIANCE, 1e-6);
    }
    image_release(&sky);
    views_init(&rig.views, &rig.scene, &rig.r.segments, rig.r.world.accel, rig.pool);
    plane_rig_release(&rig);
}

static void test_environment(void) {
    static const float wrong[] = {NAN, INFINITY, -INFINITY, -3.0f};
    struct image sky;
    make_sky(&sky);
    for (uint32_t k = 0; k < 4; k++)
        sky.pixel[3 * (3 * MAP_WIDTH + 3 * k + 1) + 1] = wrong[k];
    struct lights *lights = lights_new(&sky);
    for (uint32_t k = 0; k < 4; k++) {
        rgb there = lights_environment(lights, latlong_pixel(MAP_WIDTH, MAP_HEIGHT, 3 * k + 1, 3.0));
        CHECK_NEAR(there.g, 0.0f, 1e-3f);
        CHECK_NEAR(there.r, RADIANCE, 1e-3f);
    }
    CHECK_NEAR(lights_environment(lights, latlong_pixel(MAP_WIDTH, MAP_HEIGHT, 3.0, 5.0)).g, RADIANCE, 1e-4f);
    double whole = 0.0, wanted = 4.0 * PI * (double)RADIANCE -
                                 4.0 * (double)RADIANCE * latlong_pixel_angle(MAP_WIDTH, MAP_HEIGHT, 3);
    const uint32_t count = 1u << 14;
    for (uint32_t i = 0; i < count; i++) {
        struct light_sample s;
        float u = (float)(i % 128) / 128.0f, v = (float)(i / 128) / 128.0f;
        lights_sample(lights, (vec3){0, 0, 0}, fmodf((float)i * 0.618034f, 1.0f), u, v, &s);
        CHECK(isfinite(s.pdf) && s.pdf > 0.0f && isfinite(s.radiance.g));
        whole += (double)(s.radiance.g / s.pdf) / count;
    }
    CHECK_NEAR(whole / wanted, 1.0, 0.02);
    lights_free(lights);
    image_release(&sky);
}

int main(void) {
    test_dropped();
    test_halves();
    test_looks_in();
    test_environment();
    return check_result();
}
