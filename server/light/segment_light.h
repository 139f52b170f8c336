/* segment_light.h -- how a segment would light points if it emitted. */
#ifndef UNBAKE_LIGHT_SEGMENT_LIGHT_H
#define UNBAKE_LIGHT_SEGMENT_LIGHT_H

#include "server/light/light_point.h"
#include "server/scene/by_segment.h"

/* What is the same for all segments. */
struct segment_light {
    const struct reconstruction *r;        /* borrowed */
    struct triangles_by_segment triangles; /* owned */
    float *area_m2;                        /* [segment_count]; owned */
};

void segment_light_init(struct segment_light *l, const struct reconstruction *r);
void segment_light_release(struct segment_light *l);

/* Adds to lit[count] what a surface of albedo 1 at each point would send of a radiance of 1 from the front of the whole
 * segment, by as many points of it as given, SEGMENT_LIGHT_POINTS at most, evenly spread by area. */
#define SEGMENT_LIGHT_POINTS 32
void segment_light_add(const struct segment_light *l, const struct light_point *point, size_t count, uint32_t segment,
                       size_t points, float *lit);

#endif
