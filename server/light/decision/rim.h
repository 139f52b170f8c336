/* rim.h -- how sharply the radiance of a part of a segment ends.
 *
 * A lamp ends at its rim. Where a lamp lights a surface from nearby, be it seen or not, light falls off over as far as
 * the lamp is away, and what is just beyond the rim is hardly darker than what is just within. */
#ifndef UNBAKE_LIGHT_DECISION_RIM_H
#define UNBAKE_LIGHT_DECISION_RIM_H

#include <stddef.h>
#include <stdint.h>

#include "server/scene/adjacency.h"

/* Borrowed, all pointers. */
struct rim {
    const struct adjacency *adjacency;
    const uint32_t *of_triangle; /* [triangle_count] segment */
    const float *observed;       /* [triangle_count] radiance; negative: none */
    uint8_t *side;               /* [triangle_count] scratch: 0 of the segment's triangles, before and after */
};

/* Logarithm of the median radiance within part[count] over that beside it, both so many triangles from the rim, or as
 * far as there are any; INFINITY: nothing is known beside it. list[triangle_count of the segment]: scratch. Several
 * threads may ask at once, each of a segment of its own. */
double rim_step(const struct rim *rim, const uint32_t *part, size_t count, int triangles, uint32_t *list);

#endif
