/* segment.h -- the division of a mesh into segments: sets of triangles taken for one object.
 *
 * Given by the input's object_id, or made automatically as the supplemental of Nimier-David
 * et al. 2021 describes: connected smooth regions, split where curvature is high. */
#ifndef UNBAKE_SCENE_SEGMENT_H
#define UNBAKE_SCENE_SEGMENT_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "server/scene/mesh.h"

struct segments {
    size_t count;
    uint32_t *of_triangle; /* [triangle_count], in [0, count); owned */
    bool is_given;         /* by the input: `id` is its object_id */
    int64_t *id;           /* [count] the input's object_id, or the segment's own number; of a part that was split
                            * off: that of the whole; owned */
    size_t name_count;
    char **name; /* [name_count] of automatic segments by `id` (segment_names.h); none: NULL; owned */
};

void segments_from_object_id(struct segments *s, const struct mesh *mesh); /* needs object_id */
/* Deterministic; a few seconds for millions of triangles. */
void segments_automatic(struct segments *s, const struct mesh *mesh);
/* What the input calls the object that the segment is or is part of; of several automatic segments in one object
 * numbered; borrowed; NULL: nothing. */
const char *segments_name(const struct segments *s, const struct mesh *mesh, size_t segment);
/* A segment if it is one of is_known[count]; otherwise another one of its object that is, or itself if there is
 * none. */
uint32_t segments_known_part(const struct segments *s, uint32_t segment, const bool *is_known);
void segments_release(struct segments *s);

#endif
