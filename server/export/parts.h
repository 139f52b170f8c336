/* parts.h -- the mesh divided for export: vertices split where they have several atlas coordinates (at chart seams) or
 * several texture coordinates of the input, and triangles grouped by segment. */
#ifndef UNBAKE_EXPORT_PARTS_H
#define UNBAKE_EXPORT_PARTS_H

#include <stddef.h>
#include <stdint.h>

#include "common/error.h"
#include "server/scene/atlas.h"
#include "server/scene/mesh.h"
#include "server/scene/segment.h"

#define PARTS_MAX 16384 /* objects per file */

/* Vertices in order of first use. */
struct seams {
    size_t vertex_count;
    uint32_t *corner;     /* [vertex_count] corner 3 t + c that defines a vertex; owned */
    uint32_t (*index)[3]; /* [triangle_count] vertices of each triangle of the mesh; owned */
};

/* `order` is a permutation of the triangles that defines the order of vertices; NULL: identity. */
void seams_make(struct seams *seams, const struct mesh *mesh, const struct atlas *atlas, const uint32_t *order);
void seams_release(struct seams *seams);

/* A non-empty segment. Charts belong to one segment, so parts share no vertices. */
struct part {
    uint32_t segment;
    size_t first_vertex, vertex_count;
    size_t first_triangle, triangle_count; /* in `order` */
    vec3 lower, upper;                     /* bounds, metres */
};

struct parts {
    struct seams seams;
    uint32_t *order; /* [triangle_count] triangles grouped by segment, otherwise in order; owned */
    size_t count;
    struct part *part; /* [count] in order of segments; owned */
};

/* STATUS_LIMIT for more than PARTS_MAX. */
enum status parts_make(struct parts *parts, const struct mesh *mesh, const struct segments *segments,
                       const struct atlas *atlas, struct error *err);
void parts_release(struct parts *parts);

#define PARTS_LABEL_BYTES 96 /* of a label with its NUL */

/* A name for files that take few characters: "segment_3", or "segment_3_wall_paint" where the input calls it
 * "wall/paint". Unique, of letters, digits, -, _ and visible characters beyond ASCII, in UTF-8. */
void parts_label(const struct segments *segments, const struct mesh *mesh, uint32_t segment,
                 char label[PARTS_LABEL_BYTES]);

/* Position, normal (the mesh must have normals) and texture coordinates (0 to 1 from the top left corner) of a
 * vertex. */
static inline vec3 seams_position(const struct seams *s, const struct mesh *mesh, size_t vertex) {
    uint32_t corner = s->corner[vertex];
    return mesh->position[mesh->index[corner / 3][corner % 3]];
}
static inline vec3 seams_normal(const struct seams *s, const struct mesh *mesh, size_t vertex) {
    uint32_t corner = s->corner[vertex];
    return mesh->normal[mesh->index[corner / 3][corner % 3]];
}
static inline vec2 seams_uv(const struct seams *s, const struct atlas *atlas, size_t vertex) {
    vec2 place = atlas->corner[s->corner[vertex] / 3][s->corner[vertex] % 3];
    return (vec2){place.x / (float)atlas->width, place.y / (float)atlas->height};
}
/* Texture coordinates of the input (the mesh must have some), from the lower left; 0 where a face has none. */
static inline vec2 seams_input_uv(const struct seams *s, const struct mesh *mesh, size_t vertex) {
    uint32_t corner = s->corner[vertex];
    return mesh_has_uv(mesh, corner / 3) ? mesh->uv[corner / 3][corner % 3] : (vec2){0.0f, 0.0f};
}

#endif
