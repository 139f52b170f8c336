/* faces.h -- collects the polygons of a mesh file: triangulation and limits. Shared by the mesh readers. */
#ifndef UNBAKE_INGEST_MESH_FACES_H
#define UNBAKE_INGEST_MESH_FACES_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "common/error.h"
#include "server/ingest/mesh/polygon.h"
#include "server/scene/mesh.h"

#define FACES_MAX_NOTES 6    /* of a mesh; more are dropped */
#define FACES_NOTE_BYTES 200 /* with the NUL */

struct faces_report {
    size_t polygon_count; /* faces with more than four corners, cut into triangles */
    size_t small_count;   /* faces with fewer than three corners, left out */
    size_t note_count;
    char note[FACES_MAX_NOTES][FACES_NOTE_BYTES]; /* [note_count] what else was left out or changed, for warnings */
    double step_m; /* of the file's own precision at its farthest coordinate, where that is single; 0: finer */
};

struct faces {
    struct mesh *mesh;
    const char *name;       /* of the file, for messages */
    size_t capacity, limit; /* triangles */
    bool has_object_id;     /* whether mesh->object_id is filled */
    struct faces_report report;
    size_t corner_count;                     /* the polygon to be added: */
    uint32_t corner[POLYGON_MAX_CORNERS];    /* its vertices */
    double position[POLYGON_MAX_CORNERS][3]; /* and where the file has them */
    bool has_uv;                             /* faces_add clears it */
    vec2 uv[POLYGON_MAX_CORNERS];            /* with has_uv: texture coordinates, as in struct mesh */
    vec3 single[POLYGON_MAX_CORNERS];        /* work space of faces_add, with triangle */
    uint32_t triangle[POLYGON_MAX_CORNERS][3];
};

/* Adds a sentence, which the file's name goes before; more than FACES_MAX_NOTES are dropped. */
void faces_note(struct faces_report *report, const char *format, ...) __attribute__((format(printf, 2, 3)));

/* Appends to *mesh, which is empty, at most triangle_limit triangles. The caller's (mem_free). */
struct faces *faces_new(struct mesh *mesh, const char *name, size_t triangle_limit, bool has_object_id);

/* Reserves memory for `triangle_count` triangles in total. */
void faces_reserve(struct faces *f, size_t triangle_count);

/* Adds the polygon as face number mesh->face_count, which it increments. STATUS_LIMIT for too many triangles. */
enum status faces_add(struct faces *f, int64_t object_id, struct error *err);

#endif
