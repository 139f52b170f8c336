/* overlap.c -- see overlap.h. */
#include "server/capture/overlap.h"

#include <math.h>
#include <string.h>

#include "common/mem.h"

#define CHUNK 64 /* points a work item */
/* Stored value of 8-bit photographs below which values are so noisy that selection by them would be biased: 200 of a
 * full well of 10^4 electrons, 7 % of shot noise. */
#define DARK_VALUE 0.02f /* +25 %: no change */
/* Share of the clip above which a surface may have clipped pixels, by texture a quarter brighter than the mean. */
#define BRIGHT_SHARE 0.8f /* +25 %: no change */

struct overlap_gathering {
    const struct views *views;
    const struct atlas *atlas;
    const struct inverse_uv *inverse;
    size_t points, step;
    struct overlap_observation *observation; /* [points][OVERLAP_OBSERVATIONS_MAX] */
    uint8_t *count;                          /* [points] */
};

/* The mean of a cross of five pixels; false when one of them cannot be used. */
static bool observe_cross(const struct photograph *photo, struct overlap_observation *observation) {
    static const float offset[5][2] = {{0, 0}, {-1, 0}, {1, 0}, {0, -1}, {0, 1}};
    const float w = (float)photo->camera.width, h = (float)photo->camera.height;
    double sum[3] = {0}, gray = 0.0, squares = 0.0;
    for (int i = 0; i < 5; i++) {
        float x = observation->x + offset[i][0], y = observation->y + offset[i][1];
        struct photograph_sample s;
        if (x < 0.0f || y < 0.0f || x >= w || y >= h || !photograph_sample(photo, x, y, &s) ||
            photograph_sample_saturates(&s))
            return false;
        double mean = (double)rgb_mean(s.radiance);
        sum[0] += (double)s.radiance.r;
        sum[1] += (double)s.radiance.g;
        sum[2] += (double)s.radiance.b;
        gray += mean;
        squares += mean * mean;
    }
    float stored = photo->exposure * photograph_falloff(photo, observation->x, observation->y);
    float black = photo->is_hdr ? 0.0f : VIEWS_NOISE_VALUE, dark = photo->is_hdr ? 0.0f : DARK_VALUE;
    const float gain[3] = {photo->gain.r, photo->gain.g, photo->gain.b};
    for (int c = 0; c < 3; c++) {
        if (!(sum[c] > 0.0) || (float)(sum[c] / 5.0) * stored * gain[c] < black)
            return false;
        observation->value[c] = (float)log(sum[c] / 5.0);
        observation->level[c] = observation->value[c] + logf(stored * gain[c]);
        observation->min_value[c] = logf(dark / (stored * gain[c]));
        observation->max_value[c] = logf(BRIGHT_SHARE * photo->clip / (stored * gain[c]));
    }
    observation->contrast = (float)(sqrt(fmax(0.0, squares / 5.0 - gray * gray / 25.0)) / (gray / 5.0));
    return true;
}

static void observe_point(struct overlap_gathering *g, size_t index) {
    const struct scene *scene = g->views->scene;
    uint32_t texel = g->inverse->valid[index * g->step], triangle;
    float b1, b2;
    if (!inverse_uv_lookup(g->inverse, g->atlas, (float)(texel % g->inverse->width) + 0.5f,
                           (float)(texel / g->inverse->width) + 0.5f, &triangle, &b1, &b2))
        return;
    vec3 point = mesh_point(&scene->mesh, triangle, b1, b2);
    vec3 normal = vec3_normalize(mesh_cross(&scene->mesh, triangle));
    struct view view[OVERLAP_OBSERVATIONS_MAX];
    size_t seen = views_pick(g->views, point, normal, texel, OVERLAP_OBSERVATIONS_MAX, view);
    struct overlap_observation *observation = g->observation + index * OVERLAP_OBSERVATIONS_MAX;
    uint8_t count = 0;
    for (size_t k = 0; k < seen; k++) {
        const struct photograph *photo = &scene->photograph[g->views->train[view[k].train]];
        vec3 out = vec3_normalize(vec3_sub(camera_origin(&photo->camera), point));
        observation[count] = (struct overlap_observation){
            .train = view[k].train, .x = view[k].x, .y = view[k].y, .cosine = vec3_dot(out, normal)};
        if (views_clean(g->views, &view[k]) && observe_cross(photo, &observation[count]))
            count++;
    }
    g->count[index] = count;
}

static void gather_chunk(void *user, size_t chunk, int thread) {
    (void)thread;
    struct overlap_gathering *g = user;
    size_t end = (chunk + 1) * CHUNK < g->points ? (chunk + 1) * CHUNK : g->points;
    for (size_t i = chunk * CHUNK; i < end; i++)
        observe_point(g, i);
}

void overlaps_make(struct overlaps *o, const struct views *views, const struct atlas *atlas,
                   const struct inverse_uv *inverse, size_t points, struct parallel *pool) {
    struct overlap_gathering g = {.views = views, .atlas = atlas, .inverse = inverse};
    g.step = inverse->valid_count / (points + 1) + 1;
    g.points = inverse->valid_count / g.step;
    g.observation = mem_array(g.points * OVERLAP_OBSERVATIONS_MAX + 1, sizeof *g.observation);
    g.count = mem_calloc(g.points + 1, sizeof *g.count);
    parallel_for(pool, (g.points + CHUNK - 1) / CHUNK, gather_chunk, &g);
    *o = (struct overlaps){.start = mem_array(g.points + 1, sizeof *o->start), .observation = g.observation};
    size_t total = 0;
    for (size_t i = 0; i < g.points; i++) {
        if (g.count[i] < 2)
            continue;
        memmove(o->observation + total, g.observation + i * OVERLAP_OBSERVATIONS_MAX,
                g.count[i] * sizeof *o->observation);
        o->start[o->point_count++] = total;
        total += g.count[i];
    }
    o->start[o->point_count] = total;
    mem_free(g.count);
}

void overlaps_release(struct overlaps *o) {
    mem_free(o->start);
    mem_free(o->observation);
    *o = (struct overlaps){0};
}
