/* probes.c -- see probes.h. */
#include "server/gather/probes.h"

#include <math.h>
#include <string.h>

#include "common/mem.h"
#include "server/render/sampler.h"

/* Radius of the interpolation tent, in cells: 1.5 blends four to nine probes, and is continuous. */
#define FILTER_RADIUS 1.5f /* +25 %: -0.04 dB */
/* Weight factor of a probe that no photograph sees, for a texel that one does: such probes lie in hidden, dark places.
 * One seen probe around outweighs all others. */
#define UNSEEN_WEIGHT 0.01f /* +25 %: 0 dB */
#define MIN_WEIGHT 1e-6f    /* of any probe around, so that no texel is without light; +25 %: 0 dB */
#define CHUNK 16            /* probes a work item */

/* --- positions ------------------------------------------------------------------------------------- */

/* The best probe position of each chart in one cell: a seen texel nearest to the cell's centre. */
struct places {
    size_t count;
    struct probe *probe;
    float *distance; /* squared, from the cell's centre, texels */
};

static void offer_place(struct places *p, uint32_t texel, uint32_t chart, bool seen, float distance) {
    size_t i = 0;
    while (i < p->count && p->probe[i].chart != chart)
        i++;
    if (i == p->count)
        p->count++;
    else if (p->probe[i].seen > seen || (p->probe[i].seen == seen && p->distance[i] <= distance))
        return;
    p->probe[i] = (struct probe){.texel = texel, .chart = chart, .seen = seen};
    p->distance[i] = distance;
}

uint32_t probes_cell_side(const struct probes *p, size_t block) {
    uint32_t cells = 1u << p->halvings[block];
    return (p->spacing + cells - 1) / cells;
}

static size_t block_of(const struct probes *p, uint32_t x, uint32_t y) {
    return (size_t)(y / p->spacing) * p->columns + x / p->spacing;
}

static void find_places(struct places *places, const struct probes *p, size_t block, uint32_t cell,
                        const struct inverse_uv *inverse, const struct atlas *atlas, const struct fused *fused) {
    uint32_t side = probes_cell_side(p, block), column = cell & ((1u << p->halvings[block]) - 1u);
    uint32_t left = (uint32_t)(block % p->columns) * p->spacing, top = (uint32_t)(block / p->columns) * p->spacing;
    uint32_t x0 = left + column * side, y0 = top + (cell >> p->halvings[block]) * side;
    float middle = 0.5f * (float)(side - 1);
    places->count = 0;
    for (uint32_t y = y0; y < y0 + side && y < top + p->spacing && y < inverse->height; y++) {
        for (uint32_t x = x0; x < x0 + side && x < left + p->spacing && x < inverse->width; x++) {
            uint32_t texel = y * inverse->width + x, triangle = inverse->triangle[texel];
            if (triangle == INVERSE_UV_NONE)
                continue;
            float dx = (float)(x - x0) - middle, dy = (float)(y - y0) - middle;
            offer_place(places, texel, atlas->chart_of_triangle[triangle], fused->count[texel] > 0.0f,
                        dx * dx + dy * dy);
        }
    }
}

static void place_all(struct probes *p, const struct mesh *mesh, const struct atlas *atlas,
                      const struct inverse_uv *inverse, const struct fused *fused) {
    size_t block_count = (size_t)p->columns * p->rows, most = (size_t)p->spacing * p->spacing, capacity = block_count;
    struct places places = {.probe = mem_array(most, sizeof *places.probe),
                            .distance = mem_array(most, sizeof *places.distance)};
    p->first_cell = mem_array(block_count + 1, sizeof *p->first_cell);
    p->first_cell[0] = 0;
    for (size_t block = 0; block < block_count; block++)
        p->first_cell[block + 1] = p->first_cell[block] + (1u << 2 * p->halvings[block]);
    p->first = mem_array((size_t)p->first_cell[block_count] + 1, sizeof *p->first);
    p->probe = mem_array(capacity, sizeof *p->probe);
    p->count = 0;
    for (size_t block = 0; block < block_count; block++) {
        for (uint32_t cell = 0; cell < p->first_cell[block + 1] - p->first_cell[block]; cell++) {
            p->first[p->first_cell[block] + cell] = (uint32_t)p->count;
            find_places(&places, p, block, cell, inverse, atlas, fused);
            if (p->count + places.count > capacity) {
                capacity = 2 * (p->count + places.count);
                p->probe = mem_realloc_array(p->probe, capacity, sizeof *p->probe);
            }
            for (size_t i = 0; i < places.count; i++) {
                struct surface_point at;
                surface_at_texel(mesh, atlas, inverse, places.probe[i].texel, &at);
                places.probe[i].shading = at.shading;
                p->probe[p->count++] = places.probe[i];
            }
        }
    }
    p->first[p->first_cell[block_count]] = (uint32_t)p->count;
    mem_free(places.probe);
    mem_free(places.distance);
}

static void release_places(struct probes *p) {
    mem_free(p->probe);
    mem_free(p->first);
    mem_free(p->first_cell);
}

void probes_init(struct probes *p, uint32_t spacing, const struct mesh *mesh, const struct atlas *atlas,
                 const struct inverse_uv *inverse, const struct fused *fused) {
    *p = (struct probes){.spacing = spacing,
                         .columns = (inverse->width + spacing - 1) / spacing,
                         .rows = (inverse->height + spacing - 1) / spacing};
    p->halvings = mem_calloc((size_t)p->columns * p->rows, sizeof *p->halvings);
    place_all(p, mesh, atlas, inverse, fused);
}

void probes_place(struct probes *p, const struct mesh *mesh, const struct atlas *atlas,
                  const struct inverse_uv *inverse, const struct fused *fused) {
    release_places(p);
    place_all(p, mesh, atlas, inverse, fused);
}

void probes_release(struct probes *p) {
    release_places(p);
    mem_free(p->halvings);
    *p = (struct probes){0};
}

uint32_t probes_at(const struct probes *p, uint32_t x, uint32_t y, uint32_t chart) {
    size_t block = block_of(p, x, y);
    uint32_t side = probes_cell_side(p, block);
    uint32_t cell = p->first_cell[block] + (y % p->spacing / side << p->halvings[block]) + x % p->spacing / side;
    uint32_t k = p->first[cell];
    while (k < p->first[cell + 1] && p->probe[k].chart != chart)
        k++;
    return k < p->first[cell + 1] ? k : UINT32_MAX;
}

void probes_neighbours(const struct probes *p, const struct fused *fused, uint32_t texel, uint32_t chart,
                       struct probe_neighbours *n) {
    int64_t x = texel % fused->width, y = texel / fused->width;
    int64_t side = probes_cell_side(p, block_of(p, (uint32_t)x, (uint32_t)y));
    n->count = 0;
    for (int64_t j = y - side; j <= y + side; j += side) {
        for (int64_t i = x - side; i <= x + side; i += side) {
            uint32_t column = (uint32_t)(i < 0 ? 0 : i < fused->width ? i : fused->width - 1);
            uint32_t row = (uint32_t)(j < 0 ? 0 : j < fused->height ? j : fused->height - 1);
            uint32_t probe = probes_at(p, column, row, chart);
            size_t k = 0;
            while (k < n->count && n->probe[k] != probe)
                k++;
            if (probe != UINT32_MAX && k == n->count)
                n->probe[n->count++] = probe;
        }
    }
}

float probes_likeness(vec3 a, vec3 b) {
    float like = fmaxf(vec3_dot(a, b), 0.0f);
    like *= like;
    like *= like;
    return like * like;
}

/* --- light ----------------------------------------------------------------------------------------- */

struct gather_job {
    struct probes *probes;
    const struct light_field *field;
    const struct mesh *mesh;
    const struct atlas *atlas;
    const struct inverse_uv *inverse;
    struct incident *scratch; /* [threads] */
    uint64_t seed;
    size_t samples, first, count;
};

static void gather_chunk(void *user, size_t chunk, int thread) {
    const struct gather_job *job = user;
    size_t begin = chunk * CHUNK, end = begin + CHUNK < job->count ? begin + CHUNK : job->count;
    for (size_t i = begin; i < end; i++) {
        struct probe *probe = &job->probes->probe[job->first + i];
        struct surface_point at;
        surface_at_texel(job->mesh, job->atlas, job->inverse, probe->texel, &at);
        irradiance_gather(&probe->light, &job->scratch[thread], job->field, &at,
                          sampler_key(job->seed, probe->texel, 0), job->samples);
    }
}

void probes_gather(struct probes *p, const struct light_field *field, const struct mesh *mesh,
                   const struct atlas *atlas, const struct inverse_uv *inverse, uint64_t seed, size_t samples,
                   size_t first, size_t count, struct parallel *pool) {
    struct gather_job job = {p, field, mesh, atlas, inverse, NULL, seed, samples, first, count};
    job.scratch = mem_array((size_t)parallel_thread_count(pool), sizeof *job.scratch);
    parallel_for(pool, (count + CHUNK - 1) / CHUNK, gather_chunk, &job);
    mem_free(job.scratch);
}

/* --- between probes -------------------------------------------------------------------------------- */

static float tent(float distance) { return fmaxf(0.0f, 1.0f - fabsf(distance) * (1.0f / FILTER_RADIUS)); }

void probes_mix(const struct probes *p, const struct atlas *atlas, const struct fused *fused, uint32_t texel,
                const struct surface_point *at, struct probe_mix *mix) {
    uint32_t width = fused->width, x = texel % width, y = texel / width;
    bool seen = fused->count[texel] > 0.0f;
    float over = 1.0f / (float)probes_cell_side(p, block_of(p, x, y)), sum = 0.0f;
    struct probe_neighbours n;
    probes_neighbours(p, fused, texel, atlas->chart_of_triangle[at->triangle], &n);
    mix->count = n.count;
    for (size_t k = 0; k < n.count; k++) {
        const struct probe *probe = &p->probe[n.probe[k]];
        float dx = ((float)(probe->texel % width) - (float)x) * over;
        float dy = ((float)(probe->texel / width) - (float)y) * over;
        float w = tent(dx) * tent(dy) * probes_likeness(probe->shading, at->shading) + MIN_WEIGHT;
        if (seen && !probe->seen)
            w *= UNSEEN_WEIGHT;
        mix->probe[k] = n.probe[k];
        mix->weight[k] = w;
        sum += w;
    }
    for (size_t k = 0; k < mix->count; k++)
        mix->weight[k] /= sum;
}

void probes_irradiance(const struct probes *p, const struct probe_mix *mix, struct irradiance *out) {
    memset(out, 0, sizeof *out);
    for (size_t k = 0; k < mix->count; k++) {
        const float *from = &p->probe[mix->probe[k]].light.moment[0][0];
        float *to = &out->moment[0][0], w = mix->weight[k];
        for (int i = 0; i < IRRADIANCE_MOMENTS * 3; i++)
            to[i] += w * from[i];
        out->noise = rgb_mad(out->noise, w, p->probe[mix->probe[k]].light.noise);
    }
}
