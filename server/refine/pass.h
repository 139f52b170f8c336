/* pass.h -- one pass over the surface: the observations of an iteration.
 *
 * Texels are chosen evenly over the surface (or pixels over the photographs), each is observed by a few photographs,
 * paths are traced, and their radiance is compared with the photograph. The texels are cut into chunks; results are
 * stored by chunk and summed in the order of chunks, so they depend on neither threads nor timing. */
#ifndef UNBAKE_REFINE_PASS_H
#define UNBAKE_REFINE_PASS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "common/parallel.h"
#include "common/settings.h"
#include "server/capture/stratified.h"
#include "server/capture/views.h"
#include "server/refine/observation.h"
#include "server/scene/surface.h"

#define PASS_CHUNK_TEXELS 32 /* texels of a chunk, and of an observation batch */

/* Derivative of one observation's loss by the emission of the observed segment. The derivative by light that the
 * segment sheds on other surfaces is left out: there emission and base colour are ambiguous, and while base colours are
 * too dark it would drive the lamps up. Bias: none at the optimum, where both derivatives are 0. */
struct pass_emission {
    uint32_t segment;
    rgb d_radiance;
};

struct pass_chunk {
    double loss; /* sum over its observations */
    size_t observation_count;
    struct pass_emission *emission; /* [observation_capacity], observation_count of them filled; owned */
};

struct pass {
    struct surface surface;
    const struct views *views; /* borrowed, both */
    struct parallel *pool;
    struct stratified strata;
    bool by_pixels, one_estimate;    /* settings choose and estimates */
    struct observation_batch *batch; /* [threads of the pool] owned */
    size_t observation_capacity;     /* of a chunk */
    size_t chunk_count;
    struct pass_chunk *chunk; /* [chunk_count] owned */
};

/* Its size and its choices are settings. The world is borrowed, too. */
void pass_init(struct pass *p, const struct surface *surface, const struct world *world, const struct views *views,
               const struct settings *set, const struct path_settings *path, struct parallel *pool);
void pass_release(struct pass *p);

/* Runs the pass of an iteration. visit(user, chunk, batch) is called once a chunk, by any thread, while the batch holds
 * the chunk's observations: their paths, radiance, and d_radiance, the derivative of the loss times their weight. */
typedef void pass_visit(void *user, size_t chunk, struct observation_batch *batch);
void pass_run(struct pass *p, uint64_t iteration, pass_visit *visit, void *user);

/* Of the last run: its observations; their mean loss; derivatives d_radiance[segment_count] of the loss by emission
 * (struct pass_emission). */
size_t pass_observation_count(const struct pass *p);
double pass_mean_loss(const struct pass *p);
void pass_d_emission(const struct pass *p, double (*d_radiance)[3]);

/* Rays traced and non-finite samples dropped since pass_init. */
void pass_ray_counts(const struct pass *p, uint64_t *ray_count, uint64_t *dropped_count);

#endif
