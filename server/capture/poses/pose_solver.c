/* pose_solver.c -- see pose_solver.h: cameras, observations, their derivatives and weights. */
#include "server/capture/poses/pose_solver.h"

#include <string.h>

#include "common/mem.h"
#include "common/ordered.h"

/* Scale of a frame's residuals: so many times the mean absolute residual, which is .8 standard deviations, so that the
 * scale is two of them, as light_fit.h has it; each residual is clamped to so many scales. */
#define SCALE_PER_MEAN 2.5 /* +25 %: no change */
#define RESIDUAL_CLAMP 2.0 /* +25 %: no change */
/* Observations, of the mean residual of all frames, beside a frame's own: as many as it has unknowns of pose and
 * offset, by which its own are made small. */
#define SCALE_PRIOR (POSE_UNKNOWNS + POSE_CELLS)
#define CONSENSUS_ROUNDS 4 /* of reweighting, of the mean of eleven at most; +25 %: no change */
#define MIN_CONSENSUS 3    /* observations: of two that differ neither is known to be wrong; to 4: no change */
/* Of log residuals, until the first round has measured them: 10 %; +25 %: no change. */
#define FIRST_SCALE 0.1

/* A correction is accepted when it lowers the robust cost at held-out tracks by this share, and by so many standard
 * errors. At 6 (a chance of 1e-9) not even 10,000 photographs have one that is moved by noise; errors are not quite
 * independent, since tracks share photographs. */
#define MIN_GAIN 0.02        /* +25 %: no change */
#define MIN_SIGNIFICANCE 6.0 /* +25 %: no change */

/* --- poses ----------------------------------------------------------------------------------- */

static struct pose pose_of(const struct rigid *m) {
    struct pose pose;
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            pose.r[i][j] = (double)m->rotation[i][j];
    pose.t[0] = (double)m->translation.x;
    pose.t[1] = (double)m->translation.y;
    pose.t[2] = (double)m->translation.z;
    return pose;
}

/* exp(w) applied after the pose, then v added (Rodrigues' formula). */
static struct pose twisted(const struct pose *pose, const double w[3], const double v[3]) {
    double angle = sqrt(w[0] * w[0] + w[1] * w[1] + w[2] * w[2]);
    double a = angle > 1e-9 ? sin(angle) / angle : 1.0;
    double b = angle > 1e-9 ? (1.0 - cos(angle)) / (angle * angle) : 0.5;
    const double k[3][3] = {{0, -w[2], w[1]}, {w[2], 0, -w[0]}, {-w[1], w[0], 0}};
    struct pose out;
    for (int i = 0; i < 3; i++) {
        double e[3];
        for (int j = 0; j < 3; j++)
            e[j] = (i == j) + a * k[i][j] + b * (k[i][0] * k[0][j] + k[i][1] * k[1][j] + k[i][2] * k[2][j]);
        for (int j = 0; j < 3; j++)
            out.r[i][j] = e[0] * pose->r[0][j] + e[1] * pose->r[1][j] + e[2] * pose->r[2][j];
        out.t[i] = e[0] * pose->t[0] + e[1] * pose->t[1] + e[2] * pose->t[2] + v[i];
    }
    return out;
}

static void set_pose(struct camera *camera, const struct pose *pose) {
    struct rigid *to = &camera->camera_from_world, *from = &camera->world_from_camera;
    double back[3];
    for (int i = 0; i < 3; i++) {
        for (int j = 0; j < 3; j++) {
            to->rotation[i][j] = (float)pose->r[i][j];
            from->rotation[i][j] = (float)pose->r[j][i];
        }
        back[i] = -(pose->r[0][i] * pose->t[0] + pose->r[1][i] * pose->t[1] + pose->r[2][i] * pose->t[2]);
    }
    to->translation = (vec3){(float)pose->t[0], (float)pose->t[1], (float)pose->t[2]};
    from->translation = (vec3){(float)back[0], (float)back[1], (float)back[2]};
}

static double size_of(const double twist[POSE_UNKNOWNS]) {
    double squares = 0.0;
    for (int k = 0; k < POSE_UNKNOWNS; k++)
        squares += twist[k] * twist[k];
    return sqrt(squares);
}

void pose_frame_init(struct pose_frame *frame, const struct camera *camera) {
    *frame = (struct pose_frame){
        .before = *camera, .now = *camera, .scale = FIRST_SCALE, .pose = pose_of(&camera->camera_from_world)};
}

double pose_squared_shift(const struct camera *a, const struct camera *b, vec3 point) {
    float xa, ya, xb, yb, depth_m;
    if (!camera_project(a, point, &xa, &ya, &depth_m) || !camera_project(b, point, &xb, &yb, &depth_m))
        return NAN;
    return (double)((xa - xb) * (xa - xb) + (ya - yb) * (ya - yb));
}

void pose_twist(struct pose_frame *frame, const double twist[POSE_UNKNOWNS], double most) {
    double size = size_of(twist), length = size > most ? most / size : 1.0;
    double w[3], v[3], focal = (double)frame->now.fx;
    for (int k = 0; k < 3; k++) {
        w[k] = length * twist[k] / focal;
        v[k] = length * twist[3 + k] * frame->depth_m / focal;
    }
    for (int k = 0; k < POSE_UNKNOWNS; k++)
        frame->total[k] += length * twist[k];
    frame->pose = twisted(&frame->pose, w, v);
    set_pose(&frame->now, &frame->pose);
}

void pose_place(struct pose_frame *frame, const struct camera *camera) {
    frame->now = *camera;
    frame->pose = pose_of(&camera->camera_from_world);
}

void pose_move(struct pose_solver *s, size_t f, double most) {
    if (!s->frame[f].is_fixed)
        pose_twist(&s->frame[f], s->x + POSE_UNKNOWNS * f, most);
}

void pose_reset(struct pose_solver *s, size_t f) {
    struct pose_frame *frame = &s->frame[f];
    pose_place(frame, &frame->before);
    memset(frame->total, 0, sizeof frame->total);
    frame->is_fixed = true;
}

/* --- linearisation ------------------------------------------------------------------------------ */

static float value_at(const struct pose_solver *s, uint32_t frame, vec3 point, float *x, float *y) {
    float depth_m;
    if (!camera_project(&s->frame[frame].now, point, x, y, &depth_m))
        return NAN;
    return pyramid_value(&s->tracks->pyramid[frame], s->level, *x, *y);
}

/* An observation's surroundings. */
struct pose_patch {
    float value, along[2]; /* change of the value per `right` and `down` */
    float place[2][2];     /* change of the image position per `right` and `down` */
};

static bool sample_patch(const struct pose_solver *s, const struct track *track, float step, uint32_t frame,
                         struct pose_patch *patch) {
    const vec3 direction[2] = {track->right, track->down};
    float x, y, x2[2], y2[2];
    patch->value = value_at(s, frame, track->point, &x, &y);
    for (int k = 0; k < 2; k++) {
        float a = value_at(s, frame, vec3_mad(track->point, -step, direction[k]), &x2[0], &y2[0]);
        float b = value_at(s, frame, vec3_mad(track->point, step, direction[k]), &x2[1], &y2[1]);
        patch->along[k] = (b - a) / (2.0f * step);
        if (!isfinite(patch->along[k]))
            return false;
        patch->place[k][0] = (x2[1] - x2[0]) / (2.0f * step);
        patch->place[k][1] = (y2[1] - y2[0]) / (2.0f * step);
    }
    return isfinite(patch->value);
}

bool pose_derive(const struct pose_frame *frame, vec3 point, const float g[2], float d[POSE_UNKNOWNS]) {
    const struct camera *camera = &frame->now;
    vec3 p = rigid_point(&camera->camera_from_world, point);
    float x, y, depth_m, by_p[3];
    if (!camera_project(camera, point, &x, &y, &depth_m))
        return false;
    float step = 2e-3f * depth_m, focal = camera->fx;
    for (int k = 0; k < 3; k++) {
        const float *axis = camera->camera_from_world.rotation[k];
        float u, v;
        vec3 moved = vec3_mad(point, step, (vec3){axis[0], axis[1], axis[2]});
        if (!camera_project(camera, moved, &u, &v, &depth_m))
            return false;
        by_p[k] = (g[0] * (u - x) + g[1] * (v - y)) / (step * focal);
    }
    d[0] = by_p[2] * p.y - by_p[1] * p.z;
    d[1] = by_p[0] * p.z - by_p[2] * p.x;
    d[2] = by_p[1] * p.x - by_p[0] * p.y;
    for (int k = 0; k < 3; k++)
        d[3 + k] = by_p[k] * (float)frame->depth_m;
    return true;
}

/* Image gradient g of a value that changes by `along` per `right` and `down` of a track: g . place[i] = along[i]. */
static bool slope_from(const float along[2], const float place[2][2], float g[2]) {
    float det = place[0][0] * place[1][1] - place[0][1] * place[1][0];
    g[0] = (along[0] * place[1][1] - along[1] * place[0][1]) / det;
    g[1] = (along[1] * place[0][0] - along[0] * place[1][0]) / det;
    return fabsf(det) > 1e-3f && isfinite(g[0]) && isfinite(g[1]);
}

static void linearise_track(void *user, size_t index, int thread) {
    (void)thread;
    const struct pose_solver *s = user;
    const struct track *track = s->track[index];
    struct pose_observation *observation = s->observation + index * POSE_OBSERVATIONS_MAX;
    struct pose_patch patch[POSE_OBSERVATIONS_MAX];
    float step = (float)(1 << s->level) / s->tracks->pyramid[s->owner[index]].scale;
    float along[2] = {0.0f, 0.0f}, total = 0.0f;
    for (size_t k = 0; k < pose_observation_count(track); k++) {
        const struct pose_frame *frame = &s->frame[observation[k].frame];
        observation[k].value = NAN;
        if (!sample_patch(s, track, step, observation[k].frame, &patch[k]))
            continue;
        float trust = (float)(1.0 / (frame->scale * frame->scale));
        observation[k].value = patch[k].value;
        along[0] += trust * patch[k].along[0];
        along[1] += trust * patch[k].along[1];
        total += trust;
    }
    for (int i = 0; i < 2; i++)
        s->along[index][i] = total > 0.0f ? along[i] / total : NAN;
    for (size_t k = 0; k < pose_observation_count(track) && total > 0.0f; k++) {
        float g[2];
        if (isfinite(observation[k].value) &&
            (!slope_from(s->along[index], patch[k].place, g) ||
             !pose_derive(&s->frame[observation[k].frame], track->point, g, observation[k].d)))
            observation[k].value = NAN;
    }
}

bool pose_slope(const struct pose_solver *s, size_t track, const struct camera *camera, float g[2]) {
    const struct track *t = s->track[track];
    const vec3 direction[2] = {t->right, t->down};
    float step = (float)(1 << s->level) / s->tracks->pyramid[s->owner[track]].scale, place[2][2];
    for (int k = 0; k < 2; k++) {
        float x[2], y[2], depth_m;
        if (!camera_project(camera, vec3_mad(t->point, -step, direction[k]), &x[0], &y[0], &depth_m) ||
            !camera_project(camera, vec3_mad(t->point, step, direction[k]), &x[1], &y[1], &depth_m))
            return false;
        place[k][0] = (x[1] - x[0]) / (2.0f * step);
        place[k][1] = (y[1] - y[0]) / (2.0f * step);
    }
    return slope_from(s->along[track], (const float(*)[2])place, g);
}

void pose_linearise(struct pose_solver *s) { parallel_for(s->pool, s->track_count, linearise_track, s); }

/* --- weights ---------------------------------------------------------------------------------- */

/* The track's consensus by the given weights, offsets subtracted; false of fewer than three observations. */
static bool track_consensus(const struct pose_solver *s, size_t track, const double *weight, double *consensus) {
    const struct pose_observation *observation = s->observation + track * POSE_OBSERVATIONS_MAX;
    double sum = 0.0, total = 0.0;
    size_t count = 0;
    for (size_t k = 0; k < pose_observation_count(s->track[track]); k++) {
        if (!isfinite(observation[k].value))
            continue;
        sum += weight[k] * ((double)observation[k].value - s->x[observation[k].offset]);
        total += weight[k];
        count++;
    }
    *consensus = sum / total;
    return count >= MIN_CONSENSUS;
}

void pose_weigh_track(const struct pose_solver *s, size_t track, double *consensus,
                      double weight[POSE_OBSERVATIONS_MAX]) {
    const struct pose_observation *observation = s->observation + track * POSE_OBSERVATIONS_MAX;
    size_t count = pose_observation_count(s->track[track]);
    for (size_t k = 0; k < count; k++) {
        double scale = s->frame[observation[k].frame].scale;
        weight[k] = 1.0 / (scale * scale);
    }
    *consensus = NAN;
    for (int round = 0; round < CONSENSUS_ROUNDS; round++) {
        if (!track_consensus(s, track, weight, consensus)) {
            memset(weight, 0, count * sizeof *weight);
            return;
        }
        for (size_t k = 0; k < count; k++) {
            double scale = s->frame[observation[k].frame].scale;
            double e = ((double)observation[k].value - s->x[observation[k].offset] - *consensus) / scale;
            weight[k] = isfinite(e) ? 1.0 / ((1.0 + e * e) * scale * scale) : 0.0;
        }
    }
}

/* Sums of the frames' residuals. */
struct reweighting {
    struct pose_solver *solver;
    double *sum, *count; /* [frames] */
};

/* Weighs a track's observations; their absolute residuals, NAN where there is none, into the result. An observation has
 * its share in the consensus: of the variance of its error only 1 - share is left in the residual, which is scaled up
 * to it. Else a frame that happens to agree is trusted more, makes up the consensus by itself, and agrees all the
 * more. */
static void weigh_observations(void *user, size_t track, void *result) {
    const struct reweighting *r = user;
    struct pose_solver *s = r->solver;
    struct pose_observation *observation = s->observation + track * POSE_OBSERVATIONS_MAX;
    double consensus, weight[POSE_OBSERVATIONS_MAX], total = 0.0, *residual = result;
    pose_weigh_track(s, track, &consensus, weight);
    for (size_t k = 0; k < pose_observation_count(s->track[track]); k++)
        total += weight[k];
    for (size_t k = 0; k < pose_observation_count(s->track[track]); k++) {
        observation[k].weight = pose_is_held_out(track) ? 0.0f : (float)weight[k];
        residual[k] = weight[k] <= 0.0 ? (double)NAN
                                       : fabs((double)observation[k].value - s->x[observation[k].offset] - consensus) /
                                             sqrt(1.0 - weight[k] / total);
    }
}

static void add_residuals(void *user, size_t track, const void *result) {
    const struct reweighting *r = user;
    const struct pose_solver *s = r->solver;
    const struct pose_observation *observation = s->observation + track * POSE_OBSERVATIONS_MAX;
    const double *residual = result;
    for (size_t k = 0; k < pose_observation_count(s->track[track]); k++) {
        if (isnan(residual[k]))
            continue;
        uint32_t f = observation[k].frame;
        r->sum[f] += fmin(residual[k], RESIDUAL_CLAMP * s->frame[f].scale);
        r->count[f] += 1.0;
    }
}

void pose_reweight(struct pose_solver *s) {
    double *sum = mem_calloc(2 * s->frames + 1, sizeof *sum), *count = sum + s->frames;
    struct reweighting r = {s, sum, count};
    double all = 0.0, all_count = 0.0;
    ordered_for(s->pool, s->track_count, POSE_OBSERVATIONS_MAX * sizeof(double), weigh_observations, add_residuals, &r);
    for (size_t f = 0; f < s->frames; f++) {
        all += sum[f];
        all_count += count[f];
    }
    for (size_t f = 0; f < s->frames; f++) {
        double mean = (sum[f] + SCALE_PRIOR * all / fmax(all_count, 1.0)) / (count[f] + SCALE_PRIOR);
        if (count[f] > 0.0)
            s->frame[f].scale = fmax(POSE_MIN_SCALE, SCALE_PER_MEAN * mean);
    }
    mem_free(sum);
}

bool pose_is_improved(const struct validation *v) {
    return v->count >= POSE_MIN_OBSERVATIONS / POSE_HELD_OUT_EVERY && validation_is_significant(v, MIN_SIGNIFICANCE) &&
           v->saved > MIN_GAIN * v->total;
}

/* --- the whole ---------------------------------------------------------------------------- */

static void init_observations(struct pose_solver *s, size_t index) {
    const struct track *track = s->track[index];
    for (size_t k = 0; k < pose_observation_count(track); k++) {
        uint32_t f = k == 0 ? s->owner[index] : track->other[k - 1];
        struct pose_frame *frame = &s->frame[f];
        float x = 0.0f, y = 0.0f, depth_m = 0.0f;
        camera_project(&frame->before, track->point, &x, &y, &depth_m);
        size_t column = (size_t)(clampf(x / (float)frame->before.width, 0.0f, 0.999f) * POSE_CELL_COLUMNS);
        size_t row = (size_t)(clampf(y / (float)frame->before.height, 0.0f, 0.999f) * POSE_CELL_ROWS);
        size_t offset = POSE_UNKNOWNS * s->frames + f * POSE_CELLS + row * POSE_CELL_COLUMNS + column;
        s->observation[index * POSE_OBSERVATIONS_MAX + k] =
            (struct pose_observation){.frame = f, .offset = (uint32_t)offset};
        frame->depth_m += (double)depth_m;
        frame->observation_count++;
    }
}

/* Lists the observations of each frame. */
static void sort_by_frame(struct pose_solver *s) {
    s->first_of_frame = mem_calloc(s->frames + 1, sizeof *s->first_of_frame);
    for (size_t t = 0; t < s->track_count; t++)
        for (size_t k = 0; k < pose_observation_count(s->track[t]) && !pose_is_held_out(t); k++)
            s->first_of_frame[s->observation[t * POSE_OBSERVATIONS_MAX + k].frame + 1]++;
    for (size_t f = 0; f < s->frames; f++)
        s->first_of_frame[f + 1] += s->first_of_frame[f];
    size_t *next = mem_array(s->frames + 1, sizeof *next);
    memcpy(next, s->first_of_frame, s->frames * sizeof *next);
    s->of_frame = mem_array(s->first_of_frame[s->frames] + 1, sizeof *s->of_frame);
    s->lever = mem_array(s->first_of_frame[s->frames] + 1, sizeof *s->lever);
    s->pull = mem_array(s->first_of_frame[s->frames] + 1, sizeof *s->pull);
    s->place = mem_array(s->track_count * POSE_OBSERVATIONS_MAX + 1, sizeof *s->place);
    for (size_t t = 0; t < s->track_count; t++) {
        for (size_t k = 0; k < pose_observation_count(s->track[t]) && !pose_is_held_out(t); k++) {
            size_t i = t * POSE_OBSERVATIONS_MAX + k;
            s->place[i] = (uint32_t)next[s->observation[i].frame]++;
            s->of_frame[s->place[i]] = (uint32_t)i;
        }
    }
    mem_free(next);
}

void pose_solver_init(struct pose_solver *s, const struct tracks *tracks, struct parallel *pool) {
    const struct views *views = tracks->views;
    *s = (struct pose_solver){.tracks = tracks, .pool = pool, .frames = views->train_count};
    s->unknowns = (POSE_UNKNOWNS + POSE_CELLS) * s->frames;
    s->frame = mem_calloc(s->frames + 1, sizeof *s->frame);
    s->x = mem_calloc(s->unknowns + 1, sizeof *s->x);
    s->track = mem_array(s->frames * tracks->capacity + 1, sizeof *s->track);
    s->owner = mem_array(s->frames * tracks->capacity + 1, sizeof *s->owner);
    for (size_t f = 0; f < s->frames; f++) {
        pose_frame_init(&s->frame[f], &views->scene->photograph[views->train[f]].camera);
        for (size_t i = 0; i < tracks->count[f]; i++) {
            s->owner[s->track_count] = (uint32_t)f;
            s->track[s->track_count++] = &tracks->track[f * tracks->capacity + i];
        }
    }
    s->observation = mem_calloc(s->track_count * POSE_OBSERVATIONS_MAX + 1, sizeof *s->observation);
    s->along = mem_calloc(s->track_count + 1, sizeof *s->along);
    for (size_t i = 0; i < s->track_count; i++)
        init_observations(s, i);
    sort_by_frame(s);
    for (size_t f = 0; f < s->frames; f++) {
        s->frame[f].depth_m /= fmax(1.0, (double)s->frame[f].observation_count);
        s->frame[f].is_fixed = s->frame[f].observation_count < POSE_MIN_OBSERVATIONS;
    }
}

void pose_solver_release(struct pose_solver *s) {
    mem_free(s->frame);
    mem_free(s->x);
    mem_free(s->track);
    mem_free(s->owner);
    mem_free(s->observation);
    mem_free(s->first_of_frame);
    mem_free(s->of_frame);
    mem_free(s->place);
    mem_free(s->lever);
    mem_free(s->pull);
    mem_free(s->along);
}
