/* mesh_planes.h, height_fit.h: of a rough floor and wall both planes are found and their vertices put there, those of
 * the edge into both; what is bowed by more than its noise, and what has few vertices, stays; a paraboloid is fitted to
 * the last bit, and a line tells of none. */
#include <math.h>
#include <string.h>

#include "server/scene/mesh_planes.h"
#include "tests/check.h"
#include "tests/unit/rough_mesh.h"

#define ROUGH 0.005f /* vertices are off by as much at most, evenly, and their edges are of 10 cm */
#define FILTERED (0.5f * ROUGH)
#define DEVIATION (ROUGH / sqrtf(3.0f))

/* Finds planes and flattens a mesh whose noise was filtered before, of which `measured` has all: how many planes there
 * are, and by how much the farthest vertex was moved. Frees `measured`. */
static size_t flatten(struct mesh *m, struct mesh *measured, float noise, float *moved) {
    struct parallel *pool = parallel_new(2);
    struct face_normals faces;
    struct mesh_planes planes;
    vec3 *before = mem_array(m->vertex_count, sizeof *before);
    memcpy(before, m->position, m->vertex_count * sizeof *before);
    face_normals_init(&faces, m, pool);
    mesh_planes_find(&planes, m, measured->position, noise, &faces);
    mesh_planes_flatten(&planes, m, &faces);
    *moved = 0.0f;
    for (size_t v = 0; v < m->vertex_count; v++)
        *moved = fmaxf(*moved, vec3_length(vec3_sub(m->position[v], before[v])));
    size_t count = planes.count;
    mesh_planes_release(&planes);
    face_normals_release(&faces);
    mesh_release(measured);
    mem_free(before);
    parallel_free(pool);
    return count;
}

static void test_sheets(void) {
    struct mesh m, measured;
    float moved, farthest = 0.0f, edge = 0.0f;
    size_t row = ROUGH_SIDE + 1;
    rough_sheets(&m, FILTERED);
    rough_sheets(&measured, ROUGH);
    CHECK(flatten(&m, &measured, DEVIATION, &moved) == 2);
    for (size_t v = 0; v < m.vertex_count; v++) {
        vec3 p = m.position[v];
        if (v % (row * row) < row)
            edge = fmaxf(edge, hypotf(p.y, p.z));
        else
            farthest = fmaxf(farthest, fabsf(v < row * row ? p.y : p.z));
    }
    /* Each plane is told by 1,089 vertices: at its corners to .06 of a vertex's noise. */
    CHECK_THAT(farthest < 0.25f * DEVIATION && edge < 0.25f * DEVIATION, "%g, edge %g", (double)farthest, (double)edge);
    CHECK_THAT(moved > 0.8f * FILTERED && moved < 1.5f * FILTERED, "%g", (double)moved);
    CHECK(memcmp(m.position, m.position + row * row, row * sizeof *m.position) == 0);
    mesh_release(&m);
}

/* A sheet bowed by less than a plane reaches. With ten times the noise nobody could tell. */
static void test_bowed(void) {
    for (int noisier = 0; noisier < 2; noisier++) {
        struct mesh m[2] = {{0}, {0}};
        float moved;
        for (int i = 0; i < 2; i++) {
            rough_grow(&m[i], (ROUGH_SIDE + 1) * (ROUGH_SIDE + 1), 2 * ROUGH_SIDE * ROUGH_SIDE);
            rough_sheet(&m[i], (vec3){0.1f, 0, 0}, (vec3){0, 0, -0.1f}, i ? ROUGH : FILTERED);
            for (size_t v = 0; v < m[i].vertex_count; v++) {
                float x = (m[i].position[v].x - 1.6f) / 1.6f;
                m[i].position[v].y += DEVIATION * x * x;
            }
        }
        size_t planes = flatten(&m[0], &m[1], noisier ? 10.0f * DEVIATION : DEVIATION, &moved);
        CHECK_THAT(planes == (noisier ? 1 : 0) && (moved > 0.0f) == (bool)noisier, "%zu planes, moved %g", planes,
                   (double)moved);
        mesh_release(&m[0]);
    }
}

/* Two triangles beside each other: a plane through four vertices says nothing new. */
static void test_few(void) {
    struct mesh m[2] = {{0}, {0}};
    float moved;
    for (int i = 0; i < 2; i++) {
        rough_grow(&m[i], 4, 2);
        for (uint32_t v = 0; v < 4; v++)
            m[i].position[m[i].vertex_count++] = (vec3){(float)(v & 1), v == 2 ? 0.01f : 0.0f, -(float)(v >> 1)};
        rough_triangle(&m[i], 0, 1, 3);
        rough_triangle(&m[i], 0, 3, 2);
    }
    CHECK(flatten(&m[0], &m[1], 0.1f, &moved) == 0 && moved == 0.0f);
    mesh_release(&m[0]);
}

static void test_fit(void) {
    vec3 position[9];
    uint32_t vertex[9];
    struct height_frame f;
    struct height_fit fit;
    for (uint32_t i = 0; i < 9; i++) {
        float x = (float)(i % 3), y = (float)(i / 3);
        position[i] = (vec3){x, y, 2.0f + 0.5f * x - 0.25f * y + 0.125f * x * x - 0.5f * x * y + y * y};
        vertex[i] = i;
    }
    height_frame_init(&f, (vec3){0.0f, 0.0f, 2.0f}, position, vertex, 9);
    CHECK(f.normal.z == 1.0f);
    CHECK(height_fit(&fit, HEIGHT_PARABOLOID, &f, position, vertex, 9));
    CHECK_THAT(fit.residual_squares < 1e-10, "%g", fit.residual_squares);
    vec3 beyond = {5.0f, -3.0f, 0.0f};
    double true_z = 2.0 + 2.5 + 0.75 + 3.125 + 7.5 + 9.0;
    double z = height_fitted(&fit, &f, beyond) + (double)f.centre.z;
    CHECK_THAT(fabs(z - true_z) < 1e-4, "%.9g, true is %.9g", z, true_z);
    CHECK(height_fit(&fit, HEIGHT_PLANE, &f, position, vertex, 9) && fit.residual_squares > 0.1);
    CHECK(!height_fit(&fit, HEIGHT_PLANE, &f, position, vertex, 3));
    for (int i = 0; i < 9; i++)
        position[i] = (vec3){(float)i, 0.0f, 0.0f};
    height_frame_init(&f, (vec3){0.0f, 0.0f, 1.0f}, position, vertex, 9);
    CHECK(!height_fit(&fit, HEIGHT_PLANE, &f, position, vertex, 9));
}

int main(void) {
    test_sheets();
    test_bowed();
    test_few();
    test_fit();
    return check_result();
}
