/* plan_picture.c -- see plan_picture.h. Points spread over the surface are drawn where they lie; those of the ceiling
 * are left out, since they would cover the rest. */
#include "server/check/plan_picture.h"

#include <math.h>

#include "common/mem.h"
#include "server/scene/area_sample.h"

#define SIDE 800            /* pixels */
#define MARGIN 30.0f        /* pixels */
#define POINTS 24000        /* of the surface, spread by area: about one in 5 x 5 pixels of the plan */
#define PHOTOGRAPHS_MAX 96  /* asked for each point; evenly spaced where there are more */
#define CEILING_FROM 0.6f   /* of the height: horizontal surface above it is ceiling, lamp or the top of a cupboard */
#define FREE_SHARE 0.985f   /* of the way to a camera */
#define CAMERA_LENGTH 13.0f /* pixels */

static const rgb paper = {0.93f, 0.93f, 0.92f}, seen_color = {0.30f, 0.36f, 0.45f},
                 unseen_color = {0.85f, 0.12f, 0.03f}, camera_color = {0.01f, 0.10f, 0.75f}, ink = {0.0f, 0.0f, 0.0f};

struct plan_point {
    vec3 position, normal;
    bool is_seen;
};

struct plan_drawing {
    const struct scene *scene;
    const struct accel *accel;
    vec3 right, down, up; /* of the picture, and of the room */
    vec2 centre;          /* of the room in these, metres */
    float scale;          /* pixels per metre */
    float low, high;      /* heights of the room */
    struct area_sampler sampler;
    struct plan_point *point; /* [POINTS] */
};

static vec2 place(const struct plan_drawing *p, vec3 at) {
    return vec2_make(0.5f * SIDE + p->scale * (vec3_dot(at, p->right) - p->centre.x),
                     0.5f * SIDE + p->scale * (vec3_dot(at, p->down) - p->centre.y));
}

static bool sees(const struct plan_drawing *p, size_t photograph, const struct plan_point *point) {
    const struct camera *camera = &p->scene->photograph[photograph].camera;
    float x, y, depth;
    if (!camera_project(camera, point->position, &x, &y, &depth))
        return false;
    vec3 way = vec3_sub(point->position, camera_origin(camera));
    float distance = vec3_length(way);
    return !accel_occluded(p->accel, camera_origin(camera), vec3_scale(way, 1.0f / distance), 0.0f,
                           FREE_SHARE * distance);
}

static void look(void *user, size_t number, int thread) {
    struct plan_drawing *p = user;
    struct plan_point *point = &p->point[number];
    size_t count = p->scene->photograph_count;
    (void)thread;
    area_sampler_point(&p->sampler, 0x91a4, number, POINTS, &point->position, &point->normal);
    point->is_seen = false;
    size_t asked = count < PHOTOGRAPHS_MAX ? count : PHOTOGRAPHS_MAX;
    for (size_t i = 0; i < asked && !point->is_seen; i++)
        point->is_seen = sees(p, i * count / asked, point);
}

/* Of mesh and cameras together. */
static void find_extent(struct plan_drawing *p) {
    const struct mesh *mesh = &p->scene->mesh;
    float x0 = INFINITY, x1 = -INFINITY, y0 = INFINITY, y1 = -INFINITY;
    p->low = INFINITY;
    p->high = -INFINITY;
    for (size_t i = 0; i < mesh->vertex_count + p->scene->photograph_count; i++) {
        bool is_vertex = i < mesh->vertex_count;
        vec3 at = is_vertex ? mesh->position[i] : camera_origin(&p->scene->photograph[i - mesh->vertex_count].camera);
        float x = vec3_dot(at, p->right), y = vec3_dot(at, p->down), height = vec3_dot(at, p->up);
        x0 = fminf(x0, x);
        x1 = fmaxf(x1, x);
        y0 = fminf(y0, y);
        y1 = fmaxf(y1, y);
        p->low = is_vertex ? fminf(p->low, height) : p->low;
        p->high = is_vertex ? fmaxf(p->high, height) : p->high;
    }
    p->centre = vec2_make(0.5f * (x0 + x1), 0.5f * (y0 + y1));
    p->scale = (SIDE - 2.0f * MARGIN) / fmaxf(fmaxf(x1 - x0, y1 - y0), 1e-6f);
}

static void draw_cameras(const struct plan_drawing *p, struct drawing *drawing) {
    for (size_t i = 0; i < p->scene->photograph_count; i++) {
        const struct camera *c = &p->scene->photograph[i].camera;
        vec3 axis = {c->world_from_camera.rotation[0][2], c->world_from_camera.rotation[1][2],
                     c->world_from_camera.rotation[2][2]};
        vec2 at = place(p, camera_origin(c)), ahead = {vec3_dot(axis, p->right), vec3_dot(axis, p->down)};
        vec2 end = vec2_add(at, vec2_scale(ahead, CAMERA_LENGTH));
        vec2 left = {-ahead.y, ahead.x}, wing = vec2_scale(left, 0.5f * CAMERA_LENGTH);
        drawing_line(drawing, at, vec2_add(end, wing), 1.4f, camera_color, 0.8f);
        drawing_line(drawing, at, vec2_sub(end, wing), 1.4f, camera_color, 0.8f);
        drawing_disc(drawing, at, 3.0f, camera_color, 1.0f);
    }
}

/* One metre (or unit), lower left. */
static void draw_scale(const struct plan_drawing *p, struct drawing *drawing) {
    vec2 from = {MARGIN, SIDE - 0.5f * MARGIN}, to = {MARGIN + p->scale, SIDE - 0.5f * MARGIN};
    if (p->scale > SIDE - 2.0f * MARGIN)
        return;
    drawing_line(drawing, from, to, 2.0f, ink, 1.0f);
    for (int end = 0; end < 2; end++) {
        vec2 at = end ? to : from;
        drawing_line(drawing, vec2_make(at.x, at.y - 5.0f), vec2_make(at.x, at.y + 5.0f), 2.0f, ink, 1.0f);
    }
}

static void draw_points(const struct plan_drawing *p, struct drawing *drawing) {
    for (int unseen = 0; unseen < 2; unseen++) /* those unseen on top */
        for (size_t i = 0; i < POINTS; i++) {
            const struct plan_point *point = &p->point[i];
            float height = (vec3_dot(point->position, p->up) - p->low) / fmaxf(p->high - p->low, 1e-6f);
            bool is_level = fabsf(vec3_dot(point->normal, p->up)) > 0.7f;
            if (point->is_seen != !unseen || (is_level && height > CEILING_FROM))
                continue;
            drawing_disc(drawing, place(p, point->position), is_level ? 3.0f : 2.0f, unseen ? unseen_color : seen_color,
                         unseen     ? 0.5f
                         : is_level ? 0.12f
                                    : 0.5f);
        }
}

void plan_picture_draw(struct drawing *drawing, const struct scene *scene, const struct accel *accel,
                       struct parallel *pool, double *unseen_share) {
    struct plan_drawing p = {.scene = scene, .accel = accel, .up = scene_up(scene)};
    size_t unseen = 0;
    area_sampler_init(&p.sampler, &scene->mesh);
    p.right = fabsf(p.up.x) > 0.5f ? vec3_make(0.0f, 1.0f, 0.0f) : vec3_make(1.0f, 0.0f, 0.0f);
    p.down = vec3_cross(p.right, p.up); /* as seen from above, not mirrored */
    p.point = mem_array(POINTS, sizeof *p.point);
    find_extent(&p);
    parallel_for(pool, POINTS, look, &p);
    for (size_t i = 0; i < POINTS; i++)
        unseen += !p.point[i].is_seen;
    *unseen_share = (double)unseen / POINTS;
    drawing_init(drawing, SIDE, SIDE, paper);
    draw_points(&p, drawing);
    draw_cameras(&p, drawing);
    draw_scale(&p, drawing);
    mem_free(p.point);
    area_sampler_release(&p.sampler);
}
