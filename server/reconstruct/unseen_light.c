/* unseen_light.c -- see unseen_light.h. */
#include "server/reconstruct/unseen_light.h"

#include <math.h>
#include <string.h>

#include "common/mem.h"
#include "common/quantile.h"
#include "server/reconstruct/conjugate.h"
#include "server/reconstruct/emitters.h"
#include "server/reconstruct/incident.h"
#include "server/render/sampler.h"

#define POINTS 2048
#define WAYS 512 /* directions a point */
#define KEY_UNSEEN 23 /* keeps these random numbers apart from others of the texel */
/* The coarse map, in columns of longitude and rows of latitude. */
#define COLUMNS 12
#define ROWS 6
#define CELLS (COLUMNS * ROWS)
/* A point speaks of the unseen directions where they have this share of its rays; so many must. */
#define SHARE_LEAST 0.1f
#define LEAST_POINTS 64
/* White paint, and the part of the points that is no whiter. In scans that is not near 1: in creases of a
 * fused mesh too little light is found. */
#define WHITE_BASE_COLOR 0.85
/* Nothing is so white. Light is missing, and not only known badly, if a good part of the points are. */
#define IMPOSSIBLE_BASE_COLOR 1.5
#define NOT_IMPOSSIBLE 0.8
#define NO_WHITER 0.9
/* Standard deviations of the logarithm of base colour within a segment and above white. */
#define SPREAD_WITHIN 0.3
#define SPREAD_BEYOND 0.15
/* Deviations at which a point has a quarter of its influence: emitters are no surfaces lit. Beyond white it
 * comes later, or a room that is much too dark would be taken for one of lamps. */
#define OUTLIER 2.0
#define OUTLIER_BEYOND 5.0
/* Weights, in points of one deviation, of cells that differ from their neighbours by a factor of e, and
 * from where they began. */
#define SMOOTHNESS (0.01 * POINTS)
#define INERTIA (0.001 * POINTS)
#define STEPS 40
#define LONGEST_STEP 0.5 /* of a logarithm */

/* One point of the surface: what it shows; the light that arrives as a white surface would send it back, what
 * is known of it and what was filled in; and the shares of the ways that lead to the cells. Mean of the
 * channels. */
struct point {
    uint32_t segment;
    float shown, known, filled, unseen, share[CELLS]; /* unseen: the shares' sum */
};

struct unseen {
    struct reconstruction *r;
    uint16_t (*radiance)[3];  /* [height][width] */
    struct light_field field;
    size_t count;
    uint32_t *texel;          /* [count] */
    struct point *point;      /* [count] */
    struct incident *scratch; /* [threads] */
    double start[CELLS], log_radiance[CELLS];
};

/* The four cells around a direction and their weights. */
struct corner {
    size_t cell[4];
    float weight[4];
};

static struct corner corners_at(vec3 d) {
    double x = atan2((double)d.x, (double)-d.z) / (2.0 * PI) * COLUMNS - 0.5;
    double y = acos(fmin(fmax((double)d.y, -1.0), 1.0)) / PI * ROWS - 0.5;
    double column = floor(x), row = floor(y);
    float fx = (float)(x - column), fy = (float)(y - row);
    struct corner c;
    for (int i = 0; i < 4; i++) {
        int at_x = ((int)column + i % 2 + COLUMNS) % COLUMNS, at_y = (int)row + i / 2;
        at_y = at_y < 0 ? 0 : at_y >= ROWS ? ROWS - 1 : at_y;
        c.cell[i] = (size_t)(at_y * COLUMNS + at_x);
        c.weight[i] = (i % 2 ? fx : 1.0f - fx) * (i / 2 ? fy : 1.0f - fy);
    }
    return c;
}

/* --- looking around ------------------------------------------------------------------------------- */

static uint32_t segment_of(const struct reconstruction *r, uint32_t texel) {
    return r->segments.of_triangle[r->inverse.triangle[texel]];
}

/* What texels send out: of those that no photograph shows the mean of their segment, or of the room. */
static void fill_radiance(struct unseen *u) {
    const struct reconstruction *r = u->r;
    size_t segments = r->segments.count;
    double(*sum)[4] = mem_calloc(segments + 1, sizeof *sum);
    u->radiance = mem_calloc_large((size_t)r->fused.width * r->fused.height, sizeof *u->radiance);
    memcpy(u->radiance, r->fused.radiance, (size_t)r->fused.width * r->fused.height * sizeof *u->radiance);
    for (size_t i = 0; i < r->inverse.valid_count; i++) {
        uint32_t texel = r->inverse.valid[i];
        rgb shown = fused_radiance(&r->fused, texel);
        if (!(r->fused.count[texel] > 0.0f))
            continue;
        for (size_t s = segment_of(r, texel), k = 0; k < 2; s = segments, k++) {
            sum[s][0] += (double)shown.r;
            sum[s][1] += (double)shown.g;
            sum[s][2] += (double)shown.b;
            sum[s][3] += 1.0;
        }
    }
    for (size_t i = 0; i < r->inverse.valid_count; i++) {
        uint32_t texel = r->inverse.valid[i], segment = segment_of(r, texel);
        const double *from = sum[segment][3] > 0.0 ? sum[segment] : sum[segments];
        for (int c = 0; c < 3 && !(r->fused.count[texel] > 0.0f) && from[3] > 0.0; c++)
            u->radiance[texel][c] = image_half_from_float((float)(from[c] / from[3]));
    }
    mem_free(sum);
}

/* A surface that photographs show and that is no lamp. */
static bool tells(const struct reconstruction *r, uint32_t texel) {
    return r->fused.count[texel] > 0.0f && rgb_is_black(r->materials.emission[segment_of(r, texel)]);
}

/* Such texels, evenly spread. */
static void choose_points(struct unseen *u) {
    const struct reconstruction *r = u->r;
    size_t seen = 0, met = 0;
    for (size_t i = 0; i < r->inverse.valid_count; i++)
        seen += tells(r, r->inverse.valid[i]);
    size_t wanted = seen < POINTS ? seen : POINTS;
    u->texel = mem_array(wanted + 1, sizeof *u->texel);
    for (size_t i = 0; i < r->inverse.valid_count && u->count < wanted; i++) {
        uint32_t texel = r->inverse.valid[i];
        if (tells(r, texel) && met++ == u->count * seen / wanted)
            u->texel[u->count++] = texel;
    }
}

static void look_around(void *user, size_t index, int thread) {
    struct unseen *u = user;
    const struct reconstruction *r = u->r;
    struct point *p = &u->point[index];
    struct incident *in = &u->scratch[thread];
    uint32_t texel = u->texel[index], key = sampler_key(KEY_UNSEEN, texel, 0);
    struct surface_point at;
    *p = (struct point){.segment = segment_of(r, texel)};
    if (!surface_at_texel(&r->scene->mesh, &r->atlas, &r->inverse, texel, &at))
        return;
    vec3 frame[3] = {[2] = at.shading};
    vec3_frame(at.shading, &frame[0], &frame[1]);
    for (uint32_t i = 0; i < WAYS; i++)
        in->direction[i] = incident_cosine_direction(frame, sampler_pair(key, i, 0));
    incident_trace(in, &u->field, &at, WAYS);
    for (size_t i = 0; i < WAYS; i++) {
        bool has_map = r->environment.map.pixel != NULL;
        if (in->hit[i].triangle != ACCEL_NONE || (has_map && environment_is_seen(&r->environment, in->direction[i])))
            continue;
        p->filled += rgb_mean(in->radiance[i]) / WAYS;
        p->unseen += 1.0f / WAYS;
        struct corner c = corners_at(in->direction[i]);
        for (int k = 0; k < 4; k++)
            p->share[c.cell[k]] += c.weight[k] / WAYS;
    }
    struct irradiance light;
    irradiance_gather(&light, in, &u->field, &at, key, WAYS);
    p->known = fmaxf(rgb_mean(irradiance_diffuse(&light, at.shading, 1.0f, at.shading)) - p->filled, 0.0f);
    p->shown = rgb_mean(fused_radiance(&r->fused, texel));
}

static double unseen_share(const struct unseen *u) {
    double sum = 0.0;
    for (size_t i = 0; i < u->count; i++)
        sum += (double)u->point[i].unseen;
    return sum / fmax((double)u->count, 1.0);
}

/* Keeps the points that speak of the unseen directions. */
static void keep_telling_points(struct unseen *u) {
    size_t kept = 0;
    for (size_t i = 0; i < u->count; i++) {
        if (u->point[i].unseen >= SHARE_LEAST)
            u->point[kept++] = u->point[i];
    }
    u->count = kept;
}

/* --- what it takes -------------------------------------------------------------------------------- */

static double arrived(const struct point *p, const double log_radiance[CELLS]) {
    double sum = (double)p->known;
    for (size_t k = 0; k < CELLS; k++)
        sum += (double)p->share[k] * exp(log_radiance[k]);
    return fmax(sum, 1e-12);
}

/* Base colour that part `below` of the points do not exceed under such a map, or, without one, under what was
 * filled in. */
static double base_color_at(const struct unseen *u, double below, const double *log_radiance) {
    float *base = mem_array(u->count + 1, sizeof *base);
    for (size_t i = 0; i < u->count; i++) {
        const struct point *p = &u->point[i];
        double light = log_radiance ? arrived(p, log_radiance) : (double)(p->known + p->filled);
        base[i] = (float)((double)p->shown / fmax(light, 1e-12));
    }
    double found = (double)quantile(base, u->count, below);
    mem_free(base);
    return found;
}

/* Multiplies the map so that nearly all is no whiter than white. */
static void make_white(struct unseen *u) {
    double low = -20.0, high = 20.0, cell[CELLS];
    for (int i = 0; i < 40; i++) {
        double middle = 0.5 * (low + high);
        for (size_t k = 0; k < CELLS; k++)
            cell[k] = u->log_radiance[k] + middle;
        *(base_color_at(u, NO_WHITER, cell) > WHITE_BASE_COLOR ? &low : &high) = middle;
    }
    for (size_t k = 0; k < CELLS; k++)
        u->log_radiance[k] += high;
}

/* Geman and McClure's weight of a residual in deviations. */
static double influence(double deviations, double outlier) {
    double e = deviations / outlier, w = 1.0 / (1.0 + e * e);
    return w * w;
}

/* The weighted mean of the logarithm of base colour in each segment. */
static void means_of_segments(const struct unseen *u, const double *log_base, double *mean) {
    size_t segments = u->r->segments.count;
    double *weight = mem_calloc(segments, sizeof *weight);
    memset(mean, 0, segments * sizeof *mean);
    for (size_t i = 0; i < u->count; i++) {
        double w = influence(fmax(log_base[i] - log(WHITE_BASE_COLOR), 0.0) / SPREAD_BEYOND, OUTLIER_BEYOND);
        mean[u->point[i].segment] += w * log_base[i];
        weight[u->point[i].segment] += w;
    }
    for (size_t s = 0; s < segments; s++)
        mean[s] /= fmax(weight[s], 1e-12);
    mem_free(weight);
}

struct normal {
    double matrix[CELLS][CELLS], residual[CELLS];
};

static void multiply(const void *user, const double *x, double *out) {
    const struct normal *n = user;
    for (size_t i = 0; i < CELLS; i++)
        out[i] = conjugate_dot(n->matrix[i], x, CELLS);
}

static void precondition(const void *user, const double *residual, double *out) {
    const struct normal *n = user;
    for (size_t i = 0; i < CELLS; i++)
        out[i] = residual[i] / n->matrix[i][i];
}

/* Pulls the difference of two unknowns, or of one and a constant, to zero. */
static void tie(struct normal *n, size_t a, size_t b, double difference, double weight) {
    n->matrix[a][a] += weight;
    n->residual[a] -= weight * difference;
    if (a == b)
        return;
    n->matrix[b][b] += weight;
    n->matrix[a][b] -= weight;
    n->matrix[b][a] -= weight;
    n->residual[b] += weight * difference;
}

static void add_point(struct normal *n, const struct point *p, const double cell[CELLS], double log_base,
                      double mean) {
    double within = log_base - mean, beyond = fmax(log_base - log(WHITE_BASE_COLOR), 0.0);
    double within_weight = influence(within / SPREAD_WITHIN, OUTLIER) / (SPREAD_WITHIN * SPREAD_WITHIN);
    double beyond_weight = influence(beyond / SPREAD_BEYOND, OUTLIER_BEYOND) / (SPREAD_BEYOND * SPREAD_BEYOND);
    double pull = within_weight * within + beyond_weight * beyond;
    double weight = within_weight + (beyond > 0.0 ? beyond_weight : 0.0);
    double slope[CELLS], all = arrived(p, cell);
    for (size_t k = 0; k < CELLS; k++)
        slope[k] = (double)p->share[k] * exp(cell[k]) / all; /* of -log_base */
    for (size_t k = 0; k < CELLS; k++) {
        if (slope[k] == 0.0)
            continue;
        n->residual[k] += slope[k] * pull;
        for (size_t m = 0; m < CELLS; m++)
            n->matrix[k][m] += weight * slope[k] * slope[m];
    }
}

static void step(struct unseen *u, struct normal *n, double *log_base, double *mean) {
    double *cell = u->log_radiance, move[CELLS] = {0};
    memset(n, 0, sizeof *n);
    for (size_t i = 0; i < u->count; i++)
        log_base[i] = log(fmax((double)u->point[i].shown, 1e-12) / arrived(&u->point[i], cell));
    means_of_segments(u, log_base, mean);
    for (size_t i = 0; i < u->count; i++)
        add_point(n, &u->point[i], cell, log_base[i], mean[u->point[i].segment]);
    for (size_t k = 0; k < CELLS; k++) {
        size_t right = k % COLUMNS + 1 < COLUMNS ? k + 1 : k + 1 - COLUMNS;
        tie(n, k, k, cell[k] - u->start[k], INERTIA);
        tie(n, k, right, cell[k] - cell[right], SMOOTHNESS);
        if (k + COLUMNS < CELLS)
            tie(n, k, k + COLUMNS, cell[k] - cell[k + COLUMNS], SMOOTHNESS);
    }
    struct conjugate_system system = {CELLS, multiply, precondition, n};
    conjugate_solve(&system, CELLS, 0.0, n->residual, move);
    for (size_t k = 0; k < CELLS; k++)
        cell[k] += fmin(fmax(move[k], -LONGEST_STEP), LONGEST_STEP);
}

static void fit(struct unseen *u) {
    double *log_base = mem_array(u->count, sizeof *log_base);
    double *mean = mem_array(u->r->segments.count, sizeof *mean);
    struct normal *n = mem_array(1, sizeof *n);
    make_white(u);
    memcpy(u->start, u->log_radiance, sizeof u->start);
    for (int i = 0; i < STEPS; i++)
        step(u, n, log_base, mean);
    make_white(u);
    mem_free(n);
    mem_free(mean);
    mem_free(log_base);
}

/* --- the whole ------------------------------------------------------------------------------------ */

static void fill_in(const struct unseen *u) {
    struct environment *e = &u->r->environment;
    for (size_t row = 0; row < e->map.height; row++) {
        for (size_t column = 0; column < e->map.width; column++) {
            size_t at = row * e->map.width + column;
            if (e->confidence.pixel[2 * at] > 0.0f)
                continue;
            struct corner c = corners_at(environment_direction(e, column, row));
            double radiance = 0.0;
            for (int k = 0; k < 4; k++)
                radiance += (double)c.weight[k] * exp(u->log_radiance[c.cell[k]]);
            for (size_t channel = 0; channel < 3; channel++)
                e->map.pixel[3 * at + channel] = (float)radiance;
        }
    }
}

/* Fills the points: what they show, and what is around them. Small lamps must be looked for. */
static void gather_points(struct unseen *u, const struct views *views) {
    struct reconstruction *r = u->r;
    struct emitter_evidence *evidence = mem_calloc(r->segments.count, sizeof *evidence);
    emitters_observe(r, views, evidence);
    emitters_light_bright(r, views, evidence);
    choose_points(u);
    u->point = mem_array(u->count + 1, sizeof *u->point);
    u->scratch = mem_array((size_t)parallel_thread_count(r->pool), sizeof *u->scratch);
    parallel_for(r->pool, u->count, look_around, u);
    memset(r->materials.emission, 0, r->segments.count * sizeof *r->materials.emission);
    world_update_lights(&r->world);
    mem_free(evidence);
}

static void relight(struct unseen *u) {
    struct reconstruction *r = u->r;
    fit(u);
    if (!r->environment.map.pixel)
        environment_make_unseen(&r->environment);
    fill_in(u);
    environment_update_figures(&r->environment);
    world_set_environment(&r->world, &r->environment.map, r->pool);
}

void unseen_light_estimate(struct reconstruction *r, const struct views *views) {
    struct unseen u = {.r = r};
    fill_radiance(&u);
    u.field = (struct light_field){&r->world, (const uint16_t(*)[3])u.radiance};
    cJSON *figures = cJSON_AddObjectToObject(r->report, "unseen_light");
    gather_points(&u, views);
    r->unseen_share = unseen_share(&u);
    keep_telling_points(&u);
    double base_color = base_color_at(&u, NOT_IMPOSSIBLE, NULL);
    bool matters = u.count >= LEAST_POINTS && base_color > IMPOSSIBLE_BASE_COLOR;
    if (matters)
        relight(&u);
    json_add_number(figures, "share_of_rays", r->unseen_share);
    json_add_number(figures, "base_color_without", base_color);
    json_add_bool(figures, "estimated", matters);
    mem_free(u.scratch);
    mem_free(u.point);
    mem_free(u.texel);
    mem_free(u.radiance);
}
