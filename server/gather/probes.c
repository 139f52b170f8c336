/* probes.c -- see probes.h. */
#include "server/gather/probes.h"

#include <math.h>
#include <string.h>

#include "common/mem.h"
#include "server/render/sampler.h"

/* Radius of the interpolation tent, in blocks: 1.5 blends four to nine probes, and is continuous. */
#define FILTER_RADIUS 1.5f /* +25 %: -0.04 dB */
/* Weight factor of a probe that no photograph sees, for a texel that one does: such probes lie in hidden, dark places.
 * One seen probe around outweighs all others. */
#define UNSEEN_WEIGHT 0.01f /* +25 %: 0 dB */
#define MIN_WEIGHT 1e-6f    /* of any probe around, so that no texel is without light; +25 %: 0 dB */
#define CHUNK 16            /* probes a work item */

/* The best probe position of each chart in one block: a seen texel nearest to the block's centre. */
struct places {
    size_t count, capacity;
    struct probe *probe;
    float *distance; /* squared, from the block's centre, texels */
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

static void find_places(struct places *places, uint32_t column, uint32_t row, uint32_t spacing,
                        const struct atlas *atlas, const struct inverse_uv *inverse, const struct fused *fused) {
    places->count = 0;
    uint32_t x0 = column * spacing, y0 = row * spacing;
    float middle = 0.5f * (float)(spacing - 1);
    for (uint32_t y = y0; y < y0 + spacing && y < inverse->height; y++) {
        for (uint32_t x = x0; x < x0 + spacing && x < inverse->width; x++) {
            uint32_t texel = y * inverse->width + x;
            uint32_t triangle = inverse->triangle[texel];
            if (triangle == INVERSE_UV_NONE)
                continue;
            float dx = (float)(x - x0) - middle, dy = (float)(y - y0) - middle;
            offer_place(places, texel, atlas->chart_of_triangle[triangle], fused->count[texel] > 0.0f,
                        dx * dx + dy * dy);
        }
    }
}

void probes_init(struct probes *p, uint32_t spacing, const struct mesh *mesh, const struct atlas *atlas,
                 const struct inverse_uv *inverse, const struct fused *fused) {
    *p = (struct probes){.spacing = spacing,
                         .columns = (inverse->width + spacing - 1) / spacing,
                         .rows = (inverse->height + spacing - 1) / spacing};
    size_t block_count = (size_t)p->columns * p->rows, capacity = block_count;
    struct places places = {0};
    places.probe = mem_array((size_t)spacing * spacing, sizeof *places.probe);
    places.distance = mem_array((size_t)spacing * spacing, sizeof *places.distance);
    p->first = mem_array(block_count + 1, sizeof *p->first);
    p->probe = mem_array(capacity, sizeof *p->probe);
    for (size_t block = 0; block < block_count; block++) {
        p->first[block] = (uint32_t)p->count;
        find_places(&places, (uint32_t)(block % p->columns), (uint32_t)(block / p->columns), spacing, atlas, inverse,
                    fused);
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
    p->first[block_count] = (uint32_t)p->count;
    mem_free(places.probe);
    mem_free(places.distance);
}

void probes_release(struct probes *p) {
    mem_free(p->probe);
    mem_free(p->first);
    *p = (struct probes){0};
}

uint32_t probes_at(const struct probes *p, uint32_t x, uint32_t y, uint32_t chart) {
    size_t block = (size_t)(y / p->spacing) * p->columns + x / p->spacing;
    uint32_t k = p->first[block];
    while (k < p->first[block + 1] && p->probe[k].chart != chart)
        k++;
    return k < p->first[block + 1] ? k : UINT32_MAX;
}

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

static float tent(float distance) { return fmaxf(0.0f, 1.0f - fabsf(distance) * (1.0f / FILTER_RADIUS)); }

void probes_mix(const struct probes *p, const struct atlas *atlas, const struct fused *fused, uint32_t texel,
                const struct surface_point *at, struct probe_mix *mix) {
    uint32_t width = fused->width, x = texel % width, y = texel / width;
    uint32_t chart = atlas->chart_of_triangle[at->triangle];
    bool seen = fused->count[texel] > 0.0f;
    uint32_t column = x / p->spacing, row = y / p->spacing;
    float over = 1.0f / (float)p->spacing, sum = 0.0f;
    mix->count = 0;
    for (uint32_t j = row > 0 ? row - 1 : 0; j <= row + 1 && j < p->rows; j++) {
        for (uint32_t i = column > 0 ? column - 1 : 0; i <= column + 1 && i < p->columns; i++) {
            size_t block = (size_t)j * p->columns + i;
            for (uint32_t k = p->first[block]; k < p->first[block + 1]; k++) {
                const struct probe *probe = &p->probe[k];
                if (probe->chart != chart)
                    continue;
                float dx = ((float)(probe->texel % width) - (float)x) * over;
                float dy = ((float)(probe->texel / width) - (float)y) * over;
                float like = fmaxf(vec3_dot(probe->shading, at->shading), 0.0f);
                like *= like;
                like *= like;
                float w = tent(dx) * tent(dy) * like * like + MIN_WEIGHT;
                if (seen && !probe->seen)
                    w *= UNSEEN_WEIGHT;
                mix->probe[mix->count] = k;
                mix->weight[mix->count++] = w;
                sum += w;
            }
        }
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
