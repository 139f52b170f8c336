/* sun_blur.c -- see sun_blur.h. */
#include "server/light/sun/sun_blur.h"

#include <math.h>

#include "server/render/sampler.h"

#define VIEWS 16   /* of a point, at most */
#define SAMPLES 64 /* of them, their pixels and the disc */

struct footprint_views {
    size_t count;
    struct view view[VIEWS];
    float weight; /* of all */
};

static const struct view *view_at(const struct footprint_views *v, float u) {
    size_t i = 0;
    for (float rest = u * v->weight - v->view[0].weight; rest > 0.0f && i + 1 < v->count; rest -= v->view[i].weight)
        i++;
    return &v->view[i];
}

/* Where the ray through a place of the photograph meets the point's tangent plane; false where it does not, or not in
 * sight of the point. */
static bool place_at(const struct views *views, const struct surface_point *at, uint32_t train, float x, float y,
                     vec3 *place) {
    const struct camera *camera = &views->scene->photograph[views->train[train]].camera;
    vec3 origin = camera_origin(camera), direction;
    if (!camera_direction(camera, x, y, &direction))
        return false;
    float toward = vec3_dot(direction, at->normal);
    if (!(toward < 0.0f))
        return false;
    *place = vec3_mad(origin, vec3_dot(vec3_sub(at->position, origin), at->normal) / toward, direction);
    vec3 off = vec3_sub(*place, at->position);
    float distance = vec3_length(off);
    if (!(distance > 0.0f))
        return true;
    vec3 way = vec3_scale(off, 1.0f / distance);
    return !accel_occluded(views->accel, accel_offset(at->position, at->normal, way), way, 0.0f, distance);
}

/* In pixels: a pixel averages over its width, and a bilinear look-up weights pixels by a triangle, which is two uniform
 * variables more. */
static vec2 lookup_offset(uint32_t key, uint32_t sample) {
    vec2 off = {-1.5f, -1.5f};
    for (uint32_t k = 2; k < 5; k++) {
        vec2 u = sampler_pair(key, sample, k);
        off.x += u.x, off.y += u.y;
    }
    return off;
}

float sun_blur_visibility(const struct sun *sun, const struct views *views, const struct surface_point *at,
                          uint32_t key) {
    struct footprint_views v = {0};
    int tried = 0, open = 0;
    if (!(vec3_dot(sun->direction, at->shading) > 0.0f) || !(vec3_dot(sun->direction, at->normal) > 0.0f))
        return 0.0f;
    v.count = views_pick(views, at->position, at->normal, key, VIEWS, v.view);
    for (size_t i = 0; i < v.count; i++)
        v.weight += v.view[i].weight;
    for (uint32_t i = 0; i < SAMPLES && v.count > 0; i++) {
        const struct view *view = view_at(&v, sampler_number(key, i, 0));
        vec2 off = lookup_offset(key, i);
        vec3 place, d = sun_sample(sun, sampler_pair(key, i, 1));
        if (!place_at(views, at, view->train, view->x + off.x, view->y + off.y, &place))
            continue;
        tried++;
        open += vec3_dot(d, at->normal) > 0.0f &&
                !accel_occluded(views->accel, accel_offset(place, at->normal, d), d, 0.0f, INFINITY);
    }
    return tried > 0 ? (float)open / (float)tried : sun_visibility(sun, views->accel, at, 0);
}
