/* path_memory.c -- memory of a batch of paths; see path.h. */
#include "server/render/path.h"

#include <assert.h>

#include "common/mem.h"
#include "server/render/path_batch.h"

static struct path_batch *batch_new(size_t capacity, int max_depth) {
    assert(max_depth >= 1 && max_depth <= PATH_MAX_DEPTH);
    struct path_batch *b = mem_calloc(1, sizeof *b);
    b->capacity = capacity;
    b->max_depth = max_depth;
    b->shade = mem_calloc_large(1, sizeof *b->shade);
    b->derivative = mem_calloc_large(1, sizeof *b->derivative);
    b->state = mem_array(capacity, sizeof *b->state);
    b->ray = mem_array(capacity, sizeof *b->ray);
    b->shadow_ray = mem_array(capacity, sizeof *b->shadow_ray);
    b->hit = mem_array(capacity, sizeof *b->hit);
    b->shadow = mem_array(capacity, sizeof *b->shadow);
    b->bucket = mem_array(capacity, sizeof *b->bucket);
    b->sorted_ray = mem_array(capacity, sizeof *b->sorted_ray);
    b->sorted = mem_array(capacity, sizeof *b->sorted);
    b->occluded = mem_array(capacity, sizeof *b->occluded);
    b->key = mem_array(capacity, sizeof *b->key);
    b->sample = mem_array(capacity, sizeof *b->sample);
    b->dropped = mem_array(capacity, sizeof *b->dropped);
    b->direct = mem_array(capacity, sizeof *b->direct);
    return b;
}

struct path_batch *path_batch_new(size_t capacity, int max_depth) {
    struct path_batch *b = batch_new(capacity, max_depth);
    b->keeps_vertices = true;
    size_t blocks = (capacity + LANES - 1) / LANES;
    for (int k = 0; k < max_depth; k++)
        b->vertex[k] = mem_calloc_large(blocks, sizeof *b->vertex[k]);
    return b;
}

struct path_batch *path_batch_new_forward(size_t capacity) {
    struct path_batch *b = batch_new(capacity, PATH_MAX_DEPTH);
    b->vertex[0] = mem_calloc_large(1, sizeof *b->vertex[0]);
    return b;
}

void path_batch_free(struct path_batch *b) {
    if (!b)
        return;
    for (int k = 0; k < b->max_depth; k++)
        mem_free(b->vertex[k]);
    mem_free(b->shade);
    mem_free(b->derivative);
    mem_free(b->state);
    mem_free(b->ray);
    mem_free(b->shadow_ray);
    mem_free(b->hit);
    mem_free(b->shadow);
    mem_free(b->bucket);
    mem_free(b->sorted_ray);
    mem_free(b->sorted);
    mem_free(b->occluded);
    mem_free(b->key);
    mem_free(b->sample);
    mem_free(b->dropped);
    mem_free(b->direct);
    mem_free(b);
}
