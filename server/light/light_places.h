/* light_places.h -- what is known of places all over the surface before missing light is looked for: what
 * photographs show, what a white surface would show by the light that is known, and how odd the base colour between
 * them is. */
#ifndef UNBAKE_LIGHT_LIGHT_PLACES_H
#define UNBAKE_LIGHT_LIGHT_PLACES_H

#include <stddef.h>
#include <stdint.h>

#include "server/light/survey.h"
#include "server/scene/surface.h"

/* White paint; and what is so much brighter than its segment, in the logarithm, is bright. */
#define PLACE_WHITE 0.9f
#define PLACE_BRIGHT 0.5f

struct light_place {
    uint32_t segment;
    struct surface_point at;
    rgb shown, white;
    float odd;    /* logarithm of base colour, without more light, over the median of the segment or over white */
    /* For whoever looks for light: */
    float weight; /* 1, or less */
    float lit;    /* what a white surface would show of a strength of 1 of the light that is tried */
    float open;   /* the part of the disc of the sun that is tried which it sees */
};

struct light_places {
    size_t count;
    struct light_place *place; /* [count] by segment; owned */
};

/* Takes over what a survey tells, of so many points at best. What photographs show of them is what `shown` has around
 * each or, where it has nothing or is NULL, what was fused there. */
#define LIGHT_PLACES 16384
void light_places_init(struct light_places *places, const struct survey *survey, const struct fused *shown);
/* From place[count] of which segment, at, shown, white and weight are known, in any order; takes it over. */
void light_places_take(struct light_places *places, struct light_place *place, size_t count);
/* `most` of them, evenly spread. */
void light_places_thin(struct light_places *thin, const struct light_places *places, size_t most);
/* Leaves out segments of which most is brighter than white: lamps, for all one knows. */
void light_places_leave_out_lamps(struct light_places *places);
void light_places_release(struct light_places *places);

/* Where the segment of place `first` ends. */
size_t light_places_end(const struct light_places *places, size_t first);

/* So many are odder than that. */
size_t light_places_odder(const struct light_places *places, float odd);

#endif
