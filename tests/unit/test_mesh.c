/* test_mesh.c -- what mesh_check refuses, drops and repairs; welding; adjacency. */
#include "server/scene/mesh.h"

#include "common/mem.h"
#include "server/scene/adjacency.h"
#include "tests/check.h"

static struct mesh make(const vec3 *position, size_t vertex_count, const uint32_t (*index)[3], size_t triangle_count) {
    struct mesh mesh = {.vertex_count = vertex_count, .triangle_count = triangle_count, .face_count = triangle_count};
    mesh.position = mem_array(vertex_count, sizeof *mesh.position);
    memcpy(mesh.position, position, vertex_count * sizeof *position);
    mesh.index = mem_array(triangle_count, sizeof *mesh.index);
    if (triangle_count > 0)
        memcpy(mesh.index, index, triangle_count * sizeof *index);
    mesh.face = mem_array(triangle_count, sizeof *mesh.face);
    mesh.object_id = mem_array(triangle_count, sizeof *mesh.object_id);
    for (size_t t = 0; t < triangle_count; t++) {
        mesh.face[t] = (uint32_t)t;
        mesh.object_id[t] = 100 + (int64_t)t;
    }
    return mesh;
}

static const vec3 square[5] = {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}, {0.5f, 0, 0}};

/* mesh_check must refuse with a message that contains `wanted`. */
static void refuses(struct mesh mesh, const char *wanted) {
    struct error err = {0};
    CHECK(mesh_check(&mesh, "room.ply", NULL, &err) == STATUS_INPUT);
    CHECK_THAT(strstr(err.message, wanted) && strstr(err.message, "room.ply"), "%s", err.message);
    mesh_release(&mesh);
}

static void test_refused(void) {
    static const uint32_t good[1][3] = {{0, 1, 3}}, flat[1][3] = {{0, 4, 1}};
    static const uint32_t far_index[2][3] = {{0, 1, 2}, {0, 7, 2}};
    vec3 bad[5];
    refuses(make(square, 5, good, 0), "no faces");
    refuses(make(square, 5, far_index, 2), "face 1: vertex index 7, but there are 5");
    refuses(make(square, 5, flat, 1), "none of its 1 faces");
    memcpy(bad, square, sizeof bad);
    bad[3].y = NAN;
    refuses(make(bad, 5, good, 1), "vertex 3");
    bad[3].y = -INFINITY;
    refuses(make(bad, 5, good, 1), "vertex 3");
    bad[3].y = 3e30f;
    refuses(make(bad, 5, good, 1), "vertex 3");
}

static void test_dropped(void) {
    static const vec3 position[9] = {{0, 0, 0},     {1, 0, 0}, {1, 1, 0},      {0, 1, 0},     {0.5f, 0, 0},
                                     {-0.0f, 0, 0}, {1, 1, 0}, {1e-25f, 0, 0}, {0, 1e-25f, 0}};
    static const uint32_t index[8][3] = {
        {0, 4, 1},                       /* on one line */
        {0, 1, 2}, {0, 0, 2}, {2, 0, 1}, /* the second again, turned, */
        {1, 0, 2},                       /* the other way round, */
        {5, 1, 6},                       /* and over other vertices at the same places */
        {0, 2, 3}, {0, 7, 8}             /* its area is no float */
    };
    struct mesh mesh = make(position, 9, index, 8);
    struct mesh_report report;
    struct error err;
    CHECK(mesh_check(&mesh, "room.ply", &report, &err) == STATUS_OK);
    CHECK(report.degenerate_count == 3);
    CHECK(report.duplicate_count == 3);
    CHECK(mesh.triangle_count == 2 && mesh.face_count == 8);
    CHECK(mesh.face[0] == 1 && mesh.face[1] == 6);
    CHECK(mesh.object_id[0] == 101 && mesh.object_id[1] == 106);
    CHECK(mesh.index[1][0] == 0 && mesh.index[1][1] == 2 && mesh.index[1][2] == 3);
    CHECK_NEAR(mesh_area(&mesh), 1.0, 1e-6);
    vec3 lower, upper;
    mesh_bounds(&mesh, &lower, &upper);
    CHECK(lower.x == 0.0f && upper.x == 1.0f && upper.y == 1.0f && upper.z == 0.0f);
    CHECK(mesh_cross(&mesh, 0).z == 1.0f);
    mesh_release(&mesh);
}

static void test_normals(void) {
    static const uint32_t index[2][3] = {{0, 1, 2}, {0, 2, 3}};
    struct mesh mesh = make(square, 5, index, 2);
    struct error err;
    mesh.normal = mem_calloc(5, sizeof *mesh.normal);
    mesh.normal[0] = (vec3){0, 3e30f, 4e30f}; /* its square is no float */
    mesh.normal[1] = (vec3){NAN, 0, 1};
    mesh.normal[2] = (vec3){0, 0, -1e-30f};
    CHECK(mesh_check(&mesh, "room.ply", NULL, &err) == STATUS_OK);
    CHECK_NEAR(mesh.normal[0].y, 0.6, 1e-6);
    CHECK_NEAR(mesh.normal[0].z, 0.8, 1e-6);
    CHECK_NEAR(mesh.normal[1].z, 1.0, 1e-6); /* that of the faces */
    CHECK_NEAR(mesh.normal[2].z, -1.0, 1e-6);
    CHECK_NEAR(mesh.normal[3].z, 1.0, 1e-6);
    CHECK_NEAR(vec3_length(mesh.normal[4]), 1.0, 1e-6); /* of no face */
    mesh_release(&mesh);
}

/* Three triangles on the edge from (0,0,0) to (1,1,0), one of them over vertices of its own. */
static void test_adjacency(void) {
    static const vec3 position[7] = {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}, {1, 1, 0}, {-0.0f, 0, 0}, {0, 0, 1}};
    static const uint32_t index[3][3] = {{0, 1, 2}, {0, 2, 3}, {4, 6, 5}};
    struct mesh mesh = make(position, 7, index, 3);
    struct adjacency adjacency;
    adjacency_make(&adjacency, &mesh);
    CHECK(adjacency.weld[4] == 2 && adjacency.weld[5] == 0 && adjacency.weld[6] == 6);
    CHECK(adjacency.next[2] == 3 && adjacency.next[3] == 8 && adjacency.next[8] == 2);
    static const uint32_t alone[] = {0, 1, 4, 5, 6, 7};
    for (size_t i = 0; i < sizeof alone / sizeof *alone; i++)
        CHECK_THAT(adjacency.next[alone[i]] == alone[i], "half-edge %u", alone[i]);
    adjacency_release(&adjacency);
    mesh_release(&mesh);
}

int main(void) {
    test_refused();
    test_dropped();
    test_normals();
    test_adjacency();
    return check_result();
}
