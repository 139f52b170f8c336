/* highlight.c -- see highlight.h. */
#include "server/gather/highlight.h"

#include <assert.h>
#include <math.h>
#include <string.h>

#include "server/render/bsdf.h"
#include "server/render/light.h"
#include "server/render/sampler.h"

enum { PAIR_HALF = 8 }; /* sample dimension of the lobes, after those of incident.c */
/* Between view and shading normal, 89.94 degrees; more grazing views have no highlight; +25 %: no change. */
#define MIN_COSINE 1e-3f
/* Pairs of a view direction and a lobe sample; the mean is off by 1/32 of their deviation. */
#define ALBEDO_SAMPLES 1024 /* +25 %: no change */
#define KEY_ALBEDO 11

/* Adds the light from one direction to every level, with the density of the whole mixture of samplers. */
static void add(struct highlight *h, const struct highlight_levels *levels, const struct bsdf *lobe, const float *eta,
                vec3 wo, vec3 wi, rgb light, float samples_a_level, float light_density) {
    float lobe_value[HIGHLIGHT_ROUGHNESSES], density = light_density, cos_d = 0.0f;
    for (size_t k = 0; k < levels->roughness_count; k++) {
        struct bsdf_ggx t = bsdf_ggx(lobe[k].alpha, wo, wi);
        float over_o = 1.0f / (wo.z + t.root_o);
        cos_d = t.cos_d;
        lobe_value[k] = t.d * wi.z * over_o / (wi.z + t.root_i);
        density += samples_a_level * 0.5f * t.d * over_o;
    }
    for (size_t m = 0; m < levels->specular_count; m++) {
        float f = bsdf_fresnel(cos_d, eta[m]) / density;
        for (size_t k = 0; k < levels->roughness_count; k++)
            h->radiance[k][m] = rgb_mad(h->radiance[k][m], f * lobe_value[k], light);
    }
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
    struct bsdf lobe[HIGHLIGHT_ROUGHNESSES];
    float eta[HIGHLIGHT_SPECULARS];
    size_t levels_used = levels->roughness_count;
    for (size_t k = 0; k < levels_used; k++)
        lobe[k] = bsdf_lobe(levels->roughness[k], 1.0f);
    for (size_t m = 0; m < levels->specular_count; m++)
        eta[m] = bsdf_eta(levels->specular[m]);
    for (size_t i = 0; i < samples; i++) {
        vec2 u = sampler_pair(key, (uint32_t)(i / levels_used), PAIR_HALF + (uint32_t)(i % levels_used));
        in->direction[i] = vec3_from_frame(frame, bsdf_sample(&lobe[i % levels_used], wo, 0.0f, u.x, u.y));
    }
    incident_trace(in, field, at, key, 0, samples);
    incident_sample_lights(in, field, at, key, 0, samples, light_samples);
    for (size_t i = 0; i < samples + light_samples; i++) {
        vec3 wi = vec3_to_frame(frame, in->direction[i]);
        if (wi.z > 0.0f && !rgb_is_black(in->radiance[i]))
            add(h, levels, lobe, eta, wo, wi, in->radiance[i], (float)samples / (float)levels_used,
                (float)light_samples * in->light_pdf[i]);
    }
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
