/* shapes.c -- see shapes.h. */
#include "server/demo/shapes.h"

#include <math.h>
#include <string.h>

#include "common/buf.h"
#include "common/file.h"
#include "common/mem.h"

#define PLY_LIMIT ((size_t)1 << 28) /* bytes of the file */
#define TURN 6.28318530717958648f   /* 2 pi */

void shapes_init(struct shapes *s) { memset(s, 0, sizeof *s); }

static uint32_t add_vertex(struct shapes *s, vec3 position, vec3 normal) {
    struct mesh *m = &s->mesh;
    if (m->vertex_count == s->vertex_capacity) {
        s->vertex_capacity = s->vertex_capacity ? 2 * s->vertex_capacity : 1024;
        m->position = mem_realloc_array(m->position, s->vertex_capacity, sizeof *m->position);
        m->normal = mem_realloc_array(m->normal, s->vertex_capacity, sizeof *m->normal);
    }
    m->position[m->vertex_count] = position;
    m->normal[m->vertex_count] = normal;
    return (uint32_t)m->vertex_count++;
}

static void add_triangle(struct shapes *s, int64_t object, uint32_t a, uint32_t b, uint32_t c) {
    struct mesh *m = &s->mesh;
    if (m->triangle_count == s->triangle_capacity) {
        s->triangle_capacity = s->triangle_capacity ? 2 * s->triangle_capacity : 1024;
        m->index = mem_realloc_array(m->index, s->triangle_capacity, sizeof *m->index);
        m->face = mem_realloc_array(m->face, s->triangle_capacity, sizeof *m->face);
        m->object_id = mem_realloc_array(m->object_id, s->triangle_capacity, sizeof *m->object_id);
    }
    size_t t = m->triangle_count++;
    m->index[t][0] = a;
    m->index[t][1] = b;
    m->index[t][2] = c;
    m->face[t] = (uint32_t)t;
    m->object_id[t] = object;
    m->face_count = m->triangle_count;
}

/* The parallelogram origin, origin + u, origin + u + v, origin + v; its front is where u x v points. */
static void add_quad(struct shapes *s, int64_t object, vec3 origin, vec3 u, vec3 v) {
    vec3 normal = vec3_normalize(vec3_cross(u, v));
    uint32_t a = add_vertex(s, origin, normal);
    uint32_t b = add_vertex(s, vec3_add(origin, u), normal);
    uint32_t c = add_vertex(s, vec3_add(vec3_add(origin, u), v), normal);
    uint32_t d = add_vertex(s, vec3_add(origin, v), normal);
    add_triangle(s, object, a, b, c);
    add_triangle(s, object, a, c, d);
}

void shapes_plane(struct shapes *s, int64_t object, const vec3 corner[4]) {
    vec3 normal = vec3_normalize(vec3_cross(vec3_sub(corner[1], corner[0]), vec3_sub(corner[3], corner[0])));
    uint32_t at[4];
    for (int i = 0; i < 4; i++)
        at[i] = add_vertex(s, corner[i], normal);
    add_triangle(s, object, at[0], at[1], at[2]);
    add_triangle(s, object, at[0], at[2], at[3]);
}

void shapes_plane_with_hole(struct shapes *s, int64_t object, const vec3 corner[4], const vec3 hole[4]) {
    for (int i = 0; i < 4; i++) {
        int next = (i + 1) % 4;
        shapes_plane(s, object, (vec3[4]){corner[i], corner[next], hole[next], hole[i]});
    }
}

void shapes_box(struct shapes *s, int64_t object, vec3 lower, vec3 upper, int without) {
    vec3 size = vec3_sub(upper, lower);
    vec3 x = {size.x, 0.0f, 0.0f}, y = {0.0f, size.y, 0.0f}, z = {0.0f, 0.0f, size.z};
    const struct {
        int name;
        vec3 origin, u, v;
    } face[6] = {
        {SHAPE_LEFT, lower, z, y},   {SHAPE_RIGHT, vec3_add(lower, x), y, z},
        {SHAPE_BOTTOM, lower, x, z}, {SHAPE_TOP, vec3_add(lower, y), z, x},
        {SHAPE_BACK, lower, y, x},   {SHAPE_FRONT, vec3_add(lower, z), x, y},
    };
    for (int i = 0; i < 6; i++) {
        if (without & face[i].name)
            continue;
        if (without & SHAPE_INWARD)
            add_quad(s, object, face[i].origin, face[i].v, face[i].u);
        else
            add_quad(s, object, face[i].origin, face[i].u, face[i].v);
    }
}

/* Outward normal of the profile at point i, from the mean direction of its two edges. */
static vec2 profile_normal(const vec2 *profile, size_t count, size_t i) {
    vec2 before = profile[i > 0 ? i - 1 : i], after = profile[i + 1 < count ? i + 1 : i];
    vec2 along = vec2_sub(after, before);
    float length = sqrtf(along.x * along.x + along.y * along.y);
    return (vec2){along.y / length, -along.x / length};
}

void shapes_lathe(struct shapes *s, int64_t object, vec3 base, const vec2 *profile, size_t count, int sides) {
    uint32_t first = (uint32_t)s->mesh.vertex_count, ring = (uint32_t)sides + 1;
    for (size_t i = 0; i < count; i++) {
        vec2 n = profile_normal(profile, count, i);
        for (int k = 0; k <= sides; k++) {
            float angle = TURN * (float)k / (float)sides;
            float c = cosf(angle), d = sinf(angle), r = profile[i].x;
            add_vertex(s, vec3_make(base.x + r * c, base.y + profile[i].y, base.z + r * d),
                       vec3_make(n.x * c, n.y, n.x * d));
        }
    }
    for (uint32_t i = 0; i + 1 < count; i++) {
        for (uint32_t k = 0; k + 1 < ring; k++) {
            uint32_t a = first + i * ring + k, b = a + 1, c = a + ring + 1, d = a + ring;
            if (profile[i].x > 0.0f)
                add_triangle(s, object, a, c, b);
            if (profile[i + 1].x > 0.0f)
                add_triangle(s, object, a, d, c);
        }
    }
}

enum status shapes_write_ply(const struct mesh *mesh, const char *path, struct error *err) {
    struct buf out;
    buf_init(&out, PLY_LIMIT);
    buf_printf(&out,
               "ply\nformat binary_little_endian 1.0\ncomment the demo room of unbake\n"
               "element vertex %zu\nproperty float x\nproperty float y\nproperty float z\n"
               "property float nx\nproperty float ny\nproperty float nz\nelement face %zu\n"
               "property list uchar int vertex_indices\nproperty int object_id\nend_header\n",
               mesh->vertex_count, mesh->triangle_count);
    for (size_t i = 0; i < mesh->vertex_count; i++) {
        buf_append(&out, &mesh->position[i], sizeof(vec3));
        buf_append(&out, &mesh->normal[i], sizeof(vec3));
    }
    for (size_t t = 0; t < mesh->triangle_count; t++) {
        int32_t object = (int32_t)mesh->object_id[t];
        buf_append(&out, "\3", 1);
        buf_append(&out, mesh->index[t], sizeof mesh->index[t]);
        buf_append(&out, &object, sizeof object);
    }
    enum status status = file_replace(path, out.data, out.length, err);
    buf_release(&out);
    return status;
}
