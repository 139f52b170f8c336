/* segment_light.c -- see segment_light.h. */
#include "server/light/segment_light.h"

#include <math.h>

#include "common/mem.h"
#include "server/gather/irradiance.h"
#include "server/render/bsdf.h"

/* Inverse powers of the plastic number: the sequence of least discrepancy of its kind in the plane. */
#define RECURRENCE_1 0.75487766624669276
#define RECURRENCE_2 (RECURRENCE_1 * RECURRENCE_1)

void segment_light_init(struct segment_light *l, const struct reconstruction *r) {
    const struct mesh *mesh = &r->scene->mesh;
    *l = (struct segment_light){.r = r, .area_m2 = mem_calloc(r->segments.count + 1, sizeof *l->area_m2)};
    by_segment_sort_triangles(&l->triangles, &r->segments, mesh->triangle_count);
    for (size_t i = 0; i < mesh->triangle_count; i++)
        l->area_m2[r->segments.of_triangle[i]] += mesh_triangle_area(mesh, i);
}

void segment_light_release(struct segment_light *l) {
    by_segment_release_triangles(&l->triangles);
    mem_free(l->area_m2);
    *l = (struct segment_light){0};
}

struct lighting {
    const struct accel *accel;
    const struct light_point *point;
    float *column;
    size_t disc_count;
    const struct segment_light_disc *disc;
};

/* Irradiance from a point that represents a disc, with visibility. */
static float disc_light(const struct surface_point *from, const struct surface_point *to, float area_m2) {
    vec3 way = vec3_sub(from->position, to->position);
    float square = vec3_dot(way, way), scale = 1.0f / sqrtf(fmaxf(square, 1e-20f));
    float here = vec3_dot(way, to->shading) * scale, there = -vec3_dot(way, from->normal) * scale;
    bool in_front = here > 0.0f && there > 0.0f && vec3_dot(way, to->normal) > 0.0f;
    return in_front ? irradiance_matt(here) * area_m2 * here * there / (BSDF_PI * square + area_m2) : 0.0f;
}

static bool is_between(const struct accel *accel, const struct surface_point *from, const struct surface_point *to) {
    vec3 way = vec3_sub(from->position, to->position);
    vec3 start = accel_offset(to->position, to->normal, way);
    vec3 ray = vec3_sub(accel_offset(from->position, from->normal, vec3_neg(way)), start);
    float length = vec3_length(ray);
    return !(length > 0.0f) || accel_occluded(accel, start, vec3_scale(ray, 1.0f / length), 0.0f, length);
}

static void light_point(void *user, size_t index, int thread) {
    (void)thread;
    const struct lighting *l = user;
    const struct surface_point *at = &l->point[index].at;
    for (size_t i = 0; i < l->disc_count; i++) {
        const struct segment_light_disc *disc = &l->disc[i];
        float light = disc->radiance * disc_light(&disc->at, at, disc->area_m2);
        if (light > 0.0f && !is_between(l->accel, &disc->at, at))
            l->column[index] += light;
    }
}

/* Point `index` of a segment: in a triangle by the square-root map, by two additive recurrences (Roberts 2018). */
static struct surface_point point_in(const struct mesh *mesh, uint32_t triangle, size_t index) {
    double u = fmod(0.5 + RECURRENCE_1 * (double)index, 1.0), v = fmod(0.5 + RECURRENCE_2 * (double)index, 1.0);
    float root = sqrtf((float)u), b1 = root * (1.0f - (float)v), b2 = root * (float)v;
    vec3 normal = vec3_normalize(mesh_cross(mesh, triangle));
    return (struct surface_point){.triangle = triangle,
                                  .b1 = b1,
                                  .b2 = b2,
                                  .position = mesh_point(mesh, triangle, b1, b2),
                                  .normal = normal,
                                  .shading = normal};
}

size_t segment_light_spread(const struct segment_light *l, uint32_t segment, size_t wanted,
                            struct segment_light_disc *disc) {
    const struct mesh *mesh = &l->r->scene->mesh;
    double part = (double)l->area_m2[segment] / (double)wanted, passed = 0.0;
    size_t count = 0;
    for (size_t i = l->triangles.first[segment]; i < l->triangles.first[segment + 1]; i++) {
        uint32_t triangle = l->triangles.triangle[i];
        passed += (double)mesh_triangle_area(mesh, triangle);
        for (; count < wanted && passed > ((double)count + 0.5) * part; count++)
            disc[count] = (struct segment_light_disc){point_in(mesh, triangle, count), (float)part, 1.0f};
    }
    return count;
}

void segment_light_add_discs(const struct segment_light *l, const struct light_point *point, size_t count,
                             const struct segment_light_disc *disc, size_t disc_count, float *column) {
    struct lighting job = {l->r->world.accel, point, column, disc_count, disc};
    parallel_for(l->r->pool, count, light_point, &job);
}

void segment_light_add(const struct segment_light *l, const struct light_point *point, size_t count, uint32_t segment,
                       size_t points, float *column) {
    struct segment_light_disc disc[SEGMENT_LIGHT_POINTS];
    segment_light_add_discs(l, point, count, disc, segment_light_spread(l, segment, points, disc), column);
}
