/* gradient.h -- derivatives by all material parameters, summed in an order that does not depend
 * on threads or timing.
 *
 * Each work chunk appends to a log of its own: (texel, d rgb) entries and a dense row of
 * per-segment sums. gradient_reduce then adds the logs in chunk order, tile of texels by tile,
 * into dense or sparse sums: the same floating-point additions in the same order, whatever
 * thread did what when. */
#ifndef UNBAKE_RENDER_GRADIENT_H
#define UNBAKE_RENDER_GRADIENT_H

#include <stddef.h>
#include <stdint.h>

#include "common/parallel.h"
#include "common/vec.h"

struct gradient_log; /* of one chunk; opaque */

/* Sums of an iteration. */
struct gradient {
    size_t texel_count;      /* distinct texels touched */
    uint32_t *texel;         /* [texel_count] ascending within a tile, tiles in order; owned */
    rgb *d_base_color;       /* [texel_count] */
    float *weight;           /* [texel_count] sum over entries of |filter weight|: how much was seen */
    size_t segment_count;
    double *d_roughness;     /* [segment_count] */
    double *d_specular;      /* [segment_count] */
    double (*d_emission)[3]; /* [segment_count] */
};

struct gradient_log *gradient_log_new(size_t segment_count);
void gradient_log_free(struct gradient_log *log);
void gradient_log_clear(struct gradient_log *log);

struct gradient *gradient_new(uint32_t texture_width, uint32_t texture_height, size_t segment_count);
void gradient_free(struct gradient *gradient);

/* Replaces the content of `gradient` by the sum of log[0..log_count) in that order. */
void gradient_reduce(struct gradient *gradient, struct gradient_log *const *log, size_t log_count,
                     struct parallel *pool);

#endif
