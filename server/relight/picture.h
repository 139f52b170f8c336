/* picture.h -- renders one picture until it is as free of noise as is wanted. */
#ifndef UNBAKE_RELIGHT_PICTURE_H
#define UNBAKE_RELIGHT_PICTURE_H

#include <stdbool.h>
#include <stdint.h>

#include "common/error.h"
#include "common/image.h"
#include "common/parallel.h"
#include "server/render/path.h"
#include "server/render/world.h"
#include "server/scene/camera.h"

struct picture_goal {
    uint32_t max_spp; /* paths for each pixel, at most */
    double noise;     /* standard error over mean, of luminance; 0: all of max_spp */
    double seconds;   /* 0: no limit */
};

/* How good a picture has become. */
struct picture_quality {
    uint32_t spp;
    double noise; /* root mean square of the pixels' standard errors, over the mean; 0 of a black picture */
};

/* After each round of paths; false stops. */
typedef bool picture_round(void *user, const struct image *so_far, struct picture_quality quality);

/* *image: channels R G B, and direct.R G B where `has_direct`; the caller's. STATUS_CANCELLED: `round` said so. The
 * same bytes for the same goal and settings, unless a time limits it. */
enum status picture_render(const struct world *world, const struct camera *camera, const struct path_settings *settings,
                           const struct picture_goal *goal, bool has_direct, picture_round *round, void *user,
                           struct parallel *pool, struct image *image, struct picture_quality *quality,
                           struct error *err);

#endif
