/* calibrate_poses.c -- see calibrate_poses.h; the equations are pose_solver.h's. */
#include "server/capture/poses/calibrate_poses.h"

#include <math.h>
#include <string.h>

#include "common/mem.h"
#include "common/ordered.h"
#include "server/capture/poses/held_out_poses.h"
#include "server/capture/poses/pose_costs.h"
#include "server/capture/poses/pose_solver.h"
#include "server/capture/poses/pose_walk.h"

/* Steps at the finest level after the first judgement, which put back the photographs that did not gain; the others
 * have had POSE_ROUNDS there. */
#define LAST_ROUNDS 4 /* +25 %: no change */
/* Pixels: least width of a pyramid level that is used. Coarser ones have few gradients for six unknowns, and mislead; a
 * picture of 640 pixels is used from 80 on. */
#define COARSEST_PX 75 /* +25 %: no change */
/* Photographs that are surely moved by themselves, at least, for a drift to be looked for where all together are not
 * surely better: two an unknown of a pose. */
#define MIN_SURE 12
/* Of corrections that follow a walk: independent ones have 1 +- .12 in 72 photographs, drifts of simulated phones
 * .2. */
#define MAX_ROUGHNESS 0.5

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

static size_t free_count(const struct pose_solver *s) {
    size_t count = 0;
    for (size_t f = 0; f < s->frames; f++)
        count += !s->frame[f].is_fixed;
    return count;
}

static void run_rounds(struct pose_solver *s, int level, int rounds) {
    s->level = level;
    if (free_count(s) == 0)
        return;
    for (int round = 0; round < rounds; round++) {
        pose_linearise(s);
        pose_reweight(s);
        pose_solve(s);
        for (size_t f = 0; f < s->frames; f++)
            pose_move(s, f, POSE_STEP_PX * (1 << level) / (double)s->tracks->pyramid[f].scale);
    }
}

/* --- judgement ------------------------------------------------------------------------------------ */

/* Costs of a photograph at a track, by the others' consensus: at its first camera, NAN where there is none, and now. */
struct judged {
    double before, now;
};

static struct judged judge_observation(const struct pose_solver *s, size_t track, size_t k) {
    struct pose_observation *observation = s->observation + track * POSE_OBSERVATIONS_MAX + k;
    const struct pose_frame *frame = &s->frame[observation->frame];
    struct judged none = {(double)NAN, 0.0};
    float x, y, depth_m, value = observation->value;
    double consensus, weight[POSE_OBSERVATIONS_MAX];
    if (!isfinite(value) || !camera_project(&frame->before, s->track[track]->point, &x, &y, &depth_m))
        return none;
    float old = pyramid_value(&s->tracks->pyramid[observation->frame], s->level, x, y);
    observation->value = NAN; /* leaves it out of the consensus */
    pose_weigh_track(s, track, &consensus, weight);
    observation->value = value;
    if (!isfinite(old) || !isfinite(consensus))
        return none;
    return (struct judged){pose_robust_cost((double)old - s->x[observation->offset] - consensus, frame->scale),
                           pose_robust_cost((double)value - s->x[observation->offset] - consensus, frame->scale)};
}

struct frame_validations {
    const struct pose_solver *solver;
    struct validation *of; /* [frames] */
};

static void judge_track(void *user, size_t index, void *result) {
    const struct frame_validations *all = user;
    const struct pose_solver *s = all->solver;
    struct judged *judged = result;
    size_t track = index * POSE_HELD_OUT_EVERY;
    for (size_t k = 0; k < pose_observation_count(s->track[track]); k++)
        judged[k] = judge_observation(s, track, k);
}

static void add_judged(void *user, size_t index, const void *result) {
    const struct frame_validations *all = user;
    const struct pose_solver *s = all->solver;
    const struct judged *judged = result;
    size_t track = index * POSE_HELD_OUT_EVERY;
    for (size_t k = 0; k < pose_observation_count(s->track[track]); k++)
        if (!isnan(judged[k].before))
            validation_add(&all->of[s->observation[track * POSE_OBSERVATIONS_MAX + k].frame], judged[k].before,
                           judged[k].now);
}

static void validate_frames(const struct pose_solver *s, struct validation *validation) {
    struct frame_validations all = {s, validation};
    ordered_for(s->pool, pose_costs_count(s), POSE_OBSERVATIONS_MAX * sizeof(struct judged), judge_track, add_judged,
                &all);
}

/* Resets frames whose correction is small or not significant. */
static void judge(struct pose_solver *s) {
    struct validation *validation = mem_calloc(s->frames + 1, sizeof *validation);
    s->level = 0;
    pose_linearise(s);
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

/* Whether all photographs together agree significantly better than before. */
static bool all_improved(const double *before, const double *now, size_t count) {
    struct validation v = pose_costs_compare(before, now, count);
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
static void follow_walk(struct pose_solver *s, int coarsest) {
    free_all(s);
    s->walk = pose_walk_begin(s);
    run_rounds(s, coarsest, POSE_ROUNDS);
    s->walk.is_learnt = true;
    for (int level = coarsest > 0 ? coarsest - 1 : 0; level >= 0; level--)
        run_rounds(s, level, POSE_ROUNDS);
}

/* Whether the poses that follow a walk drift, and agree better at held-out tracks. */
static bool is_drift(const struct pose_solver *s, const double *before, const double *now, size_t count) {
    struct validation v = pose_costs_compare(before, now, count);
    return pose_walk_roughness(s) < MAX_ROUGHNESS && validation_is_significant(&v, POSE_COSTS_SIGNIFICANCE);
}

/* As shift_of, and by its twist where a frame has no tracks of its own. */
static double shift_along_walk(const struct pose_solver *s, size_t f) {
    const struct pose_frame *frame = &s->frame[f];
    double shift_px = shift_of(s, f, &frame->before, &frame->now), squares = 0.0;
    for (int k = 0; k < POSE_UNKNOWNS; k++)
        squares += frame->total[k] * frame->total[k];
    return shift_px > 0.0 ? shift_px : sqrt(squares);
}

/* Where photographs were surely moved, or all together, the tracker may drift: then those that are not sure follow
 * their neighbours. */
static void add_drift(struct pose_solver *s, bool convincing, size_t held_out_count, int coarsest) {
    if (!convincing && free_count(s) < MIN_SURE)
        return;
    double *before = mem_calloc(2 * held_out_count + 1, sizeof *before), *now = before + held_out_count;
    double *x = mem_array(s->unknowns + 1, sizeof *x);
    struct pose_frame *sure = mem_array(s->frames, sizeof *sure);
    memcpy(sure, s->frame, s->frames * sizeof *sure);
    memcpy(x, s->x, s->unknowns * sizeof *x);
    pose_costs(s, before);
    follow_walk(s, coarsest);
    pose_costs(s, now);
    if (is_drift(s, before, now, held_out_count)) {
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
    pose_solver_init(&s, tracks, pool);
    size_t held_out_count = pose_costs_count(&s);
    double *before = mem_calloc(2 * held_out_count + 1, sizeof *before), *now = before + held_out_count;
    pose_costs(&s, before);
    for (int level = coarsest_level(tracks); level >= 0; level--)
        run_rounds(&s, level, POSE_ROUNDS);
    pose_costs(&s, now);
    bool convincing = all_improved(before, now, held_out_count);
    mem_free(before);
    for (size_t f = 0; f < s.frames && !convincing; f++)
        pose_reset(&s, f);
    judge(&s);
    run_rounds(&s, 0, LAST_ROUNDS);
    judge(&s);
    add_drift(&s, convincing, held_out_count, coarsest_level(tracks));
    *found = (struct poses_found){.is_drift = s.walk.is_known, .shift = mem_calloc(s.frames + 1, sizeof *found->shift)};
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
