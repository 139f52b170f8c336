/* normals.h: a box stays as it is, a ball becomes round, a rough floor and wall become smooth on either side of the
 * edge between them; normals that are there are kept. The same for any number of threads. */
#include <math.h>
#include <string.h>

#include "common/mem.h"
#include "common/rng.h"
#include "server/scene/normals.h"
#include "tests/check.h"

#define SIDE 32 /* squares along each side of a sheet */
#define RINGS 16

static void reserve(struct mesh *m, size_t vertices, size_t triangles) {
    *m = (struct mesh){0};
    m->position = mem_array(vertices, sizeof *m->position);
    m->index = mem_array(triangles, sizeof *m->index);
}

static void add_triangle(struct mesh *m, uint32_t a, uint32_t b, uint32_t c) {
    uint32_t corner[3] = {a, b, c};
    memcpy(m->index[m->triangle_count++], corner, sizeof corner);
}

/* A sheet of (SIDE + 1)^2 vertices; those that coincide with the other sheet's are given twice. */
static void add_sheet(struct mesh *m, vec3 u, vec3 v, float roughness) {
    uint32_t first = (uint32_t)m->vertex_count;
    vec3 up = vec3_normalize(vec3_cross(u, v));
    for (uint32_t j = 0; j <= SIDE; j++) {
        for (uint32_t i = 0; i <= SIDE; i++) {
            /* The edge itself is straight: the two sheets share it. */
            float off = j == 0 ? 0.0f : roughness * (2.0f * rng_to_float((uint32_t)rng_key(7, i, j)) - 1.0f);
            vec3 p = vec3_mad(vec3_scale(u, (float)i), (float)j, v);
            m->position[m->vertex_count++] = vec3_mad(p, off, up);
        }
    }
    for (uint32_t j = 0; j < SIDE; j++) {
        for (uint32_t i = 0; i < SIDE; i++) {
            uint32_t a = first + j * (SIDE + 1) + i;
            add_triangle(m, a, a + 1, a + SIDE + 2);
            add_triangle(m, a, a + SIDE + 2, a + SIDE + 1);
        }
    }
}

/* A floor, that faces y, and a wall, that faces z. */
static void make_sheets(struct mesh *m, float roughness) {
    reserve(m, 2 * (SIDE + 1) * (SIDE + 1), 4 * SIDE * SIDE);
    add_sheet(m, (vec3){0.1f, 0, 0}, (vec3){0, 0, -0.1f}, roughness);
    add_sheet(m, (vec3){0.1f, 0, 0}, (vec3){0, 0.1f, 0}, roughness);
}

static void make_ball(struct mesh *m) {
    uint32_t around = 2 * RINGS;
    reserve(m, (RINGS + 1) * around, 2 * RINGS * around);
    for (uint32_t j = 0; j <= RINGS; j++) {
        for (uint32_t i = 0; i < around; i++) {
            float theta = 3.14159265f * (float)j / RINGS, phi = 3.14159265f * (float)i / RINGS;
            float r = j == 0 || j == RINGS ? 0.0f : sinf(theta);
            m->position[m->vertex_count++] = (vec3){r * cosf(phi), cosf(theta), r * sinf(phi)};
        }
    }
    for (uint32_t j = 0; j < RINGS; j++) {
        for (uint32_t i = 0; i < around; i++) {
            uint32_t a = j * around + i, b = j * around + (i + 1) % around;
            if (j > 0)
                add_triangle(m, a, b, b + around);
            if (j < RINGS - 1)
                add_triangle(m, a, b + around, a + around);
        }
    }
}

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
    make_sheets(&m, 0.0f);
    size_t vertices = m.vertex_count;
    CHECK(!normals_estimate(&m, pool, &roughness));
    CHECK(m.normal == NULL && m.vertex_count == vertices && roughness == 0.0f);
    mesh_release(&m);
}

static void test_ball(struct parallel *pool) {
    struct mesh m;
    float roughness, least = 1.0f;
    make_ball(&m);
    CHECK(normals_estimate(&m, pool, &roughness) && m.normal);
    for (size_t v = 0; m.normal && v < m.vertex_count; v++)
        least = fminf(least, vec3_dot(m.normal[v], vec3_normalize(m.position[v])));
    CHECK_THAT(least > 0.97f, "%g", (double)least);
    mesh_release(&m);
}

static void test_rough(struct parallel *pool) {
    struct mesh m, other;
    float roughness, again;
    make_sheets(&m, 0.01f);
    float before = tilt(&m, false);
    CHECK(normals_estimate(&m, pool, &roughness) && m.normal);
    CHECK_THAT(roughness > 0.02f && roughness < 0.2f, "%g", (double)roughness);
    float after = tilt(&m, true);
    CHECK_THAT(after < 0.35f * before, "%g of %g", (double)after, (double)before);
    struct parallel *one = parallel_new(1);
    make_sheets(&other, 0.01f);
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
