/* thing.h -- what is put into a room: a lamp, or a mesh of a file. Each of its materials is a segment of its own. */
#ifndef UNBAKE_RELIGHT_THING_H
#define UNBAKE_RELIGHT_THING_H

#include <stddef.h>

#include "common/vec.h"
#include "server/relight/bake.h"
#include "server/scene/materials.h"
#include "server/scene/mesh.h"

/* A material of a thing: a segment. */
struct thing_part {
    rgb base_color, emission; /* where they are baked: of nothing; the mean */
    float roughness, specular, metallic;
};

struct thing {
    char *name; /* "lamp_1", "insert_1"; owned */
    size_t part_count;
    struct thing_part *part;   /* [part_count]; owned */
    struct emission_cone cone; /* outer -1: none */
    struct mesh
        mesh; /* in the room's coordinates; with normals or without; object_id: the part, NULL: the first; owned */
    struct baked *baked; /* of materials with pictures; NULL: there are none; owned */
};

struct things {
    size_t count;
    struct thing *thing; /* [count] owned */
    size_t note_count;
    char **note; /* [note_count] what of files was left out, as sentences; owned */
};

#endif
