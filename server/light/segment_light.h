/* segment_light.h -- how a segment would light places if it shone. */
#ifndef UNBAKE_LIGHT_SEGMENT_LIGHT_H
#define UNBAKE_LIGHT_SEGMENT_LIGHT_H

#include "server/light/light_places.h"
#include "server/scene/by_segment.h"

/* What is the same for all segments. */
struct segment_light {
    const struct reconstruction *r; /* borrowed */
    struct texels_by_segment texels;
    float *area_m2; /* [segment_count]; owned */
};

void segment_light_init(struct segment_light *l, const struct reconstruction *r);
void segment_light_release(struct segment_light *l);

/* Fills `lit` of the places: what a white surface there would show of a radiance of 1 from the front of the whole
 * segment, by as many points of it as given, SEGMENT_LIGHT_POINTS at most. */
#define SEGMENT_LIGHT_POINTS 32
void segment_light_places(const struct segment_light *l, struct light_places *places, uint32_t segment, size_t points);

#endif
