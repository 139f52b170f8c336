/* hole_regions.h -- connected cells that pixels see through the mesh: which are holes of the scan, and which openings
 * of the room.
 *
 * Each observation is first assigned to the nearest cell on its ray. Cells that rays pass, about which photographs
 * disagree, or that touch no mesh are refused, and so are regions that are openings by the evidence (hole_evidence.h);
 * the observations then go on to the next cell, until all that are left are holes. */
#ifndef UNBAKE_HOLES_HOLE_REGIONS_H
#define UNBAKE_HOLES_HOLE_REGIONS_H

#include "server/holes/hole_evidence.h"

/* Refuses all cells that are no holes, and finds the holes; in `kept`, the openings: connected cells that might have
 * been holes and mostly are not. `observations` are assigned to the holes' cells. `fills_all`: what touches the mesh,
 * and no ray passes, is a hole whatever the photographs show. */
void hole_regions_find(struct hole_regions *holes, struct hole_regions *kept, struct hole_grid *grid,
                       struct hole_observations *observations, bool fills_all);
void hole_regions_release(struct hole_regions *regions);

#endif
