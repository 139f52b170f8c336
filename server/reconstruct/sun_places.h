/* sun_places.h -- what is known of places all over the surface before a sun is looked for: what photographs show,
 * what a white surface would show by the light that is known, and how odd the base colour between them is.
 *
 * Lamps are left out: segments of which most is brighter than white, for all one knows. */
#ifndef UNBAKE_RECONSTRUCT_SUN_PLACES_H
#define UNBAKE_RECONSTRUCT_SUN_PLACES_H

#include <stddef.h>
#include <stdint.h>

#include "server/reconstruct/reconstruction.h"
#include "server/reconstruct/views.h"
#include "server/scene/surface.h"

/* White paint; and what is so much brighter than its segment, in the logarithm, is bright. */
#define SUN_WHITE 0.9f
#define SUN_BRIGHT 0.5f

struct sun_place {
    uint32_t segment;
    struct surface_point at;
    rgb shown, white;
    float odd;  /* logarithm of base colour, without a sun, over the median of the segment or over white */
    float open; /* the part of the disc of the sun that is tried which it sees, */
    float lit;  /* times the cosine: for who looks for it */
};

struct sun_places {
    size_t count;
    struct sun_place *place; /* [count] by segment; owned */
};

/* What was seen must be fused and the world be lit by r->environment, if it has a map. */
void sun_places_init(struct sun_places *places, struct reconstruction *r, const struct views *views);
void sun_places_release(struct sun_places *places);

/* Where the segment of place `first` ends. */
size_t sun_places_end(const struct sun_places *places, size_t first);

/* So many are odder than that. */
size_t sun_places_odder(const struct sun_places *places, float odd);

#endif
