/* normals.h: a box stays as it is, a ball becomes round, a rough floor and wall become smooth on either side of the
 * edge between them; normals that are there are kept. The same for any number of threads. */
#include <math.h>
#include <string.h>

#include "server/scene/normals.h"
#include "tests/check.h"
#include "tests/unit/rough_mesh.h"

/* Root of the mean square of the tilt of normals against where their sheet faces: of triangles or of corners. */
static float tilt(const struct mesh *m, bool of_corners) {
    double sum = 0.0;
    for (size_t t = 0; t < m->triangle_count; t++) {
        vec3 faces = t < m->triangle_count / 2 ? (vec3){0, 1, 0} : (vec3){0, 0, 1};
        for (int c = 0; c < 3; c++) {
            vec3 n = of_corners ? m->normal[m->index[t][c]] : vec3_normalize(mesh_cross(m, t));
            vec3 off = vec3_sub(n, faces);
            sum += (double)vec3_dot(off, off) / (3.0 * (double)m->triangle_count);
        }
    }
    return (float)sqrt(sum);
}

static void test_plane(struct parallel *pool) {
    struct mesh m;
    float roughness;
    rough_sheets(&m, 0.0f);
    size_t vertices = m.vertex_count;
    CHECK(!normals_estimate(&m, pool, &roughness));
    CHECK(m.normal == NULL && m.vertex_count == vertices && roughness == 0.0f);
    mesh_release(&m);
}

static void test_ball(struct parallel *pool) {
    struct mesh m = {0};
    float roughness, least = 1.0f;
    rough_add_ball(&m, 0.0f);
    CHECK(normals_estimate(&m, pool, &roughness) && m.normal);
    for (size_t v = 0; m.normal && v < m.vertex_count; v++)
        least = fminf(least, vec3_dot(m.normal[v], vec3_normalize(m.position[v])));
    CHECK_THAT(least > 0.97f, "%g", (double)least);
    mesh_release(&m);
}

static void test_rough(struct parallel *pool) {
    struct mesh m, other;
    float roughness, again;
    rough_sheets(&m, 0.01f);
    float before = tilt(&m, false);
    CHECK(normals_estimate(&m, pool, &roughness) && m.normal);
    CHECK_THAT(roughness > 0.02f && roughness < 0.2f, "%g", (double)roughness);
    float after = tilt(&m, true);
    CHECK_THAT(after < 0.35f * before, "%g of %g", (double)after, (double)before);
    struct parallel *one = parallel_new(1);
    rough_sheets(&other, 0.01f);
    normals_estimate(&other, one, &again);
    CHECK(again == roughness && other.vertex_count == m.vertex_count);
    CHECK(memcmp(other.normal, m.normal, m.vertex_count * sizeof *m.normal) == 0);
    parallel_free(one);

    /* They are there now, and stay. */
    vec3 *given = m.normal;
    CHECK(normals_estimate(&m, pool, &roughness) && m.normal == given);
    mesh_release(&other);
    mesh_release(&m);
}

int main(void) {
    struct parallel *pool = parallel_new(3);
    test_plane(pool);
    test_ball(pool);
    test_rough(pool);
    parallel_free(pool);
    return check_result();
}
