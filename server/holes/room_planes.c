/* room_planes.c -- see room_planes.h. */
#include "server/holes/room_planes.h"

#include "common/cholesky.h"
#include "common/mem.h"
#include "common/rng.h"
#include "server/scene/area_sample.h"

#define POINTS 8192 /* a plane of LEAST_SHARE has 80 of them */
#define TRIALS 256  /* of them tried as a plane; one of LEAST_SHARE is missed with odds of 1 to 13, one of 4 % never */
/* Of the surface: the narrowest plane looked for; a wall of 2.5 x 1.5 m in a furnished room of 5 x 4 m. */
#define LEAST_SHARE 0.01
/* Cosine between a point's normal and that of its plane: noise of a scan turns triangles by up to 20 degrees. */
#define LIKE_COSINE 0.94f
#define FITS 4 /* of a plane to its points, which change a little each time */
#define SEED 0x701e5

struct plane_points {
    vec3 position[POINTS], normal[POINTS];
    bool is_taken[POINTS];
};

static bool lies_on(const struct plane_points *p, size_t i, const struct room_plane *plane, float reach_m) {
    return !p->is_taken[i] && vec3_dot(p->normal[i], plane->normal) > LIKE_COSINE &&
           fabsf(room_plane_height(plane, p->position[i])) < reach_m;
}

static size_t count_on(const struct plane_points *p, const struct room_plane *plane, float reach_m) {
    size_t count = 0;
    for (size_t i = 0; i < POINTS; i++)
        count += lies_on(p, i, plane, reach_m);
    return count;
}

static struct room_plane plane_through(vec3 origin, vec3 normal) {
    struct room_plane plane = {.origin = origin, .normal = normal};
    vec3_frame(normal, &plane.s, &plane.t);
    return plane;
}

/* The plane of least squared heights over `plane` of the points that lie on it; `plane` itself where they are too
 * few. */
static struct room_plane fit_plane(const struct plane_points *p, const struct room_plane *plane, float reach_m) {
    double a[3][3] = {{0}}, x[3] = {0};
    for (size_t i = 0; i < POINTS; i++) {
        if (!lies_on(p, i, plane, reach_m))
            continue;
        vec3 at = vec3_sub(p->position[i], plane->origin);
        double term[3] = {1.0, (double)vec3_dot(at, plane->s), (double)vec3_dot(at, plane->t)};
        for (int r = 0; r < 3; r++) {
            x[r] += term[r] * (double)vec3_dot(at, plane->normal);
            for (int c = 0; c < 3; c++)
                a[r][c] += term[r] * term[c];
        }
    }
    if (!cholesky_factor(3, 3, &a[0][0]))
        return *plane;
    cholesky_solve(3, 3, &a[0][0], x);
    vec3 normal = vec3_mad(vec3_mad(plane->normal, -(float)x[1], plane->s), -(float)x[2], plane->t);
    return plane_through(vec3_mad(plane->origin, (float)x[0], plane->normal), vec3_normalize(normal));
}

/* The plane with the most points; returns their number. */
static size_t widest(const struct plane_points *p, size_t number, float reach_m, struct room_plane *plane) {
    size_t most = 0;
    for (size_t k = 0; k < TRIALS; k++) {
        size_t i = rng_below((uint32_t)rng_key(SEED, number, k), POINTS);
        struct room_plane trial = plane_through(p->position[i], p->normal[i]);
        size_t count = p->is_taken[i] ? 0 : count_on(p, &trial, reach_m);
        if (count > most) {
            most = count;
            *plane = trial;
        }
    }
    for (int k = 0; k < FITS && most > 0; k++)
        *plane = fit_plane(p, plane, reach_m);
    return most > 0 ? count_on(p, plane, reach_m) : 0;
}

size_t room_planes_find(const struct mesh *mesh, float reach_m, struct room_plane plane[ROOM_PLANES_MAX]) {
    struct plane_points *p = mem_calloc(1, sizeof *p);
    struct area_sampler sampler;
    size_t count = 0;
    area_sampler_init(&sampler, mesh);
    for (size_t i = 0; i < POINTS; i++)
        area_sampler_point(&sampler, SEED, i, POINTS, &p->position[i], &p->normal[i]);
    area_sampler_release(&sampler);
    for (; count < ROOM_PLANES_MAX; count++) {
        size_t points = widest(p, count, reach_m, &plane[count]);
        if ((double)points < LEAST_SHARE * POINTS)
            break;
        plane[count].share = (double)points / POINTS;
        for (size_t i = 0; i < POINTS; i++)
            p->is_taken[i] |= lies_on(p, i, &plane[count], reach_m);
    }
    mem_free(p);
    return count;
}
