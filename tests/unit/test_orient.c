/* orient.h: objects that photographs see from behind are turned as a whole, with their normals; what is
 * seen from the front, not at all, or by a held-out photograph only keeps its front. */
#include <string.h>

#include "server/capture/orient.h"
#include "tests/check.h"

#define SIZE 16

/* Looks along z from (x, y) = (SIZE / 2, SIZE / 2); a pixel is 1 x 1 m of the plane z = 16. */
static struct camera camera_at(float z) {
    struct camera c = {.width = SIZE, .height = SIZE, .fx = SIZE, .fy = SIZE, .cx = SIZE / 2, .cy = SIZE / 2};
    for (int i = 0; i < 3; i++)
        c.world_from_camera.rotation[i][i] = 1.0f;
    c.world_from_camera.translation = (vec3){SIZE / 2, SIZE / 2, z};
    c.camera_from_world = rigid_inverse(&c.world_from_camera);
    return c;
}

static float front_z(const struct mesh *mesh, size_t t) { return mesh_cross(mesh, t).z; }

int main(void) {
    /* A wall to the left, one to the right of which a strip is out of sight, one behind both, and one that
     * only the held-out photograph shows. */
    vec3 position[] = {{0, 0, 16},   {8, 0, 16},  {8, 16, 16}, {0, 16, 16},  {8, 0, 16}, {16, 0, 16},
                       {16, 16, 16}, {8, 16, 16}, {90, 0, 16}, {90, 16, 16}, {0, 0, 17}, {16, 0, 17},
                       {16, 16, 17}, {0, 0, 48},  {16, 0, 48}, {16, 16, 48}};
    /* Clockwise as the camera sees it (x right, y down) is towards it: the left wall is right. */
    uint32_t index[][3] = {{0, 2, 1}, {0, 3, 2}, {4, 5, 6},    {4, 6, 7},
                           {5, 8, 9}, {5, 9, 6}, {10, 11, 12}, {13, 14, 15}};
    int64_t object[] = {0, 0, 1, 1, 1, 1, 2, 3};
    vec3 normal[16];
    for (int v = 0; v < 16; v++)
        normal[v] = (vec3){0, 0, v < 4 ? -1 : 1};
    struct photograph photograph[2] = {{.camera = camera_at(0)}, {.camera = camera_at(32), .is_test = true}};
    struct scene scene = {.photograph_count = 2, .photograph = photograph};
    scene.mesh = (struct mesh){.vertex_count = 16,
                               .position = position,
                               .normal = normal,
                               .triangle_count = 8,
                               .index = index,
                               .object_id = object};
    CHECK(front_z(&scene.mesh, 0) < 0 && front_z(&scene.mesh, 2) > 0);
    uint32_t before[8][3];
    memcpy(before, index, sizeof before);

    struct parallel *pool = parallel_new(2);
    struct error err;
    size_t turned = 0;
    CHECK(orient_mesh(&scene, pool, &turned, &err) == STATUS_OK);
    CHECK_THAT(turned == 4, "%zu triangles turned", turned);
    for (size_t t = 0; t < 8; t++) {
        bool was_behind = object[t] == 1; /* the strip out of sight, too: it is one piece with the rest */
        CHECK_THAT((memcmp(before[t], index[t], sizeof index[t]) != 0) == was_behind, "triangle %zu", t);
        CHECK(!was_behind || front_z(&scene.mesh, t) < 0);
    }
    for (int v = 0; v < 16; v++)
        CHECK_THAT(normal[v].z == (v < 10 ? -1.0f : 1.0f), "normal %d", v);

    /* Once is enough. */
    CHECK(orient_mesh(&scene, pool, &turned, &err) == STATUS_OK && turned == 0);
    parallel_free(pool);
    return check_result();
}
