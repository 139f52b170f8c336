/* viewpoints.c -- see viewpoints.h. Greedy cover: the gain of a surface point falls with the number of views that
 * already see it, as 1 / (1 + count)^2. */
#include "server/demo/viewpoints.h"

#include <assert.h>
#include <math.h>
#include <string.h>

#include "common/mem.h"
#include "common/rng.h"

#define CANDIDATES 480             /* cameras that are chosen from */
#define POINTS 3000                /* surface points for measuring coverage */
#define CLEARANCE_M 0.3f           /* to walls and furniture */
#define NEAREST_M 0.7f             /* minimum distance of most of what a camera sees */
#define HALF_ANGLE_TANGENT 0.7673f /* 75 degrees across */
#define TEST_APART_M 0.25f         /* minimum distance of a test camera from all training cameras */

struct demo_point {
    vec3 position, normal;
};

struct viewpoint_chooser {
    const struct room *room;
    uint64_t seed;
    struct demo_point *point; /* [POINTS] */
    struct camera *candidate; /* [CANDIDATES] */
    uint8_t *sees;            /* [CANDIDATES][POINTS] */
    bool *taken;              /* [CANDIDATES] */
    float *count;             /* [POINTS] chosen views that see it */
};

static float uniform(const struct viewpoint_chooser *c, uint64_t stream, uint64_t i, uint64_t dimension) {
    uint64_t bits = rng_key(c->seed, stream, i * 16 + dimension);
    return rng_to_float((uint32_t)(bits >> 32));
}

/* Surface points spread evenly by area. */
static void sample_surface(struct viewpoint_chooser *c) {
    const struct mesh *mesh = &c->room->mesh;
    double step = mesh_area(mesh) / POINTS, next = 0.5 * step, walked = 0.0;
    size_t i = 0;
    for (size_t t = 0; t < mesh->triangle_count; t++) {
        vec3 cross = mesh_cross(mesh, t);
        walked += 0.5 * (double)vec3_length(cross);
        for (; next < walked && i < POINTS; i++, next += step) {
            float u = sqrtf(uniform(c, 1, i, 0)), v = uniform(c, 1, i, 1);
            c->point[i].position = mesh_point(mesh, t, u * (1.0f - v), u * v);
            c->point[i].normal = vec3_normalize(cross);
        }
    }
    for (; i < POINTS; i++) /* rounding of the sums may leave the last one out */
        c->point[i] = c->point[i - 1];
}

static bool is_clear(vec3 p) {
    size_t count;
    const vec3(*box)[2] = room_obstacles(&count);
    for (size_t i = 0; i < count; i++) {
        const vec3 *b = box[i];
        if (p.x > b[0].x - CLEARANCE_M && p.x < b[1].x + CLEARANCE_M && p.y > b[0].y - CLEARANCE_M &&
            p.y < b[1].y + CLEARANCE_M && p.z > b[0].z - CLEARANCE_M && p.z < b[1].z + CLEARANCE_M)
            return false;
    }
    return true;
}

/* Upright camera at `eye` looking along unit `forward`. */
static void aim(struct camera *camera, vec3 eye, vec3 forward, uint32_t width, uint32_t height) {
    vec3 right = vec3_normalize(vec3_cross(forward, vec3_make(0.0f, 1.0f, 0.0f)));
    vec3 down = vec3_cross(forward, right);
    memset(camera, 0, sizeof *camera);
    camera->model = CAMERA_OPENCV;
    camera->width = width;
    camera->height = height;
    camera->fx = camera->fy = 0.5f * (float)width / HALF_ANGLE_TANGENT;
    camera->cx = 0.5f * (float)width;
    camera->cy = 0.5f * (float)height;
    camera->world_from_camera =
        (struct rigid){{{right.x, down.x, forward.x}, {right.y, down.y, forward.y}, {right.z, down.z, forward.z}}, eye};
    camera->camera_from_world = rigid_inverse(&camera->world_from_camera);
}

/* Whether most rays of a 5 x 5 grid over the picture are longer than NEAREST_M. */
static bool has_room_ahead(const struct viewpoint_chooser *c, const struct camera *camera) {
    int far = 0;
    for (int i = 0; i < 25; i++) {
        vec3 direction;
        struct accel_hit hit;
        float x = (0.1f + 0.2f * (float)(i % 5)) * (float)camera->width;
        float y = (0.1f + 0.2f * (float)(i / 5)) * (float)camera->height;
        far += camera_direction(camera, x, y, &direction) &&
               (!accel_intersect(c->room->world.accel, camera_origin(camera), direction, 0.0f, 100.0f, &hit) ||
                hit.distance_m > NEAREST_M);
    }
    return far >= 22;
}

static void draw_candidate(struct viewpoint_chooser *c, size_t i, uint32_t width, uint32_t height) {
    for (uint64_t attempt = i;; attempt += CANDIDATES) {
        vec3 eye = {CLEARANCE_M + uniform(c, 2, attempt, 0) * (ROOM_WIDTH - 2.0f * CLEARANCE_M),
                    0.35f + uniform(c, 2, attempt, 1) * 1.9f,
                    CLEARANCE_M + uniform(c, 2, attempt, 2) * (ROOM_DEPTH - 2.0f * CLEARANCE_M)};
        float turn = 6.2831853f * uniform(c, 2, attempt, 3);
        float rise = -0.9f + 1.5f * uniform(c, 2, attempt, 4); /* radians: up to 34, down to 52 */
        vec3 forward = {cosf(rise) * cosf(turn), sinf(rise), cosf(rise) * sinf(turn)};
        if (!is_clear(eye))
            continue;
        aim(&c->candidate[i], eye, forward, width, height);
        if (has_room_ahead(c, &c->candidate[i]))
            return;
    }
}

static bool sees(const struct viewpoint_chooser *c, const struct camera *camera, const struct demo_point *p) {
    float x, y, depth;
    vec3 to_eye = vec3_sub(camera_origin(camera), p->position);
    float distance = vec3_length(to_eye);
    vec3 direction = vec3_scale(to_eye, 1.0f / distance);
    if (vec3_dot(direction, p->normal) < 0.15f || !camera_project(camera, p->position, &x, &y, &depth))
        return false;
    vec3 origin = accel_offset(p->position, p->normal, direction);
    return !accel_occluded(c->room->world.accel, origin, direction, 0.0f, distance);
}

/* Chooses one more training camera. */
static size_t choose_next(struct viewpoint_chooser *c) {
    size_t best = CANDIDATES;
    double best_gain = -1.0;
    for (size_t i = 0; i < CANDIDATES; i++) {
        if (c->taken[i])
            continue;
        double gain = 0.0;
        for (size_t p = 0; p < POINTS; p++) {
            double missing = 1.0 / (1.0 + (double)c->count[p]);
            gain += c->sees[i * POINTS + p] ? missing * missing : 0.0;
        }
        if (gain > best_gain) {
            best_gain = gain;
            best = i;
        }
    }
    c->taken[best] = true;
    for (size_t p = 0; p < POINTS; p++)
        c->count[p] += c->sees[best * POINTS + p];
    return best;
}

static bool is_apart(const struct camera *camera, const struct camera *others, size_t count) {
    for (size_t i = 0; i < count; i++)
        if (vec3_length(vec3_sub(camera_origin(camera), camera_origin(&others[i]))) < TEST_APART_M)
            return false;
    return true;
}

/* Before test cameras are chosen: resets the counts and excludes candidates near a training camera where enough
 * others remain. */
static void prepare_tests(struct viewpoint_chooser *c, const struct camera *train, size_t train_count, size_t wanted) {
    size_t free_count = CANDIDATES - train_count;
    memset(c->count, 0, POINTS * sizeof *c->count);
    for (size_t i = 0; i < CANDIDATES && free_count > wanted; i++) {
        if (c->taken[i] || is_apart(&c->candidate[i], train, train_count))
            continue;
        c->taken[i] = true;
        free_count--;
    }
}

void viewpoints_choose(const struct room *room, uint32_t width, uint32_t height, size_t train_count, size_t test_count,
                       uint64_t seed, struct camera *camera) {
    assert(train_count + test_count <= CANDIDATES / 2);
    struct viewpoint_chooser c = {.room = room, .seed = seed};
    c.point = mem_array(POINTS, sizeof *c.point);
    c.candidate = mem_array(CANDIDATES, sizeof *c.candidate);
    c.sees = mem_array((size_t)CANDIDATES * POINTS, sizeof *c.sees);
    c.taken = mem_calloc(CANDIDATES, sizeof *c.taken);
    c.count = mem_calloc(POINTS, sizeof *c.count);
    sample_surface(&c);
    for (size_t i = 0; i < CANDIDATES; i++) {
        draw_candidate(&c, i, width, height);
        for (size_t p = 0; p < POINTS; p++)
            c.sees[i * POINTS + p] = sees(&c, &c.candidate[i], &c.point[p]);
    }
    for (size_t i = 0; i < train_count; i++)
        camera[i] = c.candidate[choose_next(&c)];
    prepare_tests(&c, camera, train_count, test_count);
    for (size_t i = 0; i < test_count; i++)
        camera[train_count + i] = c.candidate[choose_next(&c)];
    mem_free(c.count);
    mem_free(c.taken);
    mem_free(c.sees);
    mem_free(c.candidate);
    mem_free(c.point);
}
