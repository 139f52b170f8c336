/* exr_check.c -- verifies that a written EXR file holds the picture: each chunk is decoded and compared, so that
 * faults of the library or the file system show where the file is made. Reads through the page cache; does not prove
 * that the data is on disk. Uses the memory of one chunk. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "common/exr_reader.h"

struct exr_comparison {
    const struct image *image;
    int channel[IMAGE_MAX_CHANNELS]; /* of the picture, for each of the file's */
    size_t wrong_count;
    int first_channel; /* of the picture, and the pixel of the first wrong value */
    uint32_t first_x, first_y;
    float found;
};

/* The library may round to the other neighbour than image.c. */
static bool is_half_of(uint16_t half, float value) {
    uint16_t wanted = image_half_from_float(value);
    bool is_nan = (half & 0x7fff) > 0x7c00;
    return isnan(value) ? is_nan : !is_nan && abs(half - wanted) <= 1;
}

static bool is_float_of(uint32_t bits, float value) {
    float found;
    memcpy(&found, &bits, sizeof found);
    return found == value || (isnan(found) && isnan(value));
}

static void note_wrong(struct exr_comparison *c, const struct exr_row *row, uint32_t i, float found) {
    if (c->wrong_count++ > 0)
        return;
    c->first_channel = c->channel[row->channel];
    c->first_x = row->x + i;
    c->first_y = row->y;
    c->found = found;
}

static void compare_row(void *user, const struct exr_row *row) {
    struct exr_comparison *c = user;
    size_t stride = c->image->channel_count;
    const uint8_t *at = row->values;
    const float *value =
        c->image->pixel + ((size_t)row->y * c->image->width + row->x) * stride + (size_t)c->channel[row->channel];
    for (uint32_t i = 0; i < row->width; i++, value += stride) {
        if (row->type == EXR_PIXEL_HALF) {
            uint16_t half = (uint16_t)(at[0] | at[1] << 8);
            if (!is_half_of(half, *value))
                note_wrong(c, row, i, image_float_from_half(half));
            at += 2;
        } else {
            uint32_t bits = (uint32_t)at[0] | (uint32_t)at[1] << 8 | (uint32_t)at[2] << 16 | (uint32_t)at[3] << 24;
            float found;
            memcpy(&found, &bits, sizeof found);
            if (!is_float_of(bits, *value))
                note_wrong(c, row, i, found);
            at += 4;
        }
    }
}

static enum status compare(const struct exr_reader *r, const struct image *image, const struct image *header,
                           struct error *err) {
    struct exr_comparison c = {.image = image};
    const char *path = r->stream->source->name;
    if (header->width != image->width || header->height != image->height || exr_data_width(r) != image->width ||
        exr_data_height(r) != image->height)
        return error_set(err, STATUS_CORRUPT, "%s: read back, it has %u x %u pixels, not %u x %u", path, header->width,
                         header->height, image->width, image->height);
    for (int i = 0; i < r->list->num_channels; i++)
        c.channel[i] = image_channel(image, r->list->entries[i].name.str);
    for (int i = 0; i < r->list->num_channels; i++)
        if (c.channel[i] < 0 || r->list->num_channels != (int)image->channel_count)
            return error_set(err, STATUS_CORRUPT, "%s: read back, its channels are others", path);
    enum status status = exr_decode(r, compare_row, &c, err);
    if (status == STATUS_OK && c.wrong_count > 0)
        return error_set(err, STATUS_CORRUPT,
                         "%s: read back, %zu values are wrong; the first, channel %s at (%u, %u), is %g", path,
                         c.wrong_count, image->channel[c.first_channel], c.first_x, c.first_y, (double)c.found);
    return status;
}

static enum status check_source(struct image_source *source, const struct image *image, struct error *err) {
    struct exr_stream stream = {.source = source, .fd = -1};
    struct exr_reader r = {.stream = &stream};
    struct image header = {0};
    struct image_info info;
    exr_context_initializer_t init = exr_stream_reader(&stream);
    exr_result_t code = exr_start_read(&r.context, source->name, &init);
    if (code != EXR_ERR_SUCCESS)
        return exr_stream_refuse(&stream, code, err);
    enum status status = exr_read_header(&r, &header, &info, err);
    if (status == STATUS_OK)
        status = compare(&r, image, &header, err);
    image_release(&header);
    exr_finish(&r.context);
    return status;
}

enum status image_check_exr(const char *path, const struct image *image, struct error *err) {
    struct image_source source;
    enum status status = image_source_open(&source, path, err);
    if (status != STATUS_OK)
        return status;
    struct error own = {0};
    status = check_source(&source, image, &own);
    if (source.io_error)
        status = error_set_errno(err, source.io_error, "cannot read back %s", path);
    else if (status == STATUS_CORRUPT)
        error_set(err, status, "%s", own.message);
    else if (status != STATUS_OK) /* a file of ours that does not read is our fault */
        status = error_set(err, STATUS_CORRUPT, "read back: %s", own.message);
    image_source_close(&source);
    return status;
}
