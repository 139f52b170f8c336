/* gradient.c -- see gradient.h.
 *
 * gradient_reduce works in three steps:
 *   1. each log's entries are copied in order of tiles by a counting sort, stable, logs in parallel;
 *      an entry that straddles tiles goes to each of them;
 *   2. each tile adds its entries, log by log, into a dense scratch tile, then writes the touched
 *      texels to a place of its own in the output arrays, tiles in parallel;
 *   3. the places are closed up.
 * Tiles are as small as keeps their number at 32 x 32 or below, and at least 64 x 64 texels, so
 * that the counters stay small and a scratch tile stays in the second-level cache. */
#include "server/render/gradient.h"

#include <stdbool.h>
#include <string.h>

#include "common/mem.h"

#define MIN_TILE_SHIFT 6    /* tiles of 64 texels a side at least */
#define MAX_TILES_ACROSS 32 /* larger textures have larger tiles */
#define AHEAD 3             /* logs that are prefetched ahead */

typedef float float4 __attribute__((vector_size(16)));

/* Dense sums of one tile, all zero between uses. */
struct gradient_tile {
    float4 *sum;       /* [side * side] r g b weight; owned */
    uint64_t *touched; /* [side * side / 64] a bit per texel; owned */
};

/* A log sorted by tile. */
struct sorted_log {
    size_t capacity;
    struct gradient_entry *entry; /* copies, grouped by tile; owned */
    uint32_t *start;              /* [tile_count + 1] owned */
};

struct gradient_scratch {
    unsigned tile_shift;
    uint32_t tiles_x, tiles_y, tile_count;
    size_t log_capacity;
    struct sorted_log *sorted; /* [log_capacity] owned */
    size_t capacity;           /* of the output arrays */
    size_t *place;             /* [tile_count + 1] offset of a tile's output; owned */
    size_t *touched;           /* [tile_count] owned */
    int thread_count;
    struct gradient_tile *tile; /* [thread_count] owned */
};

static void tile_init(struct gradient_tile *tile, size_t texels) {
    tile->sum = mem_calloc_large(texels, sizeof *tile->sum);
    tile->touched = mem_calloc(texels / 64, sizeof *tile->touched);
}

static void tile_release(struct gradient_tile *tile) {
    mem_free(tile->sum);
    mem_free(tile->touched);
}

struct gradient_log *gradient_log_new(size_t segment_count) {
    struct gradient_log *log = mem_calloc(1, sizeof *log);
    log->segment_count = segment_count;
    log->segment = mem_calloc(segment_count, sizeof *log->segment);
    return log;
}

void gradient_log_free(struct gradient_log *log) {
    if (!log)
        return;
    mem_free(log->entry);
    mem_free(log->segment);
    mem_free(log);
}

void gradient_log_clear(struct gradient_log *log) {
    log->entry_count = 0;
    memset(log->segment, 0, log->segment_count * sizeof *log->segment);
}

struct gradient_entry *gradient_log_reserve(struct gradient_log *log, size_t count) {
    if (log->entry_count + count > log->entry_capacity) {
        log->entry_capacity = log->entry_count + count + log->entry_capacity / 2;
        log->entry = mem_realloc_array(log->entry, log->entry_capacity, sizeof *log->entry);
    }
    return log->entry + log->entry_count;
}

struct gradient *gradient_new(uint32_t texture_width, uint32_t texture_height, size_t segment_count) {
    struct gradient *g = mem_calloc(1, sizeof *g);
    g->width = texture_width;
    g->height = texture_height;
    g->segment_count = segment_count;
    g->d_roughness = mem_calloc(segment_count, sizeof *g->d_roughness);
    g->d_specular = mem_calloc(segment_count, sizeof *g->d_specular);
    g->d_emission = mem_calloc(segment_count, sizeof *g->d_emission);
    struct gradient_scratch *s = mem_calloc(1, sizeof *s);
    g->scratch = s;
    uint32_t side = texture_width > texture_height ? texture_width : texture_height;
    s->tile_shift = MIN_TILE_SHIFT;
    while (((size_t)MAX_TILES_ACROSS << s->tile_shift) < side)
        s->tile_shift++;
    uint32_t round = (1u << s->tile_shift) - 1;
    s->tiles_x = (texture_width + round) >> s->tile_shift;
    s->tiles_y = (texture_height + round) >> s->tile_shift;
    s->tile_count = s->tiles_x * s->tiles_y;
    s->place = mem_calloc(s->tile_count + 1, sizeof *s->place);
    s->touched = mem_calloc(s->tile_count, sizeof *s->touched);
    return g;
}

void gradient_free(struct gradient *g) {
    if (!g)
        return;
    struct gradient_scratch *s = g->scratch;
    for (size_t i = 0; i < s->log_capacity; i++) {
        mem_free(s->sorted[i].entry);
        mem_free(s->sorted[i].start);
    }
    for (int i = 0; i < s->thread_count; i++)
        tile_release(&s->tile[i]);
    mem_free(s->tile);
    mem_free(s->sorted);
    mem_free(s->place);
    mem_free(s->touched);
    mem_free(s);
    mem_free(g->texel);
    mem_free(g->d_base_color);
    mem_free(g->weight);
    mem_free(g->d_roughness);
    mem_free(g->d_specular);
    mem_free(g->d_emission);
    mem_free(g);
}

/* The distinct tiles in which an entry has weight; returns how many. */
static int entry_tiles(const struct gradient *g, const struct gradient_entry *e, uint32_t tile[4]) {
    const struct gradient_scratch *s = g->scratch;
    uint32_t x = e->x, y = e->y;
    uint32_t mask = (1u << s->tile_shift) - 1;
    uint32_t home = (y >> s->tile_shift) * s->tiles_x + (x >> s->tile_shift);
    bool right = (x & mask) == mask, below = (y & mask) == mask;
    tile[0] = home;
    if (!right && !below)
        return 1;
    /* a home tile without weight adds nothing */
    int count = 1;
    if (right && (e->weight[1] > 0.0f || (!below && e->weight[3] > 0.0f)))
        tile[count++] = home + 1;
    if (below && (e->weight[2] > 0.0f || (!right && e->weight[3] > 0.0f)))
        tile[count++] = home + s->tiles_x;
    if (right && below && e->weight[3] > 0.0f)
        tile[count++] = home + s->tiles_x + 1;
    return count;
}

struct reduce {
    struct gradient *g;
    struct gradient_log *const *log;
    size_t log_count;
};

static void sort_log(void *user, size_t index, int thread) {
    (void)thread;
    const struct reduce *r = user;
    const struct gradient_scratch *s = r->g->scratch;
    const struct gradient_log *log = r->log[index];
    struct sorted_log *sorted = &s->sorted[index];
    uint32_t *start = sorted->start, tile[4];
    memset(start, 0, (s->tile_count + 1) * sizeof *start);
    for (size_t i = 0; i < log->entry_count; i++)
        for (int k = entry_tiles(r->g, &log->entry[i], tile); k-- > 0;)
            start[tile[k] + 1]++;
    for (uint32_t t = 0; t < s->tile_count; t++)
        start[t + 1] += start[t];
    size_t total = start[s->tile_count];
    if (total > sorted->capacity) {
        sorted->capacity = total + total / 2;
        sorted->entry = mem_realloc_array(sorted->entry, sorted->capacity, sizeof *sorted->entry);
    }
    for (size_t i = 0; i < log->entry_count; i++)
        for (int k = entry_tiles(r->g, &log->entry[i], tile); k-- > 0;)
            sorted->entry[start[tile[k]]++] = log->entry[i];
    /* Each start has moved to the end of its tile, the start of the next one. */
    memmove(start + 1, start, s->tile_count * sizeof *start);
    start[0] = 0;
}

static void add_entry(const struct gradient_entry *e, unsigned shift, uint32_t tile_x, uint32_t tile_y,
                      struct gradient_tile *tile) {
    uint32_t side = 1u << shift;
    /* unsigned: positions left of or above the tile wrap to large values */
    uint32_t left = e->x - (tile_x << shift), top = e->y - (tile_y << shift);
    float4 d = {e->d.r, e->d.g, e->d.b, 1.0f};
    for (uint32_t k = 0; k < 4; k++) {
        uint32_t u = left + (k & 1), v = top + (k >> 1);
        float w = e->weight[k];
        if (u >= side || v >= side || w == 0.0f)
            continue;
        uint32_t at = (v << shift) + u;
        tile->sum[at] += w * d;
        tile->touched[at / 64] |= UINT64_C(1) << at % 64;
    }
}

/* Prefetches a tile's entries in a log. */
static void fetch_run(const struct sorted_log *sorted, size_t tile) {
    const struct gradient_entry *end = sorted->entry + sorted->start[tile + 1];
    for (const struct gradient_entry *e = sorted->entry + sorted->start[tile]; e < end; e += 2)
        __builtin_prefetch(e);
}

static void sum_tile(void *user, size_t index, int thread) {
    const struct reduce *r = user;
    struct gradient *g = r->g;
    struct gradient_scratch *s = g->scratch;
    s->touched[index] = 0;
    if (s->place[index] == s->place[index + 1])
        return;
    struct gradient_tile *tile = &s->tile[thread];
    uint32_t tile_y = (uint32_t)index / s->tiles_x, tile_x = (uint32_t)index - tile_y * s->tiles_x;
    for (size_t l = 0; l < r->log_count; l++) {
        const struct sorted_log *sorted = &s->sorted[l];
        if (l + AHEAD < r->log_count)
            fetch_run(sorted + AHEAD, index);
        for (uint32_t i = sorted->start[index]; i < sorted->start[index + 1]; i++)
            add_entry(&sorted->entry[i], s->tile_shift, tile_x, tile_y, tile);
    }
    size_t at = s->place[index];
    uint32_t left = tile_x << s->tile_shift, top = tile_y << s->tile_shift;
    uint32_t mask = (1u << s->tile_shift) - 1;
    for (uint32_t word = 0; word < 1u << (2 * s->tile_shift - 6); word++) {
        for (uint64_t bits = tile->touched[word]; bits != 0; bits &= bits - 1) {
            uint32_t place = word * 64 + (uint32_t)__builtin_ctzll(bits);
            float4 *from = &tile->sum[place];
            g->texel[at] = (top + (place >> s->tile_shift)) * g->width + left + (place & mask);
            g->d_base_color[at] = (rgb){(*from)[0], (*from)[1], (*from)[2]};
            g->weight[at++] = (*from)[3];
            *from = (float4){0.0f, 0.0f, 0.0f, 0.0f};
        }
        tile->touched[word] = 0;
    }
    s->touched[index] = at - s->place[index];
}

/* Ensures room for `log_count` logs and `thread_count` scratch tiles. */
static void grow_scratch(struct gradient_scratch *s, size_t log_count, int thread_count) {
    if (log_count > s->log_capacity) {
        s->sorted = mem_realloc_array(s->sorted, log_count, sizeof *s->sorted);
        for (size_t i = s->log_capacity; i < log_count; i++) {
            s->sorted[i] = (struct sorted_log){0, NULL, NULL};
            s->sorted[i].start = mem_array(s->tile_count + 1, sizeof *s->sorted[i].start);
        }
        s->log_capacity = log_count;
    }
    if (thread_count > s->thread_count) {
        s->tile = mem_realloc_array(s->tile, (size_t)thread_count, sizeof *s->tile);
        for (int i = s->thread_count; i < thread_count; i++)
            tile_init(&s->tile[i], (size_t)1 << 2 * s->tile_shift);
        s->thread_count = thread_count;
    }
}

/* Assigns each tile an output range of its maximum size. */
static void place_tiles(struct gradient *g, size_t log_count) {
    struct gradient_scratch *s = g->scratch;
    size_t area = (size_t)1 << 2 * s->tile_shift, total = 0;
    for (uint32_t t = 0; t < s->tile_count; t++) {
        s->place[t] = total;
        size_t entries = 0;
        for (size_t l = 0; l < log_count; l++)
            entries += s->sorted[l].start[t + 1] - s->sorted[l].start[t];
        total += 4 * entries < area ? 4 * entries : area;
    }
    s->place[s->tile_count] = total;
    if (total > s->capacity) {
        s->capacity = total + total / 4;
        g->texel = mem_realloc_array(g->texel, s->capacity, sizeof *g->texel);
        g->d_base_color = mem_realloc_array(g->d_base_color, s->capacity, sizeof *g->d_base_color);
        g->weight = mem_realloc_array(g->weight, s->capacity, sizeof *g->weight);
    }
}

static void close_up(struct gradient *g) {
    const struct gradient_scratch *s = g->scratch;
    size_t at = 0;
    for (uint32_t t = 0; t < s->tile_count; t++) {
        size_t from = s->place[t], count = s->touched[t];
        if (count > 0 && from != at) {
            memmove(g->texel + at, g->texel + from, count * sizeof *g->texel);
            memmove(g->d_base_color + at, g->d_base_color + from, count * sizeof *g->d_base_color);
            memmove(g->weight + at, g->weight + from, count * sizeof *g->weight);
        }
        at += count;
    }
    g->texel_count = at;
}

static void sum_segments(struct gradient *g, struct gradient_log *const *log, size_t log_count) {
    for (size_t i = 0; i < g->segment_count; i++) {
        struct gradient_segment sum = {0.0, 0.0, {0.0, 0.0, 0.0}};
        for (size_t l = 0; l < log_count; l++) {
            const struct gradient_segment *from = &log[l]->segment[i];
            sum.d_roughness += from->d_roughness;
            sum.d_specular += from->d_specular;
            for (int c = 0; c < 3; c++)
                sum.d_emission[c] += from->d_emission[c];
        }
        g->d_roughness[i] = sum.d_roughness;
        g->d_specular[i] = sum.d_specular;
        memcpy(g->d_emission[i], sum.d_emission, sizeof sum.d_emission);
    }
}

void gradient_reduce(struct gradient *g, struct gradient_log *const *log, size_t log_count, struct parallel *pool) {
    struct reduce r = {g, log, log_count};
    grow_scratch(g->scratch, log_count, parallel_thread_count(pool));
    parallel_for(pool, log_count, sort_log, &r);
    place_tiles(g, log_count);
    parallel_for(pool, g->scratch->tile_count, sum_tile, &r);
    close_up(g);
    sum_segments(g, log, log_count);
}
