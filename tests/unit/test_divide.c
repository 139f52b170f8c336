/* divide.h: base colour in closed form. A plane under light from one direction, photographed from many: what each shows
 * is base colour times the reflection model, and that base colour comes back, whatever exposure, gain and vignette a
 * photograph has; saturated and masked pixels do not tell, unless
 * most saturate: then no less is told than their lower bound; the error that the probes share is in the texel's noise;
 * what is sent out, and what white paint would show, follow. */
#include "server/material/divide.h"
#include "server/render/bsdf.h"
#include "tests/unit/plane_rig.h"

#define PHOTOGRAPHS 24
#define ROUGHNESS 0.7f

static const rgb base_color = {0.12f, 0.35f, 0.6f}, flux = {3.0f, 2.0f, 5.0f}, light_noise = {0.09f, -0.02f, 0.1f};

/* To the light, 50 degrees from the normal. */
static vec3 to_light(void) { return (vec3){sinf(0.87f), 0.0f, cosf(0.87f)}; }

static rgb white_towards(vec3 wo) {
    vec3 wi = to_light(), h = vec3_normalize(vec3_add(wo, wi));
    return rgb_scale(flux, bsdf_diffuse(ROUGHNESS, vec3_dot(wo, h), wo.z, wi.z));
}

/* As seen from a place (`user`). */
static rgb paint(void *user, vec3 place) {
    const vec3 *from = user;
    return rgb_mul(base_color, white_towards(vec3_normalize(vec3_sub(*from, place))));
}

static rgb paint_wrong(void *user, vec3 place) { return rgb_scale(paint(user, place), 3.0f); }

/* Stores what a photograph of that exposure and gain would, with a vignette. */
static void expose(struct photograph *photo, float exposure, rgb gain) {
    photo->exposure = exposure, photo->gain = gain;
    photo->vignette[0] = -0.2f;
    for (size_t i = 0; i < PLANE_PIXELS * PLANE_PIXELS; i++) {
        float falloff = photograph_falloff(photo, (float)(i % PLANE_PIXELS) + 0.5f, (float)(i / PLANE_PIXELS) + 0.5f);
        for (size_t c = 0; c < 3; c++)
            photo->pixel[i][c] =
                image_half_from_float(image_float_from_half(photo->pixel[i][c]) * exposure * falloff * (&gain.r)[c]);
    }
}

static rgb paint_dark(void *user, vec3 place) { return rgb_scale(paint(user, place), 0.5f); }

enum faults { NONE, EXPOSED, BRACKETED, MOSTLY_SATURATED, SATURATED, MASKED };

static void photograph_plane(struct plane_rig *rig, enum faults faults) {
    static uint8_t mask[PLANE_PIXELS * PLANE_PIXELS]; /* all 0: nothing may be used */
    plane_rig_init(rig, 2 * PHOTOGRAPHS, 1);
    rig->r.materials.roughness[0] = ROUGHNESS;
    for (int i = 0; i < PHOTOGRAPHS; i++) {
        float turn = 2.4f * (float)i, slant = 1.1f * (float)i / PHOTOGRAPHS;
        vec3 from = {3.0f * sinf(slant) * cosf(turn), 3.0f * sinf(slant) * sinf(turn), 3.0f * cosf(slant)};
        /* Three of four saturate: of those that are exposed longer at half of what is there. */
        bool saturates = (faults == BRACKETED || faults == MOSTLY_SATURATED) && i % 4 != 0;
        bool is_dark = faults == BRACKETED ? saturates : faults == MOSTLY_SATURATED && !saturates;
        struct photograph *photo =
            plane_rig_add(rig, from, (vec3){0.1f, 0.1f, 0.0f}, 0.05f, is_dark ? paint_dark : paint, &from);
        if (saturates)
            photo->is_hdr = false, photo->clip = image_float_from_half(photo->pixel[0][2]) * 0.5f; /* blue alone */
        if (faults == EXPOSED)
            expose(photo, ldexpf(1.0f, i % 5 - 3), rgb_make(1.3f, 1.0f, 0.8f - 0.1f * (float)(i % 2)));
        if (faults < SATURATED)
            continue;
        photo = plane_rig_add(rig, from, (vec3){0.1f, 0.1f, 0.0f}, 0.02f, paint_wrong, &from); /* sharper, and wrong */
        if (faults == SATURATED)
            photo->is_hdr = false, photo->clip = image_float_from_half(photo->pixel[0][2]) * 0.5f; /* blue alone */
        else
            photo->mask = mask;
    }
    plane_rig_look(rig, 0.02f);
}

static void test_base_color(enum faults faults) {
    struct plane_rig rig;
    struct probes probes;
    float typical;
    photograph_plane(&rig, faults);
    struct reconstruction *r = &rig.r;
    probes_init(&probes, 8, &rig.scene.mesh, &r->atlas, &r->inverse, &r->fused);
    for (size_t i = 0; i < probes.count; i++) {
        irradiance_add(&probes.probe[i].light, (vec3){0, 0, 1}, to_light(), flux);
        probes.probe[i].light.noise = light_noise;
    }
    struct divide divide;
    const struct measurement *m = plane_rig_divide(&rig, &probes, &typical, &divide);
    rgb found = measurement_value(m), noise = rgb_from_half(m->noise);
    CHECK(m->weight > 0.0f);
    /* What all photographs share: the error of the light that arrives, as a share of it. */
    rgb arrives = rgb_scale(flux, to_light().z), white, wanted_white = white_towards((vec3){0, 0, 1});
    for (size_t c = 0; c < 3; c++) {
        float base = (&base_color.r)[c];
        CHECK_THAT(fabsf((&found.r)[c] / base - 1.0f) < 2e-3f, "faults %d, channel %zu: %g for %g", (int)faults, c,
                   (double)(&found.r)[c], (double)base);
        CHECK_NEAR((&noise.r)[c] / base, (&light_noise.r)[c] / (&arrives.r)[c], 4e-3);
    }
    /* White paint is Lambert's in divide_lambert but for its roughness, which is 1. */
    CHECK(divide_lambert(&divide, PLANE_MIDDLE, &white));
    float of_rough = bsdf_diffuse(1.0f, cosf(0.435f), 1.0f, to_light().z) /
                     bsdf_diffuse(ROUGHNESS, cosf(0.435f), 1.0f, to_light().z);
    CHECK_NEAR(white.g, wanted_white.g * of_rough, 1e-4f);
    for (size_t i = 0; i < rig.scene.photograph_count; i++)
        rig.scene.photograph[i].mask = NULL;
    mem_free(divide.measured);
    probes_release(&probes);
    plane_rig_release(&rig);
}

/* Three of four photographs count as saturated in blue; the others show half of all. */
static void test_bound(void) {
    struct plane_rig rig;
    struct probes probes;
    float typical;
    photograph_plane(&rig, MOSTLY_SATURATED);
    probes_init(&probes, 8, &rig.scene.mesh, &rig.r.atlas, &rig.r.inverse, &rig.r.fused);
    for (size_t i = 0; i < probes.count; i++)
        irradiance_add(&probes.probe[i].light, (vec3){0, 0, 1}, to_light(), flux);
    struct divide divide;
    const struct measurement *m = plane_rig_divide(&rig, &probes, &typical, &divide);
    rgb found = measurement_value(m);
    for (size_t c = 0; c < 3; c++) /* of blue what is stored is its lower bound */
        CHECK_NEAR((&found.r)[c], (&base_color.r)[c], (c == 2 ? 0.05f : 0.01f) * (&base_color.r)[c]);
    CHECK(m->bounds == 4);
    mem_free(divide.measured);
    probes_release(&probes);
    plane_rig_release(&rig);
}

/* Of an emitter, or in the dark, nothing is measured that is no number. */
static void test_nothing(void) {
    struct plane_rig rig;
    struct probes probes;
    float typical;
    photograph_plane(&rig, NONE);
    probes_init(&probes, 8, &rig.scene.mesh, &rig.r.atlas, &rig.r.inverse, &rig.r.fused);
    struct divide divide;
    const struct measurement *m = plane_rig_divide(&rig, &probes, &typical, &divide);
    rgb found = measurement_value(m);
    CHECK(isfinite(found.r) && isfinite(found.g) && isfinite(found.b) && isfinite(m->weight));
    rig.r.is_emitter[0] = true;
    divide_texels(&divide, &(uint32_t){PLANE_MIDDLE}, 1);
    CHECK(m->weight == 0.0f);
    rig.r.is_emitter[0] = false;
    mem_free(divide.measured);
    probes_release(&probes);
    plane_rig_release(&rig);
}

int main(void) {
    test_base_color(NONE);
    test_base_color(EXPOSED);
    test_base_color(BRACKETED);
    test_base_color(SATURATED);
    test_base_color(MASKED);
    test_bound();
    test_nothing();
    return check_result();
}
