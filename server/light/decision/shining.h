/* shining.h -- tests whether a part of the surface may emit, from photographs alone, before materials are known.
 *
 * Two tests. Is its radiance beyond the Lambert radiance at albedo 1? Incident light is gathered by rays that read the
 * observed radiance of the triangles they meet. If so, may it be sunlit through an opening? Then there is a direction
 * that is unoccluded from the part and occluded beside it, and everything else that this direction reaches is brighter
 * than the rest of the room. */
#ifndef UNBAKE_LIGHT_DECISION_SHINING_H
#define UNBAKE_LIGHT_DECISION_SHINING_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "server/capture/triangle_light.h"
#include "server/light/sky/unseen_fit.h"
#include "server/state/reconstruction.h"

/* Assumed ratio of true to observed radiance where all photographs saturate, of what may shine and of what lights it.
 * High, since overestimated light only makes fewer splits. */
#define SHINING_SATURATED 16.0f

struct shining {
    const struct reconstruction *r; /* borrowed, both; needs world and environment */
    const struct triangle_light *light;
    float *segment_mean; /* [segment_count] of a triangle that no photograph shows; owned */
    size_t room_count;
    struct surface_point *room; /* [room_count] places all over the room; owned */
    float unseen_share;         /* of rays from surfaces: those that go where nothing is known */
    bool has_unseen;            /* what comes from there was estimated: */
    double log_unseen[SKY_CELLS];
};

void shining_init(struct shining *s, const struct reconstruction *r, const struct triangle_light *light);
void shining_release(struct shining *s);

/* Upper quartile over count > 0 triangles of Lambert radiance at albedo 1, mean of the channels. Thread-safe, as is the
 * next. */
float shining_lambert(const struct shining *s, const uint32_t *triangle, size_t count);

/* Whether light from one direction may fall on the triangles `part` and not on those of `darker` that are near them. */
bool shining_is_sunlit(const struct shining *s, const uint32_t *part, size_t part_size, const uint32_t *darker,
                       size_t darker_count);

#endif
