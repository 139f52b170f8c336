/* gloss.c -- see gloss.h. */
#include "server/reconstruct/gloss.h"

#include <math.h>
#include <string.h>

#include "common/mem.h"
#include "common/rng.h"
#include "server/reconstruct/by_segment.h"
#include "server/reconstruct/highlight.h"
#include "server/render/sampler.h"
#include "server/scene/surface.h"

/* Texels that are looked at in all; a segment's share of them goes by the root of its share of the texels. */
#define POINTS_IN_ALL 24000
#define POINTS_LEAST 24
#define POINTS_MOST 256
/* With fewer than these, pixels nearer to edges are taken as well. */
#define POINTS_ENOUGH 32
#define TRIES 16 /* texels tried for one that is looked at */
#define VIEWS 10
#define VIEWS_ASKED 40 /* of which those far from edges are taken */
#define VIEWS_LEAST 3
/* Directions a photograph and place of the patch: of each roughness level, and of the lights. */
#define SAMPLES_A_LEVEL 1
#define LIGHT_SAMPLES 5
#define KEY_GLOSS 17 /* keeps these random numbers apart from others of the texel */
/* A photograph is read at PATCH x PATCH places over this many texels around, which takes out its
 * noise; their base colour may differ, it is the same in all photographs. So are candidates
 * evaluated at all of them: a patch may be curved. */
#define PATCH 5
#define PATCH_TEXELS 8
#define PATCH_COSINE 0.8f /* between its normals and that in its middle */
#define FACING 0.1f       /* cosine at which all of it must face a photograph */
/* Misfit at which a look has a quarter of its influence: parts of the texel's radiance and of the
 * median of the room. */
#define SCALE_RELATIVE 0.06f
#define SCALE_MEDIAN 0.005f
/* Gloss must explain this part of the misfit that remains without, and by so many standard errors
 * over the texels; else the segment is called matt. */
#define GAIN_LEAST 0.03
#define GAIN_ERRORS 3.0
/* Rougher highlights cannot be told from matt reflection. */
#define GLOSS_ROUGHEST 0.7f
/* Dielectrics are near an index of refraction of 1.5, specular .5: the misfit of others counts this
 * much more, times the square of the difference. */
#define PRIOR_SPECULAR 0.5f
#define PRIOR_WEIGHT 1.0f
/* What a segment is taken for of which the photographs tell neither that it is glossy nor, by so many
 * standard errors at each roughness, that it is matt: half way to an ordinary dielectric. Either way its base colour
 * is then off by 2 %. */
#define UNKNOWN_ROUGHNESS 0.5f
#define UNKNOWN_SPECULAR (0.5f * PRIOR_SPECULAR)
#define MATT_ERRORS 3.0

#define ROUGHNESSES HIGHLIGHT_ROUGHNESSES
#define SPECULARS (HIGHLIGHT_SPECULARS + 1) /* the first is 0: no highlight */

static const struct highlight_levels levels = {
    .roughness_count = HIGHLIGHT_ROUGHNESSES,
    .specular_count = HIGHLIGHT_SPECULARS,
    .roughness = {0.05f, 0.1f, 0.15f, 0.2f, 0.25f, 0.3f, 0.375f, 0.45f, 0.55f, 0.65f, 0.8f, 1.0f},
    .specular = {0.125f, 0.25f, 0.5f, 0.75f, 1.0f},
};
static const float specular_of[SPECULARS] = {0.0f, 0.125f, 0.25f, 0.5f, 0.75f, 1.0f};

/* One texel as one photograph shows it, and what each candidate sends there. */
struct gloss_look {
    rgb shown;
    rgb white[ROUGHNESSES]; /* of base colour 1 */
    struct highlight highlight;
};

struct gloss_point {
    size_t count;
    struct gloss_look look[VIEWS];
    float misfit[ROUGHNESSES][SPECULARS];
};

/* A few texels of a chart. */
struct patch {
    size_t count;
    struct surface_point at[PATCH * PATCH];
    struct irradiance light[PATCH * PATCH];
};

struct gloss_job {
    struct reconstruction *r;
    const struct views *views;
    const struct probes *probes;
    const struct light_field *field;
    struct texels_by_segment texels;
    double roots;              /* sum over the segments of the root of their texels */
    struct gloss_point *point; /* [threads][POINTS_MOST] */
    struct incident *scratch;  /* [threads] */
};

/* --- looking ------------------------------------------------------------------------------------ */

/* Points of the surface around a texel, of its chart and not too unlike in their normals. */
static void patch_around(const struct gloss_job *job, uint32_t texel, struct patch *patch) {
    const struct reconstruction *r = job->r;
    struct surface_point at;
    patch->count = 0;
    if (!surface_at_texel(&r->scene->mesh, &r->atlas, &r->inverse, texel, &at))
        return;
    uint32_t chart = r->atlas.chart_of_triangle[at.triangle];
    float x0 = (float)(texel % r->atlas.width) + 0.5f, y0 = (float)(texel / r->atlas.width) + 0.5f;
    for (int i = 0; i < PATCH * PATCH; i++) {
        struct surface_point p;
        struct probe_mix mix;
        float dx = ((float)(i % PATCH) + 0.5f) / PATCH - 0.5f, dy = ((float)(i / PATCH) + 0.5f) / PATCH - 0.5f;
        float x = x0 + PATCH_TEXELS * dx, y = y0 + PATCH_TEXELS * dy;
        if (!surface_at(&r->scene->mesh, &r->atlas, &r->inverse, x, y, &p) ||
            r->atlas.chart_of_triangle[p.triangle] != chart || vec3_dot(p.shading, at.shading) < PATCH_COSINE)
            continue;
        probes_mix(job->probes, &r->atlas, &r->fused, (uint32_t)y * r->atlas.width + (uint32_t)x, &p, &mix);
        probes_irradiance(job->probes, &mix, &patch->light[patch->count]);
        patch->at[patch->count++] = p;
    }
}

/* What a photograph shows of the patch on average; false unless all of it faces it and was measured, no
 * nearer to edges than `edge`. */
static bool patch_shown(const struct views *views, const struct view *view, const struct patch *patch, int edge,
                        rgb *shown) {
    const struct photograph *photo = &views->scene->photograph[views->train[view->train]];
    *shown = rgb_gray(0.0f);
    for (size_t i = 0; i < patch->count; i++) {
        const struct surface_point *at = &patch->at[i];
        struct view place = *view;
        struct photograph_sample s;
        float depth_m;
        if (vec3_dot(at->shading, views_direction(views, view->train, at->position)) < FACING ||
            !camera_project(&photo->camera, at->position, &place.x, &place.y, &depth_m) ||
            views_edge(views, &place, at->triangle) > edge ||
            !photograph_sample(photo, place.x, place.y, &s) || s.saturated[0] || s.saturated[1] || s.saturated[2])
            return false;
        *shown = rgb_mad(*shown, 1.0f / (float)patch->count, s.radiance);
    }
    return patch->count > 0;
}

/* What all candidates send to a photograph, the mean over the patch. */
static void predict(const struct gloss_job *job, const struct patch *patch, uint32_t texel, uint32_t train,
                    struct incident *scratch, struct gloss_look *look) {
    float share = 1.0f / (float)patch->count;
    memset(look->white, 0, sizeof look->white);
    memset(&look->highlight, 0, sizeof look->highlight);
    for (size_t i = 0; i < patch->count; i++) {
        const struct surface_point *at = &patch->at[i];
        struct highlight highlight;
        vec3 wo = views_direction(job->views, train, at->position);
        highlight_gather(&highlight, scratch, job->field, at, wo, &levels,
                         sampler_key(KEY_GLOSS + i, texel, train), SAMPLES_A_LEVEL * ROUGHNESSES, LIGHT_SAMPLES);
        for (size_t k = 0; k < ROUGHNESSES; k++) {
            rgb white = irradiance_diffuse(&patch->light[i], at->shading, levels.roughness[k], wo);
            look->white[k] = rgb_mad(look->white[k], share, white);
            for (size_t m = 0; m < HIGHLIGHT_SPECULARS; m++)
                look->highlight.radiance[k][m] =
                    rgb_mad(look->highlight.radiance[k][m], share, highlight.radiance[k][m]);
        }
    }
}

static bool look_at_texel(const struct gloss_job *job, uint32_t texel, int edge, size_t least,
                          struct incident *scratch, struct gloss_point *point) {
    struct patch patch;
    struct view view[VIEWS_ASKED];
    size_t shown_count = 0;
    point->count = 0;
    patch_around(job, texel, &patch);
    if (patch.count == 0)
        return false;
    const struct surface_point *middle = &patch.at[patch.count / 2];
    size_t seen = views_pick(job->views, middle->position, middle->normal, texel, VIEWS_ASKED, view);
    for (size_t i = 0; i < seen && shown_count < VIEWS; i++) {
        if (patch_shown(job->views, &view[i], &patch, edge, &point->look[shown_count].shown))
            view[shown_count++] = view[i];
    }
    if (shown_count < least)
        return false;
    for (size_t i = 0; i < shown_count; i++)
        predict(job, &patch, texel, view[i].train, scratch, &point->look[i]);
    point->count = shown_count;
    return true;
}

static size_t points_of(const struct gloss_job *job, size_t segment) {
    double texels = (double)(job->texels.first[segment + 1] - job->texels.first[segment]);
    size_t points = (size_t)(POINTS_IN_ALL * sqrt(texels) / job->roots);
    return points < POINTS_LEAST ? POINTS_LEAST : points > POINTS_MOST ? POINTS_MOST : points;
}

/* Looks at some texels of a segment that `least` photographs show; returns their number. */
static size_t look_at_segment(const struct gloss_job *job, size_t segment, int edge, size_t least, int thread) {
    struct gloss_point *point = &job->point[(size_t)thread * POINTS_MOST];
    size_t points = points_of(job, segment);
    uint32_t texels = job->texels.first[segment + 1] - job->texels.first[segment];
    const uint32_t *texel = &job->texels.texel[job->texels.first[segment]];
    size_t tries = TRIES * points, count = 0;
    bool all = texels <= tries;
    tries = all ? texels : tries;
    for (size_t i = 0; i < tries && count < points; i++) {
        /* Spread evenly over the segment wherever the sequence is cut off. */
        size_t at = all ? i : rng_below(sampler_reverse((uint32_t)i), texels);
        count += look_at_texel(job, texel[at], edge, least, &job->scratch[thread], &point[count]);
    }
    return count;
}

/* --- fitting ------------------------------------------------------------------------------------ */

/* Robust misfit of one channel of a texel's photographs under roughness k and specular m, with the
 * base colour that fits them best (iteratively reweighted; Geman and McClure's function). */
static float misfit_channel(const struct gloss_point *p, size_t k, size_t m, int channel, float median) {
    float shown[VIEWS], white[VIEWS], weight[VIEWS], mean = 0.0f, misfit = 0.0f;
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
        float base = clampf(over / under, 0.0f, 1.0f);
        misfit = 0.0f;
        for (size_t i = 0; i < p->count; i++) {
            float e = (shown[i] - base * white[i]) / scale, influence = 1.0f / (1.0f + e * e);
            weight[i] = influence * influence;
            misfit += e * e * influence;
        }
    }
    return misfit;
}

static float prior(size_t m) {
    float off = m == 0 ? 0.0f : specular_of[m] - PRIOR_SPECULAR;
    return 1.0f + PRIOR_WEIGHT * off * off;
}

/* Fills the sums over the texels, weighted by the prior. */
static void misfits(struct gloss_point *point, size_t count, float median, double sum[ROUGHNESSES][SPECULARS]) {
    for (size_t k = 0; k < ROUGHNESSES; k++) {
        for (size_t m = 0; m < SPECULARS; m++) {
            sum[k][m] = 0.0;
            for (size_t i = 0; i < count; i++) {
                float *misfit = &point[i].misfit[k][m];
                *misfit = 0.0f;
                for (int c = 0; c < 3; c++)
                    *misfit += misfit_channel(&point[i], k, m, c, median);
                sum[k][m] += (double)(*misfit * prior(m));
            }
        }
    }
}

/* How much better than matt a candidate explains what the photographs show: part of the misfit, and
 * standard errors of that over the texels. */
static void compare(const struct gloss_point *point, size_t count, size_t k, size_t m, double *part, double *errors) {
    double total = 0.0, gain = 0.0, squares = 0.0, n = (double)count;
    for (size_t i = 0; i < count; i++) {
        double without = (double)point[i].misfit[ROUGHNESSES - 1][0];
        double d = without - (double)point[i].misfit[k][m];
        total += without;
        gain += d;
        squares += d * d;
    }
    *part = gain / fmax(total, 1e-30);
    *errors = gain / sqrt(fmax(squares - gain * gain / n, 1e-30));
}

static bool is_glossy(const struct gloss_point *point, size_t count, size_t k, size_t m) {
    double part, errors;
    compare(point, count, k, m, &part, &errors);
    return part > GAIN_LEAST && errors > GAIN_ERRORS;
}

/* How sure it is, from 0 to 1, that no highlight which could be told from matt reflection is there: of a
 * dielectric, at any roughness. */
static float surely_matt(const struct gloss_point *point, size_t count) {
    size_t m = 1;
    double least = MATT_ERRORS;
    while (specular_of[m] < PRIOR_SPECULAR)
        m++;
    for (size_t k = 0; k < ROUGHNESSES && levels.roughness[k] <= GLOSS_ROUGHEST; k++) {
        double part, errors;
        compare(point, count, k, m, &part, &errors);
        least = fmin(least, -errors);
    }
    return (float)fmax(least / MATT_ERRORS, 0.0);
}

/* Offset in [-0.5, 0.5] of a parabola's least through three values of which the middle is least. */
static double between(double left, double middle, double right) {
    double bend = left - 2.0 * middle + right, offset = bend > 0.0 ? 0.5 * (left - right) / bend : 0.0;
    return offset < -0.5 ? -0.5 : offset > 0.5 ? 0.5 : offset;
}

static float interpolate(const float *value, size_t at, double offset) {
    float beside = offset < 0.0 ? value[at] - value[at - 1] : offset > 0.0 ? value[at + 1] - value[at] : 0.0f;
    return value[at] + (float)offset * beside;
}

/* Between the guess for unknown segments and a matt one. */
static void set_matt(struct materials *materials, size_t segment, float share) {
    materials->roughness[segment] = UNKNOWN_ROUGHNESS + share * (1.0f - UNKNOWN_ROUGHNESS);
    materials->specular[segment] = (1.0f - share) * UNKNOWN_SPECULAR;
}

/* Whether a segment that is nowhere seen clean is darker than even the guess for unknown ones would have it:
 * at grazing angles that reflects a window. Pixels that mix surfaces, and single photographs, can tell that:
 * base colour explains whatever is brighter. */
static bool is_too_dark(const struct gloss_job *job, size_t segment, int thread) {
    struct gloss_point *point = &job->point[(size_t)thread * POINTS_MOST];
    double sum[ROUGHNESSES][SPECULARS], part, errors;
    size_t count = look_at_segment(job, segment, VIEWS_EDGE, 1, thread), k = 0, m = 0;
    if (count < 2)
        return false;
    misfits(point, count, job->views->median_radiance, sum);
    while (levels.roughness[k] < UNKNOWN_ROUGHNESS)
        k++;
    while (specular_of[m] < UNKNOWN_SPECULAR)
        m++;
    compare(point, count, k, m, &part, &errors);
    return part < -GAIN_LEAST && errors < -GAIN_ERRORS;
}

static void fit_segment(void *user, size_t segment, int thread) {
    const struct gloss_job *job = user;
    struct materials *materials = &job->r->materials;
    struct gloss_point *point = &job->point[(size_t)thread * POINTS_MOST];
    double sum[ROUGHNESSES][SPECULARS];
    size_t count = 0, k = ROUGHNESSES - 1, m = 0;
    set_matt(materials, segment, 0.0f);
    if (job->r->is_emitter[segment])
        return; /* its own light hides it */
    for (int edge = 0; edge < VIEWS_EDGE && count < POINTS_ENOUGH; edge++)
        count = look_at_segment(job, segment, edge, VIEWS_LEAST, thread);
    if (count < 2) {
        set_matt(materials, segment, is_too_dark(job, segment, thread) ? 1.0f : 0.0f);
        return;
    }
    misfits(point, count, job->views->median_radiance, sum);
    for (size_t i = 0; i < ROUGHNESSES * SPECULARS; i++) {
        size_t other_k = i / SPECULARS, other_m = i % SPECULARS;
        if (sum[other_k][other_m] < sum[k][m] && (other_m == 0 || levels.roughness[other_k] <= GLOSS_ROUGHEST))
            k = other_k, m = other_m;
    }
    if (m == 0 || !is_glossy(point, count, k, m)) {
        set_matt(materials, segment, surely_matt(point, count));
        return;
    }
    double along = 0.0, across = 0.0;
    if (k > 0 && k + 1 < ROUGHNESSES)
        along = between(sum[k - 1][m], sum[k][m], sum[k + 1][m]);
    if (m + 1 < SPECULARS)
        across = between(sum[k][m - 1], sum[k][m], sum[k][m + 1]);
    materials->roughness[segment] = interpolate(levels.roughness, k, along);
    materials->specular[segment] = interpolate(specular_of, m, across);
}

void gloss_fit(struct reconstruction *r, const struct views *views, const struct probes *probes,
               const struct light_field *field) {
    struct gloss_job job = {.r = r, .views = views, .probes = probes, .field = field};
    size_t threads = (size_t)parallel_thread_count(r->pool);
    job.point = mem_array(threads * POINTS_MOST, sizeof *job.point);
    job.scratch = mem_array(threads, sizeof *job.scratch);
    by_segment_sort(&job.texels, &r->segments, &r->inverse);
    for (size_t i = 0; i < r->segments.count; i++)
        job.roots += sqrt((double)(job.texels.first[i + 1] - job.texels.first[i]));
    parallel_for(r->pool, r->segments.count, fit_segment, &job);
    by_segment_release(&job.texels);
    mem_free(job.scratch);
    mem_free(job.point);
}
