/* pose_system.c -- pose_solve of pose_solver.h.
 *
 * The L of all tracks are eliminated and the rest is solved by conjugate gradients, as in calibrate_light.c: all twists
 * and offsets at once, since one photograph at a time would hardly move where many are wrong together. What the
 * observations leave open is decided by a prior that grows linearly with the size of a correction, not quadratically:
 * it prefers few photographs moved far to all moved a little. */
#include "server/capture/poses/pose_solver.h"

#include <string.h>

#include "common/mem.h"
#include "server/capture/conjugate.h"
#include "server/capture/poses/pose_walk.h"

/* Standard deviation of the offsets' prior, in logarithms: what is left of vignettes and reflections. */
#define OFFSET_SIGMA 0.3 /* +25 %: no change */
/* pixels: scale of the prior, which is weak: redkitchen's drift is shared by neighbouring frames */
#define PRIOR_PX 1.0 /* +25 %: no change */
/* Pixels: the prior is quadratic below this, about where corrections are not applied. */
#define PRIOR_LEAST_PX 0.2 /* +25 %: no change */
#define CG_STEPS 40        /* of conjugate gradients, at most; +25 %: no change */
#define CG_TOLERANCE 1e-3  /* of the residual's norm, over that of the right-hand side; +25 %: no change */

double pose_prior(const struct pose_frame *frame) {
    double squares = conjugate_dot(frame->total, frame->total, POSE_UNKNOWNS);
    return 1.0 / (PRIOR_PX * fmax(PRIOR_LEAST_PX, sqrt(squares)));
}

/* The same on a frame's own, where a walk may hold it to its neighbours. */
static double own_prior(const struct pose_solver *s, size_t f) {
    return s->walk.is_known ? 0.0 : pose_prior(&s->frame[f]);
}

/* out += A' W (I - M) z for one track; z[] by observation. */
static void scatter(const struct pose_solver *s, size_t track, const double *z, double *out) {
    const struct pose_observation *observation = s->observation + track * POSE_OBSERVATIONS_MAX;
    size_t count = pose_observation_count(s->track[track]);
    double sum = 0.0, weight = 0.0;
    for (size_t k = 0; k < count; k++) {
        if (observation[k].weight > 0.0f) {
            sum += (double)observation[k].weight * z[k];
            weight += (double)observation[k].weight;
        }
    }
    for (size_t k = 0; k < count; k++) {
        if (!(observation[k].weight > 0.0f))
            continue;
        double r = (double)observation[k].weight * (z[k] - sum / weight);
        double *twist = out + POSE_UNKNOWNS * observation[k].frame;
        for (int j = 0; j < POSE_UNKNOWNS; j++)
            twist[j] += r * (double)observation[k].d[j];
        out[observation[k].offset] -= r;
    }
}

static void project(const struct pose_solver *s, double *x) {
    for (size_t f = 0; f < s->frames; f++) {
        if (s->frame[f].is_fixed)
            memset(x + POSE_UNKNOWNS * f, 0, POSE_UNKNOWNS * sizeof *x);
    }
}

/* A factorised 6 x 6 block for each frame's twist, and the diagonal of the offsets. */
struct preconditioner {
    double (*block)[POSE_UNKNOWNS][POSE_UNKNOWNS]; /* [frames] lower Cholesky factors; owned */
    double *diagonal;                              /* [unknowns]; owned */
};

struct twist_system {
    const struct pose_solver *solver;
    double *damping; /* [POSE_UNKNOWNS * frames] added to the diagonal of the twists; owned */
    struct preconditioner preconditioner;
};

static void multiply(const void *user, const double *x, double *out) {
    const struct twist_system *system = user;
    const struct pose_solver *s = system->solver;
    size_t twists = POSE_UNKNOWNS * s->frames;
    for (size_t i = 0; i < s->unknowns; i++)
        out[i] = x[i] * (i < twists ? own_prior(s, i / POSE_UNKNOWNS) + system->damping[i]
                                    : 1.0 / (OFFSET_SIGMA * OFFSET_SIGMA));
    for (size_t t = 0; t < s->track_count; t++) {
        const struct pose_observation *observation = s->observation + t * POSE_OBSERVATIONS_MAX;
        double z[POSE_OBSERVATIONS_MAX];
        if (pose_is_held_out(t))
            continue;
        for (size_t k = 0; k < pose_observation_count(s->track[t]); k++) {
            const double *twist = x + POSE_UNKNOWNS * observation[k].frame;
            z[k] = -x[observation[k].offset];
            for (int j = 0; j < POSE_UNKNOWNS; j++)
                z[k] += (double)observation[k].d[j] * twist[j];
        }
        scatter(s, t, z, out);
    }
    if (s->walk.is_known)
        pose_walk_multiply(s, x, out);
    project(s, out);
}

static void preconditioner_init(struct preconditioner *p, const struct pose_solver *s, double *damping) {
    p->block = mem_calloc(s->frames + 1, sizeof *p->block);
    p->diagonal = mem_calloc(s->unknowns + 1, sizeof *p->diagonal);
    for (size_t t = 0; t < s->track_count; t++) {
        const struct pose_observation *observation = s->observation + t * POSE_OBSERVATIONS_MAX;
        for (size_t k = 0; k < pose_observation_count(s->track[t]); k++) {
            if (!(observation[k].weight > 0.0f))
                continue;
            double w = (double)observation[k].weight, (*a)[POSE_UNKNOWNS] = p->block[observation[k].frame];
            p->diagonal[observation[k].offset] += w;
            for (int i = 0; i < POSE_UNKNOWNS; i++)
                for (int j = 0; j <= i; j++)
                    a[i][j] += w * (double)observation[k].d[i] * (double)observation[k].d[j];
        }
    }
    for (size_t f = 0; f < s->frames; f++) {
        double walk[2] = {0.0, 0.0};
        if (s->walk.is_known)
            pose_walk_diagonal(s, f, walk);
        for (int i = 0; i < POSE_UNKNOWNS; i++) {
            damping[POSE_UNKNOWNS * f + (size_t)i] = POSE_DAMPING * p->block[f][i][i];
            p->block[f][i][i] += own_prior(s, f) + walk[i / 3] + POSE_DAMPING * p->block[f][i][i];
        }
        pose_factor(p->block[f]);
    }
    for (size_t i = POSE_UNKNOWNS * s->frames; i < s->unknowns; i++)
        p->diagonal[i] += 1.0 / (OFFSET_SIGMA * OFFSET_SIGMA);
}

static void preconditioner_release(struct preconditioner *p) {
    mem_free(p->block);
    mem_free(p->diagonal);
}

static void precondition(const void *user, const double *r, double *z) {
    const struct twist_system *system = user;
    const struct pose_solver *s = system->solver;
    const struct preconditioner *p = &system->preconditioner;
    for (size_t f = 0; f < s->frames; f++) {
        double *b = z + POSE_UNKNOWNS * f;
        memcpy(b, r + POSE_UNKNOWNS * f, POSE_UNKNOWNS * sizeof *b);
        cholesky_solve(POSE_UNKNOWNS, POSE_UNKNOWNS, &p->block[f][0][0], b);
    }
    for (size_t i = POSE_UNKNOWNS * s->frames; i < s->unknowns; i++)
        z[i] = r[i] / p->diagonal[i];
    project(s, z);
}

void pose_solve(struct pose_solver *s) {
    size_t n = s->unknowns, twists = POSE_UNKNOWNS * s->frames;
    double *r = mem_calloc(n, sizeof *r), *x = s->x;
    struct twist_system twist = {.solver = s, .damping = mem_calloc(twists, sizeof *twist.damping)};
    const struct conjugate_system system = {n, multiply, precondition, &twist};
    preconditioner_init(&twist.preconditioner, s, twist.damping);
    if (s->walk.is_known && s->walk.is_learnt)
        pose_walk_learn(s, twist.preconditioner.block);
    for (size_t t = 0; t < s->track_count; t++) {
        double y[POSE_OBSERVATIONS_MAX];
        for (size_t k = 0; k < pose_observation_count(s->track[t]); k++)
            y[k] = -(double)s->observation[t * POSE_OBSERVATIONS_MAX + k].value;
        if (!pose_is_held_out(t))
            scatter(s, t, y, r);
    }
    memset(x, 0, twists * sizeof *x);
    for (size_t i = 0; i < twists; i++)
        r[i] -= own_prior(s, i / POSE_UNKNOWNS) * s->frame[i / POSE_UNKNOWNS].total[i % POSE_UNKNOWNS];
    if (s->walk.is_known)
        pose_walk_pull(s, r);
    project(s, r);
    conjugate_residual(&system, x, r);
    double goal = CG_TOLERANCE * CG_TOLERANCE * conjugate_dot(r, r, n);
    conjugate_solve(&system, CG_STEPS, goal, r, x);
    preconditioner_release(&twist.preconditioner);
    mem_free(twist.damping);
    mem_free(r);
}
