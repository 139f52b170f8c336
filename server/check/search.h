/* search.h -- looks for a hypothesis under which photographs agree better about the mesh than as they were loaded.
 *
 * Hypotheses are compared at low effort; the best are measured in full, at other points than those by which they were
 * chosen. First one thing at a time is changed: what the matrices mean, the mesh's axes, its scale, the frames' order,
 * the lens. Where nothing of that agrees, combinations are tried. */
#ifndef UNBAKE_CHECK_SEARCH_H
#define UNBAKE_CHECK_SEARCH_H

#include "server/check/consistency.h"

struct search_result {
    struct hypothesis best;              /* the given one where no other is better */
    struct photo_agreement given, found; /* measured in full */
    bool given_has_parallax;             /* the agreement of the given one depends on the distances of the surface */
    double sure; /* standard errors by which `found` agrees better than `given`; 0 for the given one */
    vec3 offset; /* by which the mesh would have to be moved to agree better, metres; 0 where it would not */
    struct photo_agreement moved; /* with it */
    size_t tried;                 /* hypotheses */
};

void search_run(const struct consistency *c, const struct scene *scene, struct search_result *result);

/* Whether the scale is that of a unit of length in metres, or the other way round. */
bool search_is_unit_scale(double scale);

#endif
