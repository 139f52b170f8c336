/* segment.c -- see segment.h. */
#include "server/scene/segment.h"

#include <stdlib.h>
#include <string.h>

#include "common/mem.h"

static int ascending(const void *left, const void *right) {
    int64_t a = *(const int64_t *)left, b = *(const int64_t *)right;
    return a < b ? -1 : a > b;
}

void segments_from_object_id(struct segments *s, const struct mesh *mesh) {
    size_t n = mesh->triangle_count;
    s->id = mem_array(n, sizeof *s->id);
    s->of_triangle = mem_array(n, sizeof *s->of_triangle);
    memcpy(s->id, mesh->object_id, n * sizeof *s->id);
    qsort(s->id, n, sizeof *s->id, ascending);
    s->count = 0;
    for (size_t i = 0; i < n; i++)
        if (i == 0 || s->id[i] != s->id[i - 1])
            s->id[s->count++] = s->id[i];
    s->id = mem_realloc_array(s->id, s->count, sizeof *s->id);
    for (size_t t = 0; t < n; t++) {
        const int64_t *found = bsearch(&mesh->object_id[t], s->id, s->count, sizeof *s->id, ascending);
        s->of_triangle[t] = (uint32_t)(found - s->id);
    }
}

void segments_release(struct segments *s) {
    mem_free(s->of_triangle);
    mem_free(s->id);
    *s = (struct segments){0};
}
