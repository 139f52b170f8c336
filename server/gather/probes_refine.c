/* probes_refine.c -- see probes_refine.h. */
#include "server/gather/probes_refine.h"

#include <math.h>
#include <stdlib.h>

#include "common/mem.h"

/* Halvings of a block at most: cells of 2 x 2 texels at the usual spacing of 8. */
#define MAX_HALVINGS 2
#define PROBES_A_HALVING 3 /* that a halving adds for each that was there: four cells for one */

/* How much the light of two probes differs beyond its noise: the square, as a part of the brighter one's. */
static float contrast(const struct probe *a, const struct probe *b) {
    float from = rgb_mean(irradiance_flux(&a->light)), to = rgb_mean(irradiance_flux(&b->light));
    float noise_from = rgb_mean(a->light.noise), noise_to = rgb_mean(b->light.noise), most = fmaxf(from, to);
    float square = (from - to) * (from - to) - noise_from * noise_from - noise_to * noise_to;
    return most > 0.0f ? square / (most * most) : 0.0f;
}

/* Mean contrast of a probe with those around it that stand on surface like its own. */
static float contrast_around(const struct probes *p, const struct fused *fused, uint32_t probe) {
    const struct probe *at = &p->probe[probe];
    struct probe_neighbours n;
    float sum = 0.0f, weights = 0.0f;
    probes_neighbours(p, fused, at->texel, at->chart, &n);
    for (size_t k = 0; k < n.count; k++) {
        const struct probe *other = &p->probe[n.probe[k]];
        float weight = n.probe[k] != probe && other->seen ? probes_likeness(at->shading, other->shading) : 0.0f;
        sum += weight * contrast(at, other);
        weights += weight;
    }
    return weights > 0.0f ? sum / weights : 0.0f;
}

/* A block and what halving it would gain: squared error of light, over its seen texels, for each probe that it adds. */
struct gain {
    float gain;
    uint32_t block, added;
};

static int by_gain(const void *a, const void *b) {
    const struct gain *left = a, *right = b;
    if (left->gain != right->gain)
        return left->gain < right->gain ? 1 : -1;
    return left->block < right->block ? -1 : 1;
}

/* Seen texels of each probe's chart in its cell. [probe count]; the caller's. */
static float *seen_texels(const struct probes *p, const struct atlas *atlas, const struct inverse_uv *inverse,
                          const struct fused *fused) {
    float *texels = mem_calloc(p->count + 1, sizeof *texels);
    for (size_t i = 0; i < inverse->valid_count; i++) {
        uint32_t texel = inverse->valid[i], chart = atlas->chart_of_triangle[inverse->triangle[texel]];
        if (fused->count[texel] > 0.0f)
            texels[probes_at(p, texel % inverse->width, texel / inverse->width, chart)] += 1.0f;
    }
    return texels;
}

/* Of blocks that may be halved, best first; returns how many. */
static size_t find_gains(const struct probes *p, const struct atlas *atlas, const struct inverse_uv *inverse,
                         const struct fused *fused, struct gain *gain) {
    float *texels = seen_texels(p, atlas, inverse, fused);
    size_t count = 0;
    for (uint32_t block = 0; block < p->columns * p->rows; block++) {
        uint32_t begin = p->first[p->first_cell[block]], end = p->first[p->first_cell[block + 1]];
        float sum = 0.0f;
        for (uint32_t k = begin; k < end; k++)
            sum += texels[k] > 0.0f ? texels[k] * contrast_around(p, fused, k) : 0.0f;
        if (sum > 0.0f && p->halvings[block] < MAX_HALVINGS && probes_cell_side(p, block) > 1)
            gain[count++] = (struct gain){sum / (float)(end - begin), block, PROBES_A_HALVING * (end - begin)};
    }
    qsort(gain, count, sizeof *gain, by_gain);
    mem_free(texels);
    return count;
}

void probes_refine(struct probes *p, double share, const struct mesh *mesh, const struct atlas *atlas,
                   const struct inverse_uv *inverse, const struct fused *fused) {
    struct gain *gain = mem_array((size_t)p->columns * p->rows + 1, sizeof *gain);
    size_t count = find_gains(p, atlas, inverse, fused, gain);
    double left = share * (double)p->count;
    for (size_t i = 0; i < count && left >= (double)gain[i].added; i++) {
        p->halvings[gain[i].block]++;
        left -= (double)gain[i].added;
    }
    mem_free(gain);
    probes_place(p, mesh, atlas, inverse, fused);
}
