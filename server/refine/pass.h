/* pass.h -- one pass over the surface: what an iteration of either method that follows paths looks at.
 *
 * Texels are chosen evenly over the surface (or pixels over the photographs), each is looked at in a
 * few photographs that see it, paths are traced, and what they bring is compared with the photograph.
 * The chosen are cut into chunks; what a chunk finds is stored by its number and summed in the order
 * of numbers, so threads and timing leave no trace. */
#ifndef UNBAKE_REFINE_PASS_H
#define UNBAKE_REFINE_PASS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "server/capture/choose.h"
#include "server/capture/views.h"
#include "server/refine/look.h"
#include "server/state/reconstruction.h"

#define PASS_CHUNK_TEXELS 32 /* a look batch has room for so many texels */

/* The derivative of one look's loss by the emission of the segment that it looks at. Only what is
 * seen of a segment moves its emission. What it sheds on other surfaces is left out: there emission
 * and base colour can stand in for each other (the bias that this accepts: none at the optimum,
 * where both derivatives are 0), and while base colours are still too dark it would drive the lamps
 * up. */
struct pass_emission {
    uint32_t segment;
    rgb d_radiance;
};

struct pass_chunk {
    double loss; /* sum over its looks */
    size_t look_count;
    struct pass_emission *emission; /* [look_capacity], of them look_count filled; owned */
};

struct pass {
    const struct reconstruction *r; /* borrowed, both */
    const struct views *views;
    struct chooser chooser;
    bool by_pixels, one_estimate; /* settings choose and estimates */
    struct look_batch *batch;     /* [threads of r->pool] owned */
    size_t look_capacity;         /* looks a chunk */
    size_t chunk_count;
    struct pass_chunk *chunk;     /* [chunk_count] owned */
};

/* Settings of `r` say how much it looks at; `path` how paths are traced. */
void pass_init(struct pass *p, const struct reconstruction *r, const struct views *views,
               const struct path_settings *path);
void pass_release(struct pass *p);

/* Looks at what `iteration` chooses. visit(user, chunk, batch) is called once a chunk, by any thread,
 * while the batch still holds the chunk's looks: their paths, radiance and d_radiance, the derivative
 * of the loss, each look of which counts by its trust. */
typedef void pass_visit(void *user, size_t chunk, struct look_batch *batch);
void pass_run(struct pass *p, uint64_t iteration, pass_visit *visit, void *user);

/* Of the last run: its looks; the mean loss of one; the loss's derivatives d_radiance[segment_count]
 * by emission (see struct pass_emission). */
size_t pass_look_count(const struct pass *p);
double pass_mean_loss(const struct pass *p);
void pass_d_emission(const struct pass *p, double (*d_radiance)[3]);

/* Rays traced and non-finite samples dropped since pass_init. */
void pass_ray_counts(const struct pass *p, uint64_t *ray_count, uint64_t *dropped_count);

#endif
