/* gltf_objects.h -- the objects of a glTF file: each pair of a node (or instance) and a material of its mesh, numbered
 * from 0 in order of traversal, named by the node, else its mesh, and the material. Materials that are pages of a
 * texture (texture_pages.h) divide nothing, nor do nodes that have a page each. */
#ifndef UNBAKE_INGEST_MESH_GLTF_OBJECTS_H
#define UNBAKE_INGEST_MESH_GLTF_OBJECTS_H

#include <stdbool.h>

#include "server/ingest/mesh/faces.h"
#include "server/ingest/mesh/gltf_file.h"

struct gltf_objects {
    const struct gltf_file *file;
    bool are_pages; /* the materials */
    size_t count, capacity;
    char **name;      /* [count] owned */
    double *material; /* [count] number of the first, -1: none; owned */
};

/* `file` is borrowed until gltf_objects_settle. */
void gltf_objects_init(struct gltf_objects *o, const struct gltf_file *file);
void gltf_objects_release(struct gltf_objects *o);

/* Starts an object: part of a node's mesh with this material (-1: none). */
void gltf_objects_start(struct gltf_objects *o, size_t node, size_t mesh, double material);

/* Moves the names to the mesh and notes pages in the report; with one object, or one to a page, there are neither ids
 * nor names. */
void gltf_objects_settle(struct gltf_objects *o, struct mesh *mesh, struct faces_report *report);

#endif
