/* observation.h -- observations: a texel, a photograph that sees it, and camera paths through it.
 *
 * An observation has `samples` paths from the camera through points of the texel, and for each the photograph's value
 * there. Paths of even number form half A, odd ones half B; the halves use different random-number keys and are
 * independent. */
#ifndef UNBAKE_REFINE_OBSERVATION_H
#define UNBAKE_REFINE_OBSERVATION_H

#include <stddef.h>
#include <stdint.h>

#include "server/capture/views.h"
#include "server/render/path.h"
#include "server/scene/photograph.h"
#include "server/scene/surface.h"

struct observation {
    uint32_t texel, segment;
    const struct photograph *photograph; /* borrowed */
    struct view view;                    /* of the texel's centre */
    float weight;                        /* weight: 1, or MIXED_WEIGHT where the photograph's pixel mixes surfaces */
};

/* The observations of one work item and their paths; used by one thread. */
struct observation_batch {
    struct surface surface;
    const struct world *world; /* borrowed, both */
    const struct views *views;
    struct path_settings path;
    int cameras, samples; /* photographs of a texel, paths of an observation */
    size_t observation_count, observation_capacity;
    struct observation *observation; /* [observation_capacity] owned */
    struct path_batch *paths;        /* owned, as all below; observation k has paths [k * samples, (k + 1) * samples) */
    struct ray *ray;
    struct path_key *key;
    struct photograph_sample *reference;
    rgb *radiance, *d_radiance;
};

/* Room for `texels` texels. */
void observation_batch_init(struct observation_batch *b, const struct surface *surface, const struct world *world,
                            const struct views *views, const struct path_settings *path, int cameras, int samples,
                            size_t texels);
void observation_batch_release(struct observation_batch *b);
void observation_batch_clear(struct observation_batch *b);

/* Adds up to `cameras` observations of a valid texel, drawn by (seed, iteration, texel). */
void observation_add(struct observation_batch *b, uint32_t texel, uint64_t iteration);

/* Adds up to `cameras` observations at random pixels of random photographs, drawn by (seed, iteration, number). */
void observation_add_pixels(struct observation_batch *b, uint64_t number, uint64_t iteration);

/* Traces the paths of all observations: fills radiance[observation_count * samples]. */
void observation_trace(struct observation_batch *b);

#endif
