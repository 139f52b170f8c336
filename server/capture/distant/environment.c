/* environment.c -- see environment.h. */
#include "server/capture/distant/environment.h"

#include <string.h>

#include "common/mem.h"
#include "common/quantile.h"
#include "server/capture/distant/fill.h"
#include "server/scene/latlong.h"

void environment_make_empty(struct environment *e, uint32_t width) {
    static const char *const confidence_channels[] = {"count", "spread"};
    *e = (struct environment){0};
    image_init_rgb(&e->map, width, width / 2);
    image_init(&e->confidence, width, width / 2, 2, confidence_channels);
    for (size_t half = 0; half < ENVIRONMENT_HALVES; half++)
        e->brightened[half] = rgb_gray(1.0f);
    e->is_bound = mem_calloc((size_t)width * (width / 2), sizeof *e->is_bound);
}

void environment_make_unseen(struct environment *e) { environment_make_empty(e, ENVIRONMENT_MIN_WIDTH); }

size_t environment_cell(const struct environment *e, vec3 direction) {
    return latlong_nearest(e->map.width, e->map.height, direction);
}

bool environment_is_seen(const struct environment *e, vec3 direction) {
    return e->confidence.pixel[2 * environment_cell(e, direction)] > 0.0f;
}

bool environment_is_measured(const struct environment *e, vec3 direction) {
    size_t cell = environment_cell(e, direction);
    return e->confidence.pixel[2 * cell] > 0.0f && !(e->is_bound && e->is_bound[cell]);
}

double environment_cell_angle(const struct environment *e, size_t row) {
    return latlong_pixel_angle(e->map.width, e->map.height, (uint32_t)row);
}

vec3 environment_direction(const struct environment *e, size_t column, size_t row) {
    return latlong_pixel(e->map.width, e->map.height, (double)column, (double)row);
}

/* --- what is not seen ------------------------------------------------------------------------ */

bool *environment_known(const struct environment *e) {
    size_t cells = environment_pixel_count(e), known_count = 0;
    bool *is_unseen = mem_array(cells, sizeof *is_unseen), *is_known = mem_array(cells, sizeof *is_known);
    float *to_unseen = mem_array(cells, sizeof *to_unseen);
    for (size_t i = 0; i < cells; i++)
        is_unseen[i] = !environment_pixel_is_seen(e, i);
    fill_angles(e->map.width, e->map.height, is_unseen, to_unseen);
    for (size_t i = 0; i < cells; i++) {
        is_known[i] = !is_unseen[i] && to_unseen[i] > e->rim_angle;
        known_count += is_known[i];
    }
    for (size_t i = 0; i < cells && known_count == 0; i++)
        is_known[i] = !is_unseen[i];
    mem_free(is_unseen);
    mem_free(to_unseen);
    return is_known;
}

void environment_fill(struct environment *e) {
    size_t cells = environment_pixel_count(e);
    bool *is_known = environment_known(e);
    float *seen = mem_array(3 * cells, sizeof *seen);
    memcpy(seen, e->map.pixel, 3 * cells * sizeof *seen);
    fill_sphere(&e->map, is_known);
    for (size_t i = 0; i < cells; i++)
        if (environment_pixel_is_seen(e, i))
            memcpy(e->map.pixel + 3 * i, seen + 3 * i, 3 * sizeof *seen);
    mem_free(seen);
    mem_free(is_known);
}

void environment_update_figures(struct environment *e) {
    size_t cells = environment_pixel_count(e), spread_count = 0;
    double all = 0.0, seen = 0.0, bound = 0.0, luminance = 0.0, seen_luminance = 0.0;
    float *spread = mem_array(cells, sizeof *spread);
    for (size_t i = 0; i < cells; i++) {
        const float *known = e->confidence.pixel + 2 * i;
        double angle = environment_cell_angle(e, i / e->map.width);
        double light = angle * (double)rgb_luminance(environment_pixel_radiance(e, i));
        all += angle;
        luminance += light;
        seen += known[0] > 0.0f ? angle : 0.0;
        bound += e->is_bound && e->is_bound[i] ? angle : 0.0;
        seen_luminance += known[0] > 0.0f ? light : 0.0;
        if (known[0] > 1.0f)
            spread[spread_count++] = known[1];
    }
    e->seen_share = seen / all;
    if (e->is_bound)
        e->saturated_share = seen > 0.0 ? bound / seen : 0.0;
    e->median_spread = (double)quantile(spread, spread_count, 0.5);
    e->luminance = luminance / all;
    e->seen_luminance = seen > 0.0 ? seen_luminance / seen : 0.0;
    mem_free(spread);
}

void environment_brighten(struct environment *e, const rgb factor[ENVIRONMENT_HALVES]) {
    for (size_t i = 0; i < environment_pixel_count(e); i++) {
        size_t half = environment_half(environment_pixel_direction(e, i));
        for (size_t c = 0; c < 3 && e->is_bound[i]; c++)
            e->map.pixel[3 * i + c] *= (&factor[half].r)[c];
    }
    for (size_t half = 0; half < ENVIRONMENT_HALVES; half++)
        e->brightened[half] = rgb_mul(e->brightened[half], factor[half]);
    environment_fill(e);
    environment_update_figures(e);
}

void environment_release(struct environment *e) {
    image_release(&e->map);
    image_release(&e->confidence);
    mem_free(e->is_bound);
    *e = (struct environment){0};
}

cJSON *environment_figures(const struct environment *e) {
    cJSON *figures = cJSON_CreateObject();
    json_add_int(figures, "width", e->map.width);
    json_add_int(figures, "height", e->map.height);
    json_add_int(figures, "photographs", (int64_t)e->photograph_count);
    json_add_number(figures, "seen_share_of_sphere", e->seen_share);
    json_add_number(figures, "saturated_share_of_seen", e->saturated_share);
    json_add_number(figures, "median_spread", e->median_spread);
    json_add_number(figures, "mean_luminance_seen", e->seen_luminance);
    json_add_number(figures, "mean_luminance", e->luminance);
    return figures;
}
