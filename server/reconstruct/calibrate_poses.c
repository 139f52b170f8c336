/* calibrate_poses.c -- see calibrate_poses.h.
 *
 * Photograph f moves by a twist (rotation w, translation v, in camera axes) of its camera_from_world:
 * a track's point p in camera space moves by w x p + v. With I the photograph's pyramid, u the
 * track's place in it and L what the track really looks like,
 *
 *     I(u) + grad I . du/dp . (-[p]x, 1) (w, v) - b - L = error,
 *
 * b being one offset for each cell of a coarse grid over the picture: what is left of a wrong
 * exposure, a vignette and the slow change of glossy reflections. Both w and v are counted in
 * pixels: w times the focal length, v times the focal length over the mean depth. grad I is the
 * mean slope over all photographs of the track: noise in slopes would make steps too short.
 *
 * Each round linearises all photographs at once, eliminates the L and solves for all twists and
 * offsets by preconditioned conjugate gradients (calibrate_light.c does the same), since one after
 * the other they would hardly move together. What the evidence leaves open is decided by a prior
 * that grows with the size of a correction and not with its square: rather a few photographs
 * moved far than all a little. */
#include "server/reconstruct/calibrate_poses.h"

#include <math.h>
#include <string.h>

#include "common/mem.h"

#define ROUNDS 6             /* at each level */
#define LAST_ROUNDS 4        /* after the first judgement, at the finest level */
#define HELD_BACK_EVERY 3
#define LEAST_SIGHTS 60      /* that must tell something, for a photograph to be moved */
#define FIRST_SCALE 0.1      /* of residuals, before there are any */
#define LEAST_SCALE 0.01     /* residuals below it are all as good */
#define OFFSET_SIGMA 0.3
#define PRIOR_SIGMA_PX 4.0   /* of a correction's components, times their size or LEAST_PRIOR_PX */
#define PRIOR_LEAST_PX 0.2
#define DAMPING 0.01
#define STEP_PX 1.5          /* of a level, that a round moves a photograph at most */
#define CG_STEPS 40
#define CG_TOLERANCE 1e-3

#define UNKNOWNS 6
#define CELL_COLUMNS 8       /* of the grid of offsets */
#define CELL_ROWS 6
#define CELLS (CELL_COLUMNS * CELL_ROWS)
#define SIGHTS_MAX (TRACK_OTHERS + 1)

/* A correction is kept when the held-back tracks agree better by this share of their robust cost,
 * by this many standard errors, and moved by this much (rms). */
#define LEAST_GAIN 0.02
#define LEAST_SIGNIFICANCE 4.0
#define LEAST_SHIFT_PX 0.15

struct pose { /* camera_from_world */
    double r[3][3], t[3];
};

struct frame {
    struct camera before, now;
    struct pose pose;
    double total[UNKNOWNS]; /* sum of the twists taken, pixels */
    double depth_m;         /* mean over its sights */
    double scale;           /* of its residuals */
    bool stays;
};

/* One photograph's look at one track. */
struct sight {
    uint32_t frame;
    uint32_t offset;     /* index into x: of its cell */
    float value;         /* NAN: none */
    float weight;        /* inverse variance, made robust; 0 where held back */
    float d[UNKNOWNS];   /* derivative of `value` by the frame's twist, per pixel */
};

struct solver {
    const struct tracks *tracks;
    size_t frames, track_count, unknowns;
    const struct track **track; /* [track_count] */
    uint32_t *owner;            /* [track_count] the photograph it comes from */
    struct sight *sight;        /* [track_count][SIGHTS_MAX], the owner's first */
    struct frame *frame;        /* [frames] */
    double *x;                  /* [unknowns]: twist of each frame, then CELLS offsets of each */
    double *shift;              /* [frames] */
    int level;
};

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

/* --- linearisation ------------------------------------------------------------------------------ */

static size_t sight_count(const struct track *track) {
    return (size_t)track->other_count + 1;
}

static bool is_held_back(size_t track) {
    return track % HELD_BACK_EVERY == 0;
}

static float value_at(const struct solver *s, uint32_t frame, vec3 point, float *x, float *y) {
    float depth_m;
    if (!camera_project(&s->frame[frame].now, point, x, y, &depth_m))
        return NAN;
    return pyramid_value(&s->tracks->pyramid[frame], s->level, *x, *y);
}

/* What a sight shows of the track's surroundings. */
struct patch {
    float value, along[2];   /* change of the value per `right` and `down` */
    float place[2][2];       /* change of the place in the picture per `right` and `down` */
};

static bool look_around(const struct solver *s, const struct track *track, float step, uint32_t frame,
                        struct patch *patch) {
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

/* Derivative of the value by the twist of its camera, from the slope g by pixels. */
static bool derive(const struct frame *frame, vec3 point, const float g[2], float d[UNKNOWNS]) {
    const struct camera *camera = &frame->now;
    vec3 p = rigid_point(&camera->camera_from_world, point);
    float x, y, depth_m, by_p[3];
    if (!camera_project(camera, point, &x, &y, &depth_m))
        return false;
    float step = 2e-3f * depth_m, focal = camera->fx;
    for (int k = 0; k < 3; k++) {
        const float *axis = camera->camera_from_world.rotation[k];
        float u, v;
        if (!camera_project(camera, vec3_mad(point, step, (vec3){axis[0], axis[1], axis[2]}), &u, &v, &depth_m))
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

static void linearise_track(void *user, size_t index, int thread) {
    (void)thread;
    const struct solver *s = user;
    const struct track *track = s->track[index];
    struct sight *sight = s->sight + index * SIGHTS_MAX;
    struct patch patch[SIGHTS_MAX];
    float step = (float)(1 << s->level) / s->tracks->pyramid[s->owner[index]].scale;
    float along[2] = {0.0f, 0.0f}, total = 0.0f;
    for (size_t k = 0; k < sight_count(track); k++) {
        const struct frame *frame = &s->frame[sight[k].frame];
        sight[k].value = NAN;
        if (!look_around(s, track, step, sight[k].frame, &patch[k]))
            continue;
        float trust = (float)(1.0 / (frame->scale * frame->scale));
        sight[k].value = patch[k].value;
        along[0] += trust * patch[k].along[0];
        along[1] += trust * patch[k].along[1];
        total += trust;
    }
    for (size_t k = 0; k < sight_count(track) && total > 0.0f; k++) {
        /* The slope g by pixels has g . place[i] = along[i] / total. */
        const float(*m)[2] = (const float(*)[2])patch[k].place;
        if (!isfinite(sight[k].value))
            continue;
        float det = m[0][0] * m[1][1] - m[0][1] * m[1][0];
        float g[2] = {(along[0] * m[1][1] - along[1] * m[0][1]) / (det * total),
                      (along[1] * m[0][0] - along[0] * m[1][0]) / (det * total)};
        if (!(fabsf(det) > 1e-3f) || !derive(&s->frame[sight[k].frame], track->point, g, sight[k].d))
            sight[k].value = NAN;
    }
}

/* --- weights ---------------------------------------------------------------------------------- */

static double robust(double residual, double scale) {
    double e = residual / scale;
    return log1p(e * e);
}

/* The track's L by what weights there are, offsets taken off; false where fewer than three tell. */
static bool track_look(const struct solver *s, size_t track, const double *weight, double *look) {
    const struct sight *sight = s->sight + track * SIGHTS_MAX;
    double sum = 0.0, total = 0.0;
    size_t count = 0;
    for (size_t k = 0; k < sight_count(s->track[track]); k++) {
        if (!isfinite(sight[k].value))
            continue;
        sum += weight[k] * ((double)sight[k].value - s->x[sight[k].offset]);
        total += weight[k];
        count++;
    }
    *look = sum / total;
    return count >= 3;
}

/* Robust weights of a track's sights, by their distance from what they agree on. */
static void weigh_track(const struct solver *s, size_t track, double *look, double weight[SIGHTS_MAX]) {
    const struct sight *sight = s->sight + track * SIGHTS_MAX;
    size_t count = sight_count(s->track[track]);
    for (size_t k = 0; k < count; k++) {
        double scale = s->frame[sight[k].frame].scale;
        weight[k] = 1.0 / (scale * scale);
    }
    *look = NAN;
    for (int round = 0; round < 4; round++) {
        if (!track_look(s, track, weight, look)) {
            memset(weight, 0, count * sizeof *weight);
            return;
        }
        for (size_t k = 0; k < count; k++) {
            double scale = s->frame[sight[k].frame].scale;
            double e = ((double)sight[k].value - s->x[sight[k].offset] - *look) / scale;
            weight[k] = isfinite(e) ? 1.0 / ((1.0 + e * e) * scale * scale) : 0.0;
        }
    }
}

static void reweight(struct solver *s) {
    double *sum = mem_calloc(2 * s->frames + 1, sizeof *sum), *count = sum + s->frames;
    for (size_t i = 0; i < s->track_count; i++) {
        struct sight *sight = s->sight + i * SIGHTS_MAX;
        double look, weight[SIGHTS_MAX];
        weigh_track(s, i, &look, weight);
        for (size_t k = 0; k < sight_count(s->track[i]); k++) {
            sight[k].weight = is_held_back(i) ? 0.0f : (float)weight[k];
            if (weight[k] <= 0.0)
                continue;
            double r = fabs((double)sight[k].value - s->x[sight[k].offset] - look);
            sum[sight[k].frame] += fmin(r, 2.0 * s->frame[sight[k].frame].scale);
            count[sight[k].frame] += 1.0;
        }
    }
    for (size_t f = 0; f < s->frames; f++) {
        if (count[f] > 0.0)
            s->frame[f].scale = fmax(LEAST_SCALE, 2.5 * sum[f] / count[f]);
    }
    mem_free(sum);
}

/* --- the linear system: twists of this round, and offsets ------------------------------------------ */

static double prior_of(const struct frame *frame) {
    double squares = 0.0;
    for (int k = 0; k < UNKNOWNS; k++)
        squares += frame->total[k] * frame->total[k];
    return 1.0 / (PRIOR_SIGMA_PX * fmax(PRIOR_LEAST_PX, sqrt(squares)));
}

/* out += A' W (I - M) z over the sights of a track, z[] by sight. */
static void scatter(const struct solver *s, size_t track, const double *z, double *out) {
    const struct sight *sight = s->sight + track * SIGHTS_MAX;
    size_t count = sight_count(s->track[track]);
    double sum = 0.0, weight = 0.0;
    for (size_t k = 0; k < count; k++) {
        if (sight[k].weight > 0.0f) {
            sum += (double)sight[k].weight * z[k];
            weight += (double)sight[k].weight;
        }
    }
    for (size_t k = 0; k < count; k++) {
        if (!(sight[k].weight > 0.0f))
            continue;
        double r = (double)sight[k].weight * (z[k] - sum / weight);
        double *twist = out + UNKNOWNS * sight[k].frame;
        for (int j = 0; j < UNKNOWNS; j++)
            twist[j] += r * (double)sight[k].d[j];
        out[sight[k].offset] -= r;
    }
}

static void project(const struct solver *s, double *x) {
    for (size_t f = 0; f < s->frames; f++) {
        if (s->frame[f].stays)
            memset(x + UNKNOWNS * f, 0, UNKNOWNS * sizeof *x);
    }
}

/* `damping` [UNKNOWNS * frames] is added to the diagonal of the twists. */
static void multiply(const struct solver *s, const double *damping, const double *x, double *out) {
    size_t twists = UNKNOWNS * s->frames;
    for (size_t i = 0; i < s->unknowns; i++)
        out[i] = x[i] * (i < twists ? prior_of(&s->frame[i / UNKNOWNS]) + damping[i]
                                    : 1.0 / (OFFSET_SIGMA * OFFSET_SIGMA));
    for (size_t t = 0; t < s->track_count; t++) {
        const struct sight *sight = s->sight + t * SIGHTS_MAX;
        double z[SIGHTS_MAX];
        if (is_held_back(t))
            continue;
        for (size_t k = 0; k < sight_count(s->track[t]); k++) {
            const double *twist = x + UNKNOWNS * sight[k].frame;
            z[k] = -x[sight[k].offset];
            for (int j = 0; j < UNKNOWNS; j++)
                z[k] += (double)sight[k].d[j] * twist[j];
        }
        scatter(s, t, z, out);
    }
    project(s, out);
}

/* A factorised 6 x 6 block for each frame's twist, and the diagonal of the offsets. */
struct preconditioner {
    double (*block)[UNKNOWNS][UNKNOWNS]; /* [frames] lower Cholesky factors; owned */
    double *diagonal;                    /* [unknowns]; owned */
};

static void factorise(double a[UNKNOWNS][UNKNOWNS]) {
    for (int i = 0; i < UNKNOWNS; i++) {
        for (int j = 0; j <= i; j++) {
            double sum = a[i][j];
            for (int k = 0; k < j; k++)
                sum -= a[i][k] * a[j][k];
            a[i][j] = i == j ? sqrt(fmax(sum, 1e-12)) : sum / a[j][j];
        }
    }
}

static void preconditioner_init(struct preconditioner *p, const struct solver *s, double *damping) {
    p->block = mem_calloc(s->frames + 1, sizeof *p->block);
    p->diagonal = mem_calloc(s->unknowns + 1, sizeof *p->diagonal);
    for (size_t t = 0; t < s->track_count; t++) {
        const struct sight *sight = s->sight + t * SIGHTS_MAX;
        for (size_t k = 0; k < sight_count(s->track[t]); k++) {
            if (!(sight[k].weight > 0.0f))
                continue;
            double w = (double)sight[k].weight, (*a)[UNKNOWNS] = p->block[sight[k].frame];
            p->diagonal[sight[k].offset] += w;
            for (int i = 0; i < UNKNOWNS; i++)
                for (int j = 0; j <= i; j++)
                    a[i][j] += w * (double)sight[k].d[i] * (double)sight[k].d[j];
        }
    }
    for (size_t f = 0; f < s->frames; f++) {
        for (int i = 0; i < UNKNOWNS; i++) {
            damping[UNKNOWNS * f + (size_t)i] = DAMPING * p->block[f][i][i];
            p->block[f][i][i] += prior_of(&s->frame[f]) + DAMPING * p->block[f][i][i];
        }
        factorise(p->block[f]);
    }
    for (size_t i = UNKNOWNS * s->frames; i < s->unknowns; i++)
        p->diagonal[i] += 1.0 / (OFFSET_SIGMA * OFFSET_SIGMA);
}

static void preconditioner_release(struct preconditioner *p) {
    mem_free(p->block);
    mem_free(p->diagonal);
}

static void precondition(const struct preconditioner *p, const struct solver *s, const double *r, double *z) {
    for (size_t f = 0; f < s->frames; f++) {
        const double(*a)[UNKNOWNS] = (const double(*)[UNKNOWNS])p->block[f];
        double *b = z + UNKNOWNS * f;
        memcpy(b, r + UNKNOWNS * f, UNKNOWNS * sizeof *b);
        for (int i = 0; i < UNKNOWNS; i++) {
            for (int k = 0; k < i; k++)
                b[i] -= a[i][k] * b[k];
            b[i] /= a[i][i];
        }
        for (int i = UNKNOWNS - 1; i >= 0; i--) {
            for (int k = i + 1; k < UNKNOWNS; k++)
                b[i] -= a[k][i] * b[k];
            b[i] /= a[i][i];
        }
    }
    for (size_t i = UNKNOWNS * s->frames; i < s->unknowns; i++)
        z[i] = r[i] / p->diagonal[i];
    project(s, z);
}

static double dot(const double *a, const double *b, size_t count) {
    double sum = 0.0;
    for (size_t i = 0; i < count; i++)
        sum += a[i] * b[i];
    return sum;
}

/* Solves for s->x: the twists from 0, the offsets from what they are. */
static void solve_linear(struct solver *s) {
    size_t n = s->unknowns, twists = UNKNOWNS * s->frames;
    double *memory = mem_calloc(4 * n + twists, sizeof *memory), *x = s->x;
    double *r = memory, *z = r + n, *p = z + n, *q = p + n, *damping = q + n, rz = 0.0;
    struct preconditioner preconditioner;
    preconditioner_init(&preconditioner, s, damping);
    for (size_t t = 0; t < s->track_count; t++) {
        double y[SIGHTS_MAX];
        for (size_t k = 0; k < sight_count(s->track[t]); k++)
            y[k] = -(double)s->sight[t * SIGHTS_MAX + k].value;
        if (!is_held_back(t))
            scatter(s, t, y, r);
    }
    memset(x, 0, twists * sizeof *x);
    for (size_t i = 0; i < twists; i++)
        r[i] -= prior_of(&s->frame[i / UNKNOWNS]) * s->frame[i / UNKNOWNS].total[i % UNKNOWNS];
    project(s, r);
    multiply(s, damping, x, q);
    for (size_t i = 0; i < n; i++)
        r[i] -= q[i];
    double goal = CG_TOLERANCE * CG_TOLERANCE * dot(r, r, n);
    for (int step = 0; step < CG_STEPS && dot(r, r, n) > goal; step++) {
        precondition(&preconditioner, s, r, z);
        double next = dot(r, z, n), beta = step > 0 ? next / rz : 0.0;
        rz = next;
        for (size_t i = 0; i < n; i++)
            p[i] = z[i] + beta * p[i];
        multiply(s, damping, p, q);
        double alpha = rz / dot(p, q, n);
        for (size_t i = 0; i < n; i++) {
            x[i] += alpha * p[i];
            r[i] -= alpha * q[i];
        }
    }
    preconditioner_release(&preconditioner);
    mem_free(memory);
}

static void take_step(struct solver *s, size_t f) {
    struct frame *frame = &s->frame[f];
    const double *twist = s->x + UNKNOWNS * f;
    double most = STEP_PX * (1 << s->level) / (double)s->tracks->pyramid[f].scale;
    double size = sqrt(dot(twist, twist, UNKNOWNS)), length = size > most ? most / size : 1.0;
    double w[3], v[3], focal = (double)frame->now.fx;
    if (frame->stays)
        return;
    for (int k = 0; k < 3; k++) {
        w[k] = length * twist[k] / focal;
        v[k] = length * twist[3 + k] * frame->depth_m / focal;
    }
    for (int k = 0; k < UNKNOWNS; k++)
        frame->total[k] += length * twist[k];
    frame->pose = twisted(&frame->pose, w, v);
    set_pose(&frame->now, &frame->pose);
}

/* Root of the mean squared distance, in pixels, between the places of a frame's own tracks in two
 * cameras. */
static double shift_of(const struct solver *s, size_t f, const struct camera *a, const struct camera *b) {
    double squares = 0.0;
    size_t count = 0;
    for (size_t i = 0; i < s->tracks->count[f]; i++) {
        float xa, ya, xb, yb, depth_m;
        vec3 point = s->tracks->track[f * s->tracks->capacity + i].point;
        if (!camera_project(a, point, &xa, &ya, &depth_m) || !camera_project(b, point, &xb, &yb, &depth_m))
            continue;
        squares += (double)((xa - xb) * (xa - xb) + (ya - yb) * (ya - yb));
        count++;
    }
    return count ? sqrt(squares / (double)count) : 0.0;
}

static void run_rounds(struct solver *s, int level, int rounds, struct parallel *pool) {
    s->level = level;
    for (int round = 0; round < rounds; round++) {
        parallel_for(pool, s->track_count, linearise_track, s);
        reweight(s);
        solve_linear(s);
        for (size_t f = 0; f < s->frames; f++)
            take_step(s, f);
    }
}

/* --- judgement ------------------------------------------------------------------------------------ */

/* Evidence for a frame's correction: gains of robust cost over its held-back sights. */
struct evidence {
    double sum, squares, total;
    size_t count;
};

static void collect_evidence(const struct solver *s, struct evidence *evidence) {
    for (size_t i = 0; i < s->track_count; i += HELD_BACK_EVERY) {
        struct sight *sight = s->sight + i * SIGHTS_MAX;
        for (size_t k = 0; k < sight_count(s->track[i]); k++) {
            const struct frame *frame = &s->frame[sight[k].frame];
            float x, y, depth_m, value = sight[k].value;
            double look, weight[SIGHTS_MAX];
            if (!isfinite(value) || !camera_project(&frame->before, s->track[i]->point, &x, &y, &depth_m))
                continue;
            float old = pyramid_value(&s->tracks->pyramid[sight[k].frame], s->level, x, y);
            sight[k].value = NAN; /* what the others agree on */
            weigh_track(s, i, &look, weight);
            sight[k].value = value;
            if (!isfinite(old) || !isfinite(look))
                continue;
            double cost = robust((double)old - s->x[sight[k].offset] - look, frame->scale);
            double gain = cost - robust((double)value - s->x[sight[k].offset] - look, frame->scale);
            struct evidence *e = &evidence[sight[k].frame];
            e->sum += gain;
            e->squares += gain * gain;
            e->total += cost;
            e->count++;
        }
    }
}

static bool convinces(const struct evidence *e) {
    double error = sqrt(fmax(e->squares - e->sum * e->sum / fmax(1.0, (double)e->count), 0.0));
    return e->count >= LEAST_SIGHTS / HELD_BACK_EVERY && e->sum > LEAST_SIGNIFICANCE * error && e->sum > LEAST_GAIN * e->total;
}

/* Puts back where they were the frames whose correction is small or does not convince. */
static void judge(struct solver *s, struct parallel *pool) {
    struct evidence *evidence = mem_calloc(s->frames + 1, sizeof *evidence);
    s->level = 0;
    parallel_for(pool, s->track_count, linearise_track, s);
    reweight(s);
    collect_evidence(s, evidence);
    for (size_t f = 0; f < s->frames; f++) {
        struct frame *frame = &s->frame[f];
        s->shift[f] = frame->stays ? 0.0 : shift_of(s, f, &frame->before, &frame->now);
        if (s->shift[f] >= LEAST_SHIFT_PX && convinces(&evidence[f]))
            continue;
        frame->now = frame->before;
        frame->pose = pose_of(&frame->before.camera_from_world);
        memset(frame->total, 0, sizeof frame->total);
        frame->stays = true;
        s->shift[f] = 0.0;
    }
    mem_free(evidence);
}

/* --- the whole -------------------------------------------------------------------------------- */

static void init_sights(struct solver *s, size_t index) {
    const struct track *track = s->track[index];
    for (size_t k = 0; k < sight_count(track); k++) {
        uint32_t f = k == 0 ? s->owner[index] : track->other[k - 1];
        struct frame *frame = &s->frame[f];
        float x = 0.0f, y = 0.0f, depth_m = 0.0f;
        camera_project(&frame->before, track->point, &x, &y, &depth_m);
        size_t column = (size_t)(clampf(x / (float)frame->before.width, 0.0f, 0.999f) * CELL_COLUMNS);
        size_t row = (size_t)(clampf(y / (float)frame->before.height, 0.0f, 0.999f) * CELL_ROWS);
        size_t offset = UNKNOWNS * s->frames + f * CELLS + row * CELL_COLUMNS + column;
        s->sight[index * SIGHTS_MAX + k] = (struct sight){.frame = f, .offset = (uint32_t)offset};
        frame->depth_m += (double)depth_m;
        s->shift[f] += 1.0; /* for now: its sights */
    }
}

static void solver_init(struct solver *s, const struct tracks *tracks) {
    const struct views *views = tracks->views;
    *s = (struct solver){.tracks = tracks, .frames = views->train_count};
    s->unknowns = (UNKNOWNS + CELLS) * s->frames;
    s->frame = mem_calloc(s->frames + 1, sizeof *s->frame);
    s->shift = mem_calloc(s->frames + 1, sizeof *s->shift);
    s->x = mem_calloc(s->unknowns + 1, sizeof *s->x);
    s->track = mem_array(s->frames * tracks->capacity + 1, sizeof *s->track);
    s->owner = mem_array(s->frames * tracks->capacity + 1, sizeof *s->owner);
    for (size_t f = 0; f < s->frames; f++) {
        struct frame *frame = &s->frame[f];
        frame->before = frame->now = views->scene->photograph[views->train[f]].camera;
        frame->pose = pose_of(&frame->before.camera_from_world);
        frame->scale = FIRST_SCALE;
        for (size_t i = 0; i < tracks->count[f]; i++) {
            s->owner[s->track_count] = (uint32_t)f;
            s->track[s->track_count++] = &tracks->track[f * tracks->capacity + i];
        }
    }
    s->sight = mem_calloc(s->track_count * SIGHTS_MAX + 1, sizeof *s->sight);
    for (size_t i = 0; i < s->track_count; i++)
        init_sights(s, i);
    for (size_t f = 0; f < s->frames; f++) {
        s->frame[f].depth_m /= fmax(1.0, s->shift[f]);
        s->frame[f].stays = s->shift[f] < LEAST_SIGHTS;
        s->shift[f] = 0.0;
    }
}

static void solver_release(struct solver *s) {
    mem_free(s->frame);
    mem_free(s->shift);
    mem_free(s->x);
    mem_free(s->track);
    mem_free(s->owner);
    mem_free(s->sight);
}

void calibrate_poses(struct scene *scene, const struct tracks *tracks, struct parallel *pool,
                     struct poses_found *found) {
    struct solver s;
    const struct views *views = tracks->views;
    solver_init(&s, tracks);
    for (int level = PYRAMID_LEVELS - 1; level >= 0; level--)
        run_rounds(&s, level, ROUNDS, pool);
    judge(&s, pool);
    run_rounds(&s, 0, LAST_ROUNDS, pool);
    judge(&s, pool);
    *found = (struct poses_found){.shift = mem_calloc(s.frames + 1, sizeof *found->shift)};
    double squares = 0.0;
    for (size_t f = 0; f < s.frames; f++) {
        found->shift[f] = (float)s.shift[f];
        if (s.frame[f].stays)
            continue;
        scene->photograph[views->train[f]].camera = s.frame[f].now;
        squares += s.shift[f] * s.shift[f];
        found->moved_count++;
    }
    found->shift_px = found->moved_count ? sqrt(squares / (double)found->moved_count) : 0.0;
    solver_release(&s);
}

void poses_found_release(struct poses_found *found) {
    mem_free(found->shift);
    *found = (struct poses_found){0};
}
