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
#define PRIOR_MIN_PX 0.2  /* +25 %: no change */
#define CG_STEPS 20       /* of conjugate gradients, at most: more rounds follow; 40: a phone .01 dB */
#define CG_TOLERANCE 1e-3 /* of the residual's norm, over that of the right-hand side; +25 %: no change */

double pose_prior(const struct pose_frame *frame) {
    double squares = conjugate_dot(frame->total, frame->total, POSE_UNKNOWNS);
    return 1.0 / (PRIOR_PX * fmax(PRIOR_MIN_PX, sqrt(squares)));
}

/* The same on a frame's own, where a walk may hold it to its neighbours. */
static double own_prior(const struct pose_solver *s, size_t f) {
    return s->walk.is_known ? 0.0 : pose_prior(&s->frame[f]);
}

#define CHUNK 64 /* tracks a work item */

/* A product with A' W (I - M): track by track the observations' errors, less their mean, then frame by frame what they
 * pull at. Frames take them in the order of tracks, so that sums do not depend on threads. */
struct product {
    struct pose_solver *solver;
    const double *x; /* error z = A x; NULL: 0 */
    bool has_value;  /* z less the observed value */
    /* The frame's equations beside its observations, into its part of out; NULL: out is added to. */
    void (*start)(const void *user, size_t frame, const double *x, double *out);
    const void *user;
    double *out; /* [unknowns] */
};

static double error_of(const struct product *p, const struct pose_observation *observation) {
    double z = p->has_value ? -(double)observation->value : 0.0;
    if (!p->x)
        return z;
    const double *twist = p->x + POSE_UNKNOWNS * observation->frame;
    z -= p->x[observation->offset];
    for (int j = 0; j < POSE_UNKNOWNS; j++)
        z += (double)observation->d[j] * twist[j];
    return z;
}

static void pull_of_track(const struct product *p, size_t track) {
    const struct pose_solver *s = p->solver;
    const struct pose_observation *observation = s->observation + track * POSE_OBSERVATIONS_MAX;
    const uint32_t *place = s->place + track * POSE_OBSERVATIONS_MAX;
    double error[POSE_OBSERVATIONS_MAX], sum = 0.0, weight = 0.0;
    size_t count = pose_observation_count(s->track[track]);
    for (size_t k = 0; k < count; k++) {
        if (!(observation[k].weight > 0.0f))
            continue;
        error[k] = error_of(p, &observation[k]);
        sum += (double)observation[k].weight * error[k];
        weight += (double)observation[k].weight;
    }
    for (size_t k = 0; k < count; k++)
        if (observation[k].weight > 0.0f)
            s->pull[place[k]] = (double)observation[k].weight * (error[k] - sum / weight);
}

static void pull_of_chunk(void *user, size_t chunk, int thread) {
    (void)thread;
    const struct product *p = user;
    size_t end = (chunk + 1) * CHUNK < p->solver->track_count ? (chunk + 1) * CHUNK : p->solver->track_count;
    for (size_t t = chunk * CHUNK; t < end; t++)
        if (!pose_is_held_out(t))
            pull_of_track(p, t);
}

static void sum_frame(void *user, size_t f, int thread) {
    (void)thread;
    const struct product *p = user;
    const struct pose_solver *s = p->solver;
    double *twist = p->out + POSE_UNKNOWNS * f;
    if (p->start)
        p->start(p->user, f, p->x, p->out);
    for (size_t i = s->first_of_frame[f]; i < s->first_of_frame[f + 1]; i++) {
        const struct pose_lever *lever = &s->lever[i];
        if (!(lever->weight > 0.0f))
            continue;
        for (int j = 0; j < POSE_UNKNOWNS; j++)
            twist[j] += s->pull[i] * (double)lever->d[j];
        p->out[lever->offset] -= s->pull[i];
    }
}

static void multiply_out(struct product *p) {
    struct pose_solver *s = p->solver;
    parallel_for(s->pool, (s->track_count + CHUNK - 1) / CHUNK, pull_of_chunk, p);
    parallel_for(s->pool, s->frames, sum_frame, p);
}

/* A factorised 6 x 6 block for each frame's twist, and the diagonal of the offsets. */
struct preconditioner {
    double (*block)[POSE_UNKNOWNS][POSE_UNKNOWNS]; /* [frames] lower Cholesky factors; owned */
    double *diagonal;                              /* [unknowns]; owned */
};

struct twist_system {
    struct pose_solver *solver;
    bool keeps_twists; /* offsets alone are solved for */
    double *damping;   /* [POSE_UNKNOWNS * frames] added to the diagonal of the twists; owned */
    struct preconditioner preconditioner;
};

static void project(const struct twist_system *system, double *x) {
    const struct pose_solver *s = system->solver;
    for (size_t f = 0; f < s->frames; f++) {
        if (system->keeps_twists || s->frame[f].is_fixed)
            memset(x + POSE_UNKNOWNS * f, 0, POSE_UNKNOWNS * sizeof *x);
    }
}

/* Priors of a frame's twist and of its offsets. */
static void start_frame(const void *user, size_t f, const double *x, double *out) {
    const struct twist_system *system = user;
    const struct pose_solver *s = system->solver;
    size_t twist = POSE_UNKNOWNS * f, offset = POSE_UNKNOWNS * s->frames + POSE_CELLS * f;
    double prior = own_prior(s, f);
    for (size_t i = twist; i < twist + POSE_UNKNOWNS; i++)
        out[i] = x[i] * (prior + system->damping[i]);
    for (size_t i = offset; i < offset + POSE_CELLS; i++)
        out[i] = x[i] * (1.0 / (OFFSET_SIGMA * OFFSET_SIGMA));
}

static void multiply(const void *user, const double *x, double *out) {
    const struct twist_system *system = user;
    struct pose_solver *s = system->solver;
    multiply_out(&(struct product){s, x, false, start_frame, system, out});
    if (s->walk.is_known)
        pose_walk_multiply(s, x, out);
    project(system, out);
}

/* Takes the frame's observations, and adds up its block of the matrix. */
static void take_frame(void *user, size_t f, int thread) {
    (void)thread;
    const struct twist_system *system = user;
    const struct pose_solver *s = system->solver;
    const struct preconditioner *p = &system->preconditioner;
    double(*a)[POSE_UNKNOWNS] = p->block[f];
    for (size_t at = s->first_of_frame[f]; at < s->first_of_frame[f + 1]; at++) {
        const struct pose_observation *observation = &s->observation[s->of_frame[at]];
        struct pose_lever *lever = &s->lever[at];
        lever->weight = observation->weight;
        if (!(observation->weight > 0.0f))
            continue;
        memcpy(lever->d, observation->d, sizeof lever->d);
        lever->offset = observation->offset;
        double w = (double)observation->weight;
        p->diagonal[observation->offset] += w;
        for (int i = 0; i < POSE_UNKNOWNS; i++)
            for (int j = 0; j <= i; j++)
                a[i][j] += w * (double)observation->d[i] * (double)observation->d[j];
    }
}

static void twist_system_init(struct twist_system *system) {
    struct pose_solver *s = system->solver;
    struct preconditioner *p = &system->preconditioner;
    system->damping = mem_calloc(POSE_UNKNOWNS * s->frames + 1, sizeof *system->damping);
    p->block = mem_calloc(s->frames + 1, sizeof *p->block);
    p->diagonal = mem_calloc(s->unknowns + 1, sizeof *p->diagonal);
    parallel_for(s->pool, s->frames, take_frame, system);
    for (size_t f = 0; f < s->frames; f++) {
        double walk[2] = {0.0, 0.0};
        if (s->walk.is_known)
            pose_walk_diagonal(s, f, walk);
        for (int i = 0; i < POSE_UNKNOWNS; i++) {
            system->damping[POSE_UNKNOWNS * f + (size_t)i] = POSE_DAMPING * p->block[f][i][i];
            p->block[f][i][i] += own_prior(s, f) + walk[i / 3] + POSE_DAMPING * p->block[f][i][i];
        }
        pose_factor(p->block[f]);
    }
    for (size_t i = POSE_UNKNOWNS * s->frames; i < s->unknowns; i++)
        p->diagonal[i] += 1.0 / (OFFSET_SIGMA * OFFSET_SIGMA);
}

static void twist_system_release(struct twist_system *system) {
    mem_free(system->preconditioner.block);
    mem_free(system->preconditioner.diagonal);
    mem_free(system->damping);
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
    project(system, z);
}

void pose_solve(struct pose_solver *s) {
    size_t n = s->unknowns, twists = POSE_UNKNOWNS * s->frames;
    double *r = mem_calloc(n, sizeof *r), *x = s->x;
    struct twist_system twist = {.solver = s};
    const struct conjugate_system system = {n, multiply, precondition, &twist};
    twist_system_init(&twist);
    if (s->walk.is_known && s->walk.is_learnt)
        pose_walk_update_variances(s, twist.preconditioner.block);
    multiply_out(&(struct product){.solver = s, .has_value = true, .out = r});
    memset(x, 0, twists * sizeof *x);
    for (size_t i = 0; i < twists; i++)
        r[i] -= own_prior(s, i / POSE_UNKNOWNS) * s->frame[i / POSE_UNKNOWNS].total[i % POSE_UNKNOWNS];
    if (s->walk.is_known)
        pose_walk_pull(s, r);
    project(&twist, r);
    conjugate_residual(&system, x, r);
    double goal = CG_TOLERANCE * CG_TOLERANCE * conjugate_dot(r, r, n);
    conjugate_solve(&system, CG_STEPS, goal, r, x);
    twist_system_release(&twist);
    mem_free(r);
}

/* --- motions that all frames share ---------------------------------------------------------------- */

/* Offsets of x that make the errors least, its twists as they are. In x: a start. */
static void follow(struct twist_system *system, double *x, bool has_value) {
    struct pose_solver *s = system->solver;
    size_t n = s->unknowns, twists = POSE_UNKNOWNS * s->frames;
    double *r = mem_calloc(2 * n + 1, sizeof *r), *fixed = r + n;
    const struct conjugate_system offsets = {n, multiply, precondition, system};
    memcpy(fixed, x, twists * sizeof *fixed);
    memset(x, 0, twists * sizeof *x);
    multiply_out(&(struct product){.solver = s, .x = fixed, .has_value = has_value, .out = r});
    project(system, r);
    for (size_t i = twists; i < n; i++)
        r[i] = -r[i];
    double goal = CG_TOLERANCE * CG_TOLERANCE * conjugate_dot(r, r, n);
    conjugate_residual(&offsets, x, r);
    conjugate_solve(&offsets, CG_STEPS, goal, r, x);
    memcpy(x, fixed, twists * sizeof *x);
    mem_free(r);
}

void pose_profile(struct pose_solver *s, double *x, double *pull) {
    struct twist_system system = {.solver = s, .keeps_twists = true};
    size_t count = s->first_of_frame[s->frames];
    double *out = mem_array(s->unknowns + 1, sizeof *out);
    twist_system_init(&system);
    for (size_t k = 0; k <= POSE_UNKNOWNS; k++) {
        follow(&system, x + k * s->unknowns, k == POSE_UNKNOWNS);
        memset(s->pull, 0, count * sizeof *s->pull);
        multiply_out(
            &(struct product){.solver = s, .x = x + k * s->unknowns, .has_value = k == POSE_UNKNOWNS, .out = out});
        memcpy(pull + k * count, s->pull, count * sizeof *pull);
    }
    twist_system_release(&system);
    mem_free(out);
}
