/* mesh_round.h: a rough ball gets rounder and no smaller, the edge between a floor and a wall stays one, what lies in a
 * plane or has too few vertices stays as it is. The same for any number of threads. */
#include <math.h>
#include <string.h>

#include "server/scene/mesh_round.h"
#include "tests/check.h"
#include "tests/unit/rough_mesh.h"

#define ROUGH 0.02f /* vertices are off by as much at most, evenly */
#define DEVIATION (ROUGH / sqrtf(3.0f))

/* As if planes were found everywhere, or nowhere. */
static void smooth(struct mesh *m, bool plane, int threads) {
    struct parallel *pool = parallel_new(threads);
    struct face_normals faces;
    struct mesh_planes planes = {.region = mem_calloc(m->triangle_count, sizeof *planes.region)};
    vec3 *measured = mem_array(m->vertex_count, sizeof *measured);
    memcpy(measured, m->position, m->vertex_count * sizeof *measured);
    if (!plane)
        memset(planes.region, 0xff, m->triangle_count * sizeof *planes.region);
    face_normals_init(&faces, m, pool);
    mesh_round_smooth(m, measured, DEVIATION, &faces, &planes, pool);
    face_normals_release(&faces);
    mesh_planes_release(&planes);
    mem_free(measured);
    parallel_free(pool);
}

static void radius_of(const struct mesh *m, double *mean, double *off) {
    double sum = 0.0, squares = 0.0, count = (double)m->vertex_count;
    for (size_t v = 0; v < m->vertex_count; v++) {
        double r = (double)vec3_length(m->position[v]);
        sum += r;
        squares += (r - 1.0) * (r - 1.0);
    }
    *mean = sum / count;
    *off = sqrt(squares / count);
}

static void test_ball(void) {
    struct mesh before = {0}, m = {0}, other = {0};
    double mean, off, rough_mean, rough_off;
    rough_add_ball(&before, ROUGH);
    rough_add_ball(&m, ROUGH);
    rough_add_ball(&other, ROUGH);
    radius_of(&before, &rough_mean, &rough_off);
    smooth(&m, false, 3);
    radius_of(&m, &mean, &off);
    /* Six parameters through as many vertices as agree, some 27 here. */
    CHECK_THAT(off < 0.6 * rough_off, "%g, %g before", off, rough_off);
    CHECK_THAT(fabs(mean - 1.0) < 0.3 * (double)DEVIATION, "%g, %g before", mean, rough_mean);
    smooth(&other, false, 1);
    CHECK(memcmp(m.position, other.position, m.vertex_count * sizeof *m.position) == 0);
    mesh_release(&other);
    rough_add_ball(&other, ROUGH);
    smooth(&other, true, 1);
    for (size_t v = 0; v < before.vertex_count; v++)
        CHECK(vec3_length(vec3_sub(other.position[v], before.position[v])) == 0.0f);
    mesh_release(&other);
    mesh_release(&m);
    mesh_release(&before);
}

static void test_edge(void) {
    struct mesh m;
    float moved = 0.0f;
    rough_sheets(&m, ROUGH);
    smooth(&m, false, 2);
    for (size_t v = 0; v <= ROUGH_SIDE; v++)
        moved = fmaxf(moved, hypotf(m.position[v].y, m.position[v].z));
    CHECK_THAT(moved == 0.0f, "%g", (double)moved);
    mesh_release(&m);
}

static void test_few(void) {
    struct mesh m = {0};
    rough_grow(&m, 4, 2);
    for (uint32_t v = 0; v < 4; v++)
        m.position[m.vertex_count++] = (vec3){(float)(v & 1), v == 2 ? 0.01f : 0.0f, -(float)(v >> 1)};
    rough_triangle(&m, 0, 1, 3);
    rough_triangle(&m, 0, 3, 2);
    smooth(&m, false, 1);
    CHECK(m.position[2].y == 0.01f && m.position[0].y == 0.0f);
    mesh_release(&m);
}

int main(void) {
    test_ball();
    test_edge();
    test_few();
    return check_result();
}
