/* path_backward.c -- derivatives by materials and emission from the derivatives of a loss by the radiance of paths.
 *
 * Vertices are visited from the last depth to the first. Each block turns the derivatives by its paths' radiance into
 * derivatives by its vertices' parameters (shade_backward), logs them, and passes the radiance that leaves a vertex
 * to the previous one. See path.c for the terms. */
#include <assert.h>

#include "server/render/light.h"
#include "server/render/path.h"
#include "server/render/path_batch.h"
#include "server/render/shade.h"

static void log_emission(struct gradient_log *log, uint32_t segment, rgb amount) {
    double *d = log->segment[segment].d_emission;
    d[0] += (double)amount.r;
    d[1] += (double)amount.g;
    d[2] += (double)amount.b;
}

/* Turns derivatives by emission at the vertices of a block into derivatives by their segments' emission. */
static void apply_patterns(const struct vertex_block *v, int count, struct shade_derivative *d) {
    for (int i = 0; i < count; i++) {
        lanes3_set_rgb(&d->d_emission, i, rgb_mul(lanes3_rgb(&d->d_emission, i), lanes3_rgb(&v->pattern, i)));
        if (v->light_factor[i] > 0.0f && v->light_segment[i] != LIGHT_ENVIRONMENT)
            lanes3_set_rgb(&d->d_light_emission, i,
                           rgb_mul(lanes3_rgb(&d->d_light_emission, i), lanes3_rgb(&v->light_pattern, i)));
    }
}

/* Derivative at a vertex of the last depth, which only emits. */
static rgb emission_backward(const struct vertex_block *v, int lane, bool has_pattern, rgb d_radiance,
                             struct gradient_log *log) {
    rgb adjoint = rgb_mul(d_radiance, lanes3_rgb(&v->beta, lane));
    if (has_pattern)
        adjoint = rgb_mul(adjoint, lanes3_rgb(&v->pattern, lane));
    if (v->emission_weight[lane] > 0.0f)
        log_emission(log, v->segment[lane], rgb_scale(adjoint, v->emission_weight[lane]));
    return rgb_scale(lanes3_rgb(&v->emission, lane), v->emission_weight[lane]);
}

/* Appends the derivatives of one lane to the log. */
static void log_lane(const struct vertex_block *v, const struct shade_derivative *d, int lane,
                     struct gradient_log *log) {
    struct gradient_segment *own = &log->segment[v->segment[lane]];
    own->d_roughness += (double)d->d_roughness[lane];
    own->d_specular += (double)d->d_specular[lane];
    if (v->emission_weight[lane] > 0.0f)
        log_emission(log, v->segment[lane], lanes3_rgb(&d->d_emission, lane));
    if (v->light_factor[lane] > 0.0f && v->light_segment[lane] != LIGHT_ENVIRONMENT)
        log_emission(log, v->light_segment[lane], lanes3_rgb(&d->d_light_emission, lane));
    rgb d_base_color = lanes3_rgb(&d->d_base_color, lane);
    if (rgb_is_black(d_base_color))
        return;
    log->entry[log->entry_count++] =
        (struct gradient_entry){v->x[lane],
                                v->y[lane],
                                {v->weight[0][lane], v->weight[1][lane], v->weight[2][lane], v->weight[3][lane]},
                                d_base_color};
}

static void backward_block(struct path_batch *b, int depth, size_t block, int count, const rgb *d_radiance,
                           struct gradient_log *log) {
    struct vertex_block *v = &b->vertex[depth][block];
    struct shade_derivative *d = b->derivative;
    bool ends = b->ended && depth == b->depth_count - 1;
    for (int i = 0; i < count && !ends; i++)
        lanes3_set_rgb(&d->d_radiance, i, d_radiance[v->path[i]]);
    if (!ends)
        shade_backward(v, d);
    if (!ends && b->has_pattern)
        apply_patterns(v, count, d);
    for (int i = 0; i < count; i++) {
        uint32_t path = v->path[i];
        if (b->dropped[path])
            continue;
        rgb out = ends ? emission_backward(v, i, b->has_pattern, d_radiance[path], log) : lanes3_rgb(&d->out, i);
        if (!ends)
            log_lane(v, d, i, log);
        if (depth > 0)
            lanes3_set_rgb(&b->vertex[depth - 1][v->parent[i] / LANES].next, (int)(v->parent[i] % LANES), out);
    }
}

void path_batch_backward(struct path_batch *b, const rgb *d_radiance, struct gradient_log *log) {
    assert(b->keeps_vertices);
    for (int depth = b->depth_count - 1; depth >= 0; depth--) {
        size_t count = b->vertex_count[depth];
        gradient_log_reserve(log, count);
        for (size_t first = 0; first < count; first += LANES)
            backward_block(b, depth, first / LANES, (int)(count - first < LANES ? count - first : LANES), d_radiance,
                           log);
    }
}
