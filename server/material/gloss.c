/* gloss.c -- see gloss.h. */
#include "server/material/gloss.h"

#include <math.h>

#include "common/mem.h"
#include "server/material/gloss_belief.h"
#include "server/material/gloss_look.h"

/* With fewer than these, and than this part of those asked for, pixels nearer to edges are taken as well, then smaller
 * patches. */
#define POINTS_ENOUGH 32
#define PART_ENOUGH 8
#define VIEWS_LEAST 3
/* Misfit at which a look has a quarter of its influence: parts of the texel's radiance and of the
 * median of the room. */
#define SCALE_RELATIVE 0.12f
#define SCALE_MEDIAN 0.005f
/* The light that arrives may be found too weak by so much. Held to 1, the base colour of something white could then not
 * explain what is seen, and highlights that are not there would. */
#define MOST_BASE_COLOR 1.25f
/* Errors that all texels of a segment share move the misfit of one candidate against another's by about this part of
 * it, which adds to the standard error of the difference: those of light and base colour, and, where no pixel is far from
 * an edge, what pixels take in of other surfaces. The bars of a window and the frame of a door let the true material
 * look up to a tenth worse than matt. */
#define MISFIT_FLOOR 0.01
#define MISFIT_FLOOR_EDGE 0.03
/* A segment is matt from this probability on; below, the mean over all candidates is nearer to the truth. */
#define SURELY_MATT 0.95
/* What a segment is taken for of which too few photographs speak: half way to an ordinary dielectric. Either way
 * its base colour is then off by 2 %, unless it is darker by a part of its misfit and so many standard errors. */
#define UNKNOWN_ROUGHNESS 0.5f
#define UNKNOWN_SPECULAR 0.25f
#define DARKER_PART 0.03
#define DARKER_ERRORS 3.0

#define ROUGHNESSES HIGHLIGHT_ROUGHNESSES
#define SPECULARS (HIGHLIGHT_SPECULARS + 1) /* the first is 0: no highlight */

static const float specular_of[SPECULARS] = {0.0f, 0.125f, 0.25f, 0.5f, 0.75f, 1.0f};

/* A place of the candidates' table. */
struct candidate {
    size_t k, m;
};

static const struct candidate matt = {ROUGHNESSES - 1, 0};

/* What is known of a segment. */
struct evidence {
    size_t count; /* texels */
    double floor; /* part of a misfit by which differences of misfits are off, all texels together */
    struct gloss_point point[GLOSS_POINTS_MOST];
    float misfit[GLOSS_POINTS_MOST][ROUGHNESSES][SPECULARS];
};

struct gloss_job {
    struct materials *materials;
    struct gloss_looker looker;
    struct evidence *evidence; /* [threads] */
    struct gloss_told *told;   /* [segments] */
};

/* --- misfits ------------------------------------------------------------------------------------ */

/* Robust misfit of one channel of a texel's photographs under roughness k and specular m, with the
 * base colour that fits them best (iteratively reweighted; Geman and McClure's function). */
static float misfit_channel(const struct gloss_point *p, size_t k, size_t m, int channel, float median) {
    float shown[GLOSS_VIEWS], white[GLOSS_VIEWS], weight[GLOSS_VIEWS], mean = 0.0f, misfit = 0.0f;
    for (size_t i = 0; i < p->count; i++) {
        const struct gloss_look *l = &p->look[i];
        float gloss = m == 0 ? 0.0f : (&l->highlight.radiance[k][m - 1].r)[channel];
        shown[i] = (&l->shown.r)[channel] - gloss;
        white[i] = (&l->white[k].r)[channel];
        weight[i] = 1.0f;
        mean += (&l->shown.r)[channel] / (float)p->count;
    }
    float scale = SCALE_RELATIVE * mean + SCALE_MEDIAN * median;
    for (int sweep = 0; sweep < 4; sweep++) {
        float over = 0.0f, under = 1e-20f;
        for (size_t i = 0; i < p->count; i++) {
            over += weight[i] * white[i] * shown[i];
            under += weight[i] * white[i] * white[i];
        }
        float base = clampf(over / under, 0.0f, MOST_BASE_COLOR);
        misfit = 0.0f;
        for (size_t i = 0; i < p->count; i++) {
            float e = (shown[i] - base * white[i]) / scale, influence = 1.0f / (1.0f + e * e);
            weight[i] = influence * influence;
            misfit += e * e * influence;
        }
    }
    return misfit;
}

static void take_misfits(const struct gloss_job *job, struct evidence *e) {
    float median = job->looker.views->median_radiance;
    for (size_t i = 0; i < e->count; i++) {
        for (size_t k = 0; k < ROUGHNESSES; k++) {
            for (size_t m = 0; m < SPECULARS; m++) {
                e->misfit[i][k][m] = 0.0f;
                for (int c = 0; c < 3; c++)
                    e->misfit[i][k][m] += misfit_channel(&e->point[i], k, m, c, median);
            }
        }
    }
}

/* Looks at some texels of a segment; false where fewer than two were seen so. */
static bool look(const struct gloss_job *job, size_t segment, struct gloss_way way, int thread) {
    struct evidence *e = &job->evidence[thread];
    e->count = gloss_look_at(&job->looker, segment, way, thread, e->point);
    e->floor = way.edge == 0 ? MISFIT_FLOOR : MISFIT_FLOOR_EDGE;
    return e->count >= 2;
}

/* Looks ever closer until enough texels were seen; false where hardly any is. */
static bool look_well(const struct gloss_job *job, size_t segment, int thread) {
    struct gloss_way way = {gloss_widest_patch(&job->looker, segment), 0, VIEWS_LEAST};
    size_t enough = gloss_points_of(&job->looker, segment) / PART_ENOUGH;
    enough = enough < POINTS_ENOUGH ? POINTS_ENOUGH : enough;
    for (;; way.patch = fmaxf(0.5f * way.patch, GLOSS_PATCH_LEAST)) {
        bool seen = false;
        for (way.edge = 0; way.edge < VIEWS_EDGE; way.edge++) {
            seen = look(job, segment, way, thread);
            if (job->evidence[thread].count >= enough)
                return true;
        }
        if (way.patch <= GLOSS_PATCH_LEAST)
            return seen;
    }
}

/* Sum of a candidate's misfits over the texels. */
static double misfit_of(const struct evidence *e, struct candidate c) {
    double sum = 0.0;
    for (size_t i = 0; i < e->count; i++)
        sum += (double)e->misfit[i][c.k][c.m];
    return sum;
}

/* Matt, or the glossy candidate of the least misfit where that is less. */
static struct candidate best_of(const struct evidence *e) {
    struct candidate best = matt;
    double least = misfit_of(e, matt);
    for (size_t k = 0; k < ROUGHNESSES && gloss_levels.roughness[k] <= GLOSS_ROUGHEST; k++) {
        for (size_t m = 1; m < SPECULARS; m++) {
            struct candidate c = {k, m};
            double misfit = misfit_of(e, c);
            if (misfit < least)
                best = c, least = misfit;
        }
    }
    return best;
}

/* How much better than `a` candidate `b` explains what the photographs show: part of the misfit, and standard
 * errors of that over the texels. */
static void compare(const struct evidence *e, struct candidate a, struct candidate b, double *part, double *errors) {
    double total = 0.0, gain = 0.0, squares = 0.0, n = (double)e->count;
    for (size_t i = 0; i < e->count; i++) {
        double without = (double)e->misfit[i][a.k][a.m], d = without - (double)e->misfit[i][b.k][b.m];
        total += without;
        gain += d;
        squares += d * d;
    }
    double floor = e->floor * total;
    *part = gain / fmax(total, 1e-30);
    *errors = gain / sqrt(fmax(squares - gain * gain / n + floor * floor, 1e-30));
}

/* How likely what was seen is under a candidate: a normal deviate of its misfit beyond that of the best one. */
static double likelihood(const struct evidence *e, struct candidate c, struct candidate best) {
    double part, errors;
    compare(e, c, best, &part, &errors);
    return errors > 0.0 ? exp(-0.5 * errors * errors) : 1.0;
}

/* --- segments ----------------------------------------------------------------------------------- */

/* The mean of those texels of a segment that photographs show. */
static rgb mean_base_color(const struct gloss_looker *l, size_t segment) {
    const struct reconstruction *r = l->r;
    double sum[3] = {0.0}, count = 0.0;
    for (uint32_t i = l->texels.first[segment]; i < l->texels.first[segment + 1]; i++) {
        uint32_t texel = l->texels.texel[i];
        if (!(r->fused.count[texel] > 0.0f))
            continue;
        for (size_t c = 0; c < 3; c++)
            sum[c] += (double)r->materials.base_color.texel[texel][c];
        count += 1.0;
    }
    double scale = 1.0 / fmax(count, 1.0);
    return rgb_make((float)(scale * sum[0]), (float)(scale * sum[1]), (float)(scale * sum[2]));
}

/* Offset in [-0.5, 0.5] of a parabola's least through three values of which the middle is least. */
static double between(double left, double middle, double right) {
    double bend = left - 2.0 * middle + right, offset = bend > 0.0 ? 0.5 * (left - right) / bend : 0.0;
    return offset < -0.5 ? -0.5 : offset > 0.5 ? 0.5 : offset;
}

/* Where between the levels the misfit is least about the best candidate. */
static double roughness_about(const struct evidence *e, struct candidate best) {
    const float *level = gloss_levels.roughness;
    size_t k = best.k, m = best.m;
    double middle = (double)level[k];
    if (m == 0 || k == 0 || k + 1 == ROUGHNESSES)
        return middle;
    double offset = between(misfit_of(e, (struct candidate){k - 1, m}), misfit_of(e, best),
                            misfit_of(e, (struct candidate){k + 1, m}));
    return middle + offset * (offset < 0.0 ? middle - (double)level[k - 1] : (double)level[k + 1] - middle);
}

static void note(const struct gloss_looker *l, size_t segment, const struct evidence *e, struct gloss_told *told) {
    struct candidate best = best_of(e);
    told->any = true;
    told->part = (double)(l->texels.first[segment + 1] - l->texels.first[segment]) / (double)l->r->inverse.valid_count;
    told->base_color = mean_base_color(l, segment);
    told->best = best.m == 0 ? GLOSS_MATT : gloss_candidate(best.k, best.m - 1);
    told->best_roughness = roughness_about(e, best);
    told->likelihood[GLOSS_MATT] = likelihood(e, matt, best);
    for (size_t k = 0; k < ROUGHNESSES; k++)
        for (size_t m = 1; m < SPECULARS; m++)
            told->likelihood[gloss_candidate(k, m - 1)] = likelihood(e, (struct candidate){k, m}, best);
}

static void set_gloss(struct materials *materials, size_t segment, double roughness, double specular) {
    materials->roughness[segment] = (float)roughness;
    materials->specular[segment] = (float)specular;
}

/* Whether a segment that is nowhere seen clean is darker than even the guess for unknown ones would have it:
 * at grazing angles that reflects a window. Pixels that mix surfaces, and single photographs, can tell that:
 * base colour explains whatever is brighter. */
static bool is_too_dark(const struct gloss_job *job, size_t segment, int thread) {
    struct candidate guess = {0, 0};
    double part, errors;
    if (!look(job, segment, (struct gloss_way){GLOSS_PATCH_LEAST, VIEWS_EDGE, 1}, thread))
        return false;
    take_misfits(job, &job->evidence[thread]);
    while (gloss_levels.roughness[guess.k] < UNKNOWN_ROUGHNESS)
        guess.k++;
    while (specular_of[guess.m] < UNKNOWN_SPECULAR)
        guess.m++;
    compare(&job->evidence[thread], matt, guess, &part, &errors);
    return part < -DARKER_PART && errors < -DARKER_ERRORS;
}

static void look_at_segment(void *user, size_t segment, int thread) {
    const struct gloss_job *job = user;
    if (job->looker.r->is_emitter[segment]) { /* its own light hides what it reflects */
        set_gloss(job->materials, segment, 1.0, 0.0);
        return;
    }
    set_gloss(job->materials, segment, UNKNOWN_ROUGHNESS, UNKNOWN_SPECULAR);
    if (look_well(job, segment, thread)) {
        take_misfits(job, &job->evidence[thread]);
        note(&job->looker, segment, &job->evidence[thread], &job->told[segment]);
    } else if (is_too_dark(job, segment, thread)) {
        set_gloss(job->materials, segment, 1.0, 0.0);
    }
}

static void fit_segment(void *user, size_t segment, int thread) {
    (void)thread;
    const struct gloss_job *job = user;
    if (!job->told[segment].any)
        return;
    struct gloss_belief belief = gloss_believe(job->told, job->looker.r->segments.count, segment);
    if (belief.matt > SURELY_MATT)
        set_gloss(job->materials, segment, 1.0, 0.0);
    else
        set_gloss(job->materials, segment, belief.roughness, belief.specular);
}

void gloss_fit(struct reconstruction *r, const struct views *views, const struct probes *probes,
               const struct light_field *field) {
    struct gloss_job job = {.materials = &r->materials};
    gloss_looker_init(&job.looker, r, views, probes, field);
    job.evidence = mem_array((size_t)parallel_thread_count(r->pool), sizeof *job.evidence);
    job.told = mem_calloc(r->segments.count, sizeof *job.told);
    parallel_for(r->pool, r->segments.count, look_at_segment, &job);
    parallel_for(r->pool, r->segments.count, fit_segment, &job);
    mem_free(job.told);
    mem_free(job.evidence);
    gloss_looker_release(&job.looker);
}
