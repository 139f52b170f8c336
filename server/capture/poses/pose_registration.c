/* pose_registration.c -- see pose_registration.h. */
#include "server/capture/poses/pose_registration.h"

#include <string.h>

#include "common/mem.h"
#include "server/capture/poses/pose_costs.h"
#include "server/capture/poses/pose_solver.h"

/* Of scales and offsets before the first step. */
#define SETTLE_ROUNDS 4
#define ROUNDS 30 /* Gauss-Newton steps, at most; a motion that takes more is not found */
/* Pixels: a step that ends the rounds; about twice as much is left. */
#define STEP_PX 0.005
/* Standard deviations of the prior: what depth cameras' calibrations (.1 degree) and trackers leave, and more. It
 * decides only where the photographs leave a motion open, as along the only plane. */
#define TURN_PRIOR 0.01 /* radians: half a degree */
#define MOVE_PRIOR 0.01 /* of the mean depth: 3 cm at 3 m */
/* Of the chi-square's root: the chance of six errors is one in a thousand. Held-out tracks judge once more. */
#define MIN_DEVIATIONS 4.74
/* Least response, by which steps shorten: with less, ROUNDS do not find a motion. Decides only where the motion is too
 * near 0 to tell the response. */
#define MIN_RESPONSE 0.1
/* Places: cubes of a sixth of the tracks' extent, wider than the errors of a mesh are alike. */
#define PLACES 6

struct motion_system {
    struct pose_solver *solver;
    double depth_m;                   /* mean over the frames */
    double *x;                        /* [POSE_UNKNOWNS + 1][unknowns] of pose_profile; owned */
    double *pull;                     /* [POSE_UNKNOWNS + 1][observations] likewise; owned */
    double (*cluster)[POSE_UNKNOWNS]; /* [frames + places] sums of scores; owned */
    double information[POSE_UNKNOWNS][POSE_UNKNOWNS], gradient[POSE_UNKNOWNS];
    double first[POSE_UNKNOWNS]; /* the gradient where the bundle tells the cameras */
    double last[POSE_UNKNOWNS];  /* the step before, as the equations have it, and the factor by which it was taken */
    double factor;
};

/* --- the motion -------------------------------------------------------------------------------- */

/* Rotation by a vector (Rodrigues' formula). */
static void rotation_of(const double w[3], double r[3][3]) {
    double angle = sqrt(w[0] * w[0] + w[1] * w[1] + w[2] * w[2]);
    double a = angle > 1e-9 ? sin(angle) / angle : 1.0;
    double b = angle > 1e-9 ? (1.0 - cos(angle)) / (angle * angle) : 0.5;
    const double k[3][3] = {{0, -w[2], w[1]}, {w[2], 0, -w[0]}, {-w[1], w[0], 0}};
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            r[i][j] = (i == j) + a * k[i][j] + b * (k[i][0] * k[0][j] + k[i][1] * k[1][j] + k[i][2] * k[2][j]);
}

void pose_registration_move(const struct pose_registration *registration, struct camera *camera) {
    const struct rigid *m = &camera->world_from_camera;
    const vec3 c = registration->centre;
    const double centre[3] = {(double)c.x, (double)c.y, (double)c.z};
    const double from[3] = {(double)m->translation.x, (double)m->translation.y, (double)m->translation.z};
    double turn[3][3], to[3];
    struct rigid out;
    rotation_of(registration->turn, turn);
    for (int i = 0; i < 3; i++) {
        to[i] = centre[i] + registration->move[i];
        for (int k = 0; k < 3; k++)
            to[i] += turn[i][k] * (from[k] - centre[k]);
        for (int j = 0; j < 3; j++)
            out.rotation[i][j] =
                (float)(turn[i][0] * (double)m->rotation[0][j] + turn[i][1] * (double)m->rotation[1][j] +
                        turn[i][2] * (double)m->rotation[2][j]);
    }
    out.translation = (vec3){(float)to[0], (float)to[1], (float)to[2]};
    camera->world_from_camera = out;
    camera->camera_from_world = rigid_inverse(&out);
}

/* Puts all frames where the motion moves their first cameras. */
static void place_all(struct pose_solver *s, const struct pose_registration *registration) {
    for (size_t f = 0; f < s->frames; f++) {
        struct camera camera = s->frame[f].before;
        pose_registration_move(registration, &camera);
        pose_place(&s->frame[f], &camera);
    }
}

/* Twists of a frame, pixels, by a radian of turn about each axis of the world, and by a move of the mean depth along
 * each: points move the other way than the camera. */
static void unit_twists(const struct motion_system *system, size_t f, vec3 centre,
                        double twist[POSE_UNKNOWNS][POSE_UNKNOWNS]) {
    const struct pose_frame *frame = &system->solver->frame[f];
    const struct rigid *m = &frame->now.camera_from_world;
    vec3 c = rigid_point(m, centre);
    double focal = (double)frame->now.fx, depth_m = frame->depth_m > 0.0 ? frame->depth_m : system->depth_m;
    for (int k = 0; k < 3; k++) {
        vec3 axis = {m->rotation[0][k], m->rotation[1][k], m->rotation[2][k]};
        vec3 about = vec3_cross(axis, c);
        const float turn[3] = {axis.x, axis.y, axis.z}, move[3] = {about.x, about.y, about.z};
        for (int i = 0; i < 3; i++) {
            twist[k][i] = -focal * (double)turn[i];
            twist[k][3 + i] = focal / depth_m * (double)move[i];
            twist[3 + k][i] = 0.0;
            twist[3 + k][3 + i] = -focal * system->depth_m / depth_m * (double)turn[i];
        }
    }
}

/* --- its equations ------------------------------------------------------------------------------ */

static void add_equations(struct motion_system *system) {
    struct pose_solver *s = system->solver;
    const size_t count = s->first_of_frame[s->frames];
    memset(system->information, 0, sizeof system->information);
    memset(system->gradient, 0, sizeof system->gradient);
    for (size_t f = 0; f < s->frames; f++) {
        for (size_t at = s->first_of_frame[f]; at < s->first_of_frame[f + 1]; at++) {
            const struct pose_lever *lever = &s->lever[at];
            if (!(lever->weight > 0.0f))
                continue;
            double value = (double)s->observation[s->of_frame[at]].value;
            for (size_t i = 0; i < POSE_UNKNOWNS; i++) {
                double derivative = 0.0;
                for (int k = 0; k < POSE_UNKNOWNS; k++)
                    derivative += (double)lever->d[k] * system->x[i * s->unknowns + POSE_UNKNOWNS * f + (size_t)k];
                system->gradient[i] -= system->pull[i * count + at] * value;
                for (size_t j = 0; j < POSE_UNKNOWNS; j++)
                    system->information[j][i] += system->pull[j * count + at] * derivative;
            }
        }
    }
}

/* Linearised where the frames are, with the prior of a motion of so much already. */
static void linearise(struct motion_system *system, vec3 centre, const double motion[POSE_UNKNOWNS]) {
    struct pose_solver *s = system->solver;
    pose_linearise(s);
    pose_reweight(s);
    for (size_t f = 0; f < s->frames; f++) {
        double twist[POSE_UNKNOWNS][POSE_UNKNOWNS];
        unit_twists(system, f, centre, twist);
        for (size_t k = 0; k < POSE_UNKNOWNS; k++)
            memcpy(system->x + k * s->unknowns + POSE_UNKNOWNS * f, twist[k], sizeof twist[k]);
    }
    pose_profile(s, system->x, system->pull);
    add_equations(system);
    for (int k = 0; k < POSE_UNKNOWNS; k++) {
        double prior = k < 3 ? TURN_PRIOR : MOVE_PRIOR;
        system->information[k][k] += 1.0 / (prior * prior);
        system->gradient[k] -= motion[k] / (prior * prior);
    }
}

/* The offsets that follow the step. */
static void step_offsets(struct motion_system *system, const double step[POSE_UNKNOWNS]) {
    struct pose_solver *s = system->solver;
    for (size_t i = POSE_UNKNOWNS * s->frames; i < s->unknowns; i++) {
        s->x[i] = -system->x[POSE_UNKNOWNS * s->unknowns + i];
        for (size_t k = 0; k < POSE_UNKNOWNS; k++)
            s->x[i] += step[k] * system->x[k * s->unknowns + i];
    }
}

/* --- its errors --------------------------------------------------------------------------------- */

static size_t place_of(const struct pose_solver *s, size_t track, vec3 low, float size) {
    vec3 p = vec3_scale(vec3_sub(s->track[track]->point, low), 1.0f / size);
    return ((size_t)p.x * PLACES + (size_t)p.y) * PLACES + (size_t)p.z;
}

/* Sums of the scores by frames and by places. */
static void add_clusters(struct motion_system *system) {
    const struct pose_solver *s = system->solver;
    const size_t count = s->first_of_frame[s->frames];
    vec3 low = {INFINITY, INFINITY, INFINITY}, high = {-INFINITY, -INFINITY, -INFINITY};
    for (size_t t = 0; t < s->track_count; t++) {
        vec3 p = s->track[t]->point;
        low = (vec3){fminf(low.x, p.x), fminf(low.y, p.y), fminf(low.z, p.z)};
        high = (vec3){fmaxf(high.x, p.x), fmaxf(high.y, p.y), fmaxf(high.z, p.z)};
    }
    float extent_m = fmaxf(high.x - low.x, fmaxf(high.y - low.y, high.z - low.z));
    float size = 1.001f / PLACES * fmaxf(extent_m, 1e-6f);
    for (size_t f = 0; f < s->frames; f++) {
        for (size_t at = s->first_of_frame[f]; at < s->first_of_frame[f + 1]; at++) {
            double weight = (double)s->lever[at].weight;
            if (!(weight > 0.0))
                continue;
            size_t place = s->frames + place_of(s, s->of_frame[at] / POSE_OBSERVATIONS_MAX, low, size);
            double residual = system->pull[POSE_UNKNOWNS * count + at] / weight;
            for (size_t k = 0; k < POSE_UNKNOWNS; k++) {
                system->cluster[f][k] += system->pull[k * count + at] * residual;
                system->cluster[place][k] += system->pull[k * count + at] * residual;
            }
        }
    }
}

/* Covariance of the motion from the factor of its equations. */
static void covariance_of(struct motion_system *system, double covariance[POSE_UNKNOWNS][POSE_UNKNOWNS]) {
    size_t clusters = system->solver->frames + PLACES * PLACES * PLACES;
    add_clusters(system);
    memset(covariance, 0, sizeof(double[POSE_UNKNOWNS][POSE_UNKNOWNS]));
    for (size_t c = 0; c < clusters; c++) {
        double *effect = system->cluster[c];
        cholesky_solve(POSE_UNKNOWNS, POSE_UNKNOWNS, &system->information[0][0], effect);
        for (int i = 0; i < POSE_UNKNOWNS; i++)
            for (int j = 0; j < POSE_UNKNOWNS; j++)
                covariance[i][j] += effect[i] * effect[j];
    }
}

/* Root of the score test's chi-square; 0 where errors are unknown. `covariance`: covariance_of. The response drops out
 * of it: the gradient's covariance is that of the motion between two factors of the information. */
static double deviations_of(const struct motion_system *system, double covariance[POSE_UNKNOWNS][POSE_UNKNOWNS]) {
    double factor[POSE_UNKNOWNS][POSE_UNKNOWNS], step[POSE_UNKNOWNS], scaled[POSE_UNKNOWNS], square = 0.0;
    memcpy(factor, covariance, sizeof factor);
    memcpy(step, system->first, sizeof step);
    if (!cholesky_factor(POSE_UNKNOWNS, POSE_UNKNOWNS, &factor[0][0]))
        return 0.0;
    cholesky_solve(POSE_UNKNOWNS, POSE_UNKNOWNS, &system->information[0][0], step);
    memcpy(scaled, step, sizeof scaled);
    cholesky_solve(POSE_UNKNOWNS, POSE_UNKNOWNS, &factor[0][0], scaled);
    for (int k = 0; k < POSE_UNKNOWNS; k++)
        square += scaled[k] * step[k];
    return sqrt(square);
}

/* Share of the gradient's change that the equations foretell, along the motion, at the end of which it is 0. */
static double response_of(const struct motion_system *system, const double motion[POSE_UNKNOWNS]) {
    double changed = 0.0, foretold = 0.0;
    for (int j = 0; j < POSE_UNKNOWNS; j++) {
        double column = 0.0; /* of the factor, times the motion */
        for (int i = j; i < POSE_UNKNOWNS; i++)
            column += system->information[i][j] * motion[i];
        foretold += column * column;
        changed += system->first[j] * motion[j];
    }
    return foretold > 0.0 ? fmin(fmax(changed / foretold, MIN_RESPONSE), 1.0) : MIN_RESPONSE;
}

static double shift_of(const struct pose_solver *s) {
    double squares = 0.0, count = 0.0;
    for (size_t t = 0; t < s->track_count; t++) {
        const struct pose_frame *frame = &s->frame[s->owner[t]];
        double square = pose_squared_shift(&frame->before, &frame->now, s->track[t]->point);
        if (isnan(square))
            continue;
        squares += square;
        count += 1.0;
    }
    return count > 0.0 ? sqrt(squares / count) : 0.0;
}

/* --- the whole ---------------------------------------------------------------------------------- */

static void system_init(struct motion_system *system, struct pose_solver *s, vec3 *centre) {
    *system = (struct motion_system){.solver = s};
    *centre = (vec3){0.0f, 0.0f, 0.0f};
    for (size_t f = 0; f < s->frames; f++) {
        *centre = vec3_mad(*centre, 1.0f / (float)s->frames, camera_origin(&s->frame[f].before));
        system->depth_m += s->frame[f].depth_m / (double)s->frames;
    }
    system->x = mem_calloc((POSE_UNKNOWNS + 1) * s->unknowns + 1, sizeof *system->x);
    system->pull = mem_array((POSE_UNKNOWNS + 1) * s->first_of_frame[s->frames] + 1, sizeof *system->pull);
    system->cluster = mem_calloc(s->frames + PLACES * PLACES * PLACES, sizeof *system->cluster);
}

static void system_release(struct motion_system *system) {
    mem_free(system->x);
    mem_free(system->pull);
    mem_free(system->cluster);
}

static void set_motion(struct pose_registration *registration, const double motion[POSE_UNKNOWNS], double depth_m) {
    for (int k = 0; k < 3; k++) {
        registration->turn[k] = motion[k];
        registration->move[k] = motion[3 + k] * depth_m;
    }
}

void pose_registration_add(struct pose_registration *registration, const struct pose_registration *rest) {
    for (int k = 0; k < 3; k++) {
        registration->turn[k] += rest->turn[k];
        registration->move[k] += rest->move[k];
    }
}

/* Scales of the frames where the bundle tells the cameras, and what pulls at the motion there by them: the first of a
 * frame's is a guess. */
static void settle(struct motion_system *system, vec3 centre) {
    const double none[POSE_UNKNOWNS] = {0.0};
    for (int round = 0; round < SETTLE_ROUNDS; round++) {
        linearise(system, centre, none);
        memcpy(system->first, system->gradient, sizeof system->first);
        step_offsets(system, none);
    }
}

/* Factor of a step: the gradient changes by a part of what the equations foretell, so that steps fall short; two of
 * them tell by how much (Irons & Tuck 1969, A version of the Aitken accelerator for computer iteration). */
static double factor_of(struct motion_system *system, const double right[POSE_UNKNOWNS]) {
    double change = 0.0, square = 0.0;
    for (int k = 0; k < POSE_UNKNOWNS; k++) {
        double differs = system->last[k] - right[k];
        change += system->last[k] * differs;
        square += differs * differs;
    }
    if (system->factor > 0.0 && square > 0.0)
        system->factor = fmin(fmax(system->factor * change / square, 1.0), 1.0 / MIN_RESPONSE);
    else
        system->factor = 1.0;
    memcpy(system->last, right, sizeof system->last);
    return system->factor;
}

/* One step of Gauss-Newton; the largest shift that it makes, pixels. */
static double step(struct motion_system *system, struct pose_registration *registration, double motion[POSE_UNKNOWNS]) {
    struct pose_solver *s = system->solver;
    double squares = 0.0, *right = system->gradient;
    linearise(system, registration->centre, motion);
    if (!cholesky_factor(POSE_UNKNOWNS, POSE_UNKNOWNS, &system->information[0][0]))
        return INFINITY;
    cholesky_solve(POSE_UNKNOWNS, POSE_UNKNOWNS, &system->information[0][0], right);
    double factor = factor_of(system, right);
    for (int k = 0; k < POSE_UNKNOWNS; k++) {
        squares += right[k] * right[k];
        right[k] *= factor;
        motion[k] += right[k];
    }
    step_offsets(system, right);
    set_motion(registration, motion, system->depth_m);
    place_all(s, registration);
    return sqrt(squares) * (double)s->frame[0].now.fx;
}

/* Frames are left where the motion moves them; false where it was not found. */
static bool find(struct pose_solver *s, struct pose_registration *registration) {
    struct motion_system system;
    if (s->track_count == 0)
        return false;
    double motion[POSE_UNKNOWNS] = {0.0}, covariance[POSE_UNKNOWNS][POSE_UNKNOWNS], step_px = INFINITY;
    system_init(&system, s, &registration->centre);
    s->level = 0;
    settle(&system, registration->centre);
    for (int round = 0; round < ROUNDS && step_px > STEP_PX && (round == 0 || isfinite(step_px)); round++)
        step_px = step(&system, registration, motion);
    if (isfinite(step_px)) {
        covariance_of(&system, covariance);
        registration->response = response_of(&system, motion);
        for (int k = 0; k < 3; k++) {
            registration->turn_error[k] = sqrt(covariance[k][k]) / registration->response;
            registration->move_error[k] = sqrt(covariance[3 + k][3 + k]) / registration->response * system.depth_m;
        }
        registration->deviations = deviations_of(&system, covariance);
        registration->shift_px = shift_of(s);
    }
    system_release(&system);
    return step_px <= STEP_PX;
}

bool pose_registration_find(struct scene *scene, const struct tracks *tracks, bool is_rest, struct parallel *pool,
                            struct pose_registration *registration) {
    struct pose_solver s;
    *registration = (struct pose_registration){0};
    pose_solver_init(&s, tracks, pool);
    registration->is_applied =
        find(&s, registration) &&
        (is_rest || (registration->deviations > MIN_DEVIATIONS && registration->shift_px > POSE_MIN_SHIFT_PX));
    for (size_t i = 0; i < scene->photograph_count && registration->is_applied; i++)
        pose_registration_move(registration, &scene->photograph[i].camera);
    pose_solver_release(&s);
    return registration->is_applied;
}

bool pose_registration_agrees(struct pose_registration *registration, const struct tracks *tracks,
                              const struct photograph *told, struct parallel *pool) {
    struct pose_solver now, before; /* each with offsets and scales from the start: rounds lower costs, too */
    pose_solver_init(&now, tracks, pool);
    pose_solver_init(&before, tracks, pool);
    for (size_t f = 0; f < before.frames; f++)
        pose_place(&before.frame[f], &told[tracks->views->train[f]].camera);
    size_t count = pose_costs_count(&now);
    double *cost = mem_calloc(2 * count + 1, sizeof *cost);
    pose_costs(&before, cost);
    pose_costs(&now, cost + count);
    struct validation v = pose_costs_compare(cost, cost + count, count);
    registration->shift_px = shift_of(&before);
    mem_free(cost);
    pose_solver_release(&before);
    pose_solver_release(&now);
    return registration->shift_px > POSE_MIN_SHIFT_PX && validation_is_significant(&v, POSE_COSTS_SIGNIFICANCE);
}
