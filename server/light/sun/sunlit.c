/* sunlit.c -- see sunlit.h. */
#include "server/light/sun/sunlit.h"

#include <math.h>

#include "common/mem.h"
#include "common/quantile.h"
#include "common/spaced.h"
#include "server/light/light_priors.h"
#include "server/light/sun/sun_blur.h"
#include "server/render/sampler.h"

#define DISCS 512       /* that stand for all sunlit texels, for time */
#define KEY_BLUR 0x5b1u /* keeps these random numbers apart from others of the point */

static float part_of(const struct reconstruction *r, const struct surface_point *at, float visibility) {
    float cosine = vec3_dot(r->sun.direction, at->shading);
    return visibility * fmaxf(cosine, 0.0f) * irradiance_matt(cosine);
}

static void find_part(void *user, size_t index, int thread) {
    (void)thread;
    const struct sunlit *s = user;
    const struct reconstruction *r = s->r;
    struct sunlit_texel *t = &s->texel[index];
    struct surface_point at;
    bool is_there = surface_at_texel(&r->scene->mesh, &r->atlas, &r->inverse, t->texel, &at);
    t->part = is_there ? part_of(r, &at, sun_visibility(&r->sun, r->world.accel, &at, 0)) : 0.0f;
}

/* Mean measured radiance of each segment, of parts of which nothing is that of another part of the object; black where
 * there is none. [segment_count]; the caller's. */
static rgb *mean_radiances(const struct reconstruction *r) {
    rgb *mean = mem_calloc(r->segments.count + 1, sizeof *mean);
    float *count = mem_calloc(r->segments.count + 1, sizeof *count);
    for (size_t i = 0; i < r->inverse.valid_count; i++) {
        uint32_t texel = r->inverse.valid[i], segment = reconstruction_segment(r, texel);
        if (!(r->fused.count[texel] > 0.0f) || r->fused.is_bound[texel])
            continue;
        count[segment] += 1.0f;
        rgb off = rgb_sub(fused_radiance(&r->fused, texel), mean[segment]);
        mean[segment] = rgb_mad(mean[segment], 1.0f / count[segment], off);
    }
    bool *is_measured = mem_calloc(r->segments.count + 1, sizeof *is_measured);
    for (size_t i = 0; i < r->segments.count; i++)
        is_measured[i] = count[i] > 0.0f;
    for (uint32_t i = 0; i < r->segments.count; i++)
        mean[i] = mean[segments_known_part(&r->segments, i, is_measured)];
    mem_free(is_measured);
    mem_free(count);
    return mean;
}

void sunlit_init(struct sunlit *s, struct reconstruction *r, const struct views *views) {
    size_t reached = 0;
    *s = (struct sunlit){.r = r, .views = views, .texel = mem_array(r->inverse.valid_count + 1, sizeof *s->texel)};
    for (size_t i = 0; i < r->inverse.valid_count; i++) {
        uint32_t texel = r->inverse.valid[i];
        if (r->fused.is_bound[texel])
            s->texel[s->count++] = (struct sunlit_texel){.texel = texel, .bound = fused_radiance(&r->fused, texel)};
    }
    parallel_for(r->pool, s->count, find_part, s);
    rgb *mean = mean_radiances(r);
    for (size_t i = 0; i < s->count; i++) {
        struct sunlit_texel t = s->texel[i];
        rgb shade = mean[reconstruction_segment(r, t.texel)];
        t.shade = rgb_make(fminf(shade.r, t.bound.r), fminf(shade.g, t.bound.g), fminf(shade.b, t.bound.b));
        if (t.part > 0.0f)
            s->texel[reached++] = t;
    }
    s->count = reached;
    mem_free(mean);
}

void sunlit_release(struct sunlit *s) {
    mem_free(s->visibility);
    mem_free(s->texel);
    *s = (struct sunlit){0};
}

void sunlit_mark(const struct sunlit *s) {
    const struct reconstruction *r = s->r;
    size_t *bound = mem_calloc(r->segments.count + 1, sizeof *bound);
    size_t *lit = mem_calloc(r->segments.count + 1, sizeof *lit);
    for (size_t i = 0; i < r->inverse.valid_count; i++)
        bound[reconstruction_segment(r, r->inverse.valid[i])] += r->fused.is_bound[r->inverse.valid[i]];
    for (size_t i = 0; i < s->count; i++)
        lit[reconstruction_segment(r, s->texel[i].texel)]++;
    for (size_t i = 0; i < r->segments.count; i++)
        r->evidence[i].is_sunlit = 2 * lit[i] > bound[i];
    mem_free(lit);
    mem_free(bound);
}

void sunlit_shade(const struct sunlit *s, uint16_t (*radiance)[3]) {
    for (size_t i = 0; i < s->count; i++)
        rgb_to_half(radiance[s->texel[i].texel], s->texel[i].shade);
}

rgb sunlit_least(const struct sunlit *s) {
    rgb least = rgb_gray(0.0f);
    float *value = mem_array(s->count + 1, sizeof *value);
    for (int c = 0; c < 3 && s->count > 0; c++) {
        for (size_t i = 0; i < s->count; i++) {
            const struct sunlit_texel *t = &s->texel[i];
            value[i] = ((&t->bound.r)[c] - (&t->shade.r)[c]) / ((float)ALBEDO_WHITE * t->part);
        }
        (&least.r)[c] = quantile(value, s->count, 0.5);
    }
    mem_free(value);
    return least;
}

/* Discs of what the texels reflect of the sun at strength 1, evenly spread; returns their number. */
static size_t find_discs(const struct sunlit *s, const float *albedo, struct segment_light_disc disc[DISCS]) {
    const struct reconstruction *r = s->r;
    size_t count = s->count < DISCS ? s->count : DISCS, found = 0;
    for (size_t i = 0; i < count; i++) {
        const struct sunlit_texel *t = &s->texel[spaced(i, s->count, count)];
        struct segment_light_disc *d = &disc[found];
        if (!surface_at_texel(&r->scene->mesh, &r->atlas, &r->inverse, t->texel, &d->at))
            continue;
        d->area_m2 = surface_texel_m2(&r->scene->mesh, &r->atlas, d->at.triangle) * (float)s->count / (float)count;
        d->radiance = albedo[reconstruction_segment(r, t->texel)] * t->part;
        found++;
    }
    return found;
}

struct looking {
    struct sunlit *s;
    const struct light_point *point;
    bool *is_told;
};

static void look_at_point(void *user, size_t index, int thread) {
    (void)thread;
    const struct looking *job = user;
    const struct reconstruction *r = job->s->r;
    const struct surface_point *at = &job->point[index].at;
    float seen = sun_blur_visibility(&r->sun, job->s->views, at, sampler_key(KEY_BLUR, (uint32_t)index, 0));
    bool is_bound = job->point[index].is_bound;
    job->s->visibility[index] = is_bound ? ceilf(seen) : sun_visibility(&r->sun, r->world.accel, at, 0);
    job->is_told[index] = is_bound || seen == job->s->visibility[index];
}

void sunlit_look(struct sunlit *s, const struct light_point *point, size_t count, bool *is_told) {
    s->visibility = mem_array(count + 1, sizeof *s->visibility);
    parallel_for(s->r->pool, count, look_at_point, &(struct looking){s, point, is_told});
}

void sunlit_respond(const struct sunlit *s, const struct segment_light *light, const struct light_point *point,
                    size_t count, const float *albedo, float *column) {
    struct segment_light_disc *disc = mem_array(DISCS, sizeof *disc);
    for (size_t i = 0; i < count; i++)
        column[i] += part_of(s->r, &point[i].at, s->visibility[i]);
    segment_light_add_discs(light, point, count, disc, find_discs(s, albedo, disc), column);
    mem_free(disc);
}
