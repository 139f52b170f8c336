/* light_solve.h -- solves the joint fit of a room (light_model.h), and what follows from its values: what the sun makes
 * surfaces send, and which saturated lamps are none. */
#ifndef UNBAKE_LIGHT_LIGHT_SOLVE_H
#define UNBAKE_LIGHT_LIGHT_SOLVE_H

#include "server/light/light_model.h"

/* Moves the sources to the maximum of the posterior; surfaces that a sun lights send what they do with the albedos that
 * follow. */
void light_solve(struct light_model *m);

/* The same, and saturated lamps that white paint in this light would show as well become surfaces that reflect: as much
 * as makes them saturate, or more. */
void light_solve_deciding(struct light_model *m);

#endif
