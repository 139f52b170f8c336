/* consistency.c -- see consistency.h. */
#include "server/check/consistency.h"

#include <math.h>
#include <string.h>

#include "common/mem.h"
#include "common/quantile.h"
#include "common/rng.h"

/* Other photographs a point is compared with; a random subset where more see it. */
#define OTHERS_MAX 8 /* +25 %: no verdict */
/* Cosine of the steepest view: at grazing angles a mesh's noise moves points by many pixels. */
#define COSINE_MIN 0.15f /* +25 %: no verdict */
/* Part of the way from a point to a camera that must be free: noisy scans hide what lies just behind. */
#define FREE_SHARE 0.97f /* to .98: no verdict */
/* From so many photographs on, the spread between them is known well enough; the difference must be so many standard
 * errors by it. Few photographs may have little in common with one another. */
#define FEW_PHOTOGRAPHS 12.0 /* +25 %: no verdict */
#define PHOTOGRAPHS_SURE 3.0 /* +25 %: no verdict */
#define EDGE_SHARE 0.03f     /* border of the picture that has no points; +25 %: 1 verdict of 96 */

/* A pixel of a photograph. */
struct ray_point {
    vec3 direction; /* unit, in the camera's frame */
    float u, v;     /* relative position in the picture */
    float value;
};

struct consistency {
    const struct scene *scene;
    const struct accel *accel;
    struct parallel *pool;
    vec3 lower, upper;                      /* of the mesh */
    struct thumbnail *thumbnail;            /* [photograph_count]; owned */
    size_t count;                           /* photographs that are compared */
    size_t chosen[CONSISTENCY_PHOTOGRAPHS]; /* in an order whose every beginning is spread over the capture */
};

/* --- making -------------------------------------------------------------------------------------- */

static void thumbnail_body(void *user, size_t index, int thread) {
    struct consistency *c = user;
    (void)thread;
    thumbnail_make(&c->thumbnail[index], &c->scene->photograph[index]);
}

/* Evenly spaced photographs, those in between later (van der Corput's sequence). */
static void choose(struct consistency *c) {
    size_t total = c->scene->photograph_count;
    c->count = total < CONSISTENCY_PHOTOGRAPHS ? total : CONSISTENCY_PHOTOGRAPHS;
    bool *taken = mem_calloc(c->count + 1, sizeof *taken);
    size_t kept = 0;
    for (uint32_t i = 0; kept < c->count; i++) {
        double part = 0.0, bit = 0.5;
        for (uint32_t rest = i; rest > 0; rest /= 2, bit /= 2)
            part += bit * (rest % 2);
        size_t place = (size_t)(part * (double)c->count);
        if (taken[place])
            continue;
        taken[place] = true;
        c->chosen[kept++] = (2 * place + 1) * total / (2 * c->count);
    }
    mem_free(taken);
}

struct consistency *consistency_new(const struct scene *scene, const struct accel *accel, struct parallel *pool) {
    struct consistency *c = mem_calloc(1, sizeof *c);
    c->scene = scene;
    c->accel = accel;
    c->pool = pool;
    mesh_bounds(&scene->mesh, &c->lower, &c->upper);
    c->thumbnail = mem_calloc(scene->photograph_count + 1, sizeof *c->thumbnail);
    parallel_for(pool, scene->photograph_count, thumbnail_body, c);
    choose(c);
    return c;
}

void consistency_free(struct consistency *c) {
    if (!c)
        return;
    for (size_t i = 0; i < c->scene->photograph_count; i++)
        thumbnail_release(&c->thumbnail[i]);
    mem_free(c->thumbnail);
    mem_free(c);
}

double consistency_detail(const struct consistency *c) {
    double sum = 0.0;
    for (size_t i = 0; i < c->scene->photograph_count; i++)
        sum += (double)c->thumbnail[i].detail;
    return sum / (double)c->scene->photograph_count;
}

const struct thumbnail *consistency_thumbnail(const struct consistency *c, size_t photograph) {
    return &c->thumbnail[photograph];
}

/* --- points that several photographs see ------------------------------------------------------------ */

/* A point of one photograph as another one sees it. */
struct shared_point {
    uint32_t other; /* number among the chosen */
    float u, v;     /* relative position there */
};

/* What one photograph contributes. */
struct photograph_points {
    bool has_pose;
    size_t point_count;
    float *value;                /* [point_count]; owned */
    size_t *start;               /* [point_count + 1] into shared; owned */
    struct shared_point *shared; /* owned */
    size_t hits, backs, common;
};

struct search {
    const struct consistency *c;
    size_t count, points;
    uint64_t seed;
    struct camera camera[CONSISTENCY_PHOTOGRAPHS];
    bool has_pose[CONSISTENCY_PHOTOGRAPHS];
    struct photograph_points part[CONSISTENCY_PHOTOGRAPHS];
};

/* Whether another photograph sees the point. */
static bool sees(const struct search *s, size_t other, vec3 point, vec3 normal, struct shared_point *out) {
    float x, y, depth;
    const struct camera *camera = &s->camera[other];
    if (!s->has_pose[other] || !camera_project(camera, point, &x, &y, &depth))
        return false;
    vec3 away = vec3_sub(camera_origin(camera), point);
    float distance = vec3_length(away);
    vec3 direction = vec3_scale(away, 1.0f / distance);
    if (!(fabsf(vec3_dot(normal, direction)) > COSINE_MIN))
        return false;
    if (accel_occluded(s->c->accel, camera_origin(camera), vec3_neg(direction), 0.0f, FREE_SHARE * distance))
        return false;
    *out = (struct shared_point){(uint32_t)other, x / (float)camera->width, y / (float)camera->height};
    return true;
}

/* Appends up to OTHERS_MAX photographs that see the point. */
static size_t find_others(const struct search *s, size_t own, vec3 point, vec3 normal, uint32_t key,
                          struct shared_point *out) {
    size_t found = 0, start = rng_below(key, (uint32_t)s->count);
    for (size_t i = 0; i < s->count && found < OTHERS_MAX; i++) {
        size_t other = (start + i) % s->count;
        found += other != own && sees(s, other, point, normal, &out[found]);
    }
    return found;
}

/* Traces point number `number`, in a jittered grid. */
static void trace_point(struct search *s, size_t own, size_t number, struct photograph_points *part) {
    const struct consistency *c = s->c;
    const struct camera *camera = &s->camera[own];
    uint64_t bits = rng_key(s->seed, own, number);
    /* Roberts' R2 sequence: every beginning of it covers the picture evenly. */
    double u = 0.7548776662466927 * (double)(number + 1) + (double)rng_to_float((uint32_t)bits) * 0.05;
    double v = 0.5698402909980532 * (double)(number + 1) + (double)rng_to_float((uint32_t)(bits >> 32)) * 0.05;
    u += (double)rng_to_float((uint32_t)rng_key(s->seed, own, UINT64_MAX));
    v += (double)rng_to_float((uint32_t)rng_key(s->seed, own, UINT64_MAX - 1));
    float fu = EDGE_SHARE + (1.0f - 2.0f * EDGE_SHARE) * (float)(u - floor(u));
    float fv = EDGE_SHARE + (1.0f - 2.0f * EDGE_SHARE) * (float)(v - floor(v));
    struct accel_hit hit;
    vec3 direction;
    size_t at = part->start[number];
    part->start[number + 1] = at;
    part->value[number] = thumbnail_value(&c->thumbnail[c->chosen[own]], fu, fv);
    if (!camera_direction(camera, fu * (float)camera->width, fv * (float)camera->height, &direction) ||
        !accel_intersect(c->accel, camera_origin(camera), direction, 0.0f, INFINITY, &hit))
        return;
    vec3 normal = vec3_normalize(mesh_cross(&c->scene->mesh, hit.triangle));
    float cosine = -vec3_dot(normal, direction);
    part->hits++;
    part->backs += cosine < 0.0f;
    if (!(fabsf(cosine) > COSINE_MIN))
        return;
    vec3 point = vec3_mad(camera_origin(camera), hit.distance_m, direction);
    size_t found = find_others(s, own, point, normal, (uint32_t)(bits >> 16), part->shared + at);
    part->common += found > 0;
    part->start[number + 1] = at + found;
}

static void search_body(void *user, size_t own, int thread) {
    struct search *s = user;
    struct photograph_points *part = &s->part[own];
    (void)thread;
    part->has_pose = s->has_pose[own];
    if (!part->has_pose)
        return;
    part->point_count = s->points;
    part->value = mem_array(s->points, sizeof *part->value);
    part->start = mem_calloc(s->points + 1, sizeof *part->start);
    part->shared = mem_array(s->points * OTHERS_MAX, sizeof *part->shared);
    for (size_t i = 0; i < s->points; i++)
        trace_point(s, own, i, part);
}

/* --- the score ------------------------------------------------------------------------------------------ */

/* Where the picture of another camera is looked up in place of its own. */
struct assignment {
    size_t picture; /* number among the chosen */
    float du, dv;   /* displacement, wrapped around */
    bool flip_u, flip_v;
};

static float assigned_value(const struct search *s, const struct assignment *a, const struct shared_point *p) {
    float u = (a->flip_u ? 1.0f - p->u : p->u) + a->du, v = (a->flip_v ? 1.0f - p->v : p->v) + a->dv;
    return thumbnail_value(&s->c->thumbnail[s->c->chosen[a->picture]], u - floorf(u), v - floorf(v));
}

struct score_sums {
    double product, own, other; /* over points seen by others: of a b, a^2, mean b^2 */
    double part[CONSISTENCY_PHOTOGRAPHS];
    double all; /* of a^2, over all points */
};

static void add_photograph(const struct search *s, size_t own, const struct assignment *assigned,
                           struct score_sums *sums) {
    const struct photograph_points *part = &s->part[own];
    for (size_t i = 0; i < part->point_count; i++) {
        double a = (double)part->value[i], product = 0.0, squares = 0.0;
        size_t from = part->start[i], to = part->start[i + 1];
        sums->all += a * a;
        for (size_t k = from; k < to; k++) {
            double b = (double)assigned_value(s, &assigned[part->shared[k].other], &part->shared[k]);
            product += a * b;
            squares += b * b;
        }
        if (to == from)
            continue;
        sums->part[own] += product / (double)(to - from);
        sums->own += a * a;
        sums->other += squares / (double)(to - from);
    }
    sums->product += sums->part[own];
}

static double score_of(const struct score_sums *sums) { return sums->all > 0.0 ? sums->product / sums->all : 0.0; }

struct null_job {
    const struct search *search;
    uint64_t seed;
    double *score; /* [draws] */
};

/* Every camera gets the picture of another, turned and displaced. */
static void null_body(void *user, size_t draw, int thread) {
    const struct null_job *job = user;
    const struct search *s = job->search;
    struct assignment assigned[CONSISTENCY_PHOTOGRAPHS];
    struct score_sums sums = {0};
    (void)thread;
    for (size_t i = 0; i < s->count; i++) {
        uint64_t bits = rng_key(job->seed, draw, i);
        size_t step = s->count > 1 ? 1 + rng_below((uint32_t)bits, (uint32_t)s->count - 1) : 0;
        assigned[i] = (struct assignment){
            .picture = (i + step) % s->count,
            .du = 0.15f + 0.7f * rng_to_float((uint32_t)(bits >> 20) << 8),
            .dv = 0.15f + 0.7f * rng_to_float((uint32_t)(bits >> 32) << 8),
            .flip_u = bits >> 62 & 1,
            .flip_v = bits >> 63 & 1,
        };
    }
    for (size_t own = 0; own < s->count; own++)
        add_photograph(s, own, assigned, &sums);
    job->score[draw] = score_of(&sums);
}

static void measure_null(const struct search *s, size_t draws, uint64_t seed, struct photo_agreement *result) {
    struct null_job job = {s, seed, mem_array(draws + 1, sizeof *job.score)};
    double mean = 0.0, squares = 0.0;
    parallel_for(s->c->pool, draws, null_body, &job);
    for (size_t i = 0; i < draws; i++)
        mean += job.score[i] / (double)draws;
    for (size_t i = 0; i < draws; i++)
        squares += (job.score[i] - mean) * (job.score[i] - mean);
    result->null_mean = mean;
    result->null_deviation = draws > 1 ? sqrt(squares / (double)(draws - 1)) : 0.0;
    result->z = result->null_deviation > 0.0 ? (result->score - mean) / result->null_deviation : 0.0;
    mem_free(job.score);
}

static void sum_up(const struct search *s, struct photo_agreement *result) {
    struct assignment own_pictures[CONSISTENCY_PHOTOGRAPHS] = {0};
    struct score_sums sums = {0};
    double rays = 0.0, hits = 0.0, backs = 0.0, common = 0.0;
    for (size_t i = 0; i < s->count; i++)
        own_pictures[i].picture = i;
    for (size_t i = 0; i < s->count; i++) {
        double before = sums.all;
        add_photograph(s, i, own_pictures, &sums);
        result->part[i] = sums.part[i];
        result->weight[i] = sums.all - before;
        rays += (double)s->part[i].point_count;
        hits += (double)s->part[i].hits;
        backs += (double)s->part[i].backs;
        common += (double)s->part[i].common;
    }
    double scale = sqrt(sums.own * sums.other);
    result->photograph_count = s->count;
    result->score = score_of(&sums);
    result->correlation = scale > 0.0 ? sums.product / scale : 0.0;
    result->hit_share = rays > 0.0 ? hits / rays : 0.0;
    result->back_share = hits > 0.0 ? backs / hits : 0.0;
    result->shared_share = rays > 0.0 ? common / rays : 0.0;
}

static void place_cameras(struct search *s, const struct hypothesis *h, struct photo_agreement *result) {
    const struct consistency *c = s->c;
    vec3 margin = vec3_scale(vec3_sub(c->upper, c->lower), 0.1f);
    vec3 low = vec3_sub(c->lower, margin), high = vec3_add(c->upper, margin);
    size_t posed = 0, inside = 0;
    for (size_t i = 0; i < s->count; i++) {
        s->has_pose[i] = hypothesis_camera(h, c->scene, c->chosen[i], &s->camera[i]);
        if (!s->has_pose[i])
            continue;
        vec3 o = camera_origin(&s->camera[i]);
        posed++;
        inside += o.x > low.x && o.y > low.y && o.z > low.z && o.x < high.x && o.y < high.y && o.z < high.z;
    }
    result->inside_share = posed > 0 ? (double)inside / (double)posed : 0.0;
}

void consistency_measure(const struct consistency *c, const struct hypothesis *h,
                         const struct consistency_effort *effort, uint64_t seed, struct photo_agreement *result) {
    struct search *s = mem_calloc(1, sizeof *s);
    s->c = c;
    s->count = effort->photographs < c->count ? effort->photographs : c->count;
    s->points = effort->points;
    s->seed = seed;
    *result = (struct photo_agreement){0};
    place_cameras(s, h, result);
    parallel_for(c->pool, s->count, search_body, s);
    sum_up(s, result);
    if (effort->draws > 0)
        measure_null(s, effort->draws, rng_mix64(seed), result);
    for (size_t i = 0; i < s->count; i++) {
        mem_free(s->part[i].value);
        mem_free(s->part[i].start);
        mem_free(s->part[i].shared);
    }
    mem_free(s);
}

double consistency_compare(const struct photo_agreement *better, const struct photo_agreement *other) {
    double sum = 0.0, squares = 0.0, count = 0.0, weight = 0.0;
    for (size_t i = 0; i < better->photograph_count; i++) {
        if (!(better->weight[i] > 0.0) || !(other->weight[i] > 0.0))
            continue;
        double difference = better->part[i] - other->part[i];
        sum += difference;
        squares += difference * difference;
        weight += better->weight[i];
        count += 1.0;
    }
    if (count < 2.0)
        return 0.0;
    double spread = sqrt(fmax(squares - sum * sum / count, 0.0) * count / (count - 1.0));
    double error = hypot(better->null_deviation, other->null_deviation) * weight;
    if (count >= FEW_PHOTOGRAPHS && sum < PHOTOGRAPHS_SURE * spread)
        return fmin(sum, 0.0);
    return error > 0.0 ? sum / error : 0.0;
}

double consistency_evenness(const struct photo_agreement *a) {
    double score[CONSISTENCY_PHOTOGRAPHS];
    size_t count = 0;
    for (size_t i = 0; i < a->photograph_count; i++)
        if (a->weight[i] > 0.0)
            score[count++] = a->part[i] / a->weight[i];
    return a->score > 0.0 ? quantile_double(score, count, 0.25) / a->score : 0.0;
}
