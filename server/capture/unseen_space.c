/* unseen_space.c -- see unseen_space.h. */
#include "server/capture/unseen_space.h"

#include <math.h>

#include "common/mem.h"

#define CUBES 160       /* along the diagonal of the mesh's box: 6 cm in a room */
#define PART_M 1.0f     /* edge of the blocks within which faces are connected */
#define LEAST_FACES 4   /* of a part */
#define SAMPLES 5       /* points of a cube that are looked for */
#define FACE_OFF 0.75f  /* of a cube's side, from the middle of a seen one: a quarter into the unseen */
#define SAMPLE_OFF 0.3f /* of a cube's side: all but the first lie so far off its middle, along each axis */

static const float sample_place[SAMPLES][3] = {{0, 0, 0}, {1, 1, 1}, {1, -1, -1}, {-1, 1, -1}, {-1, -1, 1}};

static const int way[6][3] = {{1, 0, 0}, {-1, 0, 0}, {0, 1, 0}, {0, -1, 0}, {0, 0, 1}, {0, 0, -1}};

struct carving {
    const struct views *views;
    vec3 lower;
    float side_m;
    uint32_t across[3], count; /* cubes along the axes, and all */
    uint8_t *seen;             /* [count] number of the sample that is seen, from 1; 0: none is */
    uint8_t *border;           /* [count] of a seen cube a bit for each way that leads to the unseen */
    uint8_t *taken;            /* [count] those of its faces that are in a part */
};

static uint32_t cube_at(const struct carving *c, const uint32_t at[3]) {
    return (at[2] * c->across[1] + at[1]) * c->across[0] + at[0];
}

static void place_of(const struct carving *c, uint32_t cube, uint32_t at[3]) {
    at[0] = cube % c->across[0];
    at[1] = cube / c->across[0] % c->across[1];
    at[2] = cube / c->across[0] / c->across[1];
}

static vec3 middle_of(const struct carving *c, uint32_t cube) {
    uint32_t at[3];
    place_of(c, cube, at);
    vec3 steps = vec3_make((float)at[0] + 0.5f, (float)at[1] + 0.5f, (float)at[2] + 0.5f);
    return vec3_mad(c->lower, c->side_m, steps);
}

static vec3 sample_of(const struct carving *c, uint32_t cube, int sample) {
    const float *off = sample_place[sample];
    return vec3_mad(middle_of(c, cube), SAMPLE_OFF * c->side_m, vec3_make(off[0], off[1], off[2]));
}

/* The cube beside one; c->count: beyond the box. */
static uint32_t beside(const struct carving *c, uint32_t cube, const int step[3]) {
    uint32_t at[3];
    place_of(c, cube, at);
    for (int k = 0; k < 3; k++) {
        if ((step[k] < 0 && at[k] == 0) || (step[k] > 0 && at[k] + 1 == c->across[k]))
            return c->count;
        at[k] += (uint32_t)step[k];
    }
    return cube_at(c, at);
}

/* --- what cameras see ---------------------------------------------------------------------------- */

static bool is_between(const struct carving *c, vec3 from, vec3 to) {
    vec3 way_there = vec3_sub(to, from);
    float length = vec3_length(way_there);
    return length > 0.0f && accel_occluded(c->views->accel, from, vec3_scale(way_there, 1.0f / length), 0.0f, length);
}

static bool sees(const struct carving *c, uint32_t train, vec3 point) {
    const struct camera *camera = &c->views->scene->photograph[c->views->train[train]].camera;
    float x, y, depth_m;
    return camera_project(camera, point, &x, &y, &depth_m) && x >= 0.0f && y >= 0.0f && x < (float)camera->width &&
           y < (float)camera->height && !is_between(c, camera_origin(camera), point);
}

static void look_into(void *user, size_t cube, int thread) {
    (void)thread;
    struct carving *c = user;
    for (int sample = 0; sample < SAMPLES && c->seen[cube] == 0; sample++) {
        vec3 point = sample_of(c, (uint32_t)cube, sample);
        for (uint32_t t = 0; t < c->views->train_count && c->seen[cube] == 0; t++)
            c->seen[cube] = sees(c, t, point) ? (uint8_t)(sample + 1) : 0;
    }
}

/* --- the border ---------------------------------------------------------------------------------- */

static void find_border(void *user, size_t cube, int thread) {
    (void)thread;
    struct carving *c = user;
    if (c->seen[cube] == 0)
        return;
    vec3 from = sample_of(c, (uint32_t)cube, c->seen[cube] - 1);
    for (int k = 0; k < 6; k++) {
        uint32_t other = beside(c, (uint32_t)cube, way[k]);
        if (other < c->count && c->seen[other] == 0 && !is_between(c, from, middle_of(c, other)))
            c->border[cube] |= (uint8_t)(1 << k);
    }
}

static bool is_same_block(const struct carving *c, uint32_t a, uint32_t b) {
    uint32_t at[3], other[3], cubes = (uint32_t)fmaxf(PART_M / c->side_m, 1.0f);
    place_of(c, a, at);
    place_of(c, b, other);
    return at[0] / cubes == other[0] / cubes && at[1] / cubes == other[1] / cubes && at[2] / cubes == other[2] / cubes;
}

static bool is_left(const struct carving *c, uint32_t cube, uint8_t bit) {
    return (c->border[cube] & bit) != 0 && (c->taken[cube] & bit) == 0;
}

/* Lists the cubes at the border, that way, that are connected with `first` in its block; returns how many. */
static uint32_t flood(struct carving *c, uint32_t first, uint8_t bit, uint32_t *list) {
    uint32_t count = 1;
    list[0] = first;
    c->taken[first] |= bit;
    for (uint32_t i = 0; i < count; i++) {
        for (int k = 0; k < 27; k++) {
            const int step[3] = {k % 3 - 1, k / 3 % 3 - 1, k / 9 - 1};
            uint32_t other = beside(c, list[i], step);
            if (other == c->count || !is_left(c, other, bit) || !is_same_block(c, first, other))
                continue;
            c->taken[other] |= bit;
            list[count++] = other;
        }
    }
    return count;
}

static struct unseen_face face_of(const struct carving *c, uint32_t cube, int k) {
    vec3 out = vec3_make((float)way[k][0], (float)way[k][1], (float)way[k][2]);
    return (struct unseen_face){vec3_mad(middle_of(c, cube), FACE_OFF * c->side_m, out), vec3_neg(out)};
}

/* Makes a part of the faces that are connected with that of a cube; too small ones are left out. */
static void make_part(struct unseen_space *u, struct carving *c, uint32_t first, int k, uint32_t *list) {
    size_t before = u->face_count;
    uint32_t cubes = flood(c, first, (uint8_t)(1 << k), list);
    if (cubes < LEAST_FACES)
        return;
    for (uint32_t i = 0; i < cubes; i++)
        u->face[u->face_count++] = face_of(c, list[i], k);
    u->part[u->part_count++] = (struct unseen_part){before, u->face_count};
}

static void make_parts(struct unseen_space *u, struct carving *c) {
    uint32_t *list = mem_array((size_t)c->count + 1, sizeof *list);
    size_t faces = 0;
    for (uint32_t i = 0; i < c->count; i++)
        faces += (size_t)__builtin_popcount(c->border[i]);
    u->face = mem_array(faces + 1, sizeof *u->face);
    u->part = mem_array(faces + 1, sizeof *u->part);
    for (uint32_t i = 0; i < c->count; i++) {
        for (int k = 0; k < 6; k++) {
            if (is_left(c, i, (uint8_t)(1 << k)))
                make_part(u, c, i, k, list);
        }
    }
    mem_free(list);
}

/* --- the whole ----------------------------------------------------------------------------------- */

void unseen_space_find(struct unseen_space *u, const struct views *views, struct parallel *pool) {
    struct carving c = {.views = views};
    vec3 upper;
    mesh_bounds(&views->scene->mesh, &c.lower, &upper);
    vec3 size = vec3_sub(upper, c.lower);
    *u = (struct unseen_space){0};
    c.side_m = vec3_length(size) / CUBES;
    if (!(c.side_m > 0.0f))
        return;
    const float extent[3] = {size.x, size.y, size.z};
    c.count = 1;
    for (int k = 0; k < 3; k++)
        c.count *= c.across[k] = 1 + (uint32_t)(extent[k] / c.side_m);
    c.seen = mem_calloc(c.count, sizeof *c.seen);
    c.border = mem_calloc(c.count, sizeof *c.border);
    c.taken = mem_calloc(c.count, sizeof *c.taken);
    parallel_for(pool, c.count, look_into, &c);
    parallel_for(pool, c.count, find_border, &c);
    u->side_m = c.side_m;
    make_parts(u, &c);
    mem_free(c.taken);
    mem_free(c.border);
    mem_free(c.seen);
}

void unseen_space_release(struct unseen_space *u) {
    mem_free(u->part);
    mem_free(u->face);
    *u = (struct unseen_space){0};
}

void unseen_space_corners(const struct unseen_space *u, const struct unseen_face *face, vec3 corner[4]) {
    vec3 s = vec3_scale(vec3_make(face->normal.z, face->normal.x, face->normal.y), 0.5f * u->side_m);
    vec3 t = vec3_cross(face->normal, s);
    corner[0] = vec3_sub(vec3_sub(face->middle, s), t);
    corner[1] = vec3_sub(vec3_add(face->middle, s), t);
    corner[2] = vec3_add(vec3_add(face->middle, s), t);
    corner[3] = vec3_add(vec3_sub(face->middle, s), t);
}
