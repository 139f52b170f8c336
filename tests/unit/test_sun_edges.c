/* sun_blur.h, sun_shadows.h, sunlit.h: the edge of a roof's shadow, on a plane that photographs show with pixels of
 * half a metre. The sun that is seen around a point is what a bilinear look-up of such pixels shows of it; base colour
 * is the same on both sides of the edge; and how strong the sun is is not asked there. */
#include <math.h>

#include "server/light/light_model.h"
#include "server/light/sun/sun_blur.h"
#include "tests/unit/plane_rig.h"

#define PIXEL_M 0.5f
#define AMBIENT 1.0f /* lambert radiance */
#define SUN 4.0f     /* the same, of the sun above */
#define BASE_COLOR 0.4f

/* A pixel averages over its width along x. */
static rgb paint(void *user, vec3 place) {
    (void)user;
    float part = clampf(place.x / PIXEL_M + 0.5f, 0.0f, 1.0f);
    return rgb_gray(BASE_COLOR * (AMBIENT + SUN * part));
}

static void look(struct plane_rig *rig) {
    plane_rig_init_roofed(rig, 3, 1);
    for (int k = -1; k <= 1; k++)
        plane_rig_add(rig, (vec3){0.1f * (float)k, 0.2f * (float)k, 2.5f}, (vec3){0.1f * (float)k, 0.0f, 0.0f}, PIXEL_M,
                      paint, NULL);
    plane_rig_look(rig, 0.01f);
    rig->r.sun = (struct sun){
        .is_there = true, .direction = {0, 0, 1}, .radius_rad = 1e-4f, .irradiance = rgb_gray((float)PI * SUN)};
}

/* The part of a look-up at `x` pixels from the edge that lies beyond it: the distribution of the sum of three uniform
 * variables, of a pixel's width and a bilinear weight. */
static double beyond(double x) {
    double t = fmin(fabs(x), 1.5);
    double part = t < 0.5 ? 0.5 + 0.75 * t - t * t * t / 3.0 : 1.0 - pow(1.5 - t, 3.0) / 6.0;
    return x < 0.0 ? 1.0 - part : part;
}

static void test_points(void) {
    struct plane_rig rig;
    look(&rig);
    for (int i = -6; i <= 6; i++) {
        float x = 0.1f * (float)i;
        struct surface_point at = {.triangle = 1, .position = {x, 0.05f, 0}, .normal = {0, 0, 1}, .shading = {0, 0, 1}};
        double sum = 0.0, expected = beyond((double)(x / PIXEL_M));
        for (uint32_t key = 0; key < 16; key++)
            sum += (double)sun_blur_visibility(&rig.r.sun, &rig.views, &at, key) / 16.0;
        CHECK_THAT(fabs(sum - expected) < 0.06, "%g m from the edge %.3f, not %.3f", (double)x, sum, expected);
    }
    struct surface_point below = {.position = {1, 0, 0}, .normal = {0, 0, -1}, .shading = {0, 0, -1}};
    CHECK(sun_blur_visibility(&rig.r.sun, &rig.views, &below, 1) == 0.0f);
    plane_rig_release(&rig);
}

static void test_base_color(void) {
    struct plane_rig rig;
    look(&rig);
    struct probes probes;
    struct sun_shadows shadows;
    const struct surface surface = reconstruction_surface(&rig.r);
    float typical = 0.5f;
    probes_init(&probes, 8, &rig.scene.mesh, &rig.r.atlas, &rig.r.inverse, &rig.r.fused);
    for (size_t i = 0; i < probes.count; i++)
        irradiance_add(&probes.probe[i].light, (vec3){0, 0, 1}, (vec3){0, 0, 1}, rgb_gray((float)PI * AMBIENT));
    sun_shadows_init(&shadows, &surface, &rig.r.sun, rig.r.world.accel, rig.pool);
    struct divide divide = inputs_of_divide(&rig.r, &rig.views, &probes, NULL, &shadows);
    divide.stride = 1;
    divide.typical = &typical;
    divide.highlight_samples = 4;
    divide.measured = mem_calloc(PLANE_TEXELS, sizeof *divide.measured);
    for (uint32_t x = PLANE_SIDE / 2 - 3; x < PLANE_SIDE / 2 + 3; x++) {
        uint32_t texel = PLANE_SIDE / 2 * PLANE_SIDE + x;
        divide_texels(&divide, &texel, 1);
        float found = rgb_mean(measurement_value(&divide.measured[texel]));
        CHECK_NEAR(sun_shadows_at(&shadows, texel), x < PLANE_SIDE / 2 ? 0.0f : 1.0f, 0.0f);
        CHECK(sun_shadows_blurs(&shadows, texel));
        printf("texel %u: %.3f\n", x, (double)found);
        CHECK_NEAR(found, BASE_COLOR, 0.15f * BASE_COLOR);
    }
    mem_free(divide.measured);
    sun_shadows_release(&shadows);
    probes_release(&probes);
    plane_rig_release(&rig);
}

/* Points that photographs measure, and one of which they show a bound. */
static void test_told(void) {
    struct plane_rig rig;
    look(&rig);
    const float x[] = {-1.0f, -0.2f, 0.2f, 1.0f, -0.2f, -1.0f}, expected[] = {0.0f, 0.0f, 1.0f, 1.0f, 1.0f, 0.0f};
    struct light_point point[6];
    bool is_told[6];
    struct sunlit sunlit = {.r = &rig.r, .views = &rig.views};
    for (size_t i = 0; i < 6; i++) {
        point[i] = (struct light_point){.is_bound = i >= 4};
        point[i].at = (struct surface_point){
            .triangle = 1, .position = {x[i], 0.05f, 0}, .normal = {0, 0, 1}, .shading = {0, 0, 1}};
    }
    sunlit_look(&sunlit, point, 6, is_told);
    for (size_t i = 0; i < 6; i++) {
        CHECK_THAT(is_told[i] == (i != 1 && i != 2), "point %zu", i);
        CHECK_THAT(sunlit.visibility[i] == expected[i], "point %zu sees %g", i, (double)sunlit.visibility[i]);
    }
    sunlit_release(&sunlit);
    plane_rig_release(&rig);
}

/* In the joint fit. */
static void test_fit(void) {
    struct plane_rig rig;
    struct light_model m;
    struct settings settings;
    size_t near = 0, far = 0;
    look(&rig);
    settings_init(&settings);
    rig.r.settings = &settings;
    rig.r.sun.is_clipped = true;
    light_model_init(&m, &rig.r, &rig.views, false);
    light_model_survey(&m, &rig.views, NULL, NULL);
    for (size_t i = 0; i < m.points.count; i++) {
        vec3 at = m.points.point[i].at.position;
        float off = fabsf(at.x);
        if (fabsf(at.y) > 3.0f)
            continue; /* photographs average what lies beyond the roof as well */
        near += off < 0.5f * PIXEL_M;
        far += off > 3.0f * PIXEL_M;
        CHECK_THAT(off > 0.5f * PIXEL_M || m.joint[i].deviation > 100.0f, "%g m from the edge", (double)off);
        CHECK_THAT(off < 3.0f * PIXEL_M || m.joint[i].deviation < 10.0f, "%g m from the edge", (double)off);
    }
    CHECK(near > 10 && far > 10);
    light_model_release(&m);
    settings_release(&settings);
    plane_rig_release(&rig);
}

/* Without a sun there are no shadows. */
static void test_none(void) {
    struct plane_rig rig;
    look(&rig);
    struct sun_shadows shadows;
    const struct surface surface = reconstruction_surface(&rig.r);
    sun_shadows_init(&shadows, &surface, &(struct sun){0}, rig.r.world.accel, rig.pool);
    CHECK(sun_shadows_at(&shadows, PLANE_MIDDLE) == 0.0f && !sun_shadows_blurs(&shadows, PLANE_MIDDLE));
    sun_shadows_release(&shadows);
    plane_rig_release(&rig);
}

int main(void) {
    test_points();
    test_base_color();
    test_told();
    test_fit();
    test_none();
    return check_result();
}
