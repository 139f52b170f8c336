/* rim.c -- see rim.h. */
#include "server/light/decision/rim.h"

#include <math.h>
#include <stdbool.h>

#include "common/mem.h"
#include "common/quantile.h"

enum { REST, PART, PART_REACHED, REST_REACHED };

/* Adds to list[count] the triangles beside `t` in its segment that are on a side and were not reached yet. */
static size_t reach(const struct rim *rim, uint32_t t, uint8_t side, uint8_t reached, uint32_t *list, size_t count) {
    const uint32_t *next = rim->adjacency->next;
    for (uint32_t edge = 3 * t; edge < 3 * t + 3; edge++) {
        for (uint32_t h = next[edge]; h != edge; h = next[h]) {
            uint32_t other = h / 3;
            if (rim->of_triangle[other] != rim->of_triangle[t] || rim->side[other] != side)
                continue;
            rim->side[other] = reached;
            list[count++] = other;
        }
    }
    return count;
}

/* Median of the triangles that are observed; negative: there are none. */
static float median_of(const struct rim *rim, const uint32_t *list, size_t count) {
    float *value = mem_array(count + 1, sizeof *value);
    size_t known = 0;
    for (size_t i = 0; i < count; i++) {
        if (rim->observed[list[i]] >= 0.0f)
            value[known++] = rim->observed[list[i]];
    }
    float median = known > 0 ? quantile(value, known, 0.5) : -1.0f;
    mem_free(value);
    return median;
}

/* From list[count], which are next to the rim on one side, so many triangles away from it; *reached: all that list then
 * has. Returns the median radiance of the farthest that are observed; negative: none are. */
static float radiance_off_rim(const struct rim *rim, int triangles, uint8_t side, uint8_t mark, uint32_t *list,
                              size_t count, size_t *reached) {
    float radiance = -1.0f;
    size_t first = 0;
    for (int k = 0; k < triangles && first < count; k++) {
        size_t end = count;
        float median = median_of(rim, list + first, end - first);
        radiance = median >= 0.0f ? median : radiance;
        for (size_t i = first; i < end && k + 1 < triangles; i++)
            count = reach(rim, list[i], side, mark, list, count);
        first = end;
    }
    *reached = count;
    return radiance;
}

double rim_step(const struct rim *rim, const uint32_t *part, size_t count, int triangles, uint32_t *list) {
    size_t outer = 0, inner = 0, reached;
    for (size_t i = 0; i < count; i++)
        rim->side[part[i]] = PART;
    for (size_t i = 0; i < count; i++)
        outer = reach(rim, part[i], REST, REST_REACHED, list, outer);
    float beside = radiance_off_rim(rim, triangles, REST, REST_REACHED, list, outer, &reached);
    /* The first ring outside is known: its neighbours are the first within. */
    uint32_t *within = mem_array(count + 1, sizeof *within);
    for (size_t i = 0; i < outer; i++)
        inner = reach(rim, list[i], PART, PART_REACHED, within, inner);
    for (size_t i = 0; i < reached; i++)
        rim->side[list[i]] = REST;
    float inside = radiance_off_rim(rim, triangles, PART, PART_REACHED, within, inner, &reached);
    for (size_t i = 0; i < count; i++)
        rim->side[part[i]] = REST;
    mem_free(within);
    return beside >= 0.0f && inside > 0.0f ? log((double)inside / fmax((double)beside, 1e-6 * (double)inside))
                                           : INFINITY;
}
