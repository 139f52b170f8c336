/* heif_items.c -- see heif_items.h. Boxes: ISO/IEC 14496-12, 4.2 (sizes), 8.11.12 (iref). An image derives from those
 * that its "dimg" reference names, and is decoded together with the alpha plane whose "auxl" reference names it. */
#include "common/heif_items.h"

#include <stdlib.h>
#include <string.h>

#include "common/mem.h"

/* Grids of tiles with an alpha plane that is a grid, too, are three deep. */
#define MAX_DEPTH 8
/* Tiles of 256 x 256 of the largest picture are 8192. */
#define MAX_DECODED 20000.0
#define MAX_REFERENCES 65536          /* between items; a picture of tiles has some hundred */
#define META_MAX ((uint64_t)64 << 20) /* bytes of the box that lists the items */

/* To decode `user`, `used` is decoded. */
struct reference {
    uint32_t user, used;
};

struct references {
    struct reference *item; /* [count] */
    size_t count;
    bool is_full;
};

struct heif_box {
    char type[5];
    const uint8_t *content;
    size_t size;
};

static uint32_t number_at(const uint8_t *at, size_t bytes) {
    uint32_t value = 0;
    for (size_t i = 0; i < bytes; i++)
        value = value << 8 | at[i];
    return value;
}

/* The box at *at of data[size]; moves *at behind it. False at the end and where the box does not fit. */
static bool next_box(const uint8_t *data, size_t size, size_t *at, struct heif_box *box) {
    size_t left = size - *at, head = 8;
    if (left < 8)
        return false;
    uint64_t length = number_at(data + *at, 4);
    if (length == 1 && left >= 16) {
        length = (uint64_t)number_at(data + *at + 8, 4) << 32 | number_at(data + *at + 12, 4);
        head = 16;
    }
    length = length == 0 ? left : length;
    if (length < head || length > left)
        return false;
    memcpy(box->type, data + *at + 4, 4);
    box->type[4] = '\0';
    box->content = data + *at + head;
    box->size = (size_t)length - head;
    *at += (size_t)length;
    return true;
}

static void add(struct references *r, uint32_t user, uint32_t used) {
    if (r->count == MAX_REFERENCES) {
        r->is_full = true;
        return;
    }
    if ((r->count & (r->count - 1)) == 0)
        r->item = mem_realloc_array(r->item, r->count ? 2 * r->count : 1, sizeof *r->item);
    r->item[r->count++] = (struct reference){user, used};
}

/* Of one reference box: the item that refers, a count, the items that it names. */
static void read_reference(const struct heif_box *box, size_t bytes, struct references *r) {
    bool derives = strcmp(box->type, "dimg") == 0, is_plane = strcmp(box->type, "auxl") == 0;
    if ((!derives && !is_plane) || box->size < bytes + 2)
        return;
    uint32_t from = number_at(box->content, bytes), count = number_at(box->content + bytes, 2);
    for (uint32_t i = 0; i < count && (i + 1) * bytes + bytes + 2 <= box->size; i++) {
        uint32_t to = number_at(box->content + bytes + 2 + i * bytes, bytes);
        add(r, derives ? from : to, derives ? to : from);
    }
}

/* Of a meta box's content. */
static void read_meta(const uint8_t *data, size_t size, struct references *r) {
    struct heif_box box, inner;
    for (size_t at = 4; at < size && next_box(data, size, &at, &box);) {
        if (strcmp(box.type, "iref") != 0 || box.size < 4)
            continue;
        size_t bytes = box.content[0] == 0 ? 2 : 4;
        for (size_t k = 4; k < box.size && next_box(box.content, box.size, &k, &inner);)
            read_reference(&inner, bytes, r);
    }
}

static void read_file(struct image_source *source, struct references *r) {
    uint8_t head[16];
    for (uint64_t at = 0; image_source_read(source, at, head, sizeof head) >= 8;) {
        uint64_t length = number_at(head, 4), start = 8;
        if (length == 1) {
            length = (uint64_t)number_at(head + 8, 4) << 32 | number_at(head + 12, 4);
            start = 16;
        }
        if (length == 0 || length > source->size - at)
            length = source->size - at;
        if (length < start)
            return;
        if (memcmp(head + 4, "meta", 4) == 0 && length - start <= META_MAX) {
            size_t size = (size_t)(length - start);
            uint8_t *data = mem_alloc(size ? size : 1);
            read_meta(data, image_source_read(source, at + start, data, size), r);
            mem_free(data);
        }
        at += length;
    }
}

static int by_number(const void *a, const void *b) {
    uint32_t x = *(const uint32_t *)a, y = *(const uint32_t *)b;
    return (x > y) - (x < y);
}

/* Replaces the items' numbers by their places in order of size; returns how many items there are. */
static size_t number_densely(struct references *r) {
    size_t count = 0, all = 2 * r->count;
    uint32_t *id = mem_array(all, sizeof *id);
    for (size_t i = 0; i < r->count; i++) {
        id[2 * i] = r->item[i].user;
        id[2 * i + 1] = r->item[i].used;
    }
    qsort(id, all, sizeof *id, by_number);
    for (size_t i = 0; i < all; i++)
        if (i == 0 || id[i] != id[count - 1])
            id[count++] = id[i];
    for (size_t i = 0; i < r->count; i++) {
        const uint32_t *user = bsearch(&r->item[i].user, id, count, sizeof *id, by_number);
        const uint32_t *used = bsearch(&r->item[i].used, id, count, sizeof *id, by_number);
        r->item[i] = (struct reference){(uint32_t)(user - id), (uint32_t)(used - id)};
    }
    mem_free(id);
    return count;
}

/* Depth of each item above those that use none; false when one exceeds MAX_DEPTH, as in a circle. */
static bool find_depths(const struct references *r, int *depth) {
    for (bool is_changed = true; is_changed;) {
        is_changed = false;
        for (size_t i = 0; i < r->count; i++) {
            int wanted = depth[r->item[i].used] + 1;
            if (depth[r->item[i].user] >= wanted)
                continue;
            if (wanted > MAX_DEPTH)
                return false;
            depth[r->item[i].user] = wanted;
            is_changed = true;
        }
    }
    return true;
}

/* Whether decoding any item decodes more than MAX_DECODED. */
static bool are_many(const struct references *r, const int *depth, size_t item_count) {
    double *decoded = mem_array(item_count, sizeof *decoded);
    bool result = false;
    for (size_t i = 0; i < item_count; i++)
        decoded[i] = 1.0;
    for (int d = 1; d <= MAX_DEPTH; d++)
        for (size_t i = 0; i < r->count; i++)
            if (depth[r->item[i].user] == d) {
                decoded[r->item[i].user] += decoded[r->item[i].used];
                result = result || decoded[r->item[i].user] > MAX_DECODED;
            }
    mem_free(decoded);
    return result;
}

const char *heif_items_fault(struct image_source *source) {
    struct references r = {0};
    const char *fault = NULL;
    read_file(source, &r);
    if (r.count > 0) {
        size_t item_count = number_densely(&r);
        int *depth = mem_calloc(item_count, sizeof *depth);
        if (!find_depths(&r, depth))
            fault = "an image is derived from itself";
        else if (r.is_full || are_many(&r, depth, item_count))
            fault = "an image has too many parts";
        mem_free(depth);
    }
    mem_free(r.item);
    return fault;
}
