/* ply_vertices.h -- the vertices of a PLY file: positions, normals and texture coordinates. */
#ifndef UNBAKE_INGEST_MESH_PLY_VERTICES_H
#define UNBAKE_INGEST_MESH_PLY_VERTICES_H

#include "server/ingest/mesh/ply_values.h"
#include "server/ingest/mesh/positions.h"
#include "server/scene/mesh.h"

struct ply_vertices {
    struct positions position;
    vec2 *uv; /* [position.count] as in struct mesh; NULL: vertices have none; owned */
};

/* Reads the element at `in`; sets mesh->vertex_count and, where the file has them, mesh->normal. *vertices, which
 * begins as zeros but for position.offset, is the caller's (ply_vertices_release), also after a failure. */
enum status ply_read_vertices(struct ply_values *in, const struct ply_element *e, struct ply_vertices *vertices,
                              struct mesh *mesh);
void ply_vertices_release(struct ply_vertices *vertices);

#endif
