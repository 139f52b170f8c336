/* color_prior.c -- see color_prior.h. */
#include "server/material/color_prior.h"

#include <math.h>

#include "common/image.h"
#include "common/mem.h"
#include "server/scene/materials.h"
#include "server/scene/surface.h"

/* Variance by light of other surfaces (measured.mixing) at which a texel has half its weight. Small: a few clean texels
 * of a black window frame must outweigh many that are mixed with the bright window. */
#define MIXING_FLOOR 0.001 /* +25 %: -0.01 dB */
/* Lower bound of a prior's variance, summed over the channels; +25 %: no change. */
#define MIN_VARIANCE 1e-4f /* +25 %: no change */
/* Cleanly measured share of a segment's texels at which its own mean and its surroundings count alike. */
#define SHARE_KNOWN 0.003 /* +25 %: -0.02 dB */
#define MIN_WEIGHT 8.0    /* clean texels in a cube from which it is used; +25 %: 0 dB */
#define STRIDE 3          /* every third valid texel is used, for time; to 4: 0 dB */
/* Grids; the finest has 2^(LEVELS - 1) cubes along the longest side of the room; to 8: no change. */
#define LEVELS 7 /* to 8: no change */

/* Weighted sums over measured texels. */
struct chart_evidence {
    double color[3], squares, weight;
};

struct grids {
    vec3 lower;
    float scale;                         /* cubes of the finest grid per metre */
    struct chart_evidence *cell[LEVELS]; /* [2^k][2^k][2^k]; owned */
};

static void evidence_add(struct chart_evidence *e, const struct measured *m) {
    rgb v = measured_value(m);
    double weight = MIXING_FLOOR / (MIXING_FLOOR + (double)image_float_from_half(m->mixing));
    e->color[0] += weight * (double)v.r;
    e->color[1] += weight * (double)v.g;
    e->color[2] += weight * (double)v.b;
    e->squares += weight * (double)rgb_dot(v, v);
    e->weight += weight;
}

static struct color_prior prior_of(const struct chart_evidence *e) {
    if (!(e->weight > 0.0))
        return (struct color_prior){rgb_gray(NEUTRAL_BASE_COLOR), 1.0f};
    rgb mean =
        rgb_make((float)(e->color[0] / e->weight), (float)(e->color[1] / e->weight), (float)(e->color[2] / e->weight));
    float variance = (float)(e->squares / e->weight) - rgb_dot(mean, mean);
    return (struct color_prior){mean, fmaxf(variance, MIN_VARIANCE)};
}

/* --- surroundings -------------------------------------------------------------------------------- */

static void grids_init(struct grids *g, const struct mesh *mesh) {
    vec3 upper;
    mesh_bounds(mesh, &g->lower, &upper);
    vec3 size = vec3_sub(upper, g->lower);
    float longest = fmaxf(size.x, fmaxf(size.y, size.z));
    g->scale = (float)(1 << (LEVELS - 1)) / fmaxf(longest * 1.0001f, 1e-6f);
    for (int k = 0; k < LEVELS; k++)
        g->cell[k] = mem_calloc((size_t)1 << (3 * k), sizeof *g->cell[k]);
}

static void grids_release(struct grids *g) {
    for (int k = 0; k < LEVELS; k++)
        mem_free(g->cell[k]);
}

static struct chart_evidence *grids_cell(const struct grids *g, int level, vec3 point) {
    uint32_t last = (1u << (LEVELS - 1)) - 1u;
    vec3 at = vec3_scale(vec3_sub(point, g->lower), g->scale);
    const float place[3] = {at.x, at.y, at.z};
    size_t index = 0;
    for (int axis = 0; axis < 3; axis++) {
        uint32_t finest = (uint32_t)clampf(place[axis], 0.0f, (float)last);
        index = index << level | finest >> (LEVELS - 1 - level);
    }
    return &g->cell[level][index];
}

static bool is_known(const struct surface *s, const bool *is_emitter, const struct measured *measured, uint32_t texel) {
    return measured[texel].weight > 0.0f && !is_emitter[surface_segment(s, texel)];
}

static void grids_fill(struct grids *g, const struct surface *s, const bool *is_emitter,
                       const struct measured *measured) {
    for (size_t i = 0; i < s->inverse->valid_count; i += STRIDE) {
        uint32_t texel = s->inverse->valid[i];
        struct surface_point at;
        if (!is_known(s, is_emitter, measured, texel) || !surface_at_texel(s->mesh, s->atlas, s->inverse, texel, &at))
            continue;
        for (int k = 0; k < LEVELS; k++)
            evidence_add(grids_cell(g, k, at.position), &measured[texel]);
    }
}

/* Means over the surroundings of each chart's texels, each from the finest grid that has enough measurements there. */
static struct chart_evidence *around_charts(const struct surface *s, const struct grids *g) {
    struct chart_evidence *around = mem_calloc(s->atlas->chart_count, sizeof *around);
    for (size_t i = 0; i < s->inverse->valid_count; i += STRIDE) {
        uint32_t texel = s->inverse->valid[i];
        struct surface_point at;
        if (!surface_at_texel(s->mesh, s->atlas, s->inverse, texel, &at))
            continue;
        int level = LEVELS - 1;
        while (level > 0 && !(grids_cell(g, level, at.position)->weight > MIN_WEIGHT))
            level--;
        const struct chart_evidence *cell = grids_cell(g, level, at.position);
        if (!(cell->weight > 0.0))
            continue;
        struct chart_evidence *to = &around[surface_chart(s, texel)];
        for (int c = 0; c < 3; c++)
            to->color[c] += cell->color[c] / cell->weight;
        to->squares += cell->squares / cell->weight;
        to->weight += 1.0;
    }
    return around;
}

/* --- segments ------------------------------------------------------------------------------------ */

/* Sums over each segment, and its number of texels. */
static struct chart_evidence *of_segments(const struct surface *s, const bool *is_emitter,
                                          const struct measured *measured, size_t *texels) {
    struct chart_evidence *own = mem_calloc(s->segments->count, sizeof *own);
    for (size_t i = 0; i < s->inverse->valid_count; i++) {
        uint32_t texel = s->inverse->valid[i];
        texels[surface_segment(s, texel)]++;
        if (is_known(s, is_emitter, measured, texel))
            evidence_add(&own[surface_segment(s, texel)], &measured[texel]);
    }
    return own;
}

static struct color_prior mix(struct color_prior a, struct color_prior b, float part_of_b) {
    return (struct color_prior){rgb_mad(rgb_scale(a.mean, 1.0f - part_of_b), part_of_b, b.mean),
                                a.variance + part_of_b * (b.variance - a.variance)};
}

struct color_prior *color_priors(const struct surface *s, const bool *is_emitter, const struct measured *measured) {
    struct grids grids;
    size_t *texels = mem_calloc(s->segments->count, sizeof *texels);
    struct chart_evidence *own = of_segments(s, is_emitter, measured, texels);
    grids_init(&grids, s->mesh);
    grids_fill(&grids, s, is_emitter, measured);
    struct chart_evidence *around = around_charts(s, &grids);
    struct color_prior *prior = mem_array(s->atlas->chart_count, sizeof *prior);
    for (size_t i = 0; i < s->mesh->triangle_count; i++) {
        size_t chart = s->atlas->chart_of_triangle[i], segment = s->segments->of_triangle[i];
        double share = own[segment].weight / ((double)texels[segment] + 1.0) / SHARE_KNOWN;
        prior[chart] = is_emitter[segment] ? (struct color_prior){rgb_gray(NEUTRAL_BASE_COLOR), 1.0f}
                                           : mix(prior_of(&around[chart]), prior_of(&own[segment]),
                                                 (float)(share * share / (1.0 + share * share)));
    }
    mem_free(around);
    mem_free(own);
    mem_free(texels);
    grids_release(&grids);
    return prior;
}
