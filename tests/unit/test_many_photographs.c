/* fuse.h, divide.h, emission_pattern.h: of more photographs than are kept of a texel the sharpest tell, wherever they
 * come in the capture; all are counted. The same for any number of threads. */
#include "server/material/divide.h"
#include "server/material/emission_pattern.h"
#include "server/reconstruct/inputs.h"
#include "tests/unit/plane_rig.h"

#define FAR_OFF 8.0f /* metres: such a photograph weighs a 64th of one from 1 m */
#define NEAR 20      /* photographs, the last ones */

static rgb far_color = {0.2f, 0.2f, 0.2f}, near_color = {0.8f, 0.7f, 0.6f}, blue_color = {0.05f, 0.05f, 0.2f};

static rgb paint_halves(void *user, vec3 place) {
    (void)user;
    return rgb_gray(place.x < 0.1f ? 0.25f : 1.0f);
}

/* Of `count` photographs all but the last show the plane from far off. */
static void photograph_all(struct plane_rig *rig, uint32_t count, int threads, rgb paint_near(void *, vec3)) {
    plane_rig_init(rig, count, threads);
    for (uint32_t i = 0; i < count; i++) {
        bool near = i + NEAR >= count;
        vec3 at = {0.01f * (float)(i % 7), 0.01f * (float)(i % 5), near ? 1.0f : FAR_OFF};
        plane_rig_add(rig, at, (vec3){0.1f, 0.1f, 0.0f}, near ? 0.2f : 0.4f, near ? paint_near : plane_paint_one,
                      near ? &near_color : &far_color);
    }
    plane_rig_look(rig, 0.02f);
}

static void test_fuse(uint32_t count, int most_threads) {
    uint16_t first[3] = {0};
    for (int threads = 1; threads <= most_threads; threads += 2) {
        struct plane_rig rig;
        photograph_all(&rig, count, threads, plane_paint_one);
        rgb found = fused_radiance(&rig.r.fused, PLANE_MIDDLE);
        CHECK_THAT(fabsf(found.r - near_color.r) < 0.05f, "of %u photographs: %g", count, (double)found.r);
        CHECK_NEAR(found.b, near_color.b, 0.05f);
        CHECK_NEAR(rig.r.fused.count[PLANE_MIDDLE], count, 0.0f);
        CHECK(!rig.r.fused.is_bound[PLANE_MIDDLE]);
        double p = (double)NEAR / count, apart = log(0.7 + 0.002) - log(0.2 + 0.002);
        CHECK_NEAR(rig.r.fused.spread[PLANE_MIDDLE], apart * sqrt(p * (1.0 - p)), 0.02);
        if (threads == 1)
            memcpy(first, rig.r.fused.radiance[PLANE_MIDDLE], sizeof first);
        CHECK(memcmp(first, rig.r.fused.radiance[PLANE_MIDDLE], sizeof first) == 0);
        plane_rig_release(&rig);
    }
}

/* The first half only bounds it, since blue saturates: what was measured tells. */
static void test_bounds(void) {
    struct plane_rig rig;
    const uint32_t count = 600;
    plane_rig_init(&rig, count, 1);
    for (uint32_t i = 0; i < count; i++) {
        bool bound = i < count / 2;
        vec3 at = {0.01f * (float)(i % 7), 0.0f, bound ? 1.0f : FAR_OFF};
        struct photograph *photo = plane_rig_add(&rig, at, (vec3){0.1f, 0.1f, 0.0f}, bound ? 0.2f : 0.4f,
                                                 plane_paint_one, bound ? &blue_color : &near_color);
        if (bound)
            photo->is_hdr = false, photo->clip = 0.1f;
    }
    plane_rig_look(&rig, 0.02f);
    CHECK(!rig.r.fused.is_bound[PLANE_MIDDLE]);
    CHECK_NEAR(fused_radiance(&rig.r.fused, PLANE_MIDDLE).r, near_color.r, 0.01f);
    CHECK_NEAR(rig.r.fused.count[PLANE_MIDDLE], count, 0.0f);
    plane_rig_release(&rig);
}

/* How bright a texel is, by which noise is told, the photographs say by the light they had: five of a 64th of the
 * exposure are wrong, and have half of what they show as noise at what the four others show, but none at what they show
 * themselves. */
static void test_exposure(void) {
    struct plane_rig rig;
    rgb right = {1.0f, 1.0f, 1.0f}, wrong = {3.0f / 64.0f, 3.0f / 64.0f, 3.0f / 64.0f};
    plane_rig_init(&rig, 9, 1);
    for (int i = 0; i < 9; i++) {
        struct photograph *photo = plane_rig_add(&rig, (vec3){0.01f * (float)i, 0.0f, 2.0f}, (vec3){0.1f, 0.1f, 0.0f},
                                                 0.2f, plane_paint_one, i < 4 ? &right : &wrong);
        photo->exposure = i < 4 ? 1.0f : 1.0f / 64.0f;
    }
    plane_rig_look(&rig, 0.01f);
    rig.r.noise.share[19] = 0.5f; /* stored values from 1/64 to 2/64 */
    fused_release(&rig.r.fused);
    fuse(&rig.r.fused, &rig.views, &rig.r.noise, &rig.r.atlas, &rig.r.inverse, rig.pool);
    CHECK_NEAR(fused_radiance(&rig.r.fused, PLANE_MIDDLE).r, 1.0f, 0.01f);
    plane_rig_release(&rig);
}

/* Under light from above of pi irradiance: base colour is what is shown. */
static void test_divide(uint32_t count) {
    struct plane_rig rig;
    struct probes probes;
    photograph_all(&rig, count, 1, plane_paint_one);
    probes_init(&probes, 8, &rig.scene.mesh, &rig.r.atlas, &rig.r.inverse, &rig.r.fused);
    for (size_t i = 0; i < probes.count; i++)
        irradiance_add(&probes.probe[i].light, (vec3){0, 0, 1}, (vec3){0, 0, 1}, rgb_gray((float)PI));
    float typical;
    struct divide divide;
    const struct measurement *m = plane_rig_divide(&rig, &probes, &typical, &divide);
    rgb found = measurement_value(m);
    CHECK_THAT(fabsf(found.r - near_color.r) < 0.05f, "of %u photographs: %g", count, (double)found.r);
    mem_free(divide.measured);
    probes_release(&probes);
    plane_rig_release(&rig);
}

/* The picture of a screen that only those from near can tell. */
static void test_emission_pattern(uint32_t count) {
    struct plane_rig rig;
    photograph_all(&rig, count, 1, paint_halves);
    rig.r.is_emitter[0] = true;
    rig.r.evidence[0] =
        (struct emitter_evidence){.radiance = {0.5f, 0.5f, 0.5f}, .observed = {0.5f, 0.5f, 0.5f}, .is_seen = true};
    const struct emission_pattern_input input = inputs_of_pattern(&rig.r, &rig.views);
    emission_pattern_find(&input, &rig.r.materials, rig.r.evidence);
    CHECK(rig.r.materials.emission_pattern != NULL);
    if (rig.r.materials.emission_pattern) {
        float left = image_float_from_half(rig.r.materials.emission_pattern[PLANE_MIDDLE - 2][0]);
        float right = image_float_from_half(rig.r.materials.emission_pattern[PLANE_MIDDLE + 2][0]);
        CHECK_THAT(right > 2.5f * left, "%g beside %g", (double)left, (double)right);
    }
    rig.r.is_emitter[0] = false;
    plane_rig_release(&rig);
}

int main(void) {
    test_fuse(300, 3);
    test_fuse(2100, 1);
    test_bounds();
    test_exposure();
    test_divide(100);
    test_emission_pattern(100);
    return check_result();
}
