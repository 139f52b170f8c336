/* openings.c -- see openings.h. */
#include "server/light/openings.h"

#include <math.h>
#include <stdlib.h>

#include "common/mem.h"
#include "server/light/added_surface.h"
#include "server/light/emitters.h"
#include "server/light/light_model.h"
#include "server/light/sky/unseen_light.h"

/* Standard deviations by which an opening is brighter than the mean of its prior. */
#define SURE_DEVIATIONS 2.0

struct opening_candidate {
    size_t cell;
    double radiance, error; /* and the standard deviation of its logarithm */
};

static int by_error(const void *a, const void *b) {
    const struct opening_candidate *first = a, *second = b;
    if (first->error != second->error)
        return first->error < second->error ? -1 : 1;
    return (first->cell > second->cell) - (first->cell < second->cell);
}

/* The cells that are surely brighter than the mean of their prior; the surest ones first. */
static size_t choose(struct light_model *m, struct opening_candidate chosen[SURROUND_CELLS]) {
    size_t count = 0;
    light_model_find_errors(m);
    for (size_t k = 0; k < SURROUND_CELLS && m->has_sky; k++) {
        const struct joint_source *source = &m->fit.source[m->first_cell + k];
        if (!m->sky.surround->is_seen[k] && source->value - source->mean > SURE_DEVIATIONS * source->error)
            chosen[count++] = (struct opening_candidate){k, exp(source->value), source->error};
    }
    qsort(chosen, count, sizeof *chosen, by_error);
    return count < LIGHT_OPENINGS_MAX ? count : LIGHT_OPENINGS_MAX;
}

/* --- surface ----------------------------------------------------------------------------------------------- */

/* Adds a cell as a segment, the last one; returns its number. */
static uint32_t add_segment(struct reconstruction *r, const struct surround *s, size_t cell) {
    vec3 corner[1][4];
    surround_corners(s, cell, corner[0]);
    return added_surface_segment(r, "opening", (const vec3(*)[4])corner, 1);
}

/* Adds what photographs look at, and then the openings; returns the number of cells. */
static size_t add_surface(struct reconstruction *r, const struct surround *s, const struct opening_candidate *chosen,
                          size_t count) {
    size_t seen = 0;
    for (size_t k = 0; k < SURROUND_CELLS; k++) {
        if (s->is_seen[k])
            add_segment(r, s, k), seen++;
    }
    for (size_t i = 0; i < count; i++) {
        rgb radiance = rgb_gray((float)chosen[i].radiance);
        uint32_t segment = add_segment(r, s, chosen[i].cell);
        r->light.source[r->light.source_count++] =
            (struct estimated_source){ESTIMATED_OPENING, segment, radiance, (float)chosen[i].error};
    }
    r->openings = (struct segment_range){r->segments.count - count, count};
    return seen + count;
}

/* --- the whole --------------------------------------------------------------------------------------------- */

/* Part of the points' rays that leave the room where nothing is known. */
static double escaping_share(const struct light_points *points) {
    double sum = 0.0;
    for (size_t i = 0; i < points->count; i++)
        sum += (double)points->point[i].escaping;
    return sum / fmax((double)points->count, 1.0);
}

size_t openings_find(struct reconstruction *r, const struct views *views) {
    struct light_model m;
    struct surround surround;
    struct opening_candidate chosen[SURROUND_CELLS];
    if (!r->is_surrounded)
        return 0;
    surround_init(&surround, views);
    emitters_observe(r, views, r->evidence);
    light_model_init(&m, r, views, false);
    m.sky.surround = &surround;
    light_model_survey(&m, views, NULL, NULL);
    r->is_surrounded = escaping_share(&m.points) <= UNSEEN_LIGHT_MOSTLY;
    if (!r->is_surrounded) {
        light_model_release(&m);
        return 0;
    }
    joint_fit_solve(&m.fit);
    size_t count = choose(&m, chosen);
    light_model_release(&m);
    environment_release(&r->environment);
    world_set_environment(&r->world, NULL, r->pool);
    return add_surface(r, &surround, chosen, count);
}
