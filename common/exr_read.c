/* exr_read.c -- OpenEXR pictures into memory: the display window of the part that exr_header.c chose. */
#include <stdio.h>
#include <string.h>

#include "common/exr_reader.h"
#include "common/image_ceiling.h"
#include "common/mem.h"

static void unpack_row(const uint8_t *from, uint16_t type, size_t width, size_t stride, float *to) {
    if (type == EXR_PIXEL_HALF)
        for (size_t x = 0; x < width; x++)
            to[x * stride] = image_float_from_half((uint16_t)(from[2 * x] | from[2 * x + 1] << 8));
    else
        for (size_t x = 0; x < width; x++) {
            uint32_t bits = (uint32_t)from[4 * x] | (uint32_t)from[4 * x + 1] << 8 | (uint32_t)from[4 * x + 2] << 16 |
                            (uint32_t)from[4 * x + 3] << 24;
            float value = (float)bits;
            if (type == EXR_PIXEL_FLOAT)
                memcpy(&value, &bits, sizeof value);
            to[x * stride] = value;
        }
}

/* Where rows go: a picture that covers the data window. */
struct canvas {
    const struct exr_reader *reader;
    const struct image *image;
};

static void put_row(void *user, const struct exr_row *row) {
    const struct canvas *canvas = user;
    const struct image *image = canvas->image;
    if (canvas->reader->target[row->channel] < 0)
        return;
    size_t pixel = (size_t)row->y * image->width + row->x, channel = (size_t)canvas->reader->target[row->channel];
    unpack_row(row->values, row->type, row->width, image->channel_count,
               image->pixel + pixel * image->channel_count + channel);
}

static void copy_grey(struct image *image) {
    size_t pixel_count = (size_t)image->width * image->height;
    float *pixel = image->pixel;
    for (size_t i = 0; i < pixel_count; i++, pixel += image->channel_count)
        pixel[1] = pixel[2] = pixel[0];
}

/* Copies the part of `from` (the data window) that lies in `to` (the display window). */
static void copy_window(const struct exr_reader *r, const struct image *from, struct image *to) {
    int64_t dx = (int64_t)r->data.min.x - r->display.min.x;
    int64_t dy = (int64_t)r->data.min.y - r->display.min.y;
    int64_t x0 = dx > 0 ? dx : 0, x1 = dx + from->width < to->width ? dx + from->width : to->width;
    size_t stride = to->channel_count;
    for (int64_t y = 0; y < to->height && x0 < x1; y++) {
        if (y < dy || y >= dy + from->height)
            continue;
        memcpy(to->pixel + ((size_t)y * to->width + (size_t)x0) * stride,
               from->pixel + ((size_t)(y - dy) * from->width + (size_t)(x0 - dx)) * stride,
               (size_t)(x1 - x0) * stride * sizeof(float));
    }
}

static enum status decode(const struct exr_reader *r, struct image *image, struct error *err) {
    struct canvas canvas = {r, image};
    enum status status = exr_decode(r, put_row, &canvas, err);
    if (status == STATUS_OK && r->grey >= 0)
        copy_grey(image);
    return status;
}

static enum status read_pixels(const struct exr_reader *r, struct image *image, struct error *err) {
    image_allocate(image);
    if (memcmp(&r->data, &r->display, sizeof r->data) == 0)
        return decode(r, image, err);
    struct image inner = *image; /* the names are only borrowed */
    inner.width = exr_data_width(r);
    inner.height = exr_data_height(r);
    image_allocate(&inner);
    enum status status = decode(r, &inner, err);
    if (status == STATUS_OK)
        copy_window(r, &inner, image);
    mem_free(inner.pixel);
    return status;
}

/* To Rec. 709 where the file says that its primaries are others; without `chromaticities` they are Rec. 709's
 * (Technical Introduction to OpenEXR, "RGB Color"). */
static void convert(const struct exr_reader *r, struct image *image, struct image_info *info) {
    exr_attr_chromaticities_t c;
    float matrix[3][3];
    bool is_same = true;
    if (r->grey >= 0 || image_channel(image, "B") != 2 ||
        exr_attr_get_chromaticities(r->context, r->part, "chromaticities", &c) != EXR_ERR_SUCCESS)
        return;
    const struct color_primaries primaries = {{(double)c.red_x, (double)c.red_y},
                                              {(double)c.green_x, (double)c.green_y},
                                              {(double)c.blue_x, (double)c.blue_y},
                                              {(double)c.white_x, (double)c.white_y}};
    if (!color_matrix(&primaries, matrix, &is_same)) {
        snprintf(info->color_warning, sizeof info->color_warning, "its chromaticities cannot be");
        return;
    }
    if (is_same)
        return;
    snprintf(info->color_space, sizeof info->color_space, "primaries of its own, linear light");
    color_multiply(matrix, image_ceiling(info), image->pixel, image->channel_count,
                   (size_t)image->width * image->height, &info->outside_count);
}

enum status image_read_exr(struct image_source *source, bool probe, struct image *image, struct image_info *info,
                           struct error *err) {
    struct exr_stream stream = {.source = source, .fd = -1};
    struct exr_reader r = {.stream = &stream};
    exr_context_initializer_t init = exr_stream_reader(&stream);
    exr_result_t code = exr_start_read(&r.context, source->name, &init);
    if (code != EXR_ERR_SUCCESS)
        return exr_stream_refuse(&stream, code, err);
    enum status status = exr_read_header(&r, image, info, err);
    if (status == STATUS_OK && !probe)
        status = read_pixels(&r, image, err);
    if (status == STATUS_OK && !probe)
        convert(&r, image, info);
    exr_finish(&r.context);
    return status;
}

void image_exr_version(char text[IMAGE_VERSION_SIZE]) {
    int major, minor, patch;
    const char *extra;
    exr_get_library_version(&major, &minor, &patch, &extra);
    snprintf(text, IMAGE_VERSION_SIZE, "%d.%d.%d", major, minor, patch);
}
