/* view_edges.c -- see views.h: the classes of pixels, by rays through the corners of cells, of a pixel each in
 * photographs that are not large (photograph_reduce.h). */
#include <math.h>

#include "common/mem.h"
#include "server/capture/views.h"
#include "server/scene/photograph_reduce.h"

/* Depth edge: corner hits are off each other's plane by more than this many pixel footprints, plus a share of the
 * distance, for rounding and for a mesh's noise (2 mm at a metre). A lower step shifts what a
 * photograph shows by less than three pixels. */
#define EDGE_FOOTPRINTS 3.0f /* +25 %: no change */
#define EDGE_RELATIVE 0.002f /* +25 %: no change */
/* Surfaces touch where the corner hits of a mixed pixel are no farther apart than this, in footprints: at 84 degrees
 * (MIN_COSINE) neighbouring corners of one plane are as far. */
#define SEAM_FOOTPRINTS 10.0f /* +25 %: no change */

/* Crease: cosine between normals below which surfaces are lit differently. At 37 degrees light along one normal gives a
 * fifth less on the other; a column of ten faces stays whole. */
#define CREASE_COSINE 0.8f /* to .85: +0.04 dB */

#define NO_SURFACE UINT32_MAX
#define BAND 8 /* rows of cells a work item */

struct corner {
    vec3 point;
    vec3 normal;
    float distance_m;
    uint32_t segment; /* or NO_SURFACE */
};

/* Class and owner of the pixels of a cell. */
struct cell_class {
    uint8_t shows, owner;
};

struct edge_job {
    struct views *views;
    uint32_t train;
    const struct camera *camera;
    uint32_t step;          /* pixels of a cell, in each direction */
    uint32_t columns, rows; /* of cells; those at the right and below may be cut */
    float focal;            /* of the camera, in cells */
};

/* The ray through a place in the picture, given in cells. */
static bool ray_at(const struct edge_job *job, float column, float row, vec3 *direction) {
    const struct camera *c = job->camera;
    float x = fminf(column * (float)job->step, (float)c->width), y = fminf(row * (float)job->step, (float)c->height);
    return camera_direction(c, x, y, direction);
}

static bool centre_meets(const struct edge_job *job, uint32_t column, uint32_t row) {
    vec3 direction;
    return !ray_at(job, (float)column + 0.5f, (float)row + 0.5f, &direction) ||
           accel_occluded(job->views->accel, camera_origin(job->camera), direction, 0.0f, INFINITY);
}

static struct corner trace_corner(const struct edge_job *job, uint32_t column, uint32_t row) {
    struct corner corner = {.segment = NO_SURFACE};
    vec3 direction;
    struct accel_hit hit;
    vec3 origin = camera_origin(job->camera);
    if (!ray_at(job, (float)column, (float)row, &direction) ||
        !accel_intersect(job->views->accel, origin, direction, 0.0f, INFINITY, &hit))
        return corner;
    corner.point = vec3_mad(origin, hit.distance_m, direction);
    corner.normal = vec3_normalize(mesh_cross(&job->views->scene->mesh, hit.triangle));
    corner.distance_m = hit.distance_m;
    corner.segment = job->views->segments->of_triangle[hit.triangle];
    return corner;
}

static bool differ(const struct corner *a, const struct corner *b, float focal) {
    if (a->segment != b->segment)
        return true;
    if (a->segment == NO_SURFACE)
        return false;
    if (vec3_dot(a->normal, b->normal) < CREASE_COSINE)
        return true;
    vec3 between = vec3_sub(b->point, a->point);
    float slack = a->distance_m * (EDGE_FOOTPRINTS / focal + EDGE_RELATIVE);
    return fabsf(vec3_dot(between, a->normal)) > slack && fabsf(vec3_dot(between, b->normal)) > slack;
}

/* Whether two corners that differ are on surfaces that touch. */
static bool are_adjacent(const struct corner *a, const struct corner *b, float focal) {
    if (a->segment == NO_SURFACE || b->segment == NO_SURFACE)
        return a->segment == b->segment;
    return vec3_length(vec3_sub(b->point, a->point)) < a->distance_m * SEAM_FOOTPRINTS / focal;
}

/* Of the four corners of a cell: left and right ones, above and below. */
static uint8_t class_of(const struct edge_job *job, const struct corner *left_top, const struct corner *top,
                        const struct corner *left_low, const struct corner *low) {
    float focal = job->focal;
    bool mixed = differ(left_top, top, focal) || differ(left_top, left_low, focal) || differ(left_top, low, focal) ||
                 differ(top, left_low, focal);
    bool seam = mixed && are_adjacent(left_top, top, focal) && are_adjacent(left_top, left_low, focal) &&
                are_adjacent(left_top, low, focal) && are_adjacent(top, left_low, focal);
    return seam ? VIEWS_SEAM : mixed ? VIEWS_MIXED : VIEWS_SURFACE;
}

/* The pixels of a row of cells. */
static void put_row(const struct edge_job *job, uint32_t row, const struct cell_class *class) {
    size_t width = job->camera->width;
    for (uint32_t y = row * job->step; y < (row + 1) * job->step && y < job->camera->height; y++) {
        uint8_t *shows = job->views->shows[job->train] + y * width, *owner = job->views->owner[job->train] + y * width;
        views_use(job->views, job->train, y * width, width);
        for (size_t x = 0; x < width; x++) {
            shows[x] = class[x / job->step].shows;
            owner[x] = class[x / job->step].owner;
        }
    }
}

/* One row of cells, given the corners above them, [columns + 1], in whose place it leaves those below. */
static void mark_row(const struct edge_job *job, uint32_t row, struct corner *corners, struct cell_class *class) {
    struct corner left_top = corners[0], left_low = trace_corner(job, 0, row + 1);
    corners[0] = left_low;
    for (uint32_t x = 0; x < job->columns; x++) {
        struct corner top = corners[x + 1];
        struct corner low = trace_corner(job, x + 1, row + 1);
        class[x] = (struct cell_class){class_of(job, &left_top, &top, &left_low, &low), views_owner_mark(low.segment)};
        /* geometry thinner than a cell may hide between the corners */
        if (class[x].shows == VIEWS_SURFACE && low.segment == NO_SURFACE)
            class[x].shows = centre_meets(job, x, row) ? VIEWS_MIXED : VIEWS_OPEN;
        corners[x + 1] = low;
        left_top = top;
        left_low = low;
    }
    put_row(job, row, class);
}

/* BAND rows. Threads share no corners: those between two bands are traced twice. */
static void mark_band(void *user, size_t band, int thread) {
    (void)thread;
    const struct edge_job *job = user;
    struct corner *corners = mem_array((size_t)job->columns + 1, sizeof *corners);
    struct cell_class *class = mem_array(job->columns, sizeof *class);
    uint32_t first = (uint32_t)band * BAND;
    for (uint32_t x = 0; x <= job->columns; x++)
        corners[x] = trace_corner(job, x, first);
    for (uint32_t row = first; row < first + BAND && row < job->rows; row++)
        mark_row(job, row, corners, class);
    mem_free(class);
    mem_free(corners);
}

/* Gives the neighbours of pixels of class `of` at least class of - 1. */
static void spread_class(uint8_t *edge, long width, long height, uint8_t of) {
    for (long y = 0; y < height; y++) {
        for (long x = 0; x < width; x++) {
            if (edge[y * width + x] != of)
                continue;
            for (long j = y > 0 ? y - 1 : 0; j <= y + 1 && j < height; j++) {
                for (long i = x > 0 ? x - 1 : 0; i <= x + 1 && i < width; i++) {
                    uint8_t *beside = &edge[j * width + i];
                    *beside = *beside < of - 1 ? (uint8_t)(of - 1) : *beside;
                }
            }
        }
    }
}

static void make_edges(uint8_t *edge, const uint8_t *shows, uint32_t width, uint32_t height) {
    for (size_t i = 0; i < (size_t)width * height; i++)
        edge[i] = shows[i] == VIEWS_MIXED || shows[i] == VIEWS_SEAM ? VIEWS_EDGE : 0;
    for (uint8_t of = VIEWS_EDGE; of > 1; of--)
        spread_class(edge, (long)width, (long)height, of);
}

void views_update_edges(struct views *v, uint32_t train, struct parallel *pool) {
    const struct camera *camera = &v->scene->photograph[v->train[train]].camera;
    uint32_t step = camera_step(camera);
    struct edge_job job = {.views = v,
                           .train = train,
                           .camera = camera,
                           .step = step,
                           .columns = (camera->width + step - 1) / step,
                           .rows = (camera->height + step - 1) / step,
                           .focal = camera->fx / (float)step};
    parallel_for(pool, (job.rows + BAND - 1) / BAND, mark_band, &job);
    views_use(v, train, 0, (size_t)camera->width * camera->height);
    make_edges(v->edge[train], v->shows[train], camera->width, camera->height);
}
