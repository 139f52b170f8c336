/* segment_color.c -- see segment_color.h.
 *
 * Radiances are smoothed over neighbours that show nearly the same, in logarithms; regions (color_regions.h) that meet
 * then join unless the step between them is that of two things (color_steps.h). */
#include "server/scene/segment_color.h"

#include <float.h>
#include <math.h>
#include <stdbool.h>

#include "common/mem.h"
#include "server/scene/color_regions.h"
#include "server/scene/color_steps.h"

#define SMOOTH_SCALE 0.1f /* logarithms this far apart weigh half in a triangle's mean */
#define SMOOTH_ROUNDS 4
#define FLOOR 0.02f /* radiance added before the logarithm, of the mean of all */

#define NONE UINT32_MAX

/* [triangle_count] logarithms; NAN: not known; the caller's. */
static rgb *take_logarithms(const rgb *shown, size_t n) {
    rgb *value = mem_array(n, sizeof *value);
    double sum = 0.0, known = 0.0;
    for (size_t t = 0; t < n; t++) {
        if (shown[t].r < 0.0f)
            continue;
        sum += (double)rgb_mean(shown[t]);
        known += 1.0;
    }
    float floor = fmaxf(FLOOR * (float)(known > 0.0 ? sum / known : 1.0), FLT_MIN);
    for (size_t t = 0; t < n; t++)
        value[t] = shown[t].r < 0.0f
                       ? rgb_gray(NAN)
                       : rgb_make(logf(shown[t].r + floor), logf(shown[t].g + floor), logf(shown[t].b + floor));
    return value;
}

/* The mean over a triangle and its neighbours, by how alike they are; of one that is not known over its neighbours. */
static rgb smoothed(const struct adjacency *adjacency, const uint32_t *of_triangle, const rgb *value, uint32_t t) {
    bool is_known = !isnan(value[t].r);
    rgb sum = is_known ? value[t] : rgb_gray(0.0f);
    float total = is_known ? 1.0f : 0.0f;
    for (uint32_t half = 3 * t; half < 3 * t + 3; half++) {
        uint32_t other = adjacency->next[half] / 3;
        if (other == t || of_triangle[other] != of_triangle[t] || isnan(value[other].r))
            continue;
        float off = is_known ? color_distance(value[t], value[other]) / SMOOTH_SCALE : 0.0f;
        float weight = 1.0f / (1.0f + off * off);
        sum = rgb_mad(sum, weight, value[other]);
        total += weight;
    }
    return total > 0.0f ? rgb_scale(sum, 1.0f / total) : rgb_gray(NAN);
}

/* Takes `value` and returns it smoothed. */
static rgb *smooth(const struct adjacency *adjacency, const uint32_t *of_triangle, rgb *value, size_t n) {
    rgb *next = mem_array(n, sizeof *next);
    for (int round = 0; round < SMOOTH_ROUNDS; round++) {
        for (uint32_t t = 0; t < n; t++)
            next[t] = smoothed(adjacency, of_triangle, value, t);
        rgb *former = value;
        value = next;
        next = former;
    }
    mem_free(next);
    return value;
}

/* Numbers the regions: the largest of each piece of a segment that hangs together as before, the others from `count`
 * on. */
static size_t number_parts(struct color_regions *s, uint32_t *of_triangle, size_t count) {
    size_t n = s->mesh->triangle_count, found = count;
    uint32_t *largest = mem_array(n, sizeof *largest), *number = mem_array(n, sizeof *number), *root = color_roots(s);
    struct regions piece;
    regions_init(&piece, s->mesh);
    for (size_t i = 0; i < s->link_count; i++) {
        uint32_t a = regions_root(&piece, s->link[i].half_edge / 3);
        uint32_t b = regions_root(&piece, region_link_end(s->adjacency, &s->link[i]));
        if (a != b)
            regions_join(&piece, a, b, 0.0f);
    }
    for (uint32_t t = 0; t < n; t++)
        largest[t] = number[t] = NONE;
    for (uint32_t t = 0; t < n; t++) {
        uint32_t *best = &largest[regions_root(&piece, t)];
        if (*best == NONE || s->regions.area[root[t]] > s->regions.area[*best])
            *best = root[t];
    }
    for (uint32_t t = 0; t < n; t++) {
        if (root[t] == largest[regions_root(&piece, t)])
            continue;
        if (number[root[t]] == NONE)
            number[root[t]] = (uint32_t)found++;
        of_triangle[t] = number[root[t]];
    }
    regions_release(&piece);
    mem_free(root);
    mem_free(number);
    mem_free(largest);
    return found;
}

size_t segment_color_split(uint32_t *of_triangle, size_t count, const struct mesh *mesh,
                           const struct adjacency *adjacency, const rgb *shown, double least_area) {
    size_t n = mesh->triangle_count;
    struct color_regions s;
    rgb *value = smooth(adjacency, of_triangle, take_logarithms(shown, n), n);
    color_regions_find(&s, mesh, adjacency, of_triangle, value, least_area);
    while (color_steps_join(&s)) {
    }
    size_t found = number_parts(&s, of_triangle, count);
    color_regions_release(&s);
    return found;
}
