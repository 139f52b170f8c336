/* held_render.h -- renders a held-out view as two independent pictures, until their noise leaves its error known. */
#ifndef UNBAKE_RECONSTRUCT_HELD_RENDER_H
#define UNBAKE_RECONSTRUCT_HELD_RENDER_H

#include <stdbool.h>
#include <stdint.h>

#include "common/image.h"
#include "common/parallel.h"
#include "server/reconstruct/metrics.h"
#include "server/render/path.h"
#include "server/render/world.h"
#include "server/scene/camera.h"

/* The mean over views is known well enough when its standard error is this part of it: a view's may be larger by the
 * root of their number. Else the view is rendered again, up to HELD_RENDER_ROUNDS times in all. Of pictures of 100 x
 * 100 pixels and more the first render nearly always does: the product of two errors leaves the noise of all pixels
 * together, of which each has its own. */
#define HELD_RENDER_GOAL 0.1
#define HELD_RENDER_ROUNDS 4

struct held_render {
    struct image halves; /* channels as metrics.h has them */
    uint32_t spp, rounds;
};

/* Adds `spp` paths for each pixel, of an iteration (film.h) that no round before had. It begins zeroed. */
void held_render_add(struct held_render *render, const struct world *world, const struct camera *camera, uint32_t spp,
                     const struct path_settings *path, uint32_t iteration, struct parallel *pool);
void held_render_release(struct held_render *render);

/* Whether the figure of one of so many views is known well enough, or enough was done for it. */
bool held_render_is_done(const struct held_render *render, struct metric msre, size_t views);

/* The mean of both, R G B; the caller's. */
void held_render_mean(const struct image *halves, struct image *mean);

#endif
