/* by_segment.c -- see by_segment.h. */
#include "server/scene/by_segment.h"

#include "common/mem.h"

void by_segment_sort(struct texels_by_segment *t, const struct segments *segments, const struct inverse_uv *inverse) {
    size_t valid = inverse->valid_count;
    uint32_t *count = mem_calloc(segments->count + 2, sizeof *count);
    t->texel = mem_array(valid + 1, sizeof *t->texel);
    /* A counting sort; count[] is shifted by two while it counts and by one while it places. */
    for (size_t i = 0; i < valid; i++)
        count[segments->of_triangle[inverse->triangle[inverse->valid[i]]] + 2]++;
    for (size_t s = 2; s < segments->count + 2; s++)
        count[s] += count[s - 1];
    for (size_t i = 0; i < valid; i++)
        t->texel[count[segments->of_triangle[inverse->triangle[inverse->valid[i]]] + 1]++] = inverse->valid[i];
    t->first = count;
}

void by_segment_release(struct texels_by_segment *t) {
    mem_free(t->first);
    mem_free(t->texel);
    *t = (struct texels_by_segment){0};
}
