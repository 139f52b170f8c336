/* by_segment.c -- see by_segment.h. */
#include "server/scene/by_segment.h"

#include "common/mem.h"

/* Items are valid texels of `inverse` or, if that is NULL, triangles. */
static uint32_t segment_of(const struct segments *segments, const struct inverse_uv *inverse, size_t item) {
    return segments->of_triangle[inverse ? inverse->triangle[inverse->valid[item]] : item];
}

/* A counting sort; the result, first[], is shifted by two while it counts and by one while it places. */
static uint32_t *sort(const struct segments *segments, const struct inverse_uv *inverse, size_t count,
                      uint32_t *sorted) {
    uint32_t *first = mem_calloc(segments->count + 2, sizeof *first);
    for (size_t i = 0; i < count; i++)
        first[segment_of(segments, inverse, i) + 2]++;
    for (size_t s = 2; s < segments->count + 2; s++)
        first[s] += first[s - 1];
    for (size_t i = 0; i < count; i++)
        sorted[first[segment_of(segments, inverse, i) + 1]++] = inverse ? inverse->valid[i] : (uint32_t)i;
    return first;
}

void by_segment_sort(struct texels_by_segment *t, const struct segments *segments, const struct inverse_uv *inverse) {
    t->texel = mem_array(inverse->valid_count + 1, sizeof *t->texel);
    t->first = sort(segments, inverse, inverse->valid_count, t->texel);
}

void by_segment_sort_triangles(struct triangles_by_segment *t, const struct segments *segments, size_t triangle_count) {
    t->triangle = mem_array(triangle_count + 1, sizeof *t->triangle);
    t->first = sort(segments, NULL, triangle_count, t->triangle);
}

void by_segment_release_triangles(struct triangles_by_segment *t) {
    mem_free(t->first);
    mem_free(t->triangle);
    *t = (struct triangles_by_segment){0};
}

void by_segment_release(struct texels_by_segment *t) {
    mem_free(t->first);
    mem_free(t->texel);
    *t = (struct texels_by_segment){0};
}
