/* path_lights.c -- see path_lights.h. */
#include "server/render/path_lights.h"

#include <math.h>

#include "server/render/accel.h"

/* Looks up the guide row of every lane and prefetches it for shade_pick. */
static void load_guide_rows(struct shade_block *s, const struct guide *guide) {
    shade_cells(s, &guide->grid);
    for (int i = 0; i < LANES; i++) {
        s->guide_row[i] = guide->row[s->cell[i]];
        const float *row = guide->cumulative + s->guide_row[i] * guide->stride;
        for (size_t k = 0; k < guide->stride; k += 64 / sizeof *row)
            __builtin_prefetch(row + k);
    }
}

static void load_light(struct shade_block *s, struct vertex_block *v, int lane, const struct lights *lights) {
    const struct light_triangle *t = &lights->triangle[s->light[lane]];
    lanes3_set(&s->light_corner, lane, t->corner);
    lanes3_set(&s->light_edge1, lane, t->edge1);
    lanes3_set(&s->light_edge2, lane, t->edge2);
    lanes3_set_rgb(&s->radiance, lane, t->radiance);
    if (lights->materials->emission_pattern) {
        rgb pattern = lights_pattern(lights, t, s->light_u[lane], s->light_v[lane]);
        lanes3_set_rgb(&v->light_pattern, lane, pattern);
        lanes3_set_rgb(&s->radiance, lane, rgb_mul(t->radiance, pattern));
    }
    s->light_density[lane] = t->density * s->density_factor[lane];
    v->light_segment[lane] = t->segment;
}

bool path_lights_pick(struct shade_block *s, struct vertex_block *v, const struct world *world, int count) {
    const struct lights *lights = world->lights;
    if (!(lights->triangles.total > 0.0))
        return lights_any(lights);
    if (world->guide) {
        load_guide_rows(s, world->guide);
        shade_pick(s, world->guide, lights);
    }
    for (int i = 0; i < count; i++) {
        if (s->pick[i] < lights->environment_chance)
            continue; /* see path_lights_environment */
        if (!world->guide) {
            s->light[i] = (int32_t)(lights_pick(lights, s->pick[i]) - lights->triangle);
            s->density_factor[i] = 1.0f;
        }
        load_light(s, v, i, lights);
    }
    return true;
}

void path_lights_cones(struct shade_block *s, const struct vertex_block *v, const struct materials *m, int count) {
    for (int i = 0; i < count; i++) {
        if (!(s->light_pdf[i] > 0.0f) || v->light_segment[i] >= m->segment_count)
            continue;
        vec3 normal = vec3_normalize(vec3_cross(lanes3_get(&s->light_edge1, i), lanes3_get(&s->light_edge2, i)));
        float cone = materials_cone(m, v->light_segment[i], -vec3_dot(normal, lanes3_get(&s->light_direction, i)));
        lanes3_set_rgb(&s->radiance, i, rgb_scale(lanes3_rgb(&s->radiance, i), cone));
    }
}

/* Lane by lane, since they are few. */
void path_lights_environment(struct shade_block *s, struct vertex_block *v, const struct lights *lights, int count) {
    for (int i = 0; i < count; i++) {
        if (s->pick[i] >= lights->environment_chance)
            continue;
        struct light_sample light;
        vec3 point = lanes3_get(&s->point, i);
        lights_sample(lights, point, s->pick[i], s->light_u[i], s->light_v[i], &light);
        v->light_segment[i] = LIGHT_ENVIRONMENT;
        s->light[i] = 0;
        s->light_pdf[i] = light.pdf;
        lanes3_set(&s->light_direction, i, light.direction);
        lanes3_set_rgb(&s->radiance, i, light.radiance);
        lanes3_set(&s->shadow_origin, i, accel_offset(point, lanes3_get(&s->normal, i), light.direction));
        lanes3_set(&s->shadow_direction, i, light.direction);
        s->shadow_far[i] = INFINITY;
    }
}
