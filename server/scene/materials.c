/* materials.c -- see materials.h. */
#include "server/scene/materials.h"

#include <math.h>

#include "common/image.h"
#include "common/mem.h"

/* Roughness, at most. Above that of a segment of which nothing is known (specular_posterior.h), .5: a little doubt is
 * not to take away what it mirrors. */
#define MAX_POLISHED_ROUGHNESS 0.55f

void materials_init(struct materials *m, const struct inverse_uv *inverse, size_t segment_count, rgb base_color,
                    float roughness, float specular) {
    texture_init(&m->base_color, inverse, base_color);
    m->segment_count = segment_count;
    m->emission_pattern = NULL;
    m->deviation = NULL;
    m->spread = MATERIALS_SPREAD;
    m->cone = NULL;
    m->metallic = NULL;
    m->gloss = NULL;
    m->roughness = mem_array(segment_count, sizeof *m->roughness);
    m->specular = mem_array(segment_count, sizeof *m->specular);
    m->emission = mem_calloc(segment_count, sizeof *m->emission);
    for (size_t s = 0; s < segment_count; s++) {
        m->roughness[s] = roughness;
        m->specular[s] = specular;
    }
}

void materials_release(struct materials *m) {
    texture_release(&m->base_color);
    mem_free(m->roughness);
    mem_free(m->specular);
    mem_free(m->emission);
    mem_free(m->cone);
    mem_free(m->metallic);
    mem_free(m->gloss);
    mem_free(m->deviation);
    materials_drop_emission_pattern(m);
    *m = (struct materials){0};
}

void materials_start_deviation(struct materials *m) {
    mem_free(m->deviation);
    m->deviation = mem_calloc((size_t)m->base_color.width * m->base_color.height, sizeof *m->deviation);
}

rgb materials_deviation(const struct materials *m, size_t texel) {
    float measured = m->deviation ? image_float_from_half(m->deviation[texel]) : 0.0f;
    const float *c = m->base_color.texel[texel];
    rgb least = rgb_scale(rgb_make(c[0], c[1], c[2]), m->spread);
    return measured > 0.0f ? rgb_make(fmaxf(measured, least.r), fmaxf(measured, least.g), fmaxf(measured, least.b))
                           : rgb_gray(0.0f);
}

bool materials_is_polished(const struct materials *m, uint32_t segment) {
    return m->specular[segment] > 0.0f && m->roughness[segment] <= MAX_POLISHED_ROUGHNESS;
}

void materials_start_emission_pattern(struct materials *m) {
    materials_drop_emission_pattern(m);
    size_t texels = (size_t)m->base_color.width * m->base_color.height;
    m->emission_pattern = mem_calloc(texels, sizeof *m->emission_pattern);
}

void materials_drop_emission_pattern(struct materials *m) {
    mem_free(m->emission_pattern);
    m->emission_pattern = NULL;
}

/* Lower bound of a pattern's channels, since 0 stands for unknown. */
#define MIN_PATTERN 1e-3f

static float pattern_of(float radiance, float mean) { return mean > 0.0f ? fmaxf(radiance / mean, MIN_PATTERN) : 1.0f; }

void materials_set_emission_pattern(struct materials *m, size_t texel, rgb radiance, rgb mean) {
    rgb pattern = {pattern_of(radiance.r, mean.r), pattern_of(radiance.g, mean.g), pattern_of(radiance.b, mean.b)};
    rgb_to_half(m->emission_pattern[texel], pattern);
}

/* The first of the two texels around `at`, both within [0, size), and the weight of the second. */
static uint32_t linear_tap(float at, uint32_t size, float *share) {
    float x = clampf(at - 0.5f, 0.0f, (float)(size - 1));
    uint32_t first = size > 1 && x >= (float)(size - 1) ? size - 2 : (uint32_t)x;
    *share = x - (float)first;
    return first;
}

rgb materials_emission_pattern(const struct materials *m, float x, float y) {
    uint32_t width = m->base_color.width, height = m->base_color.height;
    float right, down, weights = 0.0f;
    uint32_t column = linear_tap(x, width, &right), row = linear_tap(y, height, &down);
    rgb sum = rgb_gray(0.0f);
    for (uint32_t k = 0; k < 4; k++) {
        uint32_t dx = k % 2, dy = k / 2;
        float weight = (dx ? right : 1.0f - right) * (dy ? down : 1.0f - down);
        if (!(weight > 0.0f))
            continue;
        rgb own = rgb_from_half(m->emission_pattern[(size_t)(row + dy) * width + column + dx]);
        if (rgb_is_black(own))
            continue;
        sum = rgb_mad(sum, weight, own);
        weights += weight;
    }
    return weights > 0.0f ? rgb_scale(sum, 1.0f / weights) : rgb_gray(1.0f);
}

void materials_gloss(const struct materials *m, uint32_t segment, float x, float y, float *roughness, float *metallic) {
    struct texture_taps taps;
    *roughness = m->roughness[segment];
    *metallic = m->metallic[segment];
    if (*metallic != MATERIALS_BY_TEXEL)
        return;
    float sum[2] = {0.0f, 0.0f};
    texture_taps(&m->base_color, x, y, &taps);
    for (int k = 0; k < 4; k++)
        for (int c = 0; c < 2 && taps.weight[k] > 0.0f; c++)
            sum[c] += taps.weight[k] * image_float_from_half(m->gloss[taps.texel[k]][c]);
    *roughness = sum[0];
    *metallic = sum[1];
}

rgb materials_emission_of_texel(const struct materials *m, uint32_t segment, size_t texel) {
    rgb mean = m->emission[segment], own = {0.0f, 0.0f, 0.0f};
    if (m->emission_pattern)
        own = rgb_from_half(m->emission_pattern[texel]);
    return rgb_is_black(own) ? mean : rgb_mul(mean, own);
}
