/* evaluate.h -- a finished job's outputs against the truth of its room.
 *
 * The room is a bundle with truth/ beside its photographs: objects.json, and for each test view
 * the picture of its parameters (see demo/generate.h; the demo room writes one). Parameters are
 * compared as test cameras see them (score.h), emitters by object, and the test views are
 * re-rendered from the recovered room and compared with their photographs:
 * MSRE = mean of (I - R)^2 / (R^2 + 0.01 m^2), m the median of the training pixels' radiance. */
#ifndef UNBAKE_EVALUATE_EVALUATE_H
#define UNBAKE_EVALUATE_EVALUATE_H

#include <stddef.h>
#include <stdint.h>

#include "common/error.h"
#include "common/json.h"
#include "common/parallel.h"
#include "server/evaluate/even.h"
#include "server/evaluate/noise_floor.h"
#include "server/evaluate/score.h"

struct evaluate_settings {
    uint32_t samples;          /* first hits per pixel, at least 16 */
    uint32_t spp;              /* paths per pixel of the re-renders, at least 64; 0: none, no MSRE */
    uint32_t max_depth;        /* segments of a path */
    uint64_t seed;
    const char *pictures_dir;  /* where side-by-sides go; NULL: none */
};

struct evaluate_settings evaluate_default_settings(void);

struct evaluation {
    struct score score;
    size_t view_count;
    /* By object of the truth. An emitter is found when more than half of its area emits; an
     * object that does not emit is a false emitter when any of it does. */
    size_t emitters, emitters_found, emitters_missed, emitters_false;
    double msre, msre_deviation; /* mean over the views, and how they spread; NaN without re-renders */
    struct even even;            /* places whose photographs tell their own noise; nothing without re-renders */
    struct noise_floor floor;    /* views whose photographs' noise the truth tells; none without re-renders */
};

/* `room` and `outputs` are folders. */
enum status evaluate_outputs(const char *room, const char *outputs,
                             const struct evaluate_settings *settings, struct parallel *pool,
                             struct evaluation *evaluation, struct error *err);

/* Every figure as an object; the caller's. */
cJSON *evaluate_to_json(const struct evaluation *evaluation);

#endif
