/* light_sky.c -- see light_sky.h. */
#include "server/light/sky/light_sky.h"

#include <math.h>
#include <string.h>

#include "common/mem.h"
#include "server/capture/distant/fill.h"

/* At this many radians from what is seen 1/e of the fill is kept: 6 degrees, what a window's frame hides. */
#define NEAR_RAD 0.1f

/* The corners of a direction; those beyond the horizon are moved to the cells beside it on the direction's side. */
static struct sky_corners corners_of(vec3 direction) {
    struct sky_corners c = sky_cells_around(direction);
    size_t half = environment_half(direction);
    for (int k = 0; k < 4; k++) {
        if (sky_cells_half(c.cell[k]) != half)
            c.cell[k] = half ? c.cell[k] + SKY_COLUMNS : c.cell[k] - SKY_COLUMNS;
    }
    return c;
}

float light_sky_kept(const struct light_sky *s, size_t pixel) {
    return s->angle ? expf(-s->angle[pixel] / NEAR_RAD) : 0.0f;
}

/* Part of the fill near what is seen that follows saturated directions, and is as much brighter as they are. */
static float follows_bounds(const struct light_sky *s, size_t half) {
    return s->estimates_bounds ? fmaxf((float)s->bound_share[half], 0.0f) : 0.0f;
}

/* Means of the fill about the cells, by solid angle. */
static void average_fill(struct light_sky *s) {
    const struct environment *e = s->environment;
    double unseen[SKY_CELLS] = {0};
    for (size_t i = 0; i < environment_pixel_count(e); i++) {
        size_t row = i / e->map.width;
        double angle = sin(PI * ((double)row + 0.5) / (double)e->map.height);
        struct sky_corners c = corners_of(environment_pixel_direction(e, i));
        for (int k = 0; k < 4; k++) {
            double weight = angle * (double)c.weight[k], open = environment_pixel_is_seen(e, i) ? 0.0 : weight;
            s->fill[c.cell[k]] += open * (double)rgb_mean(environment_pixel_radiance(e, i));
            unseen[c.cell[k]] += open;
        }
    }
    for (size_t k = 0; k < SKY_CELLS; k++)
        s->fill[k] = unseen[k] > 0.0 ? s->fill[k] / unseen[k] : 0.0;
}

static void measure_bounds(struct light_sky *s) {
    const struct environment *e = s->environment;
    double seen[ENVIRONMENT_HALVES] = {0.0}, bound[ENVIRONMENT_HALVES] = {0.0};
    for (size_t i = 0; i < environment_pixel_count(e); i++) {
        size_t half = environment_half(environment_pixel_direction(e, i));
        double angle = environment_pixel_is_seen(e, i) ? environment_cell_angle(e, i / e->map.width) : 0.0;
        seen[half] += angle;
        bound[half] += e->is_bound[i] ? angle : 0.0;
        s->bound_radiance[half] += e->is_bound[i] ? angle * (double)rgb_mean(environment_pixel_radiance(e, i)) : 0.0;
    }
    for (size_t half = 0; half < ENVIRONMENT_HALVES; half++) {
        s->bound_share[half] = seen[half] > 0.0 ? bound[half] / seen[half] : -1.0;
        s->bound_radiance[half] /= fmax(bound[half], 1e-20);
    }
}

void light_sky_init(struct light_sky *s, const struct environment *environment) {
    *s = (struct light_sky){.environment = environment};
    if (!environment->map.pixel)
        return;
    s->angle = mem_array(environment_pixel_count(environment), sizeof *s->angle);
    bool *is_known = environment_known(environment);
    fill_angles(environment->map.width, environment->map.height, is_known, s->angle);
    mem_free(is_known);
    average_fill(s);
    measure_bounds(s);
}

void light_sky_release(struct light_sky *s) {
    mem_free(s->angle);
    *s = (struct light_sky){0};
}

bool light_sky_known(const struct light_sky *s, struct image *map) {
    const struct environment *e = s->environment;
    if (!e->map.pixel)
        return false;
    image_init_rgb(map, e->map.width, e->map.height);
    memcpy(map->pixel, e->map.pixel, 3 * environment_pixel_count(e) * sizeof *map->pixel);
    for (size_t i = 0; i < environment_pixel_count(e); i++) {
        size_t half = environment_half(environment_pixel_direction(e, i));
        float kept = s->estimates_bounds && e->is_bound[i] ? 0.0f : 1.0f;
        if (!environment_pixel_is_seen(e, i))
            kept = light_sky_kept(s, i) * (1.0f - follows_bounds(s, half));
        for (size_t c = 0; c < 3; c++)
            map->pixel[3 * i + c] *= kept;
    }
    return true;
}

void light_sky_add_ray(const struct light_sky *s, vec3 origin, vec3 direction, float share, float cell[LIGHT_CELLS],
                       float saturated[ENVIRONMENT_HALVES]) {
    const struct environment *e = s->environment;
    if (e->map.pixel) {
        size_t pixel = environment_cell(e, direction), half = environment_half(direction);
        float kept = light_sky_kept(s, pixel),
              bound = environment_pixel_is_seen(e, pixel) ? 0.0f : kept * follows_bounds(s, half);
        if (environment_pixel_is_seen(e, pixel) && s->estimates_bounds && e->is_bound[pixel])
            bound = 1.0f;
        saturated[half] += bound * share * rgb_mean(environment_pixel_radiance(e, pixel));
        if (environment_pixel_is_seen(e, pixel))
            return;
        share *= 1.0f - kept;
    }
    if (s->surround)
        cell[surround_cell(s->surround, origin, direction)] += share;
    if (s->surround || s->is_dark)
        return;
    struct sky_corners c = corners_of(direction);
    for (int k = 0; k < 4; k++)
        cell[c.cell[k]] += share * c.weight[k];
}

void light_sky_brighten(struct reconstruction *r, const rgb factor[ENVIRONMENT_HALVES]) {
    environment_brighten(&r->environment, factor);
    world_set_environment(&r->world, &r->environment.map, r->pool);
}
