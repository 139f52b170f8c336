/* room.h -- meshes for the tests of the scene's geometry: the shared rooms and small shapes. */
#ifndef UNBAKE_TESTS_ROOM_H
#define UNBAKE_TESTS_ROOM_H

#include <stdbool.h>

#include "common/mem.h"
#include "server/ingest/mesh/mesh_file.h"
#include "server/scene/mesh.h"
#include "server/scene/segment.h"
#include "tests/check.h"

/* Loads data/NAME/mesh.ply, checked; false, with a line on stdout, where it is absent. */
static inline bool room_load(const char *name, struct mesh *mesh) {
    char path[1024];
    const char *root = getenv("UNBAKE_TEST_DATA");
    snprintf(path, sizeof path, "%s/%s/mesh.ply", root ? root : "../shared/data", name);
    if (access(path, R_OK) != 0) {
        printf("test data %s is not here\n", name);
        return false;
    }
    struct error err = {0};
    bool ok = mesh_file_read(path, name, MESH_MAX_TRIANGLES, mesh, NULL, &err) == STATUS_OK &&
              mesh_check(mesh, name, NULL, &err) == STATUS_OK;
    CHECK_THAT(ok, "%s", err.message);
    return ok;
}

static inline struct mesh room_new(size_t vertex_count, size_t triangle_count) {
    struct mesh mesh = {.vertex_count = vertex_count, .triangle_count = triangle_count, .face_count = triangle_count};
    mesh.position = mem_array(vertex_count, sizeof *mesh.position);
    mesh.index = mem_array(triangle_count, sizeof *mesh.index);
    mesh.face = mem_array(triangle_count, sizeof *mesh.face);
    for (size_t t = 0; t < triangle_count; t++)
        mesh.face[t] = (uint32_t)t;
    return mesh;
}

/* A grid of columns x rows quads, each cut in two; place(user, u, v) gives the position for
 * u, v in [0, 1]. */
static inline struct mesh room_grid(uint32_t columns, uint32_t rows, vec3 (*place)(float u, float v, void *user),
                                    void *user) {
    struct mesh mesh = room_new((size_t)(columns + 1) * (rows + 1), (size_t)2 * columns * rows);
    for (uint32_t y = 0; y <= rows; y++)
        for (uint32_t x = 0; x <= columns; x++)
            mesh.position[y * (columns + 1) + x] = place((float)x / (float)columns, (float)y / (float)rows, user);
    for (uint32_t y = 0; y < rows; y++)
        for (uint32_t x = 0; x < columns; x++) {
            uint32_t v = y * (columns + 1) + x, t = 2 * (y * columns + x);
            const uint32_t two[2][3] = {{v, v + 1, v + columns + 2}, {v, v + columns + 2, v + columns + 1}};
            memcpy(mesh.index[t], two, sizeof two);
        }
    return mesh;
}

/* One segment for all. */
static inline void room_one_segment(struct segments *segments, const struct mesh *mesh) {
    *segments = (struct segments){.count = 1};
    segments->of_triangle = mem_calloc(mesh->triangle_count, sizeof *segments->of_triangle);
    segments->id = mem_calloc(1, sizeof *segments->id);
}

#endif
