/* atlas_pack.c -- see atlas_pack.h.
 *
 * First fit, large shapes first: a shape goes to the lowest row, and there to the leftmost
 * column, where it hits nothing; of its four orientations the one whose top is lowest wins.
 *
 * All columns of a row are tried at once. level[k] of a row has bit x set when any of the 2^k
 * cells from x on is taken; so "a run of cells from x + a to x + a + n - 1 hits something" is,
 * for all x at once, the union of two shifted rows of level[floor(log2 n)]. A shape is a list of
 * runs; the union over them has a 0 where it fits. Mostly a few runs fill it with ones, so they
 * are tried longest first. What fits nowhere in a row is not tried there again in nearly the same
 * shape: the search begins at the row where the last box with such sides was placed. */
#include "server/scene/atlas_pack.h"

#include <stdlib.h>
#include <string.h>

#include "common/mem.h"

#define LEVELS 15  /* runs up to 2^14 cells and over */
#define CLASSES 96 /* of box sides, see class_of */

struct pack_run {
    uint32_t y, x, length;
};

struct shape {
    uint32_t width, height;
    struct pack_run *run; /* longest first */
    size_t run_count, run_capacity;
};

struct atlas_packer {
    uint32_t size, padding;
    size_t words;            /* of a row */
    uint64_t *level[LEVELS]; /* [size][words] */
    int level_count;
    uint64_t *hits;                   /* [words] scratch */
    struct shape shape[4];            /* of the present item, by orientation */
    uint32_t start[CLASSES][CLASSES]; /* row where the last box of these sides found a place */
};

static bool get(const struct pack_item *item, uint32_t x, uint32_t y) {
    return item->row[y * pack_words(item->width) + x / 64] >> (x % 64) & 1;
}

static int longest_first(const void *left, const void *right) {
    const struct pack_run *a = left, *b = right;
    if (a->length != b->length)
        return a->length > b->length ? -1 : 1;
    if (a->y != b->y)
        return a->y < b->y ? -1 : 1;
    return a->x < b->x ? -1 : a->x > b->x;
}

static void add_run(struct shape *shape, struct pack_run run) {
    if (shape->run_count == shape->run_capacity) {
        shape->run_capacity = shape->run_capacity ? 2 * shape->run_capacity : 64;
        shape->run = mem_realloc_array(shape->run, shape->run_capacity, sizeof *shape->run);
    }
    shape->run[shape->run_count++] = run;
}

static void shape_make(struct shape *shape, const struct pack_item *item, int quarter) {
    bool swap = quarter & 1;
    shape->width = swap ? item->height : item->width;
    shape->height = swap ? item->width : item->height;
    shape->run_count = 0;
    int32_t w = (int32_t)item->width - 1, h = (int32_t)item->height - 1; /* cells, not places */
    int back = (4 - quarter) % 4;
    for (uint32_t y = 0; y < shape->height; y++) {
        uint32_t begin = 0;
        bool inside = false;
        for (uint32_t x = 0; x <= shape->width; x++) {
            int32_t ix = 0, iy = 0;
            bool taken = false;
            if (x < shape->width) {
                pack_turn(back, swap ? h : w, swap ? w : h, (int32_t)x, (int32_t)y, &ix, &iy);
                taken = get(item, (uint32_t)ix, (uint32_t)iy);
            }
            if (taken && !inside)
                begin = x;
            if (!taken && inside)
                add_run(shape, (struct pack_run){y, begin, x - begin});
            inside = taken;
        }
    }
    qsort(shape->run, shape->run_count, sizeof *shape->run, longest_first);
}

static int level_of(const struct atlas_packer *p, uint32_t length) {
    int k = 0;
    while (k + 1 < p->level_count && (2u << k) <= length)
        k++;
    return k;
}

/* hits |= row >> shift for the words [first, last]. */
static void or_shifted(uint64_t *restrict hits, const uint64_t *restrict row, size_t words, size_t first, size_t last,
                       uint32_t shift) {
    size_t q = shift / 64;
    unsigned r = shift % 64;
    if (first + q >= words)
        return;
    size_t end = last + q < words ? last + 1 : words - q; /* row has words from q on */
    if (r == 0) {
        for (size_t i = first; i < end; i++)
            hits[i] |= row[i + q];
        return;
    }
    size_t both = end + q < words ? end : words - q - 1;
    for (size_t i = first; i < both; i++)
        hits[i] |= row[i + q] >> r | row[i + q + 1] << (64 - r);
    if (both < end)
        hits[both] |= row[both + q] >> r;
}

/* The leftmost column where the shape fits with its lowest row at y, or -1. */
static int64_t fit_row(struct atlas_packer *p, const struct shape *shape, uint32_t y) {
    uint64_t *hits = p->hits;
    uint32_t columns = p->size - shape->width + 1;
    size_t first = 0, last = (columns - 1) / 64;
    memset(hits, 0, (last + 1) * sizeof *hits);
    if (columns % 64)
        hits[last] = ~UINT64_C(0) << (columns % 64);
    for (size_t i = 0; i < shape->run_count; i++) {
        const struct pack_run *run = &shape->run[i];
        int k = level_of(p, run->length);
        const uint64_t *row = p->level[k] + (size_t)(y + run->y) * p->words;
        uint32_t span = 1u << k;
        for (uint32_t at = 0;; at += span) {
            if (at + span > run->length)
                at = run->length - span;
            or_shifted(hits, row, p->words, first, last, run->x + at);
            if (at + span >= run->length)
                break;
        }
        while (first <= last && hits[first] == ~UINT64_C(0))
            first++;
        if (first > last)
            return -1;
        while (hits[last] == ~UINT64_C(0))
            last--;
    }
    return (int64_t)(first * 64) + __builtin_ctzll(~hits[first]);
}

/* Sets cells [x0, x1) of a row in level 0. */
static void set_cells(uint64_t *row, uint32_t x0, uint32_t x1) {
    for (uint32_t x = x0; x < x1;) {
        uint32_t end = (x / 64 + 1) * 64 < x1 ? (x / 64 + 1) * 64 : x1;
        uint64_t mask = ~UINT64_C(0) >> (64 - (end - x));
        row[x / 64] |= mask << (x % 64);
        x = end;
    }
}

static void occupy(struct atlas_packer *p, const struct shape *shape, uint32_t x, uint32_t y) {
    uint32_t pad = p->padding;
    for (size_t i = 0; i < shape->run_count; i++) {
        const struct pack_run *run = &shape->run[i];
        uint32_t row = y + run->y, col = x + run->x;
        uint32_t y0 = row > pad ? row - pad : 0;
        uint32_t y1 = row + pad < p->size ? row + pad : p->size - 1;
        uint32_t x0 = col > pad ? col - pad : 0;
        uint32_t x1 = col + run->length + pad < p->size ? col + run->length + pad : p->size;
        for (uint32_t r = y0; r <= y1; r++)
            set_cells(p->level[0] + r * p->words, x0, x1);
    }
    uint32_t y0 = y > pad ? y - pad : 0;
    uint32_t y1 = y + shape->height + pad < p->size ? y + shape->height + pad : p->size;
    for (uint32_t r = y0; r < y1; r++)
        for (int k = 1; k < p->level_count; k++) {
            uint64_t *to = p->level[k] + r * p->words;
            const uint64_t *from = p->level[k - 1] + r * p->words;
            memcpy(to, from, p->words * sizeof *to);
            or_shifted(to, from, p->words, 0, p->words - 1, 1u << (k - 1));
        }
}

/* Sides of nearly one length share a class: each to 16, then eight classes an octave. */
static uint32_t class_of(uint32_t side) {
    if (side < 16)
        return side;
    uint32_t octave = 31 - (uint32_t)__builtin_clz(side); /* 4 or more */
    uint32_t class = 16 + (octave - 4) * 8 + ((side >> (octave - 3)) & 7);
    return class < CLASSES ? class : CLASSES - 1;
}

static bool place(struct atlas_packer *p, struct pack_item *item) {
    if (item->width > p->size || item->height > p->size)
        return false;
    uint32_t lowest_top = UINT32_MAX;
    for (int quarter = 0; quarter < 4; quarter++) {
        struct shape *shape = &p->shape[quarter];
        shape_make(shape, item, quarter);
        uint32_t *start = &p->start[class_of(shape->width)][class_of(shape->height)];
        for (uint32_t y = *start; y + shape->height <= p->size; y++) {
            if (y + shape->height >= lowest_top)
                break;
            int64_t x = fit_row(p, shape, y);
            if (x < 0)
                continue;
            lowest_top = y + shape->height;
            item->x = (uint32_t)x;
            item->y = y;
            item->quarter = quarter;
            *start = y;
            break;
        }
        if (shape->run_count == shape->height && shape->width == shape->height &&
            shape->run[shape->run_count - 1].length == shape->width)
            break; /* a full square looks the same from all sides */
    }
    if (lowest_top == UINT32_MAX)
        return false;
    occupy(p, &p->shape[item->quarter], item->x, item->y);
    return true;
}

struct pack_order {
    uint64_t key;
    size_t index;
};

static int by_key(const void *left, const void *right) {
    const struct pack_order *a = left, *b = right;
    if (a->key != b->key)
        return a->key > b->key ? -1 : 1;
    return a->index < b->index ? -1 : 1;
}

bool pack(struct pack_item *item, size_t count, uint32_t size, uint32_t padding) {
    struct atlas_packer p = {.size = size, .padding = padding, .words = pack_words(size)};
    uint32_t widest = 1;
    struct pack_order *order = mem_array(count, sizeof *order);
    for (size_t i = 0; i < count; i++) {
        uint32_t w = item[i].width, h = item[i].height;
        uint32_t longer = w > h ? w : h, shorter = w > h ? h : w;
        widest = longer > widest ? longer : widest;
        order[i] = (struct pack_order){(uint64_t)longer << 32 | shorter, i};
    }
    qsort(order, count, sizeof *order, by_key);
    while (p.level_count < LEVELS && (1u << p.level_count) <= widest)
        p.level_count++;
    for (int k = 0; k < p.level_count; k++)
        p.level[k] = mem_calloc((size_t)size * p.words, sizeof *p.level[k]);
    p.hits = mem_array(p.words, sizeof *p.hits);
    bool fits = true;
    for (size_t i = 0; i < count && fits; i++)
        fits = place(&p, &item[order[i].index]);
    for (int k = 0; k < p.level_count; k++)
        mem_free(p.level[k]);
    for (int quarter = 0; quarter < 4; quarter++)
        mem_free(p.shape[quarter].run);
    mem_free(p.hits);
    mem_free(order);
    return fits;
}
