/* highlight.c -- see highlight.h. */
#include "server/gather/highlight.h"

#include <assert.h>
#include <math.h>
#include <string.h>

#include "server/render/bsdf.h"
#include "server/render/kernel.h"
#include "server/render/light.h"
#include "server/render/sampler.h"

enum { PAIR_HALF = 8 }; /* sample dimension of the lobes, after those of incident.c */
/* Between view and shading normal, 89.94 degrees; more grazing views have no highlight; +25 %: no change. */
#define MIN_COSINE 1e-3f
/* Pairs of a view direction and a lobe sample; the mean is off by 1/32 of their deviation. */
#define ALBEDO_SAMPLES 1024 /* +25 %: no change */
#define KEY_ALBEDO 11

#define ROW 16 /* roughness levels in lanes: a multiple of what processors take at once */

/* The candidates as seen from one direction, and what they reflect there so far: arrays for arithmetic in lanes. */
struct candidates {
    size_t roughness_count, specular_count;
    vec3 wo;
    struct bsdf lobe[HIGHLIGHT_ROUGHNESSES];
    float alpha[ROW];               /* of the lobes; 1 beyond them */
    float eta[HIGHLIGHT_SPECULARS]; /* 1 beyond specular_count */
    float samples_a_level;
    float red[HIGHLIGHT_SPECULARS][ROW], green[HIGHLIGHT_SPECULARS][ROW], blue[HIGHLIGHT_SPECULARS][ROW];
};

static void candidates_init(struct candidates *c, const struct highlight_levels *levels, vec3 wo) {
    memset(c, 0, sizeof *c);
    c->roughness_count = levels->roughness_count;
    c->specular_count = levels->specular_count;
    c->wo = wo;
    for (size_t k = 0; k < ROW; k++)
        c->alpha[k] = 1.0f;
    for (size_t k = 0; k < levels->roughness_count; k++) {
        c->lobe[k] = bsdf_lobe(levels->roughness[k], 1.0f);
        c->alpha[k] = c->lobe[k].alpha;
    }
    for (size_t m = 0; m < HIGHLIGHT_SPECULARS; m++)
        c->eta[m] = m < levels->specular_count ? bsdf_eta(levels->specular[m]) : 1.0f;
}

/* Adds the light from one direction to the candidates, with the density of the whole mixture of samplers. Inlined with
 * constant counts of lanes. */
static inline __attribute__((always_inline)) void add_lanes(struct candidates *restrict c, vec3 wi, rgb light,
                                                            float light_density, size_t lanes, size_t speculars) {
    float lobe_value[ROW], level_density[ROW];
    float density = light_density, cos_d = bsdf_ggx(c->alpha[0], c->wo, wi).cos_d;
    for (size_t k = 0; k < lanes; k++) {
        struct bsdf_ggx t = bsdf_ggx(c->alpha[k], c->wo, wi);
        float over_o = 1.0f / (c->wo.z + t.root_o);
        lobe_value[k] = t.d * wi.z * over_o / (wi.z + t.root_i);
        level_density[k] = c->samples_a_level * 0.5f * t.d * over_o;
    }
    for (size_t k = 0; k < c->roughness_count; k++)
        density += level_density[k];
    for (size_t m = 0; m < speculars; m++) {
        float f = bsdf_fresnel(cos_d, c->eta[m]) / density;
        for (size_t k = 0; k < lanes; k++) {
            float weight = f * lobe_value[k];
            c->red[m][k] += weight * light.r;
            c->green[m][k] += weight * light.g;
            c->blue[m][k] += weight * light.b;
        }
    }
}

KERNEL static void add(struct candidates *c, vec3 wi, rgb light, float light_density) {
    if (c->roughness_count == 1 && c->specular_count == 1)
        add_lanes(c, wi, light, light_density, 1, 1);
    else
        add_lanes(c, wi, light, light_density, ROW, HIGHLIGHT_SPECULARS);
}

void highlight_gather(struct highlight *h, struct incident *in, const struct light_field *field,
                      const struct surface_point *at, vec3 wo_world, const struct highlight_levels *levels,
                      uint32_t key, size_t samples, size_t light_samples) {
    assert(samples + light_samples <= INCIDENT_CHUNK);
    memset(h, 0, sizeof *h);
    vec3 frame[3];
    frame[2] = at->shading;
    vec3_frame(at->shading, &frame[0], &frame[1]);
    vec3 wo = vec3_to_frame(frame, wo_world);
    if (!(wo.z > MIN_COSINE))
        return;
    if (!lights_any(field->world->lights))
        light_samples = 0;
    struct candidates c;
    candidates_init(&c, levels, wo);
    c.samples_a_level = (float)samples / (float)c.roughness_count;
    for (size_t i = 0; i < samples; i++) {
        size_t level = i % c.roughness_count;
        vec2 u = sampler_pair(key, (uint32_t)(i / c.roughness_count), PAIR_HALF + (uint32_t)level);
        in->direction[i] = vec3_from_frame(frame, bsdf_sample(&c.lobe[level], wo, 0.0f, u.x, u.y));
    }
    incident_trace(in, field, at, key, 0, samples);
    incident_sample_lights(in, field, at, key, 0, samples, light_samples);
    for (size_t i = 0; i < samples + light_samples; i++) {
        vec3 wi = vec3_to_frame(frame, in->direction[i]);
        if (wi.z > 0.0f && !rgb_is_black(in->radiance[i]))
            add(&c, wi, in->radiance[i], (float)light_samples * in->light_pdf[i]);
    }
    for (size_t k = 0; k < c.roughness_count; k++)
        for (size_t m = 0; m < c.specular_count; m++)
            h->radiance[k][m] = rgb_make(c.red[m][k], c.green[m][k], c.blue[m][k]);
}

float highlight_albedo(float roughness, float specular) {
    struct bsdf lobe = bsdf_lobe(roughness, 1.0f);
    float eta = bsdf_eta(specular), sum = 0.0f;
    uint32_t key = sampler_key(KEY_ALBEDO, 0, 0);
    for (uint32_t i = 0; i < ALBEDO_SAMPLES && specular > 0.0f; i++) {
        vec2 at = sampler_pair(key, i, 0), u = sampler_pair(key, i, 1);
        vec3 wo = {sqrtf(at.x), 0.0f, sqrtf(1.0f - at.x)};
        vec3 wi = bsdf_sample(&lobe, wo, 0.0f, u.x, u.y);
        if (!(wi.z > 0.0f))
            continue;
        struct bsdf_ggx t = bsdf_ggx(lobe.alpha, wo, wi);
        sum += bsdf_fresnel(t.cos_d, eta) * 2.0f * wi.z / (wi.z + t.root_i);
    }
    return sum * (1.0f / ALBEDO_SAMPLES);
}
