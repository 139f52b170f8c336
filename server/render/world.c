/* world.c -- see world.h. */
#include "server/render/world.h"

#include <math.h>
#include <string.h>

#include "common/mem.h"

static int16_t to_snorm(float v) { return (int16_t)lrintf(clampf(v, -1.0f, 1.0f) * 32767.0f); }

static void bake_triangle(struct world_triangle *t, const struct world *w, size_t index) {
    const struct mesh *mesh = w->mesh;
    const uint32_t *v = mesh->index[index];
    vec3 a = mesh->position[v[0]];
    t->normal = vec3_normalize(vec3_cross(vec3_sub(mesh->position[v[1]], a), vec3_sub(mesh->position[v[2]], a)));
    t->plane = vec3_dot(t->normal, a);
    t->segment = w->segments->of_triangle[index];
    for (int k = 0; k < 3; k++) {
        t->corner[k] = w->atlas->corner[index][k];
        vec3 n = mesh->normal ? mesh->normal[v[k]] : (vec3){0.0f, 0.0f, 0.0f};
        t->shading[k][0] = to_snorm(n.x);
        t->shading[k][1] = to_snorm(n.y);
        t->shading[k][2] = to_snorm(n.z);
    }
}

enum status world_init(struct world *w, const struct mesh *mesh, const struct segments *segments,
                       const struct atlas *atlas, const struct materials *materials, const struct image *environment,
                       struct parallel *pool, struct error *err) {
    memset(w, 0, sizeof *w);
    enum status status = accel_new(&w->accel, mesh, pool, err);
    if (status != STATUS_OK)
        return status;
    w->mesh = mesh;
    w->segments = segments;
    w->atlas = atlas;
    w->materials = materials;
    w->pool = pool;
    w->triangle = mem_calloc_large(mesh->triangle_count, sizeof *w->triangle);
    for (size_t i = 0; i < mesh->triangle_count; i++)
        bake_triangle(&w->triangle[i], w, i);
    w->lights = lights_new(NULL);
    if (environment)
        world_set_environment(w, environment, pool);
    world_update_lights(w);
    return STATUS_OK;
}

void world_set_environment(struct world *w, const struct image *environment, struct parallel *pool) {
    struct visibility visibility;
    if (environment)
        visibility_measure(&visibility, w->mesh, w->accel, pool);
    lights_set_environment(w->lights, environment, environment ? &visibility : NULL);
}

void world_release(struct world *w) {
    guide_free(w->guide);
    lights_free(w->lights);
    accel_free(w->accel);
    mem_free(w->triangle);
    memset(w, 0, sizeof *w);
}

void world_update_lights(struct world *w) {
    bool others = lights_update(w->lights, w->mesh, w->segments, w->atlas, w->materials);
    if (others) {
        guide_free(w->guide);
        w->guide = guide_new(w->lights, w->mesh, w->accel, w->pool);
    } else if (w->guide) {
        guide_update(w->guide, w->lights);
    }
}
