/* missing_light.h -- how much less odd places would be if light came from somewhere that no photograph shows.
 *
 * At each place what photographs show is base colour times (light that is known + light that is missing). Base
 * colours differ little within a segment and are never above that of white paint: the right light, in the right
 * strength, makes them so. Both are judged robustly: a texture, or a lamp, is odd whatever is done about it. */
#ifndef UNBAKE_LIGHT_MISSING_LIGHT_H
#define UNBAKE_LIGHT_MISSING_LIGHT_H

#include "server/light/light_places.h"

/* The mean of the channels, in place of one of them. */
#define MISSING_MEAN 3

struct missing_light {
    const struct light_places *places; /* borrowed */
    float white;                       /* base colours beyond it are odd */
    bool in_patches;                   /* see missing_light_init */
    float *spread;                     /* [places->count] of a segment, at its first place; owned */
    float *weight;                     /* [places->count] 1, or how far a place is asked; owned */
    float *base, *sorted;              /* [places->count] scratch; owned */
};

/* Base colours beyond `white` are odd. Light that falls `in_patches` leaves most of a segment as it is: how dark that
 * is, and thus how much a highlight may add, is judged with the light that is tried. Light that may fall everywhere
 * would make all dark, and explain anything: there it is judged without. */
void missing_light_init(struct missing_light *m, const struct light_places *places, float white, bool in_patches);
void missing_light_release(struct missing_light *m);

/* Takes over places that changed. */
void missing_light_renew(struct missing_light *m);

/* The strength, times which its `lit` is added to a place's light, that explains most; 0: none does. How much less
 * odd the places of all segments that are lit at all are with it goes to *explained, in places. */
float missing_light_strength(const struct missing_light *m, int channel, double *explained);

/* The strength by channel of light that is known to be missing. A place counts by the square of the share of its light
 * that it would be: what else is wrong with the light is alike over a whole wall, and a thousand places of it, to which
 * a lamp in a corner brings a hundredth of their light, would agree about it. */
rgb missing_light_color(struct missing_light *m);

/* The share of a place's light that a strength of the one that is tried would be. */
float missing_light_part(const struct light_place *p, float strength);

/* How odd the places are of whose light it would be such a share at least: without it and with it, in places, `count`
 * of them. */
struct missing_share {
    double count, before, after;
};
struct missing_share missing_light_share(const struct missing_light *m, float strength, float share);

/* How odd all places are as they are, in places. */
double missing_light_misfit(const struct missing_light *m);

#endif
