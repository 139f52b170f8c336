/* light_sky.c -- see light_sky.h. */
#include "server/light/light_sky.h"

#include <math.h>
#include <string.h>

#include "common/mem.h"
#include "server/capture/fill.h"
#include "server/scene/latlong.h"

/* At this many radians from what is seen 1/e of the fill is kept: 6 degrees, what a window's frame hides. */
#define NEAR_RAD 0.1f

/* The four cells around a unit direction and their weights, whose sum is 1. */
struct corners {
    size_t cell[4];
    float weight[4];
};

static struct corners corners_of(vec3 d) {
    struct latlong at = latlong_of(d); /* the centres of cells are half a cell in, both ways: this is no map */
    double x = at.around * SKY_COLUMNS - 0.5, y = at.down * SKY_ROWS - 0.5;
    double column = floor(x), row = floor(y);
    float fx = (float)(x - column), fy = (float)(y - row);
    struct corners c;
    for (int i = 0; i < 4; i++) {
        int at_x = ((int)column + i % 2 + SKY_COLUMNS) % SKY_COLUMNS, at_y = (int)row + i / 2;
        at_y = at_y < 0 ? 0 : at_y >= SKY_ROWS ? SKY_ROWS - 1 : at_y;
        c.cell[i] = (size_t)(at_y * SKY_COLUMNS + at_x);
        c.weight[i] = (i % 2 ? fx : 1.0f - fx) * (i / 2 ? fy : 1.0f - fy);
    }
    return c;
}

size_t light_sky_right(size_t cell) { return cell % SKY_COLUMNS + 1 < SKY_COLUMNS ? cell + 1 : cell + 1 - SKY_COLUMNS; }
size_t light_sky_below(size_t cell) { return cell + SKY_COLUMNS < SKY_CELLS ? cell + SKY_COLUMNS : SKY_CELLS; }

static size_t pixel_count(const struct environment *e) { return (size_t)e->map.width * e->map.height; }

/* Part of the fill that is kept at a pixel of the map. */
static float kept_of_fill(const struct light_sky *s, size_t pixel) {
    return s->angle ? expf(-s->angle[pixel] / NEAR_RAD) : 0.0f;
}

static bool is_seen(const struct environment *e, size_t pixel) { return e->confidence.pixel[2 * pixel] > 0.0f; }

static rgb map_rgb(const struct environment *e, size_t pixel) {
    const float *p = e->map.pixel + 3 * pixel;
    return rgb_make(p[0], p[1], p[2]);
}

/* Means of the fill about the cells, by solid angle. */
static void average_fill(struct light_sky *s) {
    const struct environment *e = s->environment;
    double unseen[SKY_CELLS] = {0};
    for (size_t i = 0; i < pixel_count(e); i++) {
        size_t row = i / e->map.width;
        double angle = sin(PI * ((double)row + 0.5) / (double)e->map.height);
        struct corners c = corners_of(environment_direction(e, i % e->map.width, row));
        for (int k = 0; k < 4; k++) {
            double weight = angle * (double)c.weight[k], open = is_seen(e, i) ? 0.0 : weight;
            s->fill[c.cell[k]] += open * (double)rgb_mean(map_rgb(e, i));
            unseen[c.cell[k]] += open;
        }
    }
    for (size_t k = 0; k < SKY_CELLS; k++)
        s->fill[k] = unseen[k] > 0.0 ? s->fill[k] / unseen[k] : 0.0;
}

void light_sky_init(struct light_sky *s, const struct environment *environment) {
    *s = (struct light_sky){.environment = environment};
    if (!environment->map.pixel)
        return;
    s->angle = mem_array(pixel_count(environment), sizeof *s->angle);
    fill_angles(&environment->confidence, s->angle);
    average_fill(s);
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
    memcpy(map->pixel, e->map.pixel, 3 * pixel_count(e) * sizeof *map->pixel);
    for (size_t i = 0; i < pixel_count(e); i++) {
        float kept = !is_seen(e, i) ? kept_of_fill(s, i) : s->estimates_bounds && e->is_bound[i] ? 0.0f : 1.0f;
        for (size_t c = 0; c < 3; c++)
            map->pixel[3 * i + c] *= kept;
    }
    return true;
}

void light_sky_add_ray(const struct light_sky *s, vec3 direction, float share, float cell[SKY_CELLS],
                       float *saturated) {
    const struct environment *e = s->environment;
    if (e->map.pixel) {
        size_t pixel = environment_cell(e, direction);
        if (is_seen(e, pixel)) {
            *saturated += s->estimates_bounds && e->is_bound[pixel] ? share * rgb_mean(map_rgb(e, pixel)) : 0.0f;
            return;
        }
        share *= 1.0f - kept_of_fill(s, pixel);
    }
    struct corners c = corners_of(direction);
    for (int k = 0; k < 4; k++)
        cell[c.cell[k]] += share * c.weight[k];
}

void light_sky_brighten(struct reconstruction *r, rgb factor) {
    environment_brighten(&r->environment, factor);
    world_set_environment(&r->world, &r->environment.map, r->pool);
}
