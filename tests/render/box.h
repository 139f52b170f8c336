/* box.h -- a small closed room made by hand, for tests that need no data.
 *
 * A unit-sized box seen from inside, a slab in it, and a lamp below the ceiling. Segment 0: walls,
 * 1: slab, 2: lamp. The walls' texture covers real texels (a random pattern can be put there);
 * the slab and the lamp have blocks of their own. */
#ifndef UNBAKE_TESTS_RENDER_BOX_H
#define UNBAKE_TESTS_RENDER_BOX_H

#include "common/mem.h"
#include "common/parallel.h"
#include "common/rng.h"
#include "server/render/path.h"
#include "server/render/world.h"
#include "tests/check.h"

#define BOX_SIDE 64 /* texels of the atlas */

struct box {
    struct mesh mesh;
    struct segments segments;
    struct atlas atlas;
    struct materials materials;
    struct world world;
    struct parallel *pool; /* of the world; owned; NULL: it was not built here */
};

static inline void box_quad(struct box *b, vec3 corner, vec3 u, vec3 v, uint32_t segment, float left, float top,
                            float size) {
    struct mesh *m = &b->mesh;
    uint32_t first = (uint32_t)m->vertex_count;
    m->position[first] = corner;
    m->position[first + 1] = vec3_add(corner, u);
    m->position[first + 2] = vec3_add(vec3_add(corner, u), v);
    m->position[first + 3] = vec3_add(corner, v);
    m->vertex_count += 4;
    const vec2 place[4] = {{left, top}, {left + size, top}, {left + size, top + size}, {left, top + size}};
    for (uint32_t half = 0; half < 2; half++) {
        size_t t = m->triangle_count++;
        const uint32_t corner_of[3] = {0, 1 + half, 2 + half};
        for (int k = 0; k < 3; k++) {
            m->index[t][k] = first + corner_of[k];
            b->atlas.corner[t][k] = place[corner_of[k]];
        }
        b->segments.of_triangle[t] = segment;
    }
}

static inline void box_init(struct box *b) {
    memset(b, 0, sizeof *b);
    b->mesh.position = mem_array(64, sizeof(vec3));
    b->mesh.index = mem_array(32, sizeof *b->mesh.index);
    b->segments.of_triangle = mem_array(32, sizeof(uint32_t));
    b->segments.count = 3;
    b->atlas.corner = mem_array(32, sizeof *b->atlas.corner);
    b->atlas.width = b->atlas.height = BOX_SIDE;
    vec3 x = {1, 0, 0}, y = {0, 1, 0}, z = {0, 0, 1}, o = {0, 0, 0};
    box_quad(b, o, z, x, 0, 1, 1, 14);   /* floor, facing up */
    box_quad(b, y, x, z, 0, 17, 1, 14);  /* ceiling */
    box_quad(b, o, x, y, 0, 33, 1, 14);  /* back, facing +z */
    box_quad(b, z, y, x, 0, 1, 17, 14);  /* front */
    box_quad(b, o, y, z, 0, 17, 17, 14); /* left */
    box_quad(b, x, z, y, 0, 33, 17, 14); /* right */
    box_quad(b, (vec3){0.2f, 0.35f, 0.2f}, (vec3){0, 0, 0.4f}, (vec3){0.5f, 0.1f, 0}, 1, 2, 40, 8);
    box_quad(b, (vec3){0.3f, 0.95f, 0.3f}, (vec3){0.3f, 0, 0}, (vec3){0, 0, 0.3f}, 2, 18, 40, 8);
    struct materials *m = &b->materials;
    m->segment_count = 3;
    m->roughness = mem_calloc(3, sizeof(float));
    m->specular = mem_calloc(3, sizeof(float));
    m->emission = mem_calloc(3, sizeof(rgb));
    m->base_color.width = m->base_color.height = BOX_SIDE;
    m->base_color.texel = mem_calloc(BOX_SIDE * BOX_SIDE, sizeof *m->base_color.texel);
    for (uint32_t i = 0; i < BOX_SIDE * BOX_SIDE; i++)
        for (uint32_t c = 0; c < 4; c++)
            m->base_color.texel[i][c] = c == 3 ? 1.0f : 0.2f + 0.6f * rng_to_float((uint32_t)rng_key(8, i, c));
    for (int s = 0; s < 3; s++)
        m->roughness[s] = 0.5f;
    m->emission[2] = (rgb){9.0f, 8.0f, 6.0f};
}

/* Takes the ceiling away. */
static inline void box_open(struct box *b) {
    struct mesh *m = &b->mesh;
    m->triangle_count -= 2;
    memmove(m->index + 2, m->index + 4, (m->triangle_count - 2) * sizeof *m->index);
    memmove(b->atlas.corner + 2, b->atlas.corner + 4, (m->triangle_count - 2) * sizeof *b->atlas.corner);
    memmove(b->segments.of_triangle + 2, b->segments.of_triangle + 4,
            (m->triangle_count - 2) * sizeof *b->segments.of_triangle);
}

/* After the geometry and materials are as they shall be. */
static inline void box_build(struct box *b) {
    struct error err;
    b->pool = parallel_new(1);
    CHECK(world_init(&b->world, &b->mesh, &b->segments, &b->atlas, &b->materials, NULL, b->pool, &err) == STATUS_OK);
}

static inline void box_release(struct box *b) {
    if (b->world.accel)
        world_release(&b->world);
    parallel_free(b->pool);
    mem_free(b->mesh.position);
    mem_free(b->mesh.index);
    mem_free(b->segments.of_triangle);
    mem_free(b->atlas.corner);
    mem_free(b->materials.roughness);
    mem_free(b->materials.specular);
    mem_free(b->materials.emission);
    materials_drop_emission_pattern(&b->materials);
    mem_free(b->materials.base_color.texel);
}

/* A ray from the middle of the front wall into the room, for a number of its own. */
static inline struct ray box_ray(uint32_t index) {
    float x = rng_to_float(rng_mix32(2 * index)), y = rng_to_float(rng_mix32(2 * index + 1));
    vec3 origin = {0.5f, 0.5f, 0.97f};
    return (struct ray){origin, vec3_normalize((vec3){1.4f * (x - 0.5f), 2.4f * (y - 0.5f), -1.0f})};
}

#endif
