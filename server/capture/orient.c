/* orient.c -- see orient.h. */
#include "server/capture/orient.h"

#include <math.h>
#include <stdint.h>
#include <string.h>

#include "common/mem.h"
#include "server/render/accel.h"
#include "server/scene/adjacency.h"
#include "server/scene/photograph_reduce.h"

/* Along both axes, of the pixels traced, for time: what is seen at all covers more; to 3: no change. */
#define PIXEL_STRIDE 2

/* --- sides seen by photographs --------------------------------------------------------------------- */

struct trace_job {
    const struct accel *accel;
    const struct camera *camera;
    uint32_t *hit_triangle; /* [rows][columns] the triangle met there, or ACCEL_NONE */
    size_t columns;
    uint32_t stride;
};

static void trace_row(void *user, size_t row, int thread) {
    (void)thread;
    const struct trace_job *job = user;
    for (size_t column = 0; column < job->columns; column++) {
        struct accel_hit hit;
        vec3 direction;
        float x = (float)(column * job->stride) + 0.5f, y = (float)(row * job->stride) + 0.5f;
        bool meets = camera_direction(job->camera, x, y, &direction) &&
                     accel_intersect(job->accel, camera_origin(job->camera), direction, 0.0f, INFINITY, &hit);
        job->hit_triangle[row * job->columns + column] = meets ? hit.triangle : ACCEL_NONE;
    }
}

/* Adds to balance[triangle] 1 for each pixel that shows its front and -1 for its back. */
static void count_sides(const struct scene *scene, const struct camera *camera, const struct accel *accel,
                        struct parallel *pool, long *balance) {
    uint32_t stride = PIXEL_STRIDE * camera_step(camera);
    size_t columns = (camera->width + stride - 1) / stride;
    size_t rows = (camera->height + stride - 1) / stride;
    struct trace_job job = {accel, camera, mem_array(rows * columns + 1, sizeof *job.hit_triangle), columns, stride};
    parallel_for(pool, rows, trace_row, &job);
    for (size_t i = 0; i < rows * columns; i++) {
        if (job.hit_triangle[i] == ACCEL_NONE)
            continue;
        vec3 corner = scene->mesh.position[scene->mesh.index[job.hit_triangle[i]][0]];
        vec3 to_camera = vec3_sub(camera_origin(camera), corner);
        balance[job.hit_triangle[i]] +=
            vec3_dot(to_camera, mesh_cross(&scene->mesh, job.hit_triangle[i])) > 0.0f ? 1 : -1;
    }
    mem_free(job.hit_triangle);
}

/* --- pieces --------------------------------------------------------------------------------------- */

static uint32_t root_of(uint32_t *parent, uint32_t t) {
    while (parent[t] != t)
        t = parent[t] = parent[parent[t]];
    return t;
}

/* Whether two triangles that share an edge have the same orientation: they run along it in opposite directions. */
static bool same_front(const struct mesh *mesh, const uint32_t *weld, size_t half_edge, size_t other) {
    return weld[mesh->index[half_edge / 3][half_edge % 3]] == weld[mesh->index[other / 3][(other + 1) % 3]];
}

/* Representative triangle of each triangle's piece: those of one object joined by edges that exactly two share.
 * [triangle_count], the caller's. */
static uint32_t *find_pieces(const struct mesh *mesh) {
    struct adjacency adjacency;
    adjacency_make(&adjacency, mesh);
    uint32_t *parent = mem_array(mesh->triangle_count, sizeof *parent);
    for (size_t t = 0; t < mesh->triangle_count; t++)
        parent[t] = (uint32_t)t;
    for (size_t h = 0; h < 3 * mesh->triangle_count; h++) {
        size_t other = adjacency.next[h], a = h / 3, b = other / 3;
        bool two = other != h && adjacency.next[other] == h;
        if (!two || (mesh->object_id && mesh->object_id[a] != mesh->object_id[b]) ||
            !same_front(mesh, adjacency.weld, h, other))
            continue;
        uint32_t first = root_of(parent, (uint32_t)a), second = root_of(parent, (uint32_t)b);
        parent[first > second ? first : second] = first > second ? second : first;
    }
    for (size_t t = 0; t < mesh->triangle_count; t++)
        parent[t] = root_of(parent, (uint32_t)t);
    adjacency_release(&adjacency);
    return parent;
}

/* --- turning -------------------------------------------------------------------------------------- */

/* Flips shading normals of flipped triangles, unless others share them. */
static void turn_normals(struct mesh *mesh, const bool *turned) {
    enum { KEPT = 1, TO_TURN = 2 };
    uint8_t *use = mem_calloc(mesh->vertex_count, 1);
    for (size_t t = 0; t < mesh->triangle_count; t++) {
        vec3 cross = mesh_cross(mesh, t);
        for (int k = 0; k < 3; k++) {
            uint32_t v = mesh->index[t][k];
            use[v] |= turned[t] && vec3_dot(cross, mesh->normal[v]) < 0.0f ? TO_TURN : KEPT;
        }
    }
    for (size_t v = 0; v < mesh->vertex_count; v++) {
        if (use[v] == TO_TURN)
            mesh->normal[v] = vec3_neg(mesh->normal[v]);
    }
    mem_free(use);
}

static size_t turn(struct mesh *mesh, const long *balance) {
    uint32_t *piece = find_pieces(mesh);
    long *sum = mem_calloc(mesh->triangle_count, sizeof *sum);
    bool *turned = mem_calloc(mesh->triangle_count, sizeof *turned);
    size_t count = 0;
    for (size_t t = 0; t < mesh->triangle_count; t++)
        sum[piece[t]] += balance[t];
    for (size_t t = 0; t < mesh->triangle_count; t++) {
        turned[t] = sum[piece[t]] < 0;
        if (!turned[t])
            continue;
        mesh_turn_triangle(mesh, t);
        count++;
    }
    if (mesh->normal && count > 0)
        turn_normals(mesh, turned);
    mem_free(turned);
    mem_free(sum);
    mem_free(piece);
    return count;
}

enum status orient_mesh(struct scene *scene, struct parallel *pool, size_t *turned, struct error *err) {
    struct accel *accel;
    enum status status = accel_new(&accel, &scene->mesh, pool, err);
    if (status != STATUS_OK)
        return status;
    long *balance = mem_calloc(scene->mesh.triangle_count, sizeof *balance);
    for (size_t i = 0; i < scene->photograph_count; i++) {
        if (!scene->photograph[i].is_test)
            count_sides(scene, &scene->photograph[i].camera, accel, pool, balance);
    }
    accel_free(accel);
    *turned = turn(&scene->mesh, balance);
    mem_free(balance);
    return STATUS_OK;
}
