/* specular_fit.h: roughness and specular of a plane under a disc of distant light, from photographs that show what the
 * reflection model says, integrated over the disc: a polished, a satin, an eggshell and a matt one come back.
 * specular_observation.h: means over a patch have the noise that is stated, whether they read some pixels or a part of
 * one. */
#include "server/material/specular_fit.h"
#include "common/rng.h"
#include "server/render/bsdf.h"
#include "server/scene/latlong.h"
#include "tests/unit/plane_rig.h"

#define MAP_WIDTH 128
#define MAP_HEIGHT 64
#define DISC_COSINE 0.97f /* 14 degrees */
#define RADIANCE 30.0f
#define PHOTOGRAPHS 30
#define NOISE 0.1f /* deviation, as a part of what is shown */

static const rgb base_color = {0.4f, 0.3f, 0.2f};

struct disc {
    size_t count;
    vec3 direction[512];
    float angle[512]; /* sr */
};

/* What a place of the plane shows. */
struct seen_from {
    vec3 place;
    const struct disc *disc;
    float roughness, specular;
};

static rgb paint(void *user, vec3 place) {
    const struct seen_from *from = user;
    vec3 wo = vec3_normalize(vec3_sub(from->place, place));
    struct bsdf model = bsdf_make(base_color, from->roughness, from->specular, wo.z);
    rgb sum = rgb_gray(0.0f);
    for (size_t i = 0; i < from->disc->count; i++) {
        struct bsdf_value f = bsdf_eval(&model, wo, from->disc->direction[i]);
        float light = RADIANCE * from->disc->angle[i], shine = from->specular > 0.0f ? f.specular : 0.0f;
        sum = rgb_mad(rgb_add(sum, rgb_gray(light * shine)), light * f.diffuse, base_color);
    }
    return sum;
}

static void make_sky(struct image *sky, struct disc *disc) {
    vec3 middle = vec3_normalize((vec3){0.5f, 0.1f, 1.0f});
    disc->count = 0;
    image_init_rgb(sky, MAP_WIDTH, MAP_HEIGHT);
    for (uint32_t i = 0; i < MAP_WIDTH * MAP_HEIGHT; i++) {
        vec3 d = latlong_pixel(MAP_WIDTH, MAP_HEIGHT, i % MAP_WIDTH, i / MAP_WIDTH);
        if (vec3_dot(d, middle) < DISC_COSINE)
            continue;
        disc->direction[disc->count] = d;
        disc->angle[disc->count++] = (float)latlong_pixel_angle(MAP_WIDTH, MAP_HEIGHT, i / MAP_WIDTH);
        for (size_t c = 0; c < 3; c++)
            sky->pixel[3 * i + c] = RADIANCE;
    }
    CHECK(disc->count > 30 && disc->count < 512);
}

static void test_fit(const struct image *sky, const struct disc *disc, float roughness, float specular) {
    struct plane_rig rig;
    struct probes probes;
    plane_rig_init(&rig, PHOTOGRAPHS, 1);
    struct reconstruction *r = &rig.r;
    world_set_environment(&r->world, sky, rig.pool);
    for (int i = 0; i < PHOTOGRAPHS; i++) {
        float turn = 2.4f * (float)i, slant = 1.0f * sqrtf(((float)i + 0.5f) / PHOTOGRAPHS);
        struct seen_from from = {{6.0f * sinf(slant) * cosf(turn), 6.0f * sinf(slant) * sinf(turn), 6.0f * cosf(slant)},
                                 disc,
                                 roughness,
                                 specular};
        plane_rig_add(&rig, from.place, (vec3){0.0f, 0.0f, 0.0f}, 0.35f, paint, &from);
    }
    plane_rig_look(&rig, 0.01f);
    probes_init(&probes, 8, &rig.scene.mesh, &r->atlas, &r->inverse, &r->fused);
    for (size_t i = 0; i < probes.count; i++)
        for (size_t k = 0; k < disc->count; k++)
            irradiance_add(&probes.probe[i].light, (vec3){0, 0, 1}, disc->direction[k],
                           rgb_gray(RADIANCE * disc->angle[k]));
    uint16_t(*sent)[3] = mem_calloc(PLANE_TEXELS, sizeof *sent);
    struct light_field field = {&r->world, (const uint16_t(*)[3])sent, NULL, NULL};
    const struct specular_input input = {
        reconstruction_surface(r), &r->fused, &rig.views, &r->noise, &probes, &field, &r->sun};
    specular_fit(&input, r->is_emitter, &r->materials, r->pool);
    printf("roughness %.3f specular %.3f, true %.3f %.3f\n", (double)r->materials.roughness[0],
           (double)r->materials.specular[0], (double)roughness, (double)specular);
    float found[2] = {r->materials.roughness[0], r->materials.specular[0]};
    struct parallel *three = parallel_new(3);
    specular_fit(&input, r->is_emitter, &r->materials, three);
    CHECK(found[0] == r->materials.roughness[0] && found[1] == r->materials.specular[0]);
    parallel_free(three);
    float off = roughness > 0.7f ? 2.0f : 1.0f; /* so wide a highlight is not told apart that well */
    CHECK_NEAR(r->materials.specular[0], specular, 0.06f * off);
    if (specular > 0.0f)
        CHECK_NEAR(r->materials.roughness[0], roughness, 0.03f * off);
    mem_free(sent);
    probes_release(&probes);
    plane_rig_release(&rig);
}

static rgb paint_noise(void *user, vec3 place) {
    uint32_t *drawn = user;
    (void)place;
    return rgb_gray(1.0f + NOISE * sqrtf(3.0f) * (2.0f * rng_to_float(rng_mix32((*drawn)++)) - 1.0f));
}

/* Mean square of the errors of patches of so many texels, in stated deviations. */
static void test_noise(float patch_texels, float pixel_m) {
    struct plane_rig rig;
    struct specular_observer observer;
    uint32_t drawn = 0;
    double squares = 0.0, count = 0.0;
    plane_rig_init(&rig, PHOTOGRAPHS, 1);
    for (int i = 0; i < PHOTOGRAPHS; i++)
        plane_rig_add(&rig, (vec3){0.3f * (float)(i % 6 - 3), 0.3f * (float)(i / 6 - 3), 7.0f},
                      (vec3){0.1f, 0.2f, 0.0f}, pixel_m, paint_noise, &drawn);
    plane_rig_look(&rig, NOISE);
    struct reconstruction *r = &rig.r;
    const struct specular_input input = {
        .surface = reconstruction_surface(r), .fused = &r->fused, .views = &rig.views, .noise = &r->noise};
    specular_observer_init(&observer, &input, 1);
    for (size_t attempt = 0; attempt < PLANE_TEXELS; attempt++) {
        struct specular_sample sample;
        if (!specular_observe(&observer, 0, attempt, (struct specular_criteria){patch_texels, 0, 1}, &sample))
            continue;
        for (size_t v = 0; v < sample.count; v++) {
            double e = (double)((sample.view[v].observed.g - 1.0f) / sample.view[v].deviation.g);
            squares += e * e;
            count += 1.0;
        }
    }
    printf("patches of %.1f texels, %.2f pixels a side: errors of %.2f deviations\n", (double)patch_texels,
           (double)(patch_texels * PLANE_METRES / PLANE_SIDE / pixel_m), sqrt(squares / count));
    CHECK(count > 100.0);
    CHECK_NEAR(sqrt(squares / count), 1.0, 0.25);
    specular_observer_release(&observer);
    plane_rig_release(&rig);
}

int main(void) {
    test_noise(1.0f, 1.0f);
    test_noise(8.0f, 1.0f);
    test_noise(13.0f, 0.5f);
    struct image sky;
    struct disc disc;
    make_sky(&sky, &disc);
    test_fit(&sky, &disc, 0.25f, 0.5f);
    test_fit(&sky, &disc, 0.45f, 1.0f);
    test_fit(&sky, &disc, 0.8f, 0.6f);
    test_fit(&sky, &disc, 1.0f, 0.0f);
    image_release(&sky);
    return check_result();
}
