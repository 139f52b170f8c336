/* calibrate_poses.c -- see calibrate_poses.h; the equations are pose_solver.h's. */
#include "server/capture/calibrate_poses.h"

#include <math.h>
#include <string.h>

#include "common/mem.h"
#include "server/capture/pose_guests.h"
#include "server/capture/pose_solver.h"

#define LAST_ROUNDS 4        /* after the first judgement, at the finest level */
#define COARSEST_PX 75       /* width of a picture below which it tells more lies than truth */
#define COMMON_SCALE 0.05    /* for comparing the agreement of all photographs */

/* Root of the mean squared distance, in pixels, between the places of a frame's own tracks in two
 * cameras. */
static double shift_of(const struct pose_solver *s, size_t f, const struct camera *a,
                       const struct camera *b) {
    double squares = 0.0;
    size_t count = 0;
    for (size_t i = 0; i < s->tracks->count[f]; i++) {
        double square = pose_square_between(a, b, s->tracks->track[f * s->tracks->capacity + i].point);
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

static void collect_evidence(const struct pose_solver *s, struct pose_evidence *evidence) {
    for (size_t i = 0; i < s->track_count; i += POSE_HELD_BACK_EVERY) {
        struct pose_sight *sight = s->sight + i * POSE_SIGHTS_MAX;
        for (size_t k = 0; k < pose_sight_count(s->track[i]); k++) {
            const struct pose_frame *frame = &s->frame[sight[k].frame];
            float x, y, depth_m, value = sight[k].value;
            double look, weight[POSE_SIGHTS_MAX];
            if (!isfinite(value) || !camera_project(&frame->before, s->track[i]->point, &x, &y, &depth_m))
                continue;
            float old = pyramid_value(&s->tracks->pyramid[sight[k].frame], s->level, x, y);
            sight[k].value = NAN; /* what the others agree on */
            pose_weigh_track(s, i, &look, weight);
            sight[k].value = value;
            if (!isfinite(old) || !isfinite(look))
                continue;
            double cost = pose_robust((double)old - s->x[sight[k].offset] - look, frame->scale);
            pose_evidence_add(&evidence[sight[k].frame], cost,
                              pose_robust((double)value - s->x[sight[k].offset] - look, frame->scale));
        }
    }
}

/* Puts back where they were the frames whose correction is small or does not convince. */
static void judge(struct pose_solver *s, struct parallel *pool) {
    struct pose_evidence *evidence = mem_calloc(s->frames + 1, sizeof *evidence);
    s->level = 0;
    pose_linearise(s, pool);
    pose_reweight(s);
    collect_evidence(s, evidence);
    for (size_t f = 0; f < s->frames; f++) {
        struct pose_frame *frame = &s->frame[f];
        frame->shift_px = frame->stays ? 0.0 : shift_of(s, f, &frame->before, &frame->now);
        if (frame->shift_px < POSE_LEAST_SHIFT_PX || !pose_convinces(&evidence[f]))
            pose_put_back(s, f);
        frame->shift_px = frame->stays ? 0.0 : frame->shift_px;
    }
    mem_free(evidence);
}

/* Robust cost of each held-back track with all frames where they are now, offsets fitted to that. */
static void costs_now(struct pose_solver *s, struct parallel *pool, double *cost) {
    bool *stays = mem_array(s->frames + 1, sizeof *stays);
    for (size_t f = 0; f < s->frames; f++) {
        stays[f] = s->frame[f].stays;
        s->frame[f].stays = true;
    }
    run_rounds(s, 0, 2, pool); /* of offsets only */
    for (size_t f = 0; f < s->frames; f++)
        s->frame[f].stays = stays[f];
    for (size_t i = 0; i < s->track_count; i += POSE_HELD_BACK_EVERY) {
        const struct pose_sight *sight = s->sight + i * POSE_SIGHTS_MAX;
        double look, weight[POSE_SIGHTS_MAX], count = 0.0, *sum = &cost[i / POSE_HELD_BACK_EVERY];
        pose_weigh_track(s, i, &look, weight);
        *sum = 0.0;
        for (size_t k = 0; k < pose_sight_count(s->track[i]) && isfinite(look); k++) {
            if (!isfinite(sight[k].value))
                continue;
            *sum += pose_robust((double)sight[k].value - s->x[sight[k].offset] - look, COMMON_SCALE);
            count += 1.0;
        }
        *sum = count > 0.0 ? *sum / count : NAN;
    }
    mem_free(stays);
}

/* Whether all photographs together agree clearly better than at first. */
static bool all_convince(const double *before, const double *now, size_t count) {
    struct pose_evidence e = {0};
    for (size_t i = 0; i < count; i++) {
        if (!isfinite(before[i]) || !isfinite(now[i]))
            continue;
        pose_evidence_add(&e, before[i], now[i]);
    }
    return pose_convinces(&e);
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
    size_t held_back = s.track_count / POSE_HELD_BACK_EVERY + 1;
    double *before = mem_calloc(2 * held_back, sizeof *before), *now = before + held_back;
    costs_now(&s, pool, before);
    for (int level = coarsest_level(tracks); level >= 0; level--)
        run_rounds(&s, level, POSE_ROUNDS, pool);
    costs_now(&s, pool, now);
    bool convincing = all_convince(before, now, held_back - 1);
    mem_free(before);
    for (size_t f = 0; f < s.frames && !convincing; f++)
        pose_put_back(&s, f);
    judge(&s, pool);
    run_rounds(&s, 0, LAST_ROUNDS, pool);
    judge(&s, pool);
    *found = (struct poses_found){.shift = mem_calloc(s.frames + 1, sizeof *found->shift)};
    double squares = 0.0;
    for (size_t f = 0; f < s.frames; f++) {
        const struct pose_frame *frame = &s.frame[f];
        found->shift[f] = (float)frame->shift_px;
        if (frame->stays)
            continue;
        scene->photograph[views->train[f]].camera = frame->now;
        squares += frame->shift_px * frame->shift_px;
        found->moved_count++;
    }
    found->shift_px = found->moved_count ? sqrt(squares / (double)found->moved_count) : 0.0;
    if (found->moved_count > 0)
        found->guests_moved = pose_guests(scene, &s, coarsest_level(tracks), pool, &found->guests_shift_px);
    pose_solver_release(&s);
}

void poses_found_release(struct poses_found *found) {
    mem_free(found->shift);
    *found = (struct poses_found){0};
}
