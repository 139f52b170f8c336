/* relight.h -- renders a finished job's room from any camera under any light. */
#ifndef UNBAKE_EVALUATE_RELIGHT_H
#define UNBAKE_EVALUATE_RELIGHT_H

#include <stdbool.h>
#include <stdint.h>

#include "common/error.h"
#include "common/image.h"
#include "common/parallel.h"

struct relight_settings {
    const char *cameras;     /* a transforms.json; NULL: the outputs' views.json */
    const char *view;        /* index in that file, from 0, or name of its picture */
    const char *environment; /* a latitude-longitude map that replaces the recovered environment; NULL: keep it;
                              * "none": dark */
    float environment_scale; /* factor on its radiance */
    float turn_deg;          /* turns it around the upward axis, counter-clockwise from above */
    char up;                 /* axis of the room that is the picture's top: 'x', 'y' or 'z' */
    bool lights;             /* whether emitters shine */
    uint32_t spp, max_depth;
    uint64_t seed;
};

struct relight_settings relight_default_settings(void);

/* Renders the room in folder `outputs`; needs nothing else of the job. *image: R G B, linear radiance; the caller's. */
enum status relight(const char *outputs, const struct relight_settings *settings, struct parallel *pool,
                    struct image *image, struct error *err);

/* Resamples an environment map whose top is the axis `up` into the room's frame (layout of latlong.h), turned and
 * scaled. *out, of the same size, is the caller's. */
void relight_orient(const struct image *picture, char up, float turn_deg, float scale, struct image *out);

#endif
