/* params.c -- see params.h. */
#include "server/refine/params.h"

#include <math.h>
#include <string.h>

#include "common/mem.h"
#include "server/refine/blocks.h"

/* A texel has few steps, tens in a whole run, so the moments must adapt fast. */
#define BASE_BETA1 0.9f     /* to .925: 0 dB */
#define BASE_BETA2 0.999f   /* to .99925: 0 dB */
#define SEGMENT_BETA1 0.9f  /* to .925: 0 dB */
#define SEGMENT_BETA2 0.99f /* to .9925: 0 dB */

/* Rate of a block's logarithmic step over that of a texel's linear one: the same speed at base colour .5. */
#define BLOCK_RATE 2.0f /* +25 %: +0.17 dB */

#define CHUNK 1024 /* touched texels a work item */
#define AHEAD 16   /* texels of prefetch distance */

void params_init(struct params *p, struct materials *materials, const struct inverse_uv *inverse,
                 const struct segments *segments, struct emission *emission, int level) {
    const struct texture *texture = &materials->base_color;
    size_t count = materials->segment_count;
    *p = (struct params){
        .materials = materials, .inverse = inverse, .segments = segments, .emission = emission, .level = level};
    adam_init(&p->base_color, blocks_count(texture, 0), 3, BASE_BETA1, BASE_BETA2);
    adam_init(&p->roughness, count, 1, SEGMENT_BETA1, SEGMENT_BETA2);
    adam_init(&p->specular, count, 1, SEGMENT_BETA1, SEGMENT_BETA2);
    if (level > 0) {
        p->block_sum = mem_calloc_large(blocks_count(texture, 1), sizeof *p->block_sum);
        p->block_stamp = mem_calloc_large(blocks_count(texture, 1), sizeof *p->block_stamp);
    }
}

void params_release(struct params *p) {
    adam_release(&p->base_color);
    adam_release(&p->roughness);
    adam_release(&p->specular);
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
    adam_reset(&p->base_color, 0, blocks_count(&p->materials->base_color, p->level));
    params_set_level(p, level);
}

static float slowdown(const struct params *p, size_t texel) {
    return emission_slowdown(p->emission, p->segments->of_triangle[p->inverse->triangle[texel]]);
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
            /* A step is little arithmetic and three cache misses. (In a function of its own GCC removes the
             * prefetches as dead code.) */
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

static void scale_texel(struct params *p, size_t number, const float *step, float rate) {
    float factor[3];
    rate *= slowdown(p, number);
    for (int c = 0; c < 3; c++)
        factor[c] = expf(rate * step[c]);
    blocks_scale(p->materials->base_color.texel[number], factor);
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

/* Sums by block, in the gradient's order, the derivatives by the logarithm of the block's factor, and lists the
 * blocks. */
static size_t sum_blocks(struct params *p, const struct gradient *gradient) {
    const struct texture *texture = &p->materials->base_color;
    size_t count = 0;
    if (p->block_capacity < gradient->texel_count) {
        p->block_capacity = gradient->texel_count + gradient->texel_count / 2;
        p->block = mem_realloc_array(p->block, p->block_capacity, sizeof *p->block);
    }
    p->stamp++;
    for (size_t i = 0; i < gradient->texel_count; i++) {
        uint32_t texel = gradient->texel[i];
        size_t block = blocks_at(texture, texel, p->level);
        float *sum = p->block_sum[block];
        const rgb *d = &gradient->d_base_color[i];
        if (p->block_stamp[block] != p->stamp) {
            p->block_stamp[block] = p->stamp;
            p->block[count++] = (uint32_t)block;
        }
        const float *value = texture->texel[texel];
        sum[0] += value[0] * d->r;
        sum[1] += value[1] * d->g;
        sum[2] += value[2] * d->b;
    }
    return count;
}

static void step_segments(struct params *p, const struct gradient *gradient, const struct params_rates *rates) {
    struct materials *m = p->materials;
    for (size_t s = 0; s < m->segment_count; s++) {
        float step[3];
        float d_roughness = (float)gradient->d_roughness[s];
        float d_specular = (float)gradient->d_specular[s];
        if (d_roughness != 0.0f) {
            adam_touch(&p->roughness, s, &d_roughness, step);
            m->roughness[s] = clampf(m->roughness[s] + rates->roughness * step[0], PARAMS_ROUGHNESS_MIN, 1.0f);
        }
        if (d_specular != 0.0f) {
            adam_touch(&p->specular, s, &d_specular, step);
            m->specular[s] = clampf(m->specular[s] + rates->specular * step[0], 0.0f, 1.0f);
        }
    }
    emission_step(p->emission, gradient->d_emission, rates->emission);
}

void params_free_segments(struct params *p) { p->frees_segments = true; }

void params_step(struct params *p, const struct gradient *gradient, const struct params_rates *rates,
                 struct parallel *pool) {
    if (p->frees_segments)
        step_segments(p, gradient, rates);
    struct step_job job = {.p = p, .gradient = gradient, .rate = rates->base_color};
    job.count = p->level > 0 ? sum_blocks(p, gradient) : gradient->texel_count;
    parallel_for(pool, (job.count + CHUNK - 1) / CHUNK, p->level > 0 ? step_blocks : step_texels, &job);
}
