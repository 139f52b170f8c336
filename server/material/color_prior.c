/* color_prior.c -- see color_prior.h. */
#include "server/material/color_prior.h"

#include <math.h>

#include "common/image.h"
#include "common/mem.h"
#include "common/ordered.h"
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

/* What one texel adds. */
static struct chart_evidence evidence_of(const struct measurement *m) {
    rgb v = measurement_value(m);
    double weight = MIXING_FLOOR / (MIXING_FLOOR + (double)image_float_from_half(m->mixing));
    return (struct chart_evidence){
        {weight * (double)v.r, weight * (double)v.g, weight * (double)v.b}, weight * (double)rgb_dot(v, v), weight};
}

static void evidence_add(struct chart_evidence *sum, const struct chart_evidence *e) {
    for (int c = 0; c < 3; c++)
        sum->color[c] += e->color[c];
    sum->squares += e->squares;
    sum->weight += e->weight;
}

static struct color_prior prior_of(const struct chart_evidence *e) {
    if (!(e->weight > 0.0))
        return (struct color_prior){rgb_gray(NEUTRAL_BASE_COLOR), 1.0f};
    rgb mean =
        rgb_make((float)(e->color[0] / e->weight), (float)(e->color[1] / e->weight), (float)(e->color[2] / e->weight));
    float variance = (float)(e->squares / e->weight) - rgb_dot(mean, mean);
    return (struct color_prior){mean, fmaxf(variance, MIN_VARIANCE)};
}

/* --- grids --------------------------------------------------------------------------------------- */

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

/* --- sums over texels ---------------------------------------------------------------------------- */

struct prior_sums {
    const struct surface *surface;
    const bool *is_emitter;
    const struct measurement *measured;
    struct parallel *pool;
    struct grids grids;
    struct chart_evidence *around; /* [chart_count] means over the surroundings of each chart's texels */
    struct chart_evidence *own;    /* [segment_count] over each segment */
    size_t *texels;                /* [segment_count] of each segment */
};

/* What a texel contributes. */
struct term {
    bool is_there;
    vec3 position; /* of grids alone */
    struct chart_evidence evidence;
};

static bool is_known(const struct prior_sums *s, uint32_t texel) {
    return s->measured[texel].weight > 0.0f && !s->is_emitter[surface_segment(s->surface, texel)];
}

static uint32_t texel_of_grid(const struct prior_sums *s, size_t index) {
    return s->surface->inverse->valid[index * STRIDE];
}

static size_t count_of_grid(const struct prior_sums *s) {
    return (s->surface->inverse->valid_count + STRIDE - 1) / STRIDE;
}

static bool position_of(const struct prior_sums *s, uint32_t texel, vec3 *position) {
    struct surface_point at;
    if (!surface_at_texel(s->surface->mesh, s->surface->atlas, s->surface->inverse, texel, &at))
        return false;
    *position = at.position;
    return true;
}

static void grid_term(void *user, size_t index, void *result) {
    const struct prior_sums *s = user;
    uint32_t texel = texel_of_grid(s, index);
    struct term *term = result;
    term->is_there = is_known(s, texel) && position_of(s, texel, &term->position);
    if (term->is_there)
        term->evidence = evidence_of(&s->measured[texel]);
}

static void add_to_grids(void *user, size_t index, const void *result) {
    (void)index;
    const struct prior_sums *s = user;
    const struct term *term = result;
    for (int k = 0; k < LEVELS && term->is_there; k++)
        evidence_add(grids_cell(&s->grids, k, term->position), &term->evidence);
}

/* The mean of the finest grid that has enough measurements there. */
static void surroundings_term(void *user, size_t index, void *result) {
    const struct prior_sums *s = user;
    struct term *term = result;
    term->is_there = position_of(s, texel_of_grid(s, index), &term->position);
    if (!term->is_there)
        return;
    int level = LEVELS - 1;
    while (level > 0 && !(grids_cell(&s->grids, level, term->position)->weight > MIN_WEIGHT))
        level--;
    const struct chart_evidence *cell = grids_cell(&s->grids, level, term->position);
    term->is_there = cell->weight > 0.0;
    for (int c = 0; c < 3; c++)
        term->evidence.color[c] = cell->color[c] / cell->weight;
    term->evidence.squares = cell->squares / cell->weight;
    term->evidence.weight = 1.0;
}

static void add_to_chart(void *user, size_t index, const void *result) {
    const struct prior_sums *s = user;
    const struct term *term = result;
    if (term->is_there)
        evidence_add(&s->around[surface_chart(s->surface, texel_of_grid(s, index))], &term->evidence);
}

static void own_term(void *user, size_t index, void *result) {
    const struct prior_sums *s = user;
    uint32_t texel = s->surface->inverse->valid[index];
    struct term *term = result;
    term->is_there = is_known(s, texel);
    if (term->is_there)
        term->evidence = evidence_of(&s->measured[texel]);
}

static void add_to_segment(void *user, size_t index, const void *result) {
    const struct prior_sums *s = user;
    const struct term *term = result;
    uint32_t segment = surface_segment(s->surface, s->surface->inverse->valid[index]);
    s->texels[segment]++;
    if (term->is_there)
        evidence_add(&s->own[segment], &term->evidence);
}

static void sums_make(struct prior_sums *s) {
    s->texels = mem_calloc(s->surface->segments->count, sizeof *s->texels);
    s->own = mem_calloc(s->surface->segments->count, sizeof *s->own);
    s->around = mem_calloc(s->surface->atlas->chart_count, sizeof *s->around);
    grids_init(&s->grids, s->surface->mesh);
    ordered_for(s->pool, s->surface->inverse->valid_count, sizeof(struct term), own_term, add_to_segment, s);
    ordered_for(s->pool, count_of_grid(s), sizeof(struct term), grid_term, add_to_grids, s);
    ordered_for(s->pool, count_of_grid(s), sizeof(struct term), surroundings_term, add_to_chart, s);
}

static void sums_release(struct prior_sums *s) {
    grids_release(&s->grids);
    mem_free(s->around);
    mem_free(s->own);
    mem_free(s->texels);
}

/* --- priors -------------------------------------------------------------------------------------- */

static struct color_prior mix(struct color_prior a, struct color_prior b, float part_of_b) {
    return (struct color_prior){rgb_mad(rgb_scale(a.mean, 1.0f - part_of_b), part_of_b, b.mean),
                                a.variance + part_of_b * (b.variance - a.variance)};
}

struct color_prior *color_priors(const struct surface *surface, const bool *is_emitter,
                                 const struct measurement *measured, struct parallel *pool) {
    struct prior_sums s = {.surface = surface, .is_emitter = is_emitter, .measured = measured, .pool = pool};
    sums_make(&s);
    struct color_prior *prior = mem_array(surface->atlas->chart_count, sizeof *prior);
    for (size_t i = 0; i < surface->mesh->triangle_count; i++) {
        size_t chart = surface->atlas->chart_of_triangle[i], segment = surface->segments->of_triangle[i];
        double share = s.own[segment].weight / ((double)s.texels[segment] + 1.0) / SHARE_KNOWN;
        prior[chart] = is_emitter[segment] ? (struct color_prior){rgb_gray(NEUTRAL_BASE_COLOR), 1.0f}
                                           : mix(prior_of(&s.around[chart]), prior_of(&s.own[segment]),
                                                 (float)(share * share / (1.0 + share * share)));
    }
    sums_release(&s);
    return prior;
}
