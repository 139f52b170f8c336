/* mesh_denoise.h: a rough floor and wall become plane and keep their edge, a ball beside them is
 * not spoiled, what coincides stays together; what is smooth, has few triangles, or has normals stays as it is. The
 * same for any number of threads. */
#include <math.h>
#include <string.h>

#include "server/scene/mesh_denoise.h"
#include "tests/check.h"
#include "tests/unit/rough_mesh.h"

#define ROUGH 0.02f   /* vertices are off by as much at most, evenly */
#define CRUMPLED 0.2f /* edges are .1 */
#define DEVIATION (ROUGH / sqrtf(3.0f))

/* Root of the mean square of the distance of the sheets' vertices from their plane; of those on the edge between them
 * from the edge alone, or of all others. */
static float off_plane(const struct mesh *m, bool of_edge) {
    double sum = 0.0, count = 0.0;
    size_t row = ROUGH_SIDE + 1;
    for (size_t v = 0; v < m->vertex_count; v++) {
        vec3 p = m->position[v];
        if ((v % (row * row) < row) != of_edge)
            continue;
        float off = v < row * row ? p.y : p.z;
        sum += (double)(of_edge ? p.y * p.y + p.z * p.z : off * off);
        count += 1.0;
    }
    return (float)sqrt(sum / count);
}

static float farthest_move(const struct mesh *before, const struct mesh *after) {
    float far = 0.0f;
    for (size_t v = 0; v < before->vertex_count; v++)
        far = fmaxf(far, vec3_length(vec3_sub(after->position[v], before->position[v])));
    return far;
}

static void test_sheets(struct parallel *pool) {
    struct mesh before, m, other;
    rough_sheets(&before, ROUGH);
    rough_sheets(&m, ROUGH);
    float noise = mesh_denoise(&m, pool);
    CHECK_THAT(noise > 0.8f * DEVIATION && noise < 1.2f * DEVIATION, "%g, true is %g", (double)noise,
               (double)DEVIATION);
    float was = off_plane(&before, false), is = off_plane(&m, false), edge = off_plane(&m, true);
    CHECK_THAT(is < 0.3f * was, "%g of %g", (double)is, (double)was);
    CHECK_THAT(edge < 0.5f * was, "%g", (double)edge);
    CHECK(m.normal == NULL && m.vertex_count == before.vertex_count);
    size_t row = ROUGH_SIDE + 1;
    CHECK(memcmp(m.position, m.position + row * row, row * sizeof *m.position) == 0);

    struct parallel *one = parallel_new(1);
    rough_sheets(&other, ROUGH);
    CHECK(mesh_denoise(&other, one) == noise);
    CHECK(memcmp(other.position, m.position, m.vertex_count * sizeof *m.position) == 0);
    parallel_free(one);
    mesh_release(&other);
    mesh_release(&m);
    mesh_release(&before);
}

/* Noise as large as the edges of triangles: their normals tell nothing. */
static void test_crumpled(struct parallel *pool) {
    struct mesh before, m;
    rough_sheets(&before, CRUMPLED);
    rough_sheets(&m, CRUMPLED);
    float noise = mesh_denoise(&m, pool), deviation = CRUMPLED / sqrtf(3.0f);
    CHECK_THAT(noise > 0.8f * deviation && noise < 1.2f * deviation, "%g, true is %g", (double)noise,
               (double)deviation);
    float was = off_plane(&before, false), is = off_plane(&m, false), edge = off_plane(&m, true);
    CHECK_THAT(is < 0.2f * was, "%g of %g", (double)is, (double)was);
    CHECK_THAT(edge < 0.5f * was, "%g of %g", (double)edge, (double)was);
    mesh_release(&m);
    mesh_release(&before);
}

/* Mean of the radius of the ball, which is all that follows `first`, and the root of its mean square off 1. */
static void radius_of(const struct mesh *m, size_t first, double *mean, double *off) {
    double sum = 0.0, squares = 0.0, count = (double)(m->vertex_count - first);
    for (size_t v = first; v < m->vertex_count; v++) {
        double r = (double)vec3_length(m->position[v]);
        sum += r;
        squares += (r - 1.0) * (r - 1.0);
    }
    *mean = sum / count;
    *off = sqrt(squares / count);
}

/* A coarse ball, of which the filter would make a polyhedron. */
static void test_ball(struct parallel *pool) {
    struct mesh m;
    double mean, off, rough_mean, rough_off;
    rough_sheets(&m, ROUGH);
    size_t first = m.vertex_count;
    rough_add_ball(&m, ROUGH);
    radius_of(&m, first, &rough_mean, &rough_off);
    mesh_denoise(&m, pool);
    radius_of(&m, first, &mean, &off);
    CHECK_THAT(fabs(mean - 1.0) < 0.3 * (double)DEVIATION, "%g, %g before", mean, rough_mean);
    CHECK_THAT(off < 1.15 * rough_off, "%g, %g before", off, rough_off);
    mesh_release(&m);
}

/* Its triangles differ from most of those beside them, and yet it has no noise. */
static void test_box(struct parallel *pool) {
    static const uint32_t side[6][4] = {{0, 2, 3, 1}, {4, 5, 7, 6}, {0, 1, 5, 4},
                                        {2, 6, 7, 3}, {0, 4, 6, 2}, {1, 3, 7, 5}};
    struct mesh m = {0}, before = {0};
    rough_grow(&m, 8, 12);
    rough_grow(&before, 8, 12);
    for (uint32_t v = 0; v < 8; v++)
        m.position[m.vertex_count++] = (vec3){(float)(v & 1), (float)(v >> 1 & 1), (float)(v >> 2)};
    for (int i = 0; i < 6; i++) {
        rough_triangle(&m, side[i][0], side[i][1], side[i][2]);
        rough_triangle(&m, side[i][0], side[i][2], side[i][3]);
    }
    memcpy(before.position, m.position, 8 * sizeof *m.position);
    before.vertex_count = 8;
    CHECK(mesh_denoise(&m, pool) == 0.0f && farthest_move(&before, &m) == 0.0f);
    mesh_release(&before);
    mesh_release(&m);
}

static void test_kept(struct parallel *pool) {
    struct mesh before, m;
    rough_sheets(&before, 0.0f);
    rough_sheets(&m, 0.0f);
    CHECK(mesh_denoise(&m, pool) == 0.0f && farthest_move(&before, &m) == 0.0f);
    mesh_release(&m);
    mesh_release(&before);

    rough_sheets(&before, ROUGH);
    rough_sheets(&m, ROUGH);
    m.normal = mem_calloc(m.vertex_count, sizeof *m.normal);
    CHECK(mesh_denoise(&m, pool) == 0.0f && farthest_move(&before, &m) == 0.0f);
    mesh_release(&m);
    mesh_release(&before);
}

int main(void) {
    struct parallel *pool = parallel_new(3);
    test_sheets(pool);
    test_crumpled(pool);
    test_ball(pool);
    test_box(pool);
    test_kept(pool);
    parallel_free(pool);
    return check_result();
}
