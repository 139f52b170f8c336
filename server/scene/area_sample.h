/* area_sample.h -- points spread over a mesh, evenly by area. */
#ifndef UNBAKE_SCENE_AREA_SAMPLE_H
#define UNBAKE_SCENE_AREA_SAMPLE_H

#include "server/scene/mesh.h"

struct area_sampler {
    const struct mesh *mesh; /* borrowed */
    double *until;           /* [triangle_count] sum of the areas up to this triangle, m^2; owned */
};

void area_sampler_init(struct area_sampler *sampler, const struct mesh *mesh);
void area_sampler_release(struct area_sampler *sampler);

/* The triangle that holds this much of the area, m^2 below the last of `until`. */
size_t area_sampler_triangle(const struct area_sampler *sampler, double area);

/* Point number `number` of `count`, one in each part of the area: a position, and the unit normal of its triangle. The
 * same for the same `seed`. Thread-safe. */
void area_sampler_point(const struct area_sampler *sampler, uint64_t seed, size_t number, size_t count, vec3 *position,
                        vec3 *normal);

#endif
