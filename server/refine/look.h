/* look.h -- looking at texels: a point of the surface, a photograph that sees it, paths between.
 *
 * A look is one texel seen by one photograph: `samples` paths from the camera through the texel,
 * and for each what the photograph shows there. Paths of even number form half A, odd ones half
 * B; the halves use random numbers of keys of their own and are independent. */
#ifndef UNBAKE_REFINE_LOOK_H
#define UNBAKE_REFINE_LOOK_H

#include <stddef.h>
#include <stdint.h>

#include "server/capture/views.h"
#include "server/render/path.h"
#include "server/state/reconstruction.h"

struct look {
    uint32_t texel, segment;
    const struct photograph *photograph; /* borrowed */
    struct view view; /* of the texel's middle */
    float trust; /* 1, or less where the photograph's pixel mixes surfaces */
};

/* The looks of one work item, and room for their paths; of one thread. */
struct look_batch {
    const struct reconstruction *r; /* borrowed, both */
    const struct views *views;
    struct path_settings path;
    int cameras, samples;           /* photographs a texel, paths a look */
    size_t look_count, look_capacity;
    struct look *look;              /* [look_capacity] owned */
    struct path_batch *paths;       /* owned, as all below; look k has paths [k * samples, ...) */
    struct ray *ray;
    struct path_key *key;
    struct photograph_sample *reference;
    rgb *radiance, *d_radiance;
};

/* Room for `texels` texels. */
void look_batch_init(struct look_batch *b, const struct reconstruction *r, const struct views *views,
                     const struct path_settings *path, int cameras, int samples, size_t texels);
void look_batch_release(struct look_batch *b);
void look_batch_clear(struct look_batch *b);

/* Adds up to `cameras` looks at a valid texel, drawn by (seed, iteration, texel). */
void look_add(struct look_batch *b, uint32_t texel, uint64_t iteration);

/* Adds up to `cameras` looks at what random pixels of random photographs show, drawn by (seed, iteration,
 * number). */
void look_add_pixels(struct look_batch *b, uint64_t number, uint64_t iteration);

/* Traces the paths of all looks: fills radiance[look_count * samples]. */
void look_trace(struct look_batch *b);

#endif
