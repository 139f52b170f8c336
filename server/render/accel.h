/* accel.h -- ray queries. The only file of the project that knows Embree is accel.c. */
#ifndef UNBAKE_RENDER_ACCEL_H
#define UNBAKE_RENDER_ACCEL_H

#include <stdbool.h>
#include <stdint.h>

#include "common/error.h"
#include "common/parallel.h"
#include "common/vec.h"
#include "server/scene/mesh.h"

struct accel; /* opaque */

struct accel_hit {
    float distance_m;
    uint32_t triangle;
    float b1, b2; /* barycentrics of the triangle's second and third corner */
};

/* Borrows the mesh for its life. The build uses the pool's threads. */
enum status accel_new(struct accel **accel, const struct mesh *mesh, struct parallel *pool,
                      struct error *err);
void accel_free(struct accel *accel);

/* Nearest hit with distance in (near_m, far_m); false when there is none. Thread-safe. */
bool accel_intersect(const struct accel *accel, vec3 origin, vec3 direction, float near_m, float far_m,
                     struct accel_hit *hit);
bool accel_occluded(const struct accel *accel, vec3 origin, vec3 direction, float near_m, float far_m);

/* An origin moved off the surface along its geometric normal, far enough for `point`'s
 * magnitude that a ray towards `direction` does not meet the surface it leaves. */
vec3 accel_offset(vec3 point, vec3 geometric_normal, vec3 direction);

/* The library's name and version, for logs and reports. */
const char *accel_library_version(void);

#endif
