/* light_sky.h -- the parts of the environment that are sources of light to be estimated: unseen directions, in the
 * cells of sky_cells.h, and those at which every photograph that shows them saturates, of the sky and of the ground.
 *
 * Near seen directions the fill of environment.h is kept, with a weight that falls over some degrees: what lies beside
 * an opening's edge resembles what is seen there. Cells are bilinear between their centres, but for the horizon, where
 * sky and ground part, and grey. */
#ifndef UNBAKE_LIGHT_SKY_LIGHT_SKY_H
#define UNBAKE_LIGHT_SKY_LIGHT_SKY_H

#include <stdbool.h>
#include <stddef.h>

#include "server/light/sky/sky_cells.h"
#include "server/light/surround.h"
#include "server/state/reconstruction.h"

/* Cells of the unseen light: of the sky, or around a scan. */
#define LIGHT_CELLS SURROUND_CELLS
_Static_assert(SKY_CELLS <= LIGHT_CELLS, "either fits");

struct light_sky {
    const struct environment *environment; /* borrowed */
    float *angle;                          /* [map height][map width] to what is seen; NULL: nothing is; owned */
    const struct surround *surround; /* in place of unseen sky beyond what lies beside seen directions; NULL: none;
                                            * borrowed */
    bool is_dark;                    /* nothing comes from where no photograph looks */
    double fill[SKY_CELLS];          /* mean radiance of the fill about each cell; 0: there is none */
    bool estimates_bounds;           /* saturated directions are sources; else their bounds are known light */
    /* Of each half (environment.h): the part of the seen directions that saturates, -1: none is seen; and their
     * mean. */
    double bound_share[ENVIRONMENT_HALVES], bound_radiance[ENVIRONMENT_HALVES];
};

void light_sky_init(struct light_sky *s, const struct environment *environment);
void light_sky_release(struct light_sky *s);

/* *map: the part of the environment that is no source to be estimated; the caller's. False, and no map, where there is
 * no environment. */
bool light_sky_known(const struct light_sky *s, struct image *map);

/* How many cells there are. */
static inline size_t light_sky_cells(const struct light_sky *s) { return s->surround ? SURROUND_CELLS : SKY_CELLS; }

/* Shares of rays: what a ray of weight `share` that escapes from a point in a unit direction adds to each cell, and to
 * the saturated directions of its half, times their radiance. */
void light_sky_add_ray(const struct light_sky *s, vec3 origin, vec3 direction, float share, float cell[LIGHT_CELLS],
                       float saturated[ENVIRONMENT_HALVES]);

/* Part of the fill that is kept at an unseen pixel of the map; 0 where nothing is seen. */
float light_sky_kept(const struct light_sky *s, size_t pixel);

/* Brightens the saturated directions of each half of r->environment, which has a map, and fills the unseen ones in
 * again. Updates the world. */
void light_sky_brighten(struct reconstruction *r, const rgb factor[ENVIRONMENT_HALVES]);

#endif
