/* found_emitters.h -- which objects emit: the truth's list of objects against the segments of a recovered room. */
#ifndef UNBAKE_EVALUATE_FOUND_EMITTERS_H
#define UNBAKE_EVALUATE_FOUND_EMITTERS_H

#include <stdbool.h>
#include <stddef.h>

#include "common/error.h"
#include "server/relight/recovered.h"

struct found_emitters {
    size_t count;     /* objects that emit by the truth */
    size_t found;     /* of these, those of which most of the area does in the recovered room */
    size_t missed;    /* the others of these */
    size_t unfounded; /* objects that do not emit by the truth, but in part in the recovered room */
};

/* Reads truth/objects.json of `room`. The mesh's object_id are the objects. Sets emits[triangle_count] by the truth. */
enum status found_emitters_count(const char *room, const struct mesh *mesh, const struct recovered *recovered,
                                 bool *emits, struct found_emitters *found, struct error *err);

#endif
