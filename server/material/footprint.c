/* footprint.c -- see footprint.h. */
#include "server/material/footprint.h"

#include <math.h>

#define MIN_COSINE 0.05f /* towards the camera; below, the surface counts as edge-on; +25 %: no change */
/* Last entries searched for the same texel; a longer search finds few more; +25 %: no change. */
#define REMEMBERED 16
#define MIN_SIDE 2.0f /* look-ups along an edge of a footprint; +25 %: no change */
#define FAR 1e6f      /* texels; results beyond are of degenerate triangles */

/* A triangle and its plane. */
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

/* Atlas coordinates where the ray through (x, y) meets the plane. */
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

bool footprint_of_triangle(struct footprint *f, const struct mesh *mesh, const struct atlas *atlas,
                           const struct camera *camera, uint32_t x, uint32_t y, uint32_t triangle) {
    float cx = (float)x + 0.5f, cy = (float)y + 0.5f;
    struct plane p = plane_of(mesh, triangle);
    vec2 left, right, above, below;
    f->triangle = triangle;
    if (!place(&p, atlas, triangle, camera, cx, cy, &f->middle) ||
        !place(&p, atlas, triangle, camera, cx - 0.5f, cy, &left) ||
        !place(&p, atlas, triangle, camera, cx + 0.5f, cy, &right) ||
        !place(&p, atlas, triangle, camera, cx, cy - 0.5f, &above) ||
        !place(&p, atlas, triangle, camera, cx, cy + 0.5f, &below))
        return false;
    f->across = (vec2){right.x - left.x, right.y - left.y};
    f->down = (vec2){below.x - above.x, below.y - above.y};
    return true;
}

bool footprint_find(struct footprint *f, const struct mesh *mesh, const struct atlas *atlas, const struct accel *accel,
                    const struct camera *camera, uint32_t x, uint32_t y) {
    struct accel_hit hit;
    vec3 direction;
    return camera_direction(camera, (float)x + 0.5f, (float)y + 0.5f, &direction) &&
           accel_intersect(accel, camera_origin(camera), direction, 0.0f, INFINITY, &hit) &&
           footprint_of_triangle(f, mesh, atlas, camera, x, y, hit.triangle);
}

/* Look-ups along an edge of a footprint. */
static int lookups(vec2 edge) {
    float length = ceilf(hypotf(edge.x, edge.y));
    return (int)clampf(length, MIN_SIDE, FOOTPRINT_SIDE);
}

/* Adds to the texel's entry if that is one of the last, else appends one. */
static void add_texel(struct footprint_texels *t, uint32_t texel, float share) {
    size_t end = t->count > REMEMBERED ? t->count - REMEMBERED : 0;
    for (size_t i = t->count; i > end; i--) {
        if (t->texel[i - 1] == texel) {
            t->share[i - 1] += share;
            return;
        }
    }
    t->texel[t->count] = texel;
    t->share[t->count++] = share;
}

float footprint_texels(struct footprint_texels *t, const struct footprint *f, uint32_t chart,
                       const uint32_t *chart_of_texel, uint32_t width, uint32_t height) {
    int columns = lookups(f->across), rows = lookups(f->down);
    float sum = 0.0f;
    t->count = 0;
    for (int k = 0; k < 4 * columns * rows; k++) {
        int place = k / 4;
        float a = ((float)(place % columns) + 0.5f) / (float)columns - 0.5f;
        float b = ((float)(place / columns) + 0.5f) / (float)rows - 0.5f;
        float fx = f->middle.x + a * f->across.x + b * f->down.x - 0.5f;
        float fy = f->middle.y + a * f->across.y + b * f->down.y - 0.5f;
        long x = (long)floorf(fx) + (k & 1), y = (long)floorf(fy) + (k >> 1 & 1);
        if (x < 0 || y < 0 || x >= (long)width || y >= (long)height)
            continue;
        size_t texel = (size_t)y * width + (size_t)x;
        if (chart_of_texel[texel] == chart)
            add_texel(t, (uint32_t)texel, (1.0f - fabsf(fx - (float)x)) * (1.0f - fabsf(fy - (float)y)));
    }
    for (size_t i = 0; i < t->count; i++)
        sum += t->share[i];
    for (size_t i = 0; i < t->count; i++)
        t->share[i] /= sum;
    return sum / (float)(columns * rows);
}
