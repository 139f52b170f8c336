/* pose_solver.h, pose_solve: the twists and offsets of random observations against the normal equations, formed row by
 * row and solved as a dense system; the same bytes for any number of threads. */
#include <math.h>
#include <string.h>

#include "common/cholesky.h"
#include "common/mem.h"
#include "common/rng.h"
#include "server/capture/poses/pose_solver.h"
#include "tests/check.h"

#define FRAMES 5
#define TRACKS 120 /* a frame */
#define UNKNOWNS ((POSE_UNKNOWNS + POSE_CELLS) * FRAMES)
#define FIXED 3 /* a frame that may not move */
#define OFFSET_PRECISION (1.0 / (0.3 * 0.3))

static struct photograph photograph[FRAMES];
static uint32_t train[FRAMES] = {0, 1, 2, 3, 4};
static struct track track[FRAMES * TRACKS];
static size_t track_counts[FRAMES];

static float random_number(uint64_t a, uint64_t b) { return rng_to_float((uint32_t)rng_key(11, a, b)) - 0.5f; }

static void make_tracks(struct tracks *tracks) {
    for (uint32_t f = 0; f < FRAMES; f++) {
        photograph[f].camera =
            (struct camera){.width = 320, .height = 240, .fx = 200.0f, .fy = 200.0f, .cx = 160.0f, .cy = 120.0f};
        photograph[f].camera.camera_from_world = photograph[f].camera.world_from_camera =
            (struct rigid){{{1.0f, 0.0f, 0.0f}, {0.0f, 1.0f, 0.0f}, {0.0f, 0.0f, 1.0f}}, {0.0f, 0.0f, 0.0f}};
        track_counts[f] = TRACKS;
        for (uint32_t i = 0; i < TRACKS; i++) {
            struct track *t = &track[f * TRACKS + i];
            t->point = vec3_make(random_number(f, i), random_number(i, f), 1.0f);
            t->other_count = (uint8_t)(2 + i % 3);
            for (uint32_t k = 0; k < t->other_count; k++)
                t->other[k] = (f + 1 + k) % FRAMES;
        }
    }
    tracks->count = track_counts;
    tracks->track = track;
    tracks->capacity = TRACKS;
}

/* Random values, slopes and weights; every seventh observation is none. */
static void observe(struct pose_solver *s) {
    for (size_t i = 0; i < s->track_count * POSE_OBSERVATIONS_MAX; i++) {
        struct pose_observation *o = &s->observation[i];
        bool is_none = i % 7 == 0;
        o->value = is_none ? NAN : random_number(i, 1);
        o->weight = is_none || pose_is_held_out(i / POSE_OBSERVATIONS_MAX) ? 0.0f : 10.0f + 15.0f * random_number(i, 2);
        for (uint64_t j = 0; j < POSE_UNKNOWNS; j++)
            o->d[j] = random_number(i, 3 + j);
    }
    s->frame[FIXED].is_fixed = true;
}

/* The row of an observation: what its value, less its track's, changes by with each unknown. */
static void row_of(const struct pose_observation *o, double row[UNKNOWNS]) {
    memset(row, 0, UNKNOWNS * sizeof *row);
    for (int j = 0; j < POSE_UNKNOWNS; j++)
        row[POSE_UNKNOWNS * o->frame + (uint32_t)j] = (double)o->d[j];
    row[o->offset] = -1.0;
}

/* Adds weight row' row to the matrix, and -weight value row to the right side. */
static void add_row(double *matrix, double *right, const double row[UNKNOWNS], double value, double weight) {
    for (size_t i = 0; i < UNKNOWNS; i++) {
        right[i] -= weight * value * row[i];
        for (size_t j = 0; j <= i && row[i] != 0.0; j++)
            matrix[i * UNKNOWNS + j] += weight * row[i] * row[j];
    }
}

/* With the track's own value eliminated, and, for the damping, the diagonal with it known. */
static void add_track(const struct pose_solver *s, size_t t, double *matrix, double *right, double *diagonal) {
    double row[UNKNOWNS], mean[UNKNOWNS] = {0.0}, value = 0.0, weights = 0.0;
    for (size_t k = 0; k < pose_observation_count(s->track[t]); k++) {
        const struct pose_observation *o = &s->observation[t * POSE_OBSERVATIONS_MAX + k];
        if (!(o->weight > 0.0f))
            continue;
        double w = (double)o->weight;
        row_of(o, row);
        add_row(matrix, right, row, (double)o->value, w);
        for (size_t i = 0; i < UNKNOWNS; i++) {
            mean[i] += w * row[i];
            diagonal[i] += w * row[i] * row[i];
        }
        value += w * (double)o->value;
        weights += w;
    }
    if (weights > 0.0)
        add_row(matrix, right, mean, value, -1.0 / weights);
}

static void solve_dense(const struct pose_solver *s, double *x) {
    double *matrix = mem_calloc((size_t)UNKNOWNS * UNKNOWNS, sizeof *matrix), diagonal[UNKNOWNS] = {0.0};
    for (size_t t = 0; t < s->track_count; t++)
        if (!pose_is_held_out(t))
            add_track(s, t, matrix, x, diagonal);
    for (size_t i = 0; i < UNKNOWNS; i++) {
        bool is_twist = i < POSE_UNKNOWNS * FRAMES, is_fixed = is_twist && i / POSE_UNKNOWNS == FIXED;
        matrix[i * UNKNOWNS + i] +=
            is_twist ? pose_prior(&s->frame[i / POSE_UNKNOWNS]) + POSE_DAMPING * diagonal[i] : OFFSET_PRECISION;
        matrix[i * UNKNOWNS + i] *= is_fixed ? 1e12 : 1.0;
    }
    CHECK(cholesky_factor(UNKNOWNS, UNKNOWNS, matrix));
    cholesky_solve(UNKNOWNS, UNKNOWNS, matrix, x);
    mem_free(matrix);
}

int main(void) {
    struct scene scene = {.photograph = photograph, .photograph_count = FRAMES};
    struct views views = {.scene = &scene, .train_count = FRAMES, .train = train};
    struct tracks tracks = {.views = &views};
    double wanted[UNKNOWNS] = {0.0}, first[UNKNOWNS], largest = 0.0;
    make_tracks(&tracks);
    for (int threads = 1; threads <= 5; threads += 2) {
        struct parallel *pool = parallel_new(threads);
        struct pose_solver s;
        pose_solver_init(&s, &tracks, pool);
        CHECK(s.unknowns == UNKNOWNS && s.first_of_frame[FRAMES] > 0);
        observe(&s);
        if (threads == 1)
            solve_dense(&s, wanted);
        pose_solve(&s);
        if (threads == 1)
            memcpy(first, s.x, sizeof first);
        CHECK(memcmp(first, s.x, sizeof first) == 0);
        pose_solver_release(&s);
        parallel_free(pool);
    }
    for (size_t i = 0; i < UNKNOWNS; i++)
        largest = fmax(largest, fabs(wanted[i]));
    for (size_t i = 0; i < UNKNOWNS; i++)
        CHECK_THAT(fabs(first[i] - wanted[i]) < 5e-3 * largest, "x[%zu] is %g, not %g", i, first[i], wanted[i]);
    CHECK(largest > 0.01 && first[POSE_UNKNOWNS * FIXED] == 0.0);
    return check_result();
}
