/* params.c -- see params.h. */
#include "server/reconstruct/params.h"

#include <math.h>
#include <string.h>

#include "common/mem.h"

/* Touches are few (tens a texel in a whole run), so the moments must be quick to fill. */
#define BASE_BETA1 0.9f
#define BASE_BETA2 0.999f
#define SEGMENT_BETA1 0.9f
#define SEGMENT_BETA2 0.99f

/* Radiance below which a recovered emission is taken for none; also keeps the logarithm finite. */
#define LOG_EMISSION_MIN (-20.0f)
#define LOG_EMISSION_MAX 20.0f

/* Base colour of an emitter moves at this share of the rate. */
#define EMITTER_SLOWDOWN 0.05f

/* A block moves in the logarithm, at this multiple of the rate: the same speed at a mid grey; and
 * not down to 0, from where no factor would bring it back. */
#define BLOCK_RATE 2.0f
#define BLOCK_MIN 0.002f

/* Looks that the solved state counts for. One look is off by a third (16 paths, one pixel), the
 * solved light of a block by 2 %: (.33 / .02)^2. */
#define MATCH_PRIOR 256.0f

#define CHUNK 1024 /* touched texels a work item */
#define AHEAD 16   /* texels under way to the cache */

static size_t blocks_across(uint32_t texels, int level) {
    return ((size_t)texels + ((size_t)1 << level) - 1) >> level;
}

static size_t block_count(const struct params *p, int level) {
    const struct texture *t = &p->materials->base_color;
    return blocks_across(t->width, level) * blocks_across(t->height, level);
}

static float log_emission(float radiance) {
    return radiance > 0.0f ? fmaxf(logf(radiance), LOG_EMISSION_MIN) : LOG_EMISSION_MIN;
}

void params_init(struct params *p, struct materials *materials, const struct inverse_uv *inverse,
                 const struct segments *segments, const uint32_t *chart_of_triangle, int level) {
    size_t count = materials->segment_count;
    *p = (struct params){
        .materials = materials, .inverse = inverse, .segments = segments, .chart_of_triangle = chart_of_triangle, .level = level};
    adam_init(&p->base_color, block_count(p, 0), 3, BASE_BETA1, BASE_BETA2);
    adam_init(&p->roughness, count, 1, SEGMENT_BETA1, SEGMENT_BETA2);
    adam_init(&p->specular, count, 1, SEGMENT_BETA1, SEGMENT_BETA2);
    adam_init(&p->emission, count, 3, SEGMENT_BETA1, SEGMENT_BETA2);
    p->log_emission = mem_array(count, sizeof *p->log_emission);
    for (size_t s = 0; s < count; s++)
        params_set_emission(p, s, materials->emission[s]);
    if (level > 0) {
        p->block_sum = mem_calloc_large(block_count(p, 1), sizeof *p->block_sum);
        p->block_stamp = mem_calloc_large(block_count(p, 1), sizeof *p->block_stamp);
    }
}

void params_release(struct params *p) {
    adam_release(&p->base_color);
    adam_release(&p->roughness);
    adam_release(&p->specular);
    adam_release(&p->emission);
    mem_free(p->log_emission);
    mem_free(p->block_sum);
    mem_free(p->block_stamp);
    mem_free(p->block);
    *p = (struct params){0};
}

void params_set_level(struct params *p, int level) {
    p->level = level;
    if (level == 0) {
        mem_free(p->block_sum);
        mem_free(p->block_stamp);
        p->block_sum = NULL;
        p->block_stamp = NULL;
    }
}

void params_refine(struct params *p, int level) {
    adam_reset(&p->base_color, 0, block_count(p, p->level));
    params_set_level(p, level);
}

static float slowdown(const struct params *p, size_t texel) {
    if (p->is_emitter && p->is_emitter[p->segments->of_triangle[p->inverse->triangle[texel]]])
        return EMITTER_SLOWDOWN;
    return 1.0f;
}

static void move_texel(struct params *p, size_t number, const float *step, float rate) {
    float *texel = p->materials->base_color.texel[number];
    rate *= slowdown(p, number);
    for (int c = 0; c < 3; c++)
        texel[c] = clampf(texel[c] + rate * step[c], 0.0f, 1.0f);
}

struct step_job {
    struct params *p;
    const struct gradient *gradient;
    float rate;
    size_t count;
};

static void step_texels(void *user, size_t chunk, int thread) {
    (void)thread;
    struct step_job *job = user;
    size_t end = (chunk + 1) * CHUNK < job->count ? (chunk + 1) * CHUNK : job->count;
    for (size_t i = chunk * CHUNK; i < end; i++) {
        uint32_t texel = job->gradient->texel[i];
        if (i + AHEAD < job->count) {
            /* At a random place a step is little arithmetic and three trips to memory. (Not in a
             * function of its own: GCC finds that it does nothing and leaves it out.) */
            uint32_t later = job->gradient->texel[i + AHEAD];
            __builtin_prefetch(adam_record(&job->p->base_color, later), 1);
            __builtin_prefetch(job->p->materials->base_color.texel[later], 1);
            __builtin_prefetch(&job->p->inverse->triangle[later]);
        }
        const rgb *d = &job->gradient->d_base_color[i];
        float gradient[3] = {d->r, d->g, d->b}, step[3];
        adam_touch(&job->p->base_color, texel, gradient, step);
        move_texel(job->p, texel, step, job->rate);
    }
}

/* A block moves by a common factor: what differs within it stays. */
static void scale_texel(struct params *p, size_t number, const float *step, float rate) {
    float *texel = p->materials->base_color.texel[number];
    rate *= slowdown(p, number);
    for (int c = 0; c < 3; c++)
        texel[c] = clampf(texel[c] * expf(rate * step[c]), BLOCK_MIN, 1.0f);
}

static void step_blocks(void *user, size_t chunk, int thread) {
    (void)thread;
    struct step_job *job = user;
    struct params *p = job->p;
    struct texture *texture = &p->materials->base_color;
    size_t across = blocks_across(texture->width, p->level);
    size_t end = (chunk + 1) * CHUNK < job->count ? (chunk + 1) * CHUNK : job->count;
    for (size_t i = chunk * CHUNK; i < end; i++) {
        uint32_t block = p->block[i];
        float step[3];
        adam_touch(&p->base_color, block, p->block_sum[block], step);
        memset(p->block_sum[block], 0, sizeof p->block_sum[block]);
        size_t side = (size_t)1 << p->level;
        size_t x0 = block % across << p->level, y0 = block / across << p->level;
        for (size_t y = y0; y < y0 + side && y < texture->height; y++) {
            for (size_t x = x0; x < x0 + side && x < texture->width; x++) {
                size_t texel = y * texture->width + x;
                if (texture->texel[texel][3] != 0.0f)
                    scale_texel(p, texel, step, BLOCK_RATE * job->rate);
            }
        }
    }
}

/* Adds up by block, in the gradient's order, the derivatives by the logarithm of the block's common
 * factor, and lists the blocks. */
static size_t sum_blocks(struct params *p, const struct gradient *gradient) {
    uint32_t width = p->materials->base_color.width;
    size_t across = blocks_across(width, p->level), count = 0;
    if (p->block_capacity < gradient->texel_count) {
        p->block_capacity = gradient->texel_count + gradient->texel_count / 2;
        p->block = mem_realloc_array(p->block, p->block_capacity, sizeof *p->block);
    }
    p->stamp++;
    for (size_t i = 0; i < gradient->texel_count; i++) {
        uint32_t texel = gradient->texel[i];
        size_t block = (texel / width >> p->level) * across + (texel % width >> p->level);
        float *sum = p->block_sum[block];
        const rgb *d = &gradient->d_base_color[i];
        if (p->block_stamp[block] != p->stamp) {
            p->block_stamp[block] = p->stamp;
            p->block[count++] = (uint32_t)block;
        }
        const float *value = p->materials->base_color.texel[texel];
        sum[0] += value[0] * d->r;
        sum[1] += value[1] * d->g;
        sum[2] += value[2] * d->b;
    }
    return count;
}

static void step_segments(struct params *p, const struct gradient *gradient,
                          const struct params_rates *rates) {
    struct materials *m = p->materials;
    for (size_t s = 0; s < m->segment_count; s++) {
        float step[3];
        float d_roughness = (float)gradient->d_roughness[s];
        float d_specular = (float)gradient->d_specular[s];
        if (d_roughness != 0.0f) {
            adam_touch(&p->roughness, s, &d_roughness, step);
            m->roughness[s] = clampf(m->roughness[s] + rates->roughness * step[0],
                                     PARAMS_ROUGHNESS_MIN, 1.0f);
        }
        if (d_specular != 0.0f) {
            adam_touch(&p->specular, s, &d_specular, step);
            m->specular[s] = clampf(m->specular[s] + rates->specular * step[0], 0.0f, 1.0f);
        }
        if (rgb_is_black(m->emission[s]))
            continue;
        float emission[3] = {m->emission[s].r, m->emission[s].g, m->emission[s].b};
        float d_log[3]; /* d loss / d log e = e d loss / d e */
        for (int c = 0; c < 3; c++)
            d_log[c] = emission[c] * (float)gradient->d_emission[s][c];
        if (d_log[0] == 0.0f && d_log[1] == 0.0f && d_log[2] == 0.0f)
            continue;
        adam_touch(&p->emission, s, d_log, step);
        for (int c = 0; c < 3; c++) {
            float moved = p->log_emission[s][c] + rates->emission * step[c];
            p->log_emission[s][c] = clampf(moved, LOG_EMISSION_MIN, LOG_EMISSION_MAX);
            emission[c] = expf(p->log_emission[s][c]);
        }
        m->emission[s] = rgb_make(emission[0], emission[1], emission[2]);
    }
}

void params_step(struct params *p, const struct gradient *gradient, const struct params_rates *rates,
                 struct parallel *pool) {
    if (p->is_emitter || p->any_emits)
        step_segments(p, gradient, rates);
    if (rates->skip_base_color)
        return;
    struct step_job job = {.p = p, .gradient = gradient, .rate = rates->base_color};
    job.count = p->level > 0 ? sum_blocks(p, gradient) : gradient->texel_count;
    parallel_for(pool, (job.count + CHUNK - 1) / CHUNK, p->level > 0 ? step_blocks : step_texels,
                 &job);
}

void params_match(struct params *p, uint32_t texel, const struct loss_match *match, float trust) {
    struct texture *texture = &p->materials->base_color;
    size_t column = texel % texture->width, row = texel / texture->width;
    size_t block = (row >> p->level) * blocks_across(texture->width, p->level) + (column >> p->level);
    float *looks = &adam_record(&p->base_color, block)[0];
    float step = slowdown(p, texel) * trust / (*looks + MATCH_PRIOR);
    *looks += 1.0f;
    float factor[3];
    for (int c = 0; c < 3; c++)
        factor[c] = (1.0f + step * (match->shown[c] - 1.0f)) / (1.0f + step * (match->rendered[c] - 1.0f));
    const uint32_t *triangle = p->inverse->triangle;
    uint32_t chart = p->chart_of_triangle[triangle[texel]];
    size_t half = ((size_t)1 << p->level) / 2;
    for (size_t y = row > half ? row - half : 0; y <= row + half && y < texture->height; y++) {
        for (size_t x = column > half ? column - half : 0; x <= column + half && x < texture->width; x++) {
            size_t at = y * texture->width + x;
            float *value = texture->texel[at];
            if (triangle[at] == INVERSE_UV_NONE || p->chart_of_triangle[triangle[at]] != chart)
                continue;
            for (int c = 0; c < 3; c++)
                value[c] = clampf(value[c] * factor[c], BLOCK_MIN, 1.0f);
        }
    }
}

void params_fix_emitters(struct params *p, const bool *is_emitter) {
    p->is_emitter = is_emitter;
    for (size_t s = 0; s < p->materials->segment_count; s++) {
        if (!is_emitter[s])
            p->materials->emission[s] = rgb_gray(0.0f);
    }
}

void params_free_emission(struct params *p) {
    p->any_emits = true;
}

void params_set_emission(struct params *p, size_t segment, rgb emission) {
    p->materials->emission[segment] = emission;
    p->log_emission[segment][0] = log_emission(emission.r);
    p->log_emission[segment][1] = log_emission(emission.g);
    p->log_emission[segment][2] = log_emission(emission.b);
    adam_reset(&p->emission, segment, 1);
}
