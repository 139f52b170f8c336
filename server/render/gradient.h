/* gradient.h -- derivatives by all material parameters, summed in an order that does not depend on threads or timing.
 *
 * Each work item appends to its own log: entries of up to four neighbouring texels, and dense per-segment sums.
 * gradient_reduce adds the logs in order of work items, tile by tile of the texture, into sparse sums: the same
 * floating-point additions in the same order for any number of threads. */
#ifndef UNBAKE_RENDER_GRADIENT_H
#define UNBAKE_RENDER_GRADIENT_H

#include <stddef.h>
#include <stdint.h>

#include "common/parallel.h"
#include "common/vec.h"

/* Derivative by one texture lookup: texels (x, y), (x + 1, y), (x, y + 1), (x + 1, y + 1) get weight[k] * d. A texel
 * of weight 0 may lie outside the texture. */
struct gradient_entry {
    uint16_t x, y;
    float weight[4];
    rgb d;
};

/* Sums over one segment. */
struct gradient_segment {
    double d_roughness, d_specular;
    double d_emission[3];
};

/* Log of one work item, filled by path_batch_backward or by hand. */
struct gradient_log {
    size_t entry_count, entry_capacity;
    struct gradient_entry *entry; /* owned */
    size_t segment_count;
    struct gradient_segment *segment; /* [segment_count] owned */
};

/* Sums of an iteration. */
struct gradient {
    uint32_t width, height; /* of the texture, texels */
    size_t texel_count;     /* distinct texels touched */
    uint32_t *texel;        /* [texel_count] ascending within a tile, tiles in order; owned */
    rgb *d_base_color;      /* [texel_count] */
    float *weight;          /* [texel_count] sum of filter weights */
    size_t segment_count;
    double *d_roughness;              /* [segment_count] */
    double *d_specular;               /* [segment_count] */
    double (*d_emission)[3];          /* [segment_count] */
    struct gradient_scratch *scratch; /* owned */
};

struct gradient_log *gradient_log_new(size_t segment_count);
void gradient_log_free(struct gradient_log *log);
void gradient_log_clear(struct gradient_log *log); /* keeps the memory */

/* Makes room for `count` more entries and returns the first; the caller increases entry_count. */
struct gradient_entry *gradient_log_reserve(struct gradient_log *log, size_t count);

struct gradient *gradient_new(uint32_t texture_width, uint32_t texture_height, size_t segment_count);
void gradient_free(struct gradient *gradient);

/* Replaces the content of `gradient` by the sum of log[0..log_count) in that order. */
void gradient_reduce(struct gradient *gradient, struct gradient_log *const *log, size_t log_count,
                     struct parallel *pool);

#endif
