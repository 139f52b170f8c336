/* emitters.c -- see emitters.h. */
#include "server/reconstruct/emitters.h"

#include <stdlib.h>

#include "common/mem.h"

#define TEXELS_PER_SEGMENT 256
#define VIEWS_PER_TEXEL 4
/* Share of the observed radiance that an emitter's emission explains, at least. */
#define EMITTER_SHARE 0.5f

struct observe_job {
    const struct reconstruction *r;
    const struct views *views;
    const uint32_t *first; /* [segment_count + 1] into texel */
    const uint32_t *texel; /* valid texels by segment */
    rgb *radiance;
};

static int compare_floats(const void *a, const void *b) {
    float x = *(const float *)a, y = *(const float *)b;
    return (x > y) - (x < y);
}

static void observe_segment(void *user, size_t segment, int thread) {
    (void)thread;
    struct observe_job *job = user;
    const struct reconstruction *r = job->r;
    float value[3][TEXELS_PER_SEGMENT * VIEWS_PER_TEXEL];
    size_t count = 0, texels = job->first[segment + 1] - job->first[segment];
    size_t wanted = texels < TEXELS_PER_SEGMENT ? texels : TEXELS_PER_SEGMENT;
    for (size_t i = 0; i < wanted; i++) {
        uint32_t texel = job->texel[job->first[segment] + i * texels / wanted], triangle;
        float b1, b2;
        if (!inverse_uv_lookup(&r->inverse, &r->atlas, (float)(texel % r->atlas.width) + 0.5f,
                               (float)(texel / r->atlas.width) + 0.5f, &triangle, &b1, &b2))
            continue;
        vec3 normal = vec3_normalize(mesh_cross(&r->scene->mesh, triangle));
        vec3 point = mesh_point(&r->scene->mesh, triangle, b1, b2);
        struct view view[VIEWS_PER_TEXEL];
        size_t seen = views_pick(job->views, point, normal, texel, VIEWS_PER_TEXEL, view);
        for (size_t k = 0; k < seen; k++) {
            struct photograph_sample sample;
            const struct photograph *photo =
                &r->scene->photograph[job->views->train[view[k].train]];
            if (!photograph_sample(photo, view[k].x, view[k].y, &sample))
                continue;
            value[0][count] = sample.radiance.r;
            value[1][count] = sample.radiance.g;
            value[2][count++] = sample.radiance.b;
        }
    }
    job->radiance[segment] = rgb_gray(0.0f);
    if (count == 0)
        return;
    for (int c = 0; c < 3; c++)
        qsort(value[c], count, sizeof value[c][0], compare_floats);
    job->radiance[segment] = rgb_make(value[0][count / 2], value[1][count / 2], value[2][count / 2]);
}

void emitters_observe(const struct reconstruction *r, const struct views *views, rgb *radiance) {
    size_t segments = r->segments.count, valid = r->inverse.valid_count;
    uint32_t *first = mem_calloc(segments + 2, sizeof *first);
    uint32_t *texel = mem_array(valid + 1, sizeof *texel);
    /* A counting sort by segment; first[] is shifted by one while it counts. */
    for (size_t i = 0; i < valid; i++)
        first[r->segments.of_triangle[r->inverse.triangle[r->inverse.valid[i]]] + 2]++;
    for (size_t s = 2; s < segments + 2; s++)
        first[s] += first[s - 1];
    for (size_t i = 0; i < valid; i++) {
        uint32_t segment = r->segments.of_triangle[r->inverse.triangle[r->inverse.valid[i]]];
        texel[first[segment + 1]++] = r->inverse.valid[i];
    }
    struct observe_job job = {r, views, first, texel, radiance};
    parallel_for(r->pool, segments, observe_segment, &job);
    mem_free(texel);
    mem_free(first);
}

void emitters_decide(const struct materials *materials, const rgb *observed, bool *is_emitter,
                     float *share) {
    for (size_t s = 0; s < materials->segment_count; s++) {
        float emission = rgb_mean(materials->emission[s]);
        float seen = rgb_mean(observed[s]);
        share[s] = seen > 0.0f ? emission / seen : 0.0f;
        is_emitter[s] = share[s] >= EMITTER_SHARE;
    }
}
