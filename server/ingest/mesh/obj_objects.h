/* obj_objects.h -- the objects of an OBJ file: combinations of the names of o, g and usemtl that faces have, numbered
 * from 0 in order of first use. Materials that are pages of a texture (texture_pages.h) divide nothing, nor do names of
 * o or g that go with them one by one. */
#ifndef UNBAKE_INGEST_MESH_OBJ_OBJECTS_H
#define UNBAKE_INGEST_MESH_OBJ_OBJECTS_H

#include <stdbool.h>

#include "server/ingest/mesh/faces.h"
#include "server/ingest/mesh/intern.h"

enum obj_label { OBJ_OBJECT, OBJ_GROUP, OBJ_MATERIAL, OBJ_LABEL_COUNT };

struct obj_objects {
    struct intern labels, objects;
    uint32_t label[OBJ_LABEL_COUNT]; /* current ones, by number */
    uint32_t object;                 /* number of their combination, once a face has used it: */
    bool object_known;
    char *library; /* of materials (mtllib), or NULL; owned */
};

void obj_objects_init(struct obj_objects *o);
void obj_objects_release(struct obj_objects *o);

void obj_objects_set(struct obj_objects *o, enum obj_label kind, const void *name, size_t length);
void obj_objects_set_library(struct obj_objects *o, const void *name, size_t length);
/* The number of the current combination, for a face. */
uint32_t obj_objects_current(struct obj_objects *o);

/* Takes pages out of mesh->object_id, with a note in the report, and names the objects; with one object only, there are
 * neither ids nor names. `folder` has the library, NULL: it cannot be read. */
void obj_objects_settle(struct obj_objects *o, const char *folder, struct mesh *mesh, struct faces_report *report);

#endif
