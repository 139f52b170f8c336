/* light_response_rig.h -- a reconstruction in which the floor is observed. */
#ifndef UNBAKE_TESTS_RENDER_LIGHT_RESPONSE_RIG_H
#define UNBAKE_TESTS_RENDER_LIGHT_RESPONSE_RIG_H

#include "server/light/light_point.h"
#include "server/state/evidence.h"
#include "tests/check.h"
#include "tests/render/small_room.h"

#define WALL 4
#define WALL_AT 2.0f /* x of a wall across the room, from floor to ceiling */

/* A reconstruction in which the floor is observed, and all that these units ask of one. */
struct rig {
    struct scene scene;
    struct model model;
    struct reconstruction r;
    struct parallel *pool;
};

static inline void rig_init(struct rig *g) {
    g->pool = parallel_new(0);
    model_init(&g->model, &g->scene.mesh, 128, 0.5f, g->pool);
    model_light(&g->model, &g->scene.mesh, rgb_gray(0.0f), NULL, g->pool);
    size_t texels = (size_t)g->model.atlas.width * g->model.atlas.height;
    g->r = (struct reconstruction){.scene = &g->scene, .pool = g->pool};
    g->r.segments = g->model.segments, g->r.atlas = g->model.atlas, g->r.inverse = g->model.inverse;
    g->r.materials = g->model.materials, g->r.world = g->model.world;
    g->r.fused = (struct fused){.width = g->model.atlas.width, .height = g->model.atlas.height};
    g->r.fused.radiance = mem_calloc(texels, sizeof *g->r.fused.radiance);
    g->r.fused.count = mem_calloc(texels, sizeof *g->r.fused.count);
    g->r.fused.is_bound = mem_calloc(texels, sizeof *g->r.fused.is_bound);
    for (size_t i = 0; i < g->model.inverse.valid_count; i++) {
        uint32_t texel = g->model.inverse.valid[i];
        g->r.fused.count[texel] = g->r.segments.id[reconstruction_segment(&g->r, texel)] == FLOOR;
    }
}

static inline void rig_release(struct rig *g) {
    mem_free(g->r.fused.is_bound);
    mem_free(g->r.fused.count);
    mem_free(g->r.fused.radiance);
    g->model.world = g->r.world; /* as the test has left it */
    model_release(&g->model);
    scene_release(&g->scene);
    parallel_free(g->pool);
}

/* Points of the floor, one for each of its texels; the caller's. */
static inline struct light_point *floor_points(const struct rig *g, size_t *count) {
    struct light_point *point = mem_calloc(g->model.inverse.valid_count, sizeof *point);
    *count = 0;
    for (size_t i = 0; i < g->model.inverse.valid_count; i++) {
        uint32_t texel = g->model.inverse.valid[i];
        if (g->r.fused.count[texel] > 0.0f &&
            surface_at_texel(&g->scene.mesh, &g->r.atlas, &g->r.inverse, texel, &point[*count].at))
            ++*count;
    }
    return point;
}

static inline size_t segment_of(const struct rig *g, int64_t object) {
    size_t found = 0;
    for (size_t s = 0; s < g->r.segments.count; s++)
        found = g->r.segments.id[s] == object ? s : found;
    return found;
}

#endif
