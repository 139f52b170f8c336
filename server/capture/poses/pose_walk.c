/* pose_walk.c -- see pose_walk.h. */
#include "server/capture/poses/pose_walk.h"

#include <string.h>

/* Pixels a step, to start with: with half and twice as much drifting captures end at the same poses. */
#define FIRST_TURN_PX 1.0
#define FIRST_MOVE_PX 0.5
/* Pixels a step: least deviation, a third of the least correction that is applied. */
#define MIN_PX 0.05

static size_t place_of(const struct pose_solver *s, size_t f) { return s->tracks->views->train[f]; }

/* --- corrections ------------------------------------------------------------------------------ */

/* out = R^T in, R being the rotation of camera_from_world before any correction. */
static void to_world(const struct pose_frame *frame, const double in[3], double scale, double out[3]) {
    for (int i = 0; i < 3; i++) {
        out[i] = 0.0;
        for (int k = 0; k < 3; k++)
            out[i] += (double)frame->before.camera_from_world.rotation[k][i] * in[k] * scale;
    }
}

static void to_camera(const struct pose_frame *frame, const double in[3], double scale, double out[3]) {
    for (int i = 0; i < 3; i++) {
        out[i] = 0.0;
        for (int k = 0; k < 3; k++)
            out[i] += (double)frame->before.camera_from_world.rotation[i][k] * in[k] * scale;
    }
}

/* Of a pixel of rotation, radians; of translation, metres. */
static double turn_of_px(const struct pose_frame *frame) { return 1.0 / (double)frame->before.fx; }

static double move_of_px(const struct pose_frame *frame) { return frame->depth_m / (double)frame->before.fx; }

static struct pose_drift drift_of_twist(const struct pose_frame *frame, const double twist[POSE_UNKNOWNS]) {
    struct pose_drift drift;
    to_world(frame, twist, turn_of_px(frame), drift.turn);
    to_world(frame, twist + 3, move_of_px(frame), drift.move);
    return drift;
}

struct pose_drift pose_walk_drift(const struct pose_frame *frame) {
    return drift_of_twist(frame, frame->total);
}

void pose_walk_twist(const struct pose_frame *frame, const struct pose_drift *drift, double twist[POSE_UNKNOWNS]) {
    to_camera(frame, drift->turn, 1.0 / turn_of_px(frame), twist);
    to_camera(frame, drift->move, 1.0 / move_of_px(frame), twist + 3);
}

static struct pose_drift mix(const struct pose_drift *a, const struct pose_drift *b, double share) {
    struct pose_drift out;
    for (int k = 0; k < 3; k++) {
        out.turn[k] = (1.0 - share) * a->turn[k] + share * b->turn[k];
        out.move[k] = (1.0 - share) * a->move[k] + share * b->move[k];
    }
    return out;
}

static double square3(const double a[3], const double b[3]) {
    double sum = 0.0;
    for (int k = 0; k < 3; k++)
        sum += (a[k] - b[k]) * (a[k] - b[k]);
    return sum;
}

/* --- the walk --------------------------------------------------------------------------------- */

/* Variances of steps of so many pixels, at the frames' mean focal length and depth. */
static struct pose_walk walk_of(const struct pose_solver *s, double turn_px, double move_px) {
    double turn = 0.0, move = 0.0;
    for (size_t f = 0; f < s->frames; f++) {
        turn += turn_px * turn_of_px(&s->frame[f]) / (double)s->frames;
        move += move_px * move_of_px(&s->frame[f]) / (double)s->frames;
    }
    return (struct pose_walk){.is_known = true, .turn_variance = turn * turn, .move_variance = move * move};
}

struct pose_walk pose_walk_begin(const struct pose_solver *s) {
    return walk_of(s, FIRST_TURN_PX, FIRST_MOVE_PX);
}

struct pose_drift pose_walk_expect(const struct pose_solver *s, size_t at) {
    size_t right = 0;
    while (right + 1 < s->frames && place_of(s, right) < at)
        right++;
    size_t left = right > 0 && place_of(s, right) > at ? right - 1 : right;
    struct pose_drift a = pose_walk_drift(&s->frame[left]), b = pose_walk_drift(&s->frame[right]);
    double steps = (double)(place_of(s, right) - place_of(s, left));
    return left == right ? a : mix(&a, &b, ((double)at - (double)place_of(s, left)) / steps);
}

double pose_walk_roughness(const struct pose_solver *s) {
    struct pose_drift mean = {{0.0}, {0.0}};
    double turn = 0.0, move = 0.0, spread = 0.0, steps = 0.0, count = (double)s->frames;
    for (size_t f = 0; f < s->frames; f++) {
        struct pose_drift here = pose_walk_drift(&s->frame[f]);
        mean = mix(&mean, &here, 1.0 / (double)(f + 1));
        turn += turn_of_px(&s->frame[f]) / count;
        move += move_of_px(&s->frame[f]) / count;
    }
    for (size_t f = 0; f < s->frames; f++) {
        struct pose_drift here = pose_walk_drift(&s->frame[f]);
        spread += square3(here.turn, mean.turn) / (turn * turn) + square3(here.move, mean.move) / (move * move);
        if (f + 1 == s->frames)
            continue;
        struct pose_drift next = pose_walk_drift(&s->frame[f + 1]);
        steps += square3(here.turn, next.turn) / (turn * turn) + square3(here.move, next.move) / (move * move);
    }
    return steps / (count - 1.0) / (2.0 * spread / count);
}

/* Traces of a frame's covariance, radians^2 and metres^2, from the factor of its equations. */
static void variances_of(const struct pose_frame *frame, double (*factor)[POSE_UNKNOWNS], double variance[2]) {
    double turn = turn_of_px(frame), move = move_of_px(frame);
    variance[0] = variance[1] = 0.0;
    for (int k = 0; k < POSE_UNKNOWNS; k++) {
        double column[POSE_UNKNOWNS] = {0.0};
        column[k] = 1.0;
        cholesky_solve(POSE_UNKNOWNS, POSE_UNKNOWNS, &factor[0][0], column);
        variance[k / 3] += column[k] * (k < 3 ? turn * turn : move * move);
    }
}

void pose_walk_update_variances(struct pose_solver *s, double (*block)[POSE_UNKNOWNS][POSE_UNKNOWNS]) {
    struct pose_walk least = walk_of(s, MIN_PX, MIN_PX);
    double turn = 0.0, move = 0.0, before[2] = {0.0, 0.0};
    for (size_t f = 0; f < s->frames; f++) {
        double here[2];
        variances_of(&s->frame[f], block[f], here);
        if (f > 0) {
            struct pose_drift a = pose_walk_drift(&s->frame[f - 1]), b = pose_walk_drift(&s->frame[f]);
            double axes = 3.0 * (double)(place_of(s, f) - place_of(s, f - 1));
            turn += (square3(a.turn, b.turn) + before[0] + here[0]) / axes;
            move += (square3(a.move, b.move) + before[1] + here[1]) / axes;
        }
        memcpy(before, here, sizeof before);
    }
    if (s->frames < 2)
        return;
    s->walk.turn_variance = fmax(turn / (double)(s->frames - 1), least.turn_variance);
    s->walk.move_variance = fmax(move / (double)(s->frames - 1), least.move_variance);
}

/* --- equations -------------------------------------------------------------------------------- */

/* out += P times the twists of `scale` x, or of the frames' totals where x is NULL: frame by frame the differences to
 * both neighbours in order. */
static void add_precision(const struct pose_solver *s, const double *x, double scale, double *out) {
    for (size_t f = 0; f + 1 < s->frames; f++) {
        const struct pose_frame *a = &s->frame[f], *b = a + 1;
        struct pose_drift from = drift_of_twist(a, x ? x + POSE_UNKNOWNS * f : a->total);
        struct pose_drift to = drift_of_twist(b, x ? x + POSE_UNKNOWNS * (f + 1) : b->total);
        double steps = (double)(place_of(s, f + 1) - place_of(s, f)), force[2][3], back[3];
        for (int k = 0; k < 3; k++) {
            force[0][k] = scale * (from.turn[k] - to.turn[k]) / (steps * s->walk.turn_variance);
            force[1][k] = scale * (from.move[k] - to.move[k]) / (steps * s->walk.move_variance);
        }
        for (int half = 0; half < 2; half++) {
            to_camera(a, force[half], half ? move_of_px(a) : turn_of_px(a), back);
            for (int k = 0; k < 3; k++)
                out[POSE_UNKNOWNS * f + (size_t)(3 * half + k)] += back[k];
            to_camera(b, force[half], half ? move_of_px(b) : turn_of_px(b), back);
            for (int k = 0; k < 3; k++)
                out[POSE_UNKNOWNS * (f + 1) + (size_t)(3 * half + k)] -= back[k];
        }
    }
}

void pose_walk_multiply(const struct pose_solver *s, const double *x, double *out) { add_precision(s, x, 1.0, out); }

void pose_walk_pull(const struct pose_solver *s, double *out) { add_precision(s, NULL, -1.0, out); }

void pose_walk_diagonal(const struct pose_solver *s, size_t frame, double diagonal[2]) {
    double links = 0.0, turn = turn_of_px(&s->frame[frame]), move = move_of_px(&s->frame[frame]);
    if (frame > 0)
        links += 1.0 / (double)(place_of(s, frame) - place_of(s, frame - 1));
    if (frame + 1 < s->frames)
        links += 1.0 / (double)(place_of(s, frame + 1) - place_of(s, frame));
    diagonal[0] = links * turn * turn / s->walk.turn_variance;
    diagonal[1] = links * move * move / s->walk.move_variance;
}
