/* accel.h -- ray queries. The only file of the project that knows Embree is accel.c. */
#ifndef UNBAKE_RENDER_ACCEL_H
#define UNBAKE_RENDER_ACCEL_H

#include <stdbool.h>
#include <stdint.h>

#include "common/error.h"
#include "common/parallel.h"
#include "common/vec.h"
#include "server/scene/mesh.h"

#define ACCEL_NONE UINT32_MAX /* no triangle */

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

/* Borrows the mesh for its life. The build is single-threaded whatever the pool: with more threads the order of
 * triangles in a leaf depends on timing, and with it which of two coplanar neighbours a ray through their common edge
 * hits. */
enum status accel_new(struct accel **accel, const struct mesh *mesh, struct parallel *pool, struct error *err);
void accel_free(struct accel *accel);

/* Nearest hit with distance in (near_m, far_m); false when there is none. Thread-safe. */
bool accel_intersect(const struct accel *accel, vec3 origin, vec3 direction, float near_m, float far_m,
                     struct accel_hit *hit);
bool accel_occluded(const struct accel *accel, vec3 origin, vec3 direction, float near_m, float far_m);

/* The same for many rays, traced in packets: hit[i].triangle is ACCEL_NONE for a miss; occluded[i] is 0 or 1. Fastest
 * when neighbouring rays share their origin and have similar directions. */
void accel_intersect_many(const struct accel *accel, size_t count, const struct accel_ray *ray, struct accel_hit *hit);
void accel_occluded_many(const struct accel *accel, size_t count, const struct accel_ray *ray, uint8_t *occluded);

/* Offsets a ray origin along the geometric normal, to the side of `direction`, far enough at the magnitude of `point`
 * that the ray does not hit the surface it leaves. */
static inline vec3 accel_offset(vec3 point, vec3 geometric_normal, vec3 direction) {
    float size = fmaxf(fabsf(point.x), fmaxf(fabsf(point.y), fabsf(point.z)));
    float distance = (size + 1e-2f) * 0x1p-16f;
    return vec3_mad(point, copysignf(distance, vec3_dot(geometric_normal, direction)), geometric_normal);
}

/* The library's name and version, for logs and reports. */
const char *accel_library_version(void);

#endif
