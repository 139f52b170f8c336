/* match.c -- see match.h. */
#include "server/reconstruct/match.h"

#include <math.h>

#include "common/mem.h"
#include "server/reconstruct/blocks.h"

/* Share of the median radiance below which a relative difference counts for less. */
#define DIFFERENCE_FLOOR 0.003f

/* So many deviations of noise off a look still has half its trust. Were it few, what is rarely much too bright, as
 * photographs of a renderer are, would count for less than what is often a little too dark, and all would darken. */
#define NOISE_WIDTH 8.0f

/* Looks that the solved state counts for. One look is off by a third (16 paths, one pixel), the
 * solved light of a block by 2 %: (.33 / .02)^2. */
#define PRIOR_LOOKS 256.0f

/* Logarithm of the factor by which looks at a block move together, at most. */
#define MOST_MOVED 0.1f

struct match match_look(const struct photograph_sample *reference, const rgb *radiance,
                        int sample_count, rgb expected, float deviation, float median_radiance) {
    float shown[3] = {0}, rendered[3] = {0}, clip[3] = {0};
    bool saturated[3] = {false};
    float each = 1.0f / (float)sample_count;
    for (int s = 0; s < sample_count; s++) {
        const struct photograph_sample *ref = &reference[s];
        const float r[3] = {ref->radiance.r, ref->radiance.g, ref->radiance.b};
        const float i[3] = {radiance[s].r, radiance[s].g, radiance[s].b};
        const float k[3] = {ref->clip_radiance.r, ref->clip_radiance.g, ref->clip_radiance.b};
        for (int c = 0; c < 3; c++) {
            shown[c] += each * fmaxf(r[c], 0.0f);
            rendered[c] += each * i[c];
            clip[c] += each * k[c];
            saturated[c] = saturated[c] || ref->saturated[c];
        }
    }
    struct match match;
    float off = 0.0f;
    const float about[3] = {expected.r, expected.g, expected.b};
    for (int c = 0; c < 3; c++) {
        if (saturated[c])
            shown[c] = rendered[c] >= clip[c] ? rendered[c] : clip[c];
        float scale = 1.0f / (about[c] + DIFFERENCE_FLOOR * median_radiance);
        match.shown[c] = scale * shown[c];
        match.rendered[c] = scale * rendered[c];
        off += (match.shown[c] - scale * about[c]) / 3.0f;
    }
    float usual = NOISE_WIDTH * deviation / (rgb_mean(expected) + DIFFERENCE_FLOOR * median_radiance);
    match.trust = 1.0f / (1.0f + off * off / (1.0f + usual * usual));
    return match;
}

void matcher_init(struct matcher *m, struct texture *base_color, const struct inverse_uv *inverse,
                  const struct segments *segments, const uint32_t *chart_of_triangle,
                  const struct emission *emission, int level) {
    *m = (struct matcher){.base_color = base_color, .inverse = inverse, .segments = segments,
                          .chart_of_triangle = chart_of_triangle, .emission = emission, .level = level};
    m->block = mem_calloc(blocks_count(base_color, level), sizeof *m->block);
}

void matcher_release(struct matcher *m) {
    mem_free(m->block);
    *m = (struct matcher){0};
}

size_t matcher_bytes(const struct matcher *m) {
    return blocks_count(m->base_color, m->level) * sizeof *m->block;
}

void matcher_step(struct matcher *m, uint32_t texel, const struct match *match, float trust) {
    struct texture *texture = m->base_color;
    const uint32_t *triangle = m->inverse->triangle;
    struct matcher_block *block = &m->block[blocks_at(texture, texel, m->level)];
    float slowdown = emission_slowdown(m->emission, m->segments->of_triangle[triangle[texel]]);
    float step = slowdown * trust / (block->look_count + PRIOR_LOOKS);
    block->look_count += 1.0f;
    float factor[3];
    for (int c = 0; c < 3; c++) {
        float off = (1.0f + step * (match->shown[c] - 1.0f)) / (1.0f + step * (match->rendered[c] - 1.0f));
        float moved = clampf(block->moved[c] + logf(off), -MOST_MOVED, MOST_MOVED);
        factor[c] = expf(moved - block->moved[c]);
        block->moved[c] = moved;
    }
    uint32_t chart = m->chart_of_triangle[triangle[texel]];
    size_t column = texel % texture->width, row = texel / texture->width;
    size_t half = ((size_t)1 << m->level) / 2;
    for (size_t y = row > half ? row - half : 0; y <= row + half && y < texture->height; y++) {
        for (size_t x = column > half ? column - half : 0; x <= column + half && x < texture->width; x++) {
            size_t at = y * texture->width + x;
            if (triangle[at] != INVERSE_UV_NONE && m->chart_of_triangle[triangle[at]] == chart)
                blocks_scale(texture->texel[at], factor);
        }
    }
}
