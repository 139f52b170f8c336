/* surround.c -- see surround.h. */
#include "server/light/surround.h"

#include <math.h>

#define ACROSS SURROUND_ACROSS
#define BEYOND 0.01f   /* of the mesh's extent: the box's distance from it */
#define PIXEL_STRIDE 2 /* of photographs that are asked what they look at, both ways */

static float along(vec3 v, size_t axis) { return (&v.x)[axis]; }

size_t surround_cell(const struct surround *s, vec3 origin, vec3 direction) {
    size_t axis = 0;
    float nearest = INFINITY;
    for (size_t k = 0; k < 3; k++) {
        float slope = along(direction, k), end = slope > 0.0f ? along(s->upper, k) : along(s->lower, k);
        float way = slope != 0.0f ? (end - along(origin, k)) / slope : INFINITY;
        if (way < nearest)
            nearest = way, axis = k;
    }
    vec3 at = vec3_mad(origin, nearest, direction);
    size_t cell = 2 * axis + (along(direction, axis) > 0.0f);
    for (size_t k = 1; k < 3; k++) {
        size_t other = (axis + k) % 3;
        float lower = along(s->lower, other), part = (along(at, other) - lower) / (along(s->upper, other) - lower);
        cell = ACROSS * cell + (size_t)clampf(part * ACROSS, 0.0f, ACROSS - 1.0f);
    }
    return cell;
}

void surround_corners(const struct surround *s, size_t cell, vec3 corner[4]) {
    size_t side = cell / (ACROSS * ACROSS), axis = side / 2, is_upper = side % 2;
    size_t first[3] = {0};
    first[(axis + 1) % 3] = cell / ACROSS % ACROSS;
    first[(axis + 2) % 3] = cell % ACROSS;
    for (size_t k = 0; k < 4; k++) {
        size_t one = k == 1 || k == 2, other = k >= 2, step[3] = {0};
        step[(axis + 1) % 3] = is_upper ? other : one;
        step[(axis + 2) % 3] = is_upper ? one : other;
        for (size_t c = 0; c < 3; c++) {
            float lower = along(s->lower, c), upper = along(s->upper, c);
            float part = c == axis ? (float)is_upper : (float)(first[c] + step[c]) / ACROSS;
            (&corner[k].x)[c] = lower + part * (upper - lower);
        }
    }
}

/* Marks what a photograph shows through the mesh. */
static void mark_seen(struct surround *s, const struct views *views, uint32_t train) {
    const struct camera *camera = &views->scene->photograph[views->train[train]].camera;
    vec3 direction, origin = camera_origin(camera);
    for (uint32_t y = 0; y < camera->height; y += PIXEL_STRIDE) {
        views_use(views, train, (size_t)y * camera->width, camera->width);
        for (uint32_t x = 0; x < camera->width; x += PIXEL_STRIDE) {
            if (views->shows[train][(size_t)y * camera->width + x] == VIEWS_OPEN &&
                camera_direction(camera, (float)x + 0.5f, (float)y + 0.5f, &direction))
                s->is_seen[surround_cell(s, origin, direction)] = true;
        }
    }
}

/* Makes room for the cameras, which stand in the room, also where nothing around them was scanned: from outside they
 * would look at the box's back. */
static void hold_cameras(const struct scene *scene, vec3 *lower, vec3 *upper) {
    for (size_t f = 0; f < scene->photograph_count; f++) {
        vec3 at = camera_origin(&scene->photograph[f].camera);
        for (size_t c = 0; c < 3; c++) {
            (&lower->x)[c] = fminf(along(*lower, c), along(at, c));
            (&upper->x)[c] = fmaxf(along(*upper, c), along(at, c));
        }
    }
}

void surround_init(struct surround *s, const struct views *views) {
    vec3 lower, upper;
    mesh_bounds(&views->scene->mesh, &lower, &upper);
    hold_cameras(views->scene, &lower, &upper);
    vec3 size = vec3_sub(upper, lower);
    *s = (struct surround){.lower = vec3_mad(lower, -BEYOND, size), .upper = vec3_mad(upper, BEYOND, size)};
    for (uint32_t t = 0; t < views->train_count; t++)
        mark_seen(s, views, t);
}
