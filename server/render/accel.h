/* accel.h -- ray queries. The only file of the project that knows Embree is accel.c. */
#ifndef UNBAKE_RENDER_ACCEL_H
#define UNBAKE_RENDER_ACCEL_H

#include <stdbool.h>
#include <stdint.h>

#include "common/error.h"
#include "common/parallel.h"
#include "common/vec.h"
#include "server/scene/mesh.h"

#define ACCEL_NONE UINT32_MAX

struct accel; /* opaque */

struct accel_hit {
    float distance_m;
    uint32_t triangle;
    float b1, b2; /* barycentrics of the triangle's second and third corner */
};

/* A ray as the batch queries take it. */
struct accel_ray {
    vec3 origin;
    float near_m;
    vec3 direction; /* unit */
    float far_m;
};

/* Borrows the mesh for its life. The build runs in one thread whatever the pool has: with more,
 * the order of triangles within a leaf, and so which of two coplanar neighbours a ray through
 * their common edge reports, would depend on timing. */
enum status accel_new(struct accel **accel, const struct mesh *mesh, struct parallel *pool,
                      struct error *err);
void accel_free(struct accel *accel);

/* Nearest hit with distance in (near_m, far_m); false when there is none. Thread-safe. */
bool accel_intersect(const struct accel *accel, vec3 origin, vec3 direction, float near_m, float far_m,
                     struct accel_hit *hit);
bool accel_occluded(const struct accel *accel, vec3 origin, vec3 direction, float near_m, float far_m);

/* The same for many rays, several at once: hit[i].triangle is ACCEL_NONE for a ray that meets
 * nothing; occluded[i] is 0 or 1. Rays beside each other that leave one point in about one
 * direction are fastest. */
void accel_intersect_many(const struct accel *accel, size_t count, const struct accel_ray *ray,
                          struct accel_hit *hit);
void accel_occluded_many(const struct accel *accel, size_t count, const struct accel_ray *ray,
                         uint8_t *occluded);

/* An origin moved off the surface along its geometric normal, far enough for `point`'s
 * magnitude that a ray towards `direction` does not meet the surface it leaves. */
static inline vec3 accel_offset(vec3 point, vec3 geometric_normal, vec3 direction) {
    float size = fmaxf(fabsf(point.x), fmaxf(fabsf(point.y), fabsf(point.z)));
    float distance = (size + 1e-2f) * 0x1p-16f;
    return vec3_mad(point, copysignf(distance, vec3_dot(geometric_normal, direction)),
                    geometric_normal);
}

/* The library's name and version, for logs and reports. */
const char *accel_library_version(void);

#endif
