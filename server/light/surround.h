/* surround.h -- a box around what was scanned, from whose sides light comes in where a scan lacks surface.
 *
 * What is behind the gaps of a scan is near: a wall that the scanner did not reach, a lamp, the next storey. Light of
 * distant sky would be the same at all places of the room that see a direction, and would light what this light does
 * not reach. So each side of the box is cut into cells, whose radiances are sources of the joint fit (light_model.h) in
 * place of the cells of the sky. */
#ifndef UNBAKE_LIGHT_SURROUND_H
#define UNBAKE_LIGHT_SURROUND_H

#include "server/capture/views.h"

#define SURROUND_ACROSS 4 /* cells along each edge of a side */
#define SURROUND_CELLS (6 * SURROUND_ACROSS * SURROUND_ACROSS)

struct surround {
    vec3 lower, upper;            /* corners, metres: the mesh and all cameras lie inside */
    bool is_seen[SURROUND_CELLS]; /* some photograph looks at it through the mesh */
};

void surround_init(struct surround *s, const struct views *views);

/* The cell that a ray from inside leaves through. */
size_t surround_cell(const struct surround *s, vec3 origin, vec3 direction);

/* Corners of a cell, counter-clockwise from inside. */
void surround_corners(const struct surround *s, size_t cell, vec3 corner[4]);

#endif
