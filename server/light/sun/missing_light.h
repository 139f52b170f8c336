/* missing_light.h -- misfit of the places' base colours, and how much a hypothetical light reduces it.
 *
 * A place's observed radiance is base colour times known plus missing light. Base colours vary little within a segment
 * and do not exceed that of white paint; the right light at the right strength makes them so. The misfit is robust,
 * since textures and lamps remain outliers under any light. */
#ifndef UNBAKE_LIGHT_SUN_MISSING_LIGHT_H
#define UNBAKE_LIGHT_SUN_MISSING_LIGHT_H

#include "common/parallel.h"
#include "server/light/sun/light_places.h"
#include "server/light/strength_search.h"

/* The mean of the channels, in place of one of them. */
#define MISSING_MEAN 3

struct missing_light {
    const struct light_places *places; /* borrowed */
    float *weight;                     /* [places->count] 1, or by the share of its light; owned */
    struct parallel *pool;             /* borrowed */
    size_t segment_count;              /* of those that any place is of */
    size_t *first;                     /* [segment_count + 1] first place of each; owned, as the next */
    float *base, *sorted;              /* [STRENGTHS][places->count] scratch */
    double *misfit;                    /* [STRENGTHS][segment_count] scratch */
};

/* The light falls in patches and leaves most of a segment as it is: how dark that
 * is, and thus how much a highlight may add, is judged with the light that is tried. */
void missing_light_init(struct missing_light *m, const struct light_places *places, struct parallel *pool);
void missing_light_release(struct missing_light *m);

/* Strength of the light with which misfit is least, `response` times strength being added to a place's light; 0: no
 * strength helps. *explained: reduction of misfit over all segments that it reaches, in places. */
float missing_light_strength(const struct missing_light *m, int channel, double *explained);

/* The strength by channel of light that is known to be missing. A place counts by the square of the share of its light
 * that it would be: what else is wrong with the light is alike over a whole wall, and a thousand places of it, to which
 * a lamp in a corner brings a hundredth of their light, would agree about it. */
rgb missing_light_color(struct missing_light *m);

#endif
