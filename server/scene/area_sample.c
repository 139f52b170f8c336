/* area_sample.c -- see area_sample.h. */
#include "server/scene/area_sample.h"

#include <math.h>

#include "common/mem.h"
#include "common/rng.h"

void area_sampler_init(struct area_sampler *s, const struct mesh *mesh) {
    double sum = 0.0;
    s->mesh = mesh;
    s->until = mem_array(mesh->triangle_count, sizeof *s->until);
    for (size_t t = 0; t < mesh->triangle_count; t++)
        s->until[t] = sum += (double)mesh_triangle_area(mesh, t);
}

void area_sampler_release(struct area_sampler *s) {
    mem_free(s->until);
    s->until = NULL;
}

size_t area_sampler_triangle(const struct area_sampler *s, double area) {
    size_t low = 0, high = s->mesh->triangle_count - 1;
    while (low < high) {
        size_t middle = (low + high) / 2;
        if (s->until[middle] > area)
            high = middle;
        else
            low = middle + 1;
    }
    return low;
}

void area_sampler_point(const struct area_sampler *s, uint64_t seed, size_t number, size_t count, vec3 *position,
                        vec3 *normal) {
    uint64_t bits = rng_key(seed, number, 0);
    double total = s->until[s->mesh->triangle_count - 1];
    size_t t =
        area_sampler_triangle(s, total * ((double)number + (double)rng_to_float((uint32_t)bits)) / (double)count);
    float root = sqrtf(rng_to_float((uint32_t)(bits >> 32))), v = rng_to_float(rng_mix32((uint32_t)(bits >> 16)));
    *position = mesh_point(s->mesh, t, root * (1.0f - v), root * v);
    *normal = vec3_normalize(mesh_cross(s->mesh, t));
}
