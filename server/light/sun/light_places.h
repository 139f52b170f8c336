/* light_places.h -- sample places of the surface for the search of missing light: observed radiance, Lambert radiance
 * at albedo 1 by known light, and the residual of their ratio, base colour. */
#ifndef UNBAKE_LIGHT_SUN_LIGHT_PLACES_H
#define UNBAKE_LIGHT_SUN_LIGHT_PLACES_H

#include <stddef.h>
#include <stdint.h>

#include "server/light/light_priors.h"
#include "server/light/survey.h"
#include "server/scene/surface.h"

/* A place is bright if its residual exceeds this: a factor of 1.6 in base colour. */
#define PLACE_BRIGHT 0.5f

struct light_place {
    uint32_t segment;
    struct surface_point at;
    rgb observed, lambert;
    float residual; /* log(base colour / (median of the segment, or that of white paint)), without missing light */
    /* Of the search: */
    float weight;   /* at most 1 */
    float response; /* Lambert radiance at albedo 1 by the hypothetical light at strength 1 */
    float visible;  /* part of the disc of the hypothetical sun */
};

struct light_places {
    size_t count;
    struct light_place *place; /* [count] by segment; owned */
};

/* Makes the places from a survey; observed radiance is the mean around each. */
#define LIGHT_PLACES 16384
void light_places_init(struct light_places *places, const struct survey *survey);
/* From place[count] whose segment, at, observed, lambert and weight are set, in any order; takes it over. */
void light_places_take(struct light_places *places, struct light_place *place, size_t count);
/* Drops segments of which most is brighter than white paint could be: probably lamps. */
void light_places_leave_out_lamps(struct light_places *places);
void light_places_release(struct light_places *places);

/* Where the segment of place `first` ends. */
size_t light_places_end(const struct light_places *places, size_t first);

/* Number of places of a greater residual. */
size_t light_places_above(const struct light_places *places, float residual);

#endif
