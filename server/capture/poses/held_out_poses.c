/* held_out_poses.c -- see held_out_poses.h. */
#include "server/capture/poses/held_out_poses.h"

#include <math.h>

#include "common/mem.h"
#include "common/quantile.h"
#include "server/capture/poses/pose_walk.h"

/* An occluder is nearer than the point by this share of its distance: 2 cm at 2 m. Poses are not known well yet. */
#define OCCLUSION_MARGIN 0.01f /* +25 %: no change */

/* A held-out photograph. */
struct held_out_photograph {
    struct photograph *photo;
    struct pyramid pyramid;
    struct pose_frame frame;
    size_t count;
    uint32_t *track; /* [count] tracks that it sees, by index; owned */
};

struct held_out_set {
    const struct pose_solver *solver;
    struct held_out_photograph *held_out;
    double *consensus; /* [track_count] consensus of each track at this level; NAN: unknown */
    int level;
};

/* One observation of a track. */
struct track_sample {
    float d[POSE_UNKNOWNS];
    double residual; /* observed minus consensus */
    bool is_held_out;
};

/* --- visible tracks ------------------------------------------------------------------------------ */

static bool sees(const struct held_out_photograph *h, const struct accel *accel, const struct track *track,
                 float *depth_m) {
    const struct camera *camera = &h->frame.before;
    vec3 origin = camera_origin(camera), to = vec3_sub(track->point, origin);
    vec3 normal = vec3_normalize(vec3_cross(track->right, track->down));
    float x, y, distance = vec3_length(to);
    return camera_project(camera, track->point, &x, &y, depth_m) &&
           fabsf(vec3_dot(to, normal)) > TRACK_MIN_COSINE * distance &&
           !accel_occluded(accel, origin, vec3_scale(to, 1.0f / distance), 0.0f, (1.0f - OCCLUSION_MARGIN) * distance);
}

static void find_tracks(void *user, size_t index, int thread) {
    (void)thread;
    const struct held_out_set *all = user;
    const struct pose_solver *s = all->solver;
    struct held_out_photograph *h = &all->held_out[index];
    double depth_sum_m = 0.0;
    h->track = mem_array(s->track_count + 1, sizeof *h->track);
    for (size_t i = 0; i < s->track_count; i++) {
        float depth_m;
        if (!sees(h, s->tracks->views->accel, s->track[i], &depth_m))
            continue;
        depth_sum_m += (double)depth_m;
        h->track[h->count++] = (uint32_t)i;
    }
    h->frame.depth_m = depth_sum_m / fmax(1.0, (double)h->count);
    if (s->walk.is_known && h->count > 0) {
        double twist[POSE_UNKNOWNS];
        size_t at = (size_t)(h->photo - s->tracks->views->scene->photograph);
        struct pose_drift drift = pose_walk_expect(s, at);
        pose_walk_twist(&h->frame, &drift, twist);
        pose_twist(&h->frame, twist, INFINITY);
    }
}

/* --- alignment ----------------------------------------------------------------------------------- */

/* Residuals and derivatives of the tracks that the frame shows; returns their number. */
static size_t evaluate_tracks(const struct held_out_set *all, const struct held_out_photograph *h,
                              struct track_sample *sample) {
    size_t count = 0;
    for (size_t k = 0; k < h->count; k++) {
        const struct track *track = all->solver->track[h->track[k]];
        double consensus = all->consensus[h->track[k]];
        float x, y, depth_m, slope[2];
        if (isnan(consensus) || !camera_project(&h->frame.now, track->point, &x, &y, &depth_m) ||
            !pose_slope(all->solver, h->track[k], &h->frame.now, slope) ||
            !pose_derive(&h->frame, track->point, slope, sample[count].d))
            continue;
        sample[count].residual = (double)pyramid_value(&h->pyramid, all->level, x, y) - consensus;
        if (isnan(sample[count].residual))
            continue;
        sample[count++].is_held_out = pose_is_held_out(h->track[k]);
    }
    return count;
}

/* Offset of the photograph in log radiance: the median residual, since its exposure may be unknown. */
static double offset_of(const struct track_sample *sample, size_t count, double *scratch) {
    for (size_t k = 0; k < count; k++)
        scratch[k] = sample[k].residual;
    return quantile_double(scratch, count, 0.5);
}

/* Robust scale of the residuals about an offset. */
static double scale_of(const struct track_sample *sample, size_t count, double offset, double *scratch) {
    for (size_t k = 0; k < count; k++)
        scratch[k] = fabs(sample[k].residual - offset);
    return fmax(POSE_MIN_SCALE, QUANTILE_DEVIATIONS_PER_MAD * quantile_double(scratch, count, 0.5));
}

/* One step of the robust least squares, from which the offset is eliminated. */
static void step(const struct held_out_set *all, struct held_out_photograph *h, const struct track_sample *sample,
                 size_t count, double *scratch) {
    double a[POSE_UNKNOWNS][POSE_UNKNOWNS] = {{0.0}}, b[POSE_UNKNOWNS] = {0.0}, d[POSE_UNKNOWNS] = {0.0};
    double offset = offset_of(sample, count, scratch), weights = 0.0, residual_sum = 0.0;
    const double prior = pose_prior(&h->frame);
    h->frame.scale = scale_of(sample, count, offset, scratch);
    for (size_t k = 0; k < count; k++) {
        double scale = h->frame.scale, r = sample[k].residual - offset, w = 1.0 / (scale * scale + r * r);
        if (sample[k].is_held_out)
            continue;
        weights += w;
        residual_sum += w * r;
        for (int i = 0; i < POSE_UNKNOWNS; i++) {
            double di = (double)sample[k].d[i];
            d[i] += w * di;
            b[i] -= w * di * r;
            for (int j = 0; j <= i; j++)
                a[i][j] += w * di * (double)sample[k].d[j];
        }
    }
    for (int i = 0; i < POSE_UNKNOWNS && weights > 0.0; i++) {
        b[i] += d[i] * residual_sum / weights;
        for (int j = 0; j <= i; j++)
            a[i][j] -= d[i] * d[j] / weights;
        a[i][i] += POSE_DAMPING * a[i][i] + prior;
        b[i] -= prior * h->frame.total[i];
    }
    pose_factor(a);
    cholesky_solve(POSE_UNKNOWNS, POSE_UNKNOWNS, &a[0][0], b);
    pose_twist(&h->frame, b, POSE_STEP_PX * (1 << all->level) / (double)h->pyramid.scale);
}

static void align(void *user, size_t index, int thread) {
    (void)thread;
    const struct held_out_set *all = user;
    struct held_out_photograph *h = &all->held_out[index];
    struct track_sample *sample = mem_array(h->count + 1, sizeof *sample);
    double *scratch = mem_array(h->count + 1, sizeof *scratch);
    for (int round = 0; round < POSE_ROUNDS; round++) {
        size_t count = evaluate_tracks(all, h, sample);
        if (count < POSE_MIN_OBSERVATIONS)
            break;
        step(all, h, sample, count, scratch);
    }
    mem_free(scratch);
    mem_free(sample);
}

/* --- judgement ------------------------------------------------------------------------------------ */

/* Robust costs of the held-out tracks, by place in h->track; NAN elsewhere. Returns the number of tracks shown, held
 * out or not. */
static size_t costs(const struct held_out_set *all, const struct held_out_photograph *h, const struct camera *camera,
                    double scale, double *cost) {
    double *residual = mem_array(2 * h->count + 1, sizeof *residual), *scratch = residual + h->count;
    size_t count = 0;
    for (size_t k = 0; k < h->count; k++) {
        float x, y, depth_m;
        residual[k] = NAN;
        if (camera_project(camera, all->solver->track[h->track[k]]->point, &x, &y, &depth_m))
            residual[k] = (double)pyramid_value(&h->pyramid, all->level, x, y) - all->consensus[h->track[k]];
        if (isfinite(residual[k]))
            scratch[count++] = residual[k];
    }
    double offset = count > 0 ? quantile_double(scratch, count, 0.5) : 0.0;
    for (size_t k = 0; k < h->count; k++)
        cost[k] = pose_is_held_out(h->track[k]) ? pose_robust_cost(residual[k] - offset, scale) : NAN;
    mem_free(residual);
    return count;
}

/* Root mean squared distance between the tracks' image positions in both cameras, pixels. */
static double shift_of(const struct held_out_set *all, const struct held_out_photograph *h) {
    double squares = 0.0, count = 0.0;
    for (size_t k = 0; k < h->count; k++) {
        double square = pose_squared_shift(&h->frame.before, &h->frame.now, all->solver->track[h->track[k]]->point);
        if (isnan(square))
            continue;
        squares += square;
        count += 1.0;
    }
    return count > 0.0 ? sqrt(squares / count) : 0.0;
}

static void judge(void *user, size_t index, int thread) {
    (void)thread;
    const struct held_out_set *all = user;
    struct held_out_photograph *h = &all->held_out[index];
    double *before = mem_array(2 * h->count + 1, sizeof *before), *now = before + h->count;
    struct validation v = {0};
    size_t seen = costs(all, h, &h->frame.before, h->frame.scale, before);
    costs(all, h, &h->frame.now, h->frame.scale, now);
    for (size_t k = 0; k < h->count && seen >= POSE_MIN_OBSERVATIONS; k++)
        if (isfinite(before[k]) && isfinite(now[k]))
            validation_add(&v, before[k], now[k]);
    h->frame.shift_px = shift_of(all, h);
    bool is_right = all->solver->walk.is_known ? v.saved >= 0.0 : pose_is_improved(&v);
    h->frame.is_fixed = h->frame.shift_px < POSE_MIN_SHIFT_PX || !is_right;
    mem_free(before);
}

/* --- the whole ------------------------------------------------------------------------------------ */

static void find_consensus(void *user, size_t track, int thread) {
    (void)thread;
    const struct held_out_set *all = user;
    double weight[POSE_OBSERVATIONS_MAX];
    pose_weigh_track(all->solver, track, &all->consensus[track], weight);
}

/* Consensus of the tracks at a level, by the training photographs where they are now. */
static void update_consensus(struct held_out_set *all, struct pose_solver *s, int level, struct parallel *pool) {
    s->level = all->level = level;
    pose_linearise(s);
    pose_reweight(s);
    parallel_for(pool, s->track_count, find_consensus, all);
}

static size_t init_all(struct held_out_set *all, struct scene *scene) {
    const struct tracks *tracks = all->solver->tracks;
    size_t count = 0;
    for (size_t i = 0; i < scene->photograph_count; i++) {
        struct photograph *photo = &scene->photograph[i];
        if (!photo->is_test)
            continue;
        struct held_out_photograph *h = &all->held_out[count++];
        *h = (struct held_out_photograph){.photo = photo};
        pose_frame_init(&h->frame, &photo->camera);
        tracks_pyramid(tracks, photo, &h->pyramid);
    }
    return count;
}

size_t held_out_poses_align(struct scene *scene, struct pose_solver *s, int coarsest, struct parallel *pool,
                            double *shift_px) {
    struct held_out_set all = {.solver = s,
                               .held_out = mem_calloc(scene->photograph_count + 1, sizeof *all.held_out),
                               .consensus = mem_array(s->track_count + 1, sizeof *all.consensus)};
    size_t count = init_all(&all, scene), moved = 0;
    double squares = 0.0;
    parallel_for(pool, count, find_tracks, &all);
    for (int level = coarsest; level >= 0; level--) {
        update_consensus(&all, s, level, pool);
        parallel_for(pool, count, align, &all);
    }
    parallel_for(pool, count, judge, &all);
    for (size_t i = 0; i < count; i++) {
        struct held_out_photograph *h = &all.held_out[i];
        if (!h->frame.is_fixed) {
            h->photo->camera = h->frame.now;
            squares += h->frame.shift_px * h->frame.shift_px;
            moved++;
        }
        pyramid_release(&h->pyramid);
        mem_free(h->track);
    }
    mem_free(all.consensus);
    mem_free(all.held_out);
    *shift_px = moved > 0 ? sqrt(squares / (double)moved) : 0.0;
    return moved;
}
