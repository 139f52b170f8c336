/* hdr.c -- Radiance RGBE pictures (Ward, "Real Pixels", Graphics Gems II, 1991; the file format
 * is described in Radiance's filefmts.pdf).
 *
 * Scanlines may be flat, run-length encoded the old way (a pixel 1,1,1,n repeats the last one)
 * or the new way (each component on its own). Values are divided by the header's EXPOSURE
 * factors, as the format defines, so that files of one set agree; a mantissa of 0 is 0. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "common/image_ceiling.h"
#include "common/image_codec.h"
#include "common/mem.h"

/* A scanline takes at least 8 bytes, and old-style runs multiply by 255 or more. A header that claims more pixels per
 * byte is refused. */
#define MAX_PIXELS_PER_BYTE 4096

/* The file as a stream of bytes. */
struct hdr_stream {
    struct image_source *source;
    uint64_t offset; /* of the byte after the buffer */
    size_t at, end;
    uint8_t buffer[32768];
};

struct header {
    float scale;        /* of values */
    bool is_other;      /* the primaries are not Rec. 709's: */
    float matrix[3][3]; /* to these */
};

/* The next byte, or -1 at the end. */
static int next_byte(struct hdr_stream *s) {
    if (s->at == s->end) {
        s->at = 0;
        s->end = image_source_read(s->source, s->offset, s->buffer, sizeof s->buffer);
        s->offset += s->end;
        if (s->end == 0)
            return -1;
    }
    return s->buffer[s->at++];
}

static bool next_bytes(struct hdr_stream *s, uint8_t *out, size_t count) {
    for (size_t i = 0; i < count; i++) {
        int byte = next_byte(s);
        if (byte < 0)
            return false;
        out[i] = (uint8_t)byte;
    }
    return true;
}

/* One line without its end; false when the file ends first or the line does not fit. */
static bool next_line(struct hdr_stream *s, char *line, size_t size) {
    for (size_t length = 0; length < size; length++) {
        int byte = next_byte(s);
        if (byte < 0)
            return false;
        line[length] = (char)byte;
        if (byte == '\n') {
            line[length] = '\0';
            return true;
        }
    }
    return false;
}

/* Files without PRIMARIES= are taken for Rec. 709, although filefmts.pdf has other defaults, which no program uses. */
static void read_primaries(const char *text, struct header *h, struct image_info *info) {
    struct color_primaries p;
    bool is_same = true;
    if (sscanf(text, "%lf %lf %lf %lf %lf %lf %lf %lf", &p.red[0], &p.red[1], &p.green[0], &p.green[1], &p.blue[0],
               &p.blue[1], &p.white[0], &p.white[1]) == 8 &&
        color_matrix(&p, h->matrix, &is_same)) {
        h->is_other = !is_same;
        return;
    }
    snprintf(info->color_warning, sizeof info->color_warning, "its PRIMARIES cannot be");
}

static enum status read_header(struct hdr_stream *s, struct image *image, struct header *h, struct image_info *info,
                               struct error *err) {
    const char *name = s->source->name;
    char line[512];
    double exposure = 1;
    bool ok = next_line(s, line, sizeof line); /* #?RADIANCE, #?RGBE or a program's name */
    while (ok) {
        ok = next_line(s, line, sizeof line);
        if (!ok || line[0] == '\0' || strcmp(line, "\r") == 0)
            break;
        if (strncmp(line, "FORMAT=", 7) == 0 && strncmp(line + 7, "32-bit_rle_rgbe", 15) != 0)
            return error_set(err, STATUS_INPUT,
                             "%s: Radiance format %.40s is not supported; expected "
                             "32-bit_rle_rgbe",
                             name, line + 7);
        if (strncmp(line, "EXPOSURE=", 9) == 0)
            exposure *= strtod(line + 9, NULL);
        if (strncmp(line, "PRIMARIES=", 10) == 0)
            read_primaries(line + 10, h, info);
    }
    ok = ok && next_line(s, line, sizeof line);
    if (!ok)
        return error_set(err, STATUS_INPUT, "%s: the Radiance header has no end", name);
    if (!(exposure > 1e-30 && exposure < 1e30))
        return error_set(err, STATUS_INPUT,
                         "%s: the Radiance header's EXPOSURE is not a positive "
                         "number",
                         name);
    h->scale = (float)(1 / exposure);
    unsigned long width = 0, height = 0;
    char rest = '\0';
    int found = sscanf(line, "-Y %9lu +X %9lu%c", &height, &width, &rest);
    if (found < 2 || (found == 3 && rest != '\r'))
        return error_set(err, STATUS_INPUT, "%s: expected the resolution as '-Y height +X width', found '%.60s'", name,
                         line);
    enum status status = image_header(image, name, width, height, 3, image_rgba, err);
    if (status == STATUS_OK && width * height / MAX_PIXELS_PER_BYTE > s->source->size)
        status = error_set(err, STATUS_INPUT,
                           "%s: the file's %llu bytes cannot hold %lu x %lu "
                           "pixels",
                           name, (unsigned long long)s->source->size, width, height);
    return status;
}

/* Each of the four components is a row of runs (128 + count, value) and copies (count, ...). */
static bool read_new_rle(struct hdr_stream *s, uint8_t *row, size_t width) {
    for (int c = 0; c < 4; c++) {
        for (size_t x = 0; x < width;) {
            int code = next_byte(s);
            size_t count = (size_t)(code > 128 ? code - 128 : code);
            if (code <= 0 || count > width - x)
                return false;
            int value = code > 128 ? next_byte(s) : 0;
            for (; count > 0 && value >= 0; count--, x++) {
                if (code <= 128)
                    value = next_byte(s);
                row[4 * x + (size_t)c] = (uint8_t)value;
            }
            if (value < 0)
                return false;
        }
    }
    return true;
}

/* Flat pixels and old-style runs; `pixel` is the first one, read already. */
static bool read_old_rle(struct hdr_stream *s, uint8_t pixel[4], uint8_t *row, size_t width) {
    int shift = 0;
    for (size_t x = 0;;) {
        if (pixel[0] == 1 && pixel[1] == 1 && pixel[2] == 1) {
            size_t count = (size_t)pixel[3] << shift;
            if (x == 0 || shift > 16 || count > width - x)
                return false;
            for (; count > 0; count--, x++)
                memcpy(row + 4 * x, row + 4 * (x - 1), 4);
            shift += 8;
        } else {
            memcpy(row + 4 * x++, pixel, 4);
            shift = 0;
        }
        if (x == width)
            return true;
        if (!next_bytes(s, pixel, 4))
            return false;
    }
}

static bool read_row(struct hdr_stream *s, uint8_t *row, size_t width) {
    uint8_t pixel[4];
    if (!next_bytes(s, pixel, 4))
        return false;
    if (width < 8 || width > 32767 || pixel[0] != 2 || pixel[1] != 2 || pixel[2] >= 128)
        return read_old_rle(s, pixel, row, width);
    return ((size_t)pixel[2] << 8 | pixel[3]) == width && read_new_rle(s, row, width);
}

enum status image_read_hdr(struct image_source *source, bool probe, struct image *image, struct image_info *info,
                           struct error *err) {
    struct hdr_stream s = {.source = source};
    struct header header = {.scale = 1};
    enum status status = read_header(&s, image, &header, info, err);
    if (status != STATUS_OK)
        return status;
    info->encoding = IMAGE_LINEAR;
    info->bits = 8;
    if (probe)
        return STATUS_OK;
    float factor[256]; /* of a mantissa, by exponent; exponent 0 means black */
    factor[0] = 0;
    for (int e = 1; e < 256; e++)
        factor[e] = ldexpf(header.scale, e - 136);
    image_allocate(image);
    size_t width = image->width;
    uint8_t *row = mem_array(width, 4);
    float *pixel = image->pixel;
    for (uint32_t y = 0; y < image->height && status == STATUS_OK; y++) {
        if (!read_row(&s, row, width))
            status = error_set(err, STATUS_INPUT,
                               "%s: row %u of the Radiance picture is damaged or "
                               "cut short",
                               source->name, y);
        else
            for (size_t x = 0; x < width; x++, pixel += 3)
                for (size_t c = 0; c < 3; c++)
                    pixel[c] = (float)row[4 * x + c] * factor[row[4 * x + 3]];
    }
    mem_free(row);
    if (status == STATUS_OK && header.is_other) {
        snprintf(info->color_space, sizeof info->color_space, "primaries of its own, linear light");
        color_multiply(header.matrix, image_ceiling(info), image->pixel, 3, width * image->height,
                       &info->outside_count);
    }
    return status;
}
