/* virtual_object.h -- an object that a render puts into a recovered room: a lamp, or a mesh of a file. Each of its
 * materials is a segment of its own. */
#ifndef UNBAKE_RELIGHT_VIRTUAL_OBJECT_H
#define UNBAKE_RELIGHT_VIRTUAL_OBJECT_H

#include <stddef.h>

#include "common/vec.h"
#include "server/relight/bake.h"
#include "server/scene/materials.h"
#include "server/scene/mesh.h"

/* A material of an object: a segment. */
struct virtual_object_part {
    rgb base_color, emission; /* where they are baked: of nothing; the mean */
    float roughness, specular, metallic;
};

struct virtual_object {
    char *name; /* "lamp_1", "insert_1"; owned */
    size_t part_count;
    struct virtual_object_part *part; /* [part_count]; owned */
    struct emission_cone cone;        /* outer -1: none */
    struct mesh mesh;    /* in the room's coordinates; normals or NULL; object_id: the part, NULL: the first; owned */
    struct baked *baked; /* of materials with pictures; NULL: there are none; owned */
};

struct virtual_objects {
    size_t count;
    struct virtual_object *object; /* [count] owned */
    size_t note_count;
    char **note; /* [note_count] what of files was left out, as sentences; owned */
};

#endif
