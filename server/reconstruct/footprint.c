/* footprint.c -- see footprint.h. */
#include "server/reconstruct/footprint.h"

#include <math.h>

#define MIN_COSINE 0.05f
#define FAR 1e6f /* texels: of a triangle hardly wider than a line */

/* A triangle, and the plane that it lies in. */
struct plane {
    vec3 corner, edge[2], normal;
    float dot[3]; /* of edges 0 0, 0 1, 1 1 */
};

static struct plane plane_of(const struct mesh *mesh, size_t triangle) {
    const uint32_t *v = mesh->index[triangle];
    struct plane p = {.corner = mesh->position[v[0]]};
    p.edge[0] = vec3_sub(mesh->position[v[1]], p.corner);
    p.edge[1] = vec3_sub(mesh->position[v[2]], p.corner);
    p.normal = vec3_normalize(mesh_cross(mesh, triangle));
    p.dot[0] = vec3_dot(p.edge[0], p.edge[0]);
    p.dot[1] = vec3_dot(p.edge[0], p.edge[1]);
    p.dot[2] = vec3_dot(p.edge[1], p.edge[1]);
    return p;
}

/* The place in the atlas where the ray through (x, y) meets the plane. */
static bool place(const struct plane *p, const struct atlas *atlas, size_t triangle, const struct camera *camera,
                  float x, float y, vec2 *at) {
    vec3 direction, origin = camera_origin(camera);
    if (!camera_direction(camera, x, y, &direction))
        return false;
    float cosine = vec3_dot(direction, p->normal);
    if (!(cosine < -MIN_COSINE))
        return false;
    float distance = vec3_dot(vec3_sub(p->corner, origin), p->normal) / cosine;
    vec3 from = vec3_sub(vec3_mad(origin, distance, direction), p->corner);
    float d0 = vec3_dot(from, p->edge[0]), d1 = vec3_dot(from, p->edge[1]);
    float area = p->dot[0] * p->dot[2] - p->dot[1] * p->dot[1];
    *at = atlas_point(atlas, triangle, (d0 * p->dot[2] - d1 * p->dot[1]) / area,
                      (d1 * p->dot[0] - d0 * p->dot[1]) / area);
    return fabsf(at->x) < FAR && fabsf(at->y) < FAR;
}

bool footprint_find(struct footprint *f, const struct mesh *mesh, const struct atlas *atlas, const struct accel *accel,
                    const struct camera *camera, uint32_t x, uint32_t y) {
    float cx = (float)x + 0.5f, cy = (float)y + 0.5f;
    struct accel_hit hit;
    vec3 direction;
    vec2 left, right, above, below;
    if (!camera_direction(camera, cx, cy, &direction) ||
        !accel_intersect(accel, camera_origin(camera), direction, 0.0f, INFINITY, &hit))
        return false;
    struct plane p = plane_of(mesh, hit.triangle);
    f->triangle = hit.triangle;
    f->middle = atlas_point(atlas, hit.triangle, hit.b1, hit.b2);
    if (!place(&p, atlas, hit.triangle, camera, cx - 0.5f, cy, &left) ||
        !place(&p, atlas, hit.triangle, camera, cx + 0.5f, cy, &right) ||
        !place(&p, atlas, hit.triangle, camera, cx, cy - 0.5f, &above) ||
        !place(&p, atlas, hit.triangle, camera, cx, cy + 0.5f, &below))
        return false;
    f->across = (vec2){right.x - left.x, right.y - left.y};
    f->down = (vec2){below.x - above.x, below.y - above.y};
    return true;
}
