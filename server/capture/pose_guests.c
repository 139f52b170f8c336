/* pose_guests.c -- see pose_guests.h. */
#include "server/capture/pose_guests.h"

#include <math.h>

#include "common/mem.h"
#include "common/quantile.h"

#define LEAST_COSINE 0.2f /* at which a surface is seen */
#define BEFORE_IT 0.01f   /* share of its distance by which what hides a point is nearer */

/* A held-out photograph. */
struct guest {
    struct photograph *photo;
    struct pyramid pyramid;
    struct pose_frame frame;
    size_t count;
    uint32_t *track;  /* [count] those it sees, by index; owned */
};

struct guests {
    const struct pose_solver *solver;
    struct guest *guest;
    double *look;     /* [track_count] what each track looks like at this level; NAN: not known */
    int level;
};

/* One look at a track. */
struct glance {
    float d[POSE_UNKNOWNS];
    double off;       /* beyond the track's look */
    bool held_back;
};

/* --- what a guest sees ---------------------------------------------------------------------------- */

static bool sees(const struct guest *g, const struct accel *accel, const struct track *track, float *depth_m) {
    const struct camera *camera = &g->frame.before;
    vec3 origin = camera_origin(camera), to = vec3_sub(track->point, origin);
    vec3 normal = vec3_normalize(vec3_cross(track->right, track->down));
    float x, y, distance = vec3_length(to);
    return camera_project(camera, track->point, &x, &y, depth_m) &&
           fabsf(vec3_dot(to, normal)) > LEAST_COSINE * distance &&
           !accel_occluded(accel, origin, vec3_scale(to, 1.0f / distance), 0.0f, (1.0f - BEFORE_IT) * distance);
}

static void meet(void *user, size_t index, int thread) {
    (void)thread;
    const struct guests *all = user;
    const struct pose_solver *s = all->solver;
    struct guest *g = &all->guest[index];
    double depth_sum_m = 0.0;
    g->track = mem_array(s->track_count + 1, sizeof *g->track);
    for (size_t i = 0; i < s->track_count; i++) {
        float depth_m;
        if (!sees(g, s->tracks->views->accel, s->track[i], &depth_m))
            continue;
        depth_sum_m += (double)depth_m;
        g->track[g->count++] = (uint32_t)i;
    }
    g->frame.depth_m = depth_sum_m / fmax(1.0, (double)g->count);
}

/* --- moving it ------------------------------------------------------------------------------------ */

/* How a guest's frame shows the tracks, where it does; returns their number. */
static size_t glance_at_all(const struct guests *all, const struct guest *g, struct glance *glance) {
    size_t count = 0;
    for (size_t k = 0; k < g->count; k++) {
        const struct track *track = all->solver->track[g->track[k]];
        double look = all->look[g->track[k]];
        float x, y, depth_m, slope[2];
        if (isnan(look) || !camera_project(&g->frame.now, track->point, &x, &y, &depth_m) ||
            !pose_slope(all->solver, g->track[k], &g->frame.now, slope) ||
            !pose_derive(&g->frame, track->point, slope, glance[count].d))
            continue;
        glance[count].off = (double)pyramid_value(&g->pyramid, all->level, x, y) - look;
        if (isnan(glance[count].off))
            continue;
        glance[count++].held_back = pose_is_held_back(g->track[k]);
    }
    return count;
}

/* By how much the photograph is brighter than the tracks: the median, since its exposure may not be known. */
static double brightness(const struct glance *glance, size_t count, double *scratch) {
    for (size_t k = 0; k < count; k++)
        scratch[k] = glance[k].off;
    return quantile_double(scratch, count, 0.5);
}

/* The scale of residuals about an offset. */
static double scale_of(const struct glance *glance, size_t count, double offset, double *scratch) {
    for (size_t k = 0; k < count; k++)
        scratch[k] = fabs(glance[k].off - offset);
    return fmax(POSE_LEAST_SCALE, 1.5 * quantile_double(scratch, count, 0.5));
}

/* One step of the robust least squares, from which the offset is eliminated. */
static void step(const struct guests *all, struct guest *g, const struct glance *glance, size_t count, double *scratch) {
    double a[POSE_UNKNOWNS][POSE_UNKNOWNS] = {{0.0}}, b[POSE_UNKNOWNS] = {0.0}, d[POSE_UNKNOWNS] = {0.0};
    double offset = brightness(glance, count, scratch), weights = 0.0, off = 0.0;
    const double prior = pose_prior(&g->frame);
    g->frame.scale = scale_of(glance, count, offset, scratch);
    for (size_t k = 0; k < count; k++) {
        double scale = g->frame.scale, r = glance[k].off - offset, w = 1.0 / (scale * scale + r * r);
        if (glance[k].held_back)
            continue;
        weights += w;
        off += w * r;
        for (int i = 0; i < POSE_UNKNOWNS; i++) {
            double di = (double)glance[k].d[i];
            d[i] += w * di;
            b[i] -= w * di * r;
            for (int j = 0; j <= i; j++)
                a[i][j] += w * di * (double)glance[k].d[j];
        }
    }
    for (int i = 0; i < POSE_UNKNOWNS && weights > 0.0; i++) {
        b[i] += d[i] * off / weights;
        for (int j = 0; j <= i; j++)
            a[i][j] -= d[i] * d[j] / weights;
        a[i][i] += POSE_DAMPING * a[i][i] + prior;
        b[i] -= prior * g->frame.total[i];
    }
    pose_factor(a);
    cholesky_solve(POSE_UNKNOWNS, POSE_UNKNOWNS, &a[0][0], b);
    pose_twist(&g->frame, b, POSE_STEP_PX * (1 << all->level) / (double)g->pyramid.scale);
}

static void move(void *user, size_t index, int thread) {
    (void)thread;
    const struct guests *all = user;
    struct guest *g = &all->guest[index];
    struct glance *glance = mem_array(g->count + 1, sizeof *glance);
    double *scratch = mem_array(g->count + 1, sizeof *scratch);
    for (int round = 0; round < POSE_ROUNDS; round++) {
        size_t count = glance_at_all(all, g, glance);
        if (count < POSE_LEAST_SIGHTS)
            break;
        step(all, g, glance, count, scratch);
    }
    mem_free(scratch);
    mem_free(glance);
}

/* --- judgement ------------------------------------------------------------------------------------ */

/* The robust costs of the tracks that were held back, by place in g->track; NAN where there is none. Returns how many
 * tracks, held back or not, are shown. */
static size_t costs(const struct guests *all, const struct guest *g, const struct camera *camera, double scale,
                    double *cost) {
    double *off = mem_array(2 * g->count + 1, sizeof *off), *scratch = off + g->count;
    size_t count = 0;
    for (size_t k = 0; k < g->count; k++) {
        float x, y, depth_m;
        off[k] = NAN;
        if (camera_project(camera, all->solver->track[g->track[k]]->point, &x, &y, &depth_m))
            off[k] = (double)pyramid_value(&g->pyramid, all->level, x, y) - all->look[g->track[k]];
        if (isfinite(off[k]))
            scratch[count++] = off[k];
    }
    double offset = count > 0 ? quantile_double(scratch, count, 0.5) : 0.0;
    for (size_t k = 0; k < g->count; k++)
        cost[k] = pose_is_held_back(g->track[k]) ? pose_robust(off[k] - offset, scale) : NAN;
    mem_free(off);
    return count;
}

/* Root of the mean squared distance between the tracks' places in both cameras. */
static double shift_of(const struct guests *all, const struct guest *g) {
    double squares = 0.0, count = 0.0;
    for (size_t k = 0; k < g->count; k++) {
        double square = pose_square_between(&g->frame.before, &g->frame.now, all->solver->track[g->track[k]]->point);
        if (isnan(square))
            continue;
        squares += square;
        count += 1.0;
    }
    return count > 0.0 ? sqrt(squares / count) : 0.0;
}

static void judge(void *user, size_t index, int thread) {
    (void)thread;
    const struct guests *all = user;
    struct guest *g = &all->guest[index];
    double *before = mem_array(2 * g->count + 1, sizeof *before), *now = before + g->count;
    struct pose_evidence e = {0};
    size_t seen = costs(all, g, &g->frame.before, g->frame.scale, before);
    costs(all, g, &g->frame.now, g->frame.scale, now);
    for (size_t k = 0; k < g->count && seen >= POSE_LEAST_SIGHTS; k++)
        if (isfinite(before[k]) && isfinite(now[k]))
            pose_evidence_add(&e, before[k], now[k]);
    g->frame.shift_px = shift_of(all, g);
    g->frame.stays = g->frame.shift_px < POSE_LEAST_SHIFT_PX || !pose_convinces(&e);
    mem_free(before);
}

/* --- the whole ------------------------------------------------------------------------------------ */

/* What the tracks look like at a level, by the photographs where they are now. */
static void take_looks(struct guests *all, struct pose_solver *s, int level, struct parallel *pool) {
    s->level = all->level = level;
    pose_linearise(s, pool);
    pose_reweight(s);
    for (size_t i = 0; i < s->track_count; i++) {
        double weight[POSE_SIGHTS_MAX];
        pose_weigh_track(s, i, &all->look[i], weight);
    }
}

static size_t invite(struct guests *all, struct scene *scene) {
    const struct tracks *tracks = all->solver->tracks;
    size_t count = 0;
    for (size_t i = 0; i < scene->photograph_count; i++) {
        struct photograph *photo = &scene->photograph[i];
        if (!photo->is_test)
            continue;
        struct guest *g = &all->guest[count++];
        *g = (struct guest){.photo = photo};
        pose_frame_init(&g->frame, &photo->camera);
        tracks_pyramid(tracks, photo, &g->pyramid);
    }
    return count;
}

size_t pose_guests(struct scene *scene, struct pose_solver *s, int coarsest, struct parallel *pool, double *shift_px) {
    struct guests all = {.solver = s, .guest = mem_calloc(scene->photograph_count + 1, sizeof *all.guest),
                         .look = mem_array(s->track_count + 1, sizeof *all.look)};
    size_t count = invite(&all, scene), moved = 0;
    double squares = 0.0;
    parallel_for(pool, count, meet, &all);
    for (int level = coarsest; level >= 0; level--) {
        take_looks(&all, s, level, pool);
        parallel_for(pool, count, move, &all);
    }
    parallel_for(pool, count, judge, &all);
    for (size_t i = 0; i < count; i++) {
        struct guest *g = &all.guest[i];
        if (!g->frame.stays) {
            g->photo->camera = g->frame.now;
            squares += g->frame.shift_px * g->frame.shift_px;
            moved++;
        }
        pyramid_release(&g->pyramid);
        mem_free(g->track);
    }
    mem_free(all.look);
    mem_free(all.guest);
    *shift_px = moved > 0 ? sqrt(squares / (double)moved) : 0.0;
    return moved;
}
