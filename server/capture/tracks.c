/* tracks.c -- see tracks.h. */
#include "server/capture/tracks.h"

#include <math.h>

#include "common/mem.h"
#include "common/rng.h"
#include "server/capture/stratified.h"

/* Tracks in all, for time and memory; for each photograph at least 25 a pose's unknown, at most one in a square of 22
 * pixels of PYRAMID_MAX. */
#define TRACKS_TOTAL 50000               /* +25 %: no change */
#define TRACKS_MIN 150                   /* +25 %: no change */
#define TRACKS_MAX 600                   /* +25 %: no change */
#define PYRAMID_TOTAL ((size_t)64 << 20) /* pixels of all level 0, also of held-out photographs: 256 MiB */
#define PYRAMID_MAX ((size_t)640 * 480)  /* pixels of level 0, at most: finer ones add time, and noise */
/* Random positions of which the strongest gradient is taken: an order statistic, no maximum, for spread. */
#define PLACES_PER_CELL 8   /* +25 %: no change */
#define DISTANCE_RATIO 1.7f /* of two cameras' distances, at most: within the pyramid's factor of 2; +25 %: no change */
/* Least gradient of a track, log luminance per pixel: the noise of a pixel of 1 % is then a pixel's shift. */
#define MIN_SLOPE 0.01f /* +25 %: no change */
/* Radiance added before logarithms, as a share of the median: noise of dark pixels counts less. */
#define FLOOR_SHARE 0.05f /* +25 %: no change */

static void make_pyramid(void *user, size_t t, int thread) {
    (void)thread;
    struct tracks *tracks = user;
    const struct views *views = tracks->views;
    pyramid_make(&tracks->pyramid[t], &views->scene->photograph[views->train[t]], views->shows[t],
                 tracks->pyramid_pixels, FLOOR_SHARE * views->median_radiance);
}

/* Position of the strongest gradient among random ones of a cell; false when none suffices. */
static bool choose_place(const struct tracks *tracks, size_t t, size_t cell, size_t columns, size_t rows, float *x,
                         float *y) {
    const struct views *views = tracks->views;
    const struct camera *camera = &views->scene->photograph[views->train[t]].camera;
    float best = MIN_SLOPE;
    *x = *y = 0.0f;
    for (uint64_t k = 0; k < PLACES_PER_CELL; k++) {
        uint64_t bits = rng_key(t, cell, k);
        float px = ((float)(cell % columns) + rng_to_float((uint32_t)bits)) / (float)columns;
        float py = ((float)(cell / columns) + rng_to_float((uint32_t)(bits >> 32))) / (float)rows;
        px *= (float)camera->width;
        py *= (float)camera->height;
        float value, g[2];
        if (!pyramid_gradient(&tracks->pyramid[t], 1, px, py, &value, g))
            continue;
        float slope = sqrtf(g[0] * g[0] + g[1] * g[1]);
        if (slope > best) {
            best = slope;
            *x = px;
            *y = py;
        }
    }
    return best > MIN_SLOPE;
}

/* From the point to where the ray through (x, y) meets the surface's plane. */
static vec3 to_pixel(const struct camera *camera, float x, float y, vec3 point, vec3 normal) {
    vec3 direction, origin = camera_origin(camera);
    if (!camera_direction(camera, x, y, &direction))
        return (vec3){0, 0, 0};
    float distance = vec3_dot(vec3_sub(point, origin), normal) / vec3_dot(direction, normal);
    return vec3_sub(vec3_mad(origin, distance, direction), point);
}

static bool make_track(const struct views *views, size_t t, float x, float y, uint32_t key, struct track *track) {
    const struct camera *camera = &views->scene->photograph[views->train[t]].camera;
    vec3 direction, origin = camera_origin(camera);
    struct accel_hit hit;
    if (!camera_direction(camera, x, y, &direction) ||
        !accel_intersect(views->accel, origin, direction, 0.0f, INFINITY, &hit))
        return false;
    vec3 normal = vec3_normalize(mesh_cross(&views->scene->mesh, hit.triangle));
    if (-vec3_dot(normal, direction) < TRACK_MIN_COSINE)
        return false;
    *track = (struct track){.x = x, .y = y, .point = vec3_mad(origin, hit.distance_m, direction)};
    track->right = to_pixel(camera, x + 1.0f, y, track->point, normal);
    track->down = to_pixel(camera, x, y + 1.0f, track->point, normal);
    uint32_t frames = (uint32_t)views->train_count;
    for (uint32_t i = 0; i < frames && track->other_count < TRACK_OTHERS; i++) {
        uint32_t other = stratified_permute(i, frames, key);
        struct view view;
        vec3 to = vec3_sub(camera_origin(&views->scene->photograph[views->train[other]].camera), track->point);
        float distance = vec3_length(to);
        if (other != t && distance < DISTANCE_RATIO * hit.distance_m && hit.distance_m < DISTANCE_RATIO * distance &&
            vec3_dot(to, normal) > TRACK_MIN_COSINE * distance && views_sees(views, other, track->point, normal, &view))
            track->other[track->other_count++] = other;
    }
    return track->other_count >= 2;
}

static void make_tracks(void *user, size_t t, int thread) {
    (void)thread;
    struct tracks *tracks = user;
    const struct views *views = tracks->views;
    const struct camera *camera = &views->scene->photograph[views->train[t]].camera;
    double aspect = (double)camera->width / (double)camera->height;
    size_t columns = (size_t)fmax(1.0, sqrt((double)tracks->capacity * aspect));
    size_t rows = tracks->capacity / columns;
    rows = rows < 1 ? 1 : rows;
    for (size_t cell = 0; cell < columns * rows && tracks->count[t] < tracks->capacity; cell++) {
        float x, y;
        uint32_t key = (uint32_t)rng_key(t, cell, PLACES_PER_CELL);
        if (choose_place(tracks, t, cell, columns, rows, &x, &y) &&
            make_track(views, t, x, y, key, &tracks->track[t * tracks->capacity + tracks->count[t]]))
            tracks->count[t]++;
    }
}

void tracks_make(struct tracks *t, const struct views *views, struct parallel *pool) {
    size_t frames = views->train_count, per_frame = TRACKS_TOTAL / (frames + 1);
    *t = (struct tracks){.views = views};
    t->capacity = per_frame < TRACKS_MIN ? TRACKS_MIN : per_frame > TRACKS_MAX ? TRACKS_MAX : per_frame;
    t->pyramid = mem_calloc(frames + 1, sizeof *t->pyramid);
    t->count = mem_calloc(frames + 1, sizeof *t->count);
    t->track = mem_array(frames * t->capacity + 1, sizeof *t->track);
    size_t pixels = PYRAMID_TOTAL / (views->scene->photograph_count + 1);
    t->pyramid_pixels = pixels < PYRAMID_MAX ? pixels : PYRAMID_MAX;
    parallel_for(pool, frames, make_pyramid, t);
    parallel_for(pool, frames, make_tracks, t);
}

void tracks_pyramid(const struct tracks *t, const struct photograph *photo, struct pyramid *pyramid) {
    pyramid_make(pyramid, photo, NULL, t->pyramid_pixels, FLOOR_SHARE * t->views->median_radiance);
}

void tracks_release(struct tracks *t) {
    for (size_t i = 0; t->pyramid && i < t->views->train_count; i++)
        pyramid_release(&t->pyramid[i]);
    mem_free(t->pyramid);
    mem_free(t->count);
    mem_free(t->track);
    *t = (struct tracks){0};
}
