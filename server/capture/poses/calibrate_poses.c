/* calibrate_poses.c -- see calibrate_poses.h; the equations are pose_solver.h's. */
#include "server/capture/poses/calibrate_poses.h"

#include <math.h>
#include <string.h>

#include "common/mem.h"
#include "server/capture/poses/held_out_poses.h"
#include "server/capture/poses/pose_solver.h"
#include "server/capture/poses/pose_walk.h"

/* Steps at the finest level after the first judgement, which put back the photographs that did not gain; the others
 * have had POSE_ROUNDS there. */
#define LAST_ROUNDS 4 /* +25 %: no change */
/* Pixels: least width of a pyramid level that is used. Coarser ones have few gradients for six unknowns, and mislead; a
 * picture of 640 pixels is used from 80 on. */
#define COARSEST_PX 75 /* +25 %: no change */
/* Photographs that are surely moved, at least, for a drift to be looked for: two an unknown of a pose. */
#define MIN_SURE 12
/* Of corrections that follow a walk: independent ones have 1 +- .12 in 72 photographs, drifts of simulated phones .2. */
#define MAX_ROUGHNESS 0.5
#define DRIFT_SIGNIFICANCE 3.0 /* standard errors; of one decision, not of one a photograph */
/* Of log residuals: 5 %. One for all photographs, so that their agreement compares. */
#define COMMON_SCALE 0.05 /* +25 %: no change */

/* Root mean squared distance, in pixels, between the image positions of a frame's own tracks in two cameras. */
static double shift_of(const struct pose_solver *s, size_t f, const struct camera *a, const struct camera *b) {
    double squares = 0.0;
    size_t count = 0;
    for (size_t i = 0; i < s->tracks->count[f]; i++) {
        double square = pose_squared_shift(a, b, s->tracks->track[f * s->tracks->capacity + i].point);
        if (isnan(square))
            continue;
        squares += square;
        count++;
    }
    return count ? sqrt(squares / (double)count) : 0.0;
}

static void run_rounds(struct pose_solver *s, int level, int rounds, struct parallel *pool) {
    s->level = level;
    for (int round = 0; round < rounds; round++) {
        pose_linearise(s, pool);
        pose_reweight(s);
        pose_solve(s);
        for (size_t f = 0; f < s->frames; f++)
            pose_move(s, f, POSE_STEP_PX * (1 << level) / (double)s->tracks->pyramid[f].scale);
    }
}

/* --- judgement ------------------------------------------------------------------------------------ */

static void validate_frames(const struct pose_solver *s, struct validation *validation) {
    for (size_t i = 0; i < s->track_count; i += POSE_HELD_OUT_EVERY) {
        struct pose_observation *observation = s->observation + i * POSE_OBSERVATIONS_MAX;
        for (size_t k = 0; k < pose_observation_count(s->track[i]); k++) {
            const struct pose_frame *frame = &s->frame[observation[k].frame];
            float x, y, depth_m, value = observation[k].value;
            double consensus, weight[POSE_OBSERVATIONS_MAX];
            if (!isfinite(value) || !camera_project(&frame->before, s->track[i]->point, &x, &y, &depth_m))
                continue;
            float old = pyramid_value(&s->tracks->pyramid[observation[k].frame], s->level, x, y);
            observation[k].value = NAN; /* leaves it out of the consensus */
            pose_weigh_track(s, i, &consensus, weight);
            observation[k].value = value;
            if (!isfinite(old) || !isfinite(consensus))
                continue;
            double cost = pose_robust_cost((double)old - s->x[observation[k].offset] - consensus, frame->scale);
            validation_add(&validation[observation[k].frame], cost,
                           pose_robust_cost((double)value - s->x[observation[k].offset] - consensus, frame->scale));
        }
    }
}

/* Resets frames whose correction is small or not significant. */
static void judge(struct pose_solver *s, struct parallel *pool) {
    struct validation *validation = mem_calloc(s->frames + 1, sizeof *validation);
    s->level = 0;
    pose_linearise(s, pool);
    pose_reweight(s);
    validate_frames(s, validation);
    for (size_t f = 0; f < s->frames; f++) {
        struct pose_frame *frame = &s->frame[f];
        frame->shift_px = frame->is_fixed ? 0.0 : shift_of(s, f, &frame->before, &frame->now);
        if (frame->shift_px < POSE_MIN_SHIFT_PX || !pose_is_improved(&validation[f]))
            pose_reset(s, f);
        frame->shift_px = frame->is_fixed ? 0.0 : frame->shift_px;
    }
    mem_free(validation);
}

/* Robust cost of each held-out track with all frames where they are now and offsets fitted to that. */
static void costs_now(struct pose_solver *s, struct parallel *pool, double *cost) {
    bool *is_fixed = mem_array(s->frames + 1, sizeof *is_fixed);
    for (size_t f = 0; f < s->frames; f++) {
        is_fixed[f] = s->frame[f].is_fixed;
        s->frame[f].is_fixed = true;
    }
    run_rounds(s, 0, 2, pool); /* offsets only: all frames are fixed */
    for (size_t f = 0; f < s->frames; f++)
        s->frame[f].is_fixed = is_fixed[f];
    for (size_t i = 0; i < s->track_count; i += POSE_HELD_OUT_EVERY) {
        const struct pose_observation *observation = s->observation + i * POSE_OBSERVATIONS_MAX;
        double consensus, weight[POSE_OBSERVATIONS_MAX], count = 0.0, *sum = &cost[i / POSE_HELD_OUT_EVERY];
        pose_weigh_track(s, i, &consensus, weight);
        *sum = 0.0;
        for (size_t k = 0; k < pose_observation_count(s->track[i]) && isfinite(consensus); k++) {
            if (!isfinite(observation[k].value))
                continue;
            *sum +=
                pose_robust_cost((double)observation[k].value - s->x[observation[k].offset] - consensus, COMMON_SCALE);
            count += 1.0;
        }
        *sum = count > 0.0 ? *sum / count : NAN;
    }
    mem_free(is_fixed);
}

static struct validation compare(const double *before, const double *now, size_t count) {
    struct validation v = {0};
    for (size_t i = 0; i < count; i++) {
        if (!isfinite(before[i]) || !isfinite(now[i]))
            continue;
        validation_add(&v, before[i], now[i]);
    }
    return v;
}

/* Whether all photographs together agree significantly better than before. */
static bool all_improved(const double *before, const double *now, size_t count) {
    struct validation v = compare(before, now, count);
    return pose_is_improved(&v);
}

/* --- drift ------------------------------------------------------------------------------------ */

/* All frames as they were at first, free to move. One without observations gets the others' depth, by which its
 * translation counts in pixels. */
static void free_all(struct pose_solver *s) {
    double depth_m = 0.0, count = 0.0;
    for (size_t f = 0; f < s->frames; f++) {
        depth_m += s->frame[f].depth_m;
        count += s->frame[f].depth_m > 0.0;
    }
    for (size_t f = 0; f < s->frames; f++) {
        pose_reset(s, f);
        s->frame[f].is_fixed = false;
        s->frame[f].depth_m = s->frame[f].depth_m > 0.0 ? s->frame[f].depth_m : depth_m / count;
    }
}

/* Finds all poses anew, coarse to fine, each held to its neighbours' corrections. */
static void follow_walk(struct pose_solver *s, int coarsest, struct parallel *pool) {
    free_all(s);
    s->walk = pose_walk_begin(s);
    run_rounds(s, coarsest, POSE_ROUNDS, pool);
    s->walk.is_learnt = true;
    for (int level = coarsest > 0 ? coarsest - 1 : 0; level >= 0; level--)
        run_rounds(s, level, POSE_ROUNDS, pool);
}

/* Whether the poses that follow a walk drift, and agree better at held-out tracks. */
static bool is_drift(const struct pose_solver *s, const double *before, const double *now, size_t count) {
    struct validation v = compare(before, now, count);
    return pose_walk_roughness(s) < MAX_ROUGHNESS && validation_is_significant(&v, DRIFT_SIGNIFICANCE);
}

/* As shift_of, and by its twist where a frame has no tracks of its own. */
static double shift_along_walk(const struct pose_solver *s, size_t f) {
    const struct pose_frame *frame = &s->frame[f];
    double shift_px = shift_of(s, f, &frame->before, &frame->now), squares = 0.0;
    for (int k = 0; k < POSE_UNKNOWNS; k++)
        squares += frame->total[k] * frame->total[k];
    return shift_px > 0.0 ? shift_px : sqrt(squares);
}

/* Where photographs were surely moved the tracker may drift: then those that are not sure follow their neighbours. */
static void add_drift(struct pose_solver *s, size_t held_out_count, int coarsest, struct parallel *pool) {
    size_t sure_count = 0;
    for (size_t f = 0; f < s->frames; f++)
        sure_count += !s->frame[f].is_fixed;
    if (sure_count < MIN_SURE)
        return;
    double *before = mem_calloc(2 * held_out_count, sizeof *before), *now = before + held_out_count;
    double *x = mem_array(s->unknowns + 1, sizeof *x);
    struct pose_frame *sure = mem_array(s->frames, sizeof *sure);
    memcpy(sure, s->frame, s->frames * sizeof *sure);
    memcpy(x, s->x, s->unknowns * sizeof *x);
    costs_now(s, pool, before);
    follow_walk(s, coarsest, pool);
    costs_now(s, pool, now);
    if (is_drift(s, before, now, held_out_count - 1)) {
        for (size_t f = 0; f < s->frames; f++)
            s->frame[f].shift_px = shift_along_walk(s, f);
    } else {
        memcpy(s->frame, sure, s->frames * sizeof *sure);
        memcpy(s->x, x, s->unknowns * sizeof *x);
        s->walk.is_known = false;
    }
    mem_free(sure);
    mem_free(x);
    mem_free(before);
}

/* --- the whole -------------------------------------------------------------------------------- */

static int coarsest_level(const struct tracks *tracks) {
    int level = 0;
    for (size_t f = 0; f < tracks->views->train_count; f++) {
        while (level + 1 < PYRAMID_LEVELS && tracks->pyramid[f].width[level + 1] >= COARSEST_PX)
            level++;
    }
    return level;
}

void calibrate_poses(struct scene *scene, const struct tracks *tracks, struct parallel *pool,
                     struct poses_found *found) {
    struct pose_solver s;
    const struct views *views = tracks->views;
    pose_solver_init(&s, tracks);
    size_t held_out_count = s.track_count / POSE_HELD_OUT_EVERY + 1;
    double *before = mem_calloc(2 * held_out_count, sizeof *before), *now = before + held_out_count;
    costs_now(&s, pool, before);
    for (int level = coarsest_level(tracks); level >= 0; level--)
        run_rounds(&s, level, POSE_ROUNDS, pool);
    costs_now(&s, pool, now);
    bool convincing = all_improved(before, now, held_out_count - 1);
    mem_free(before);
    for (size_t f = 0; f < s.frames && !convincing; f++)
        pose_reset(&s, f);
    judge(&s, pool);
    run_rounds(&s, 0, LAST_ROUNDS, pool);
    judge(&s, pool);
    add_drift(&s, held_out_count, coarsest_level(tracks), pool);
    *found = (struct poses_found){.shift = mem_calloc(s.frames + 1, sizeof *found->shift)};
    double squares = 0.0;
    for (size_t f = 0; f < s.frames; f++) {
        const struct pose_frame *frame = &s.frame[f];
        found->shift[f] = (float)frame->shift_px;
        if (frame->is_fixed)
            continue;
        scene->photograph[views->train[f]].camera = frame->now;
        squares += frame->shift_px * frame->shift_px;
        found->moved_count++;
    }
    found->shift_px = found->moved_count ? sqrt(squares / (double)found->moved_count) : 0.0;
    if (found->moved_count > 0)
        found->held_out_moved_count =
            held_out_poses_align(scene, &s, coarsest_level(tracks), pool, &found->held_out_shift_px);
    pose_solver_release(&s);
}

void poses_found_release(struct poses_found *found) {
    mem_free(found->shift);
    *found = (struct poses_found){0};
}
