/* evaluate.h -- compares a finished job's outputs with the ground truth of its room.
 *
 * The room is a bundle with truth/ beside its photographs: objects.json, and a picture of the parameters of each test
 * view (see demo/generate.h). Parameters are compared as the test cameras see them (score.h), emitters by object, and
 * the test views are re-rendered from the recovered room and compared with their photographs: MSRE = mean of (I -
 * R)^2 / (R^2 + 0.01 m^2), with m the median radiance of the training pixels, free of the re-renders' noise
 * (metrics.h): what the photographs' noise adds is in it. */
#ifndef UNBAKE_EVALUATE_EVALUATE_H
#define UNBAKE_EVALUATE_EVALUATE_H

#include <stddef.h>
#include <stdint.h>

#include "common/error.h"
#include "common/json.h"
#include "common/parallel.h"
#include "server/evaluate/found_emitters.h"
#include "server/evaluate/noise_floor.h"
#include "server/evaluate/plain_surface.h"
#include "server/evaluate/score.h"
#include "server/evaluate/smooth_areas.h"
#include "server/evaluate/stated_deviation.h"

struct reading; /* common/reading.h */

struct evaluate_settings {
    uint32_t samples;   /* first hits per pixel, at least 16 */
    uint32_t spp;       /* paths per pixel of the re-renders, more where their noise asks for it; 0: none, no MSRE */
    uint32_t max_depth; /* segments of a path */
    uint64_t seed;
    const char *pictures_dir;      /* where side-by-sides go; NULL: none */
    const struct reading *reading; /* how the room is read, as its job read it; NULL: as its files say */
};

struct evaluate_settings evaluate_default_settings(void);

struct evaluation {
    struct score score;
    struct deviation_coverage coverage;
    struct plain_surface plain;
    size_t view_count;
    /* By object of the truth. An emitter is found if more than half of its area emits; a non-emitting object any part
     * of which emits is a false emitter. */
    struct found_emitters emitters;
    double msre, msre_deviation; /* mean over views and standard deviation; NaN without re-renders */
    double msre_noise_left;      /* standard error of the mean by the re-renders' noise */
    struct smooth_areas smooth;  /* needs re-renders */
    struct noise_floor floor;    /* views with a flat render in the truth; needs re-renders */
};

/* `room` and `outputs` are folders. */
enum status evaluate_outputs(const char *room, const char *outputs, const struct evaluate_settings *settings,
                             struct parallel *pool, struct evaluation *evaluation, struct error *err);

/* Every figure as an object; the caller's. */
cJSON *evaluate_to_json(const struct evaluation *evaluation);

#endif
