/* jpeg.c -- reads JPEG pictures by libjpeg-turbo (its libjpeg.txt), with EXIF from the first APP1.
 *
 * The library fills damaged parts with grey and counts a warning. That grey would be taken for light, so corrupt or
 * truncated data is an error here. Errors arrive by longjmp; what must survive one is in struct jpeg_reader. */
#include <setjmp.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <jpeglib.h>

#include <jerror.h>

#include "common/color_icc.h"
#include "common/image_codec.h"
#include "common/mem.h"

/* A block of 64 pixels takes at least one bit. */
#define MAX_PIXELS_PER_BYTE 512
/* A progressive file may ask for any number of passes over the whole picture. */
#define MAX_SCANS 500

struct jpeg_reader {
    struct jpeg_decompress_struct jpeg; /* each finds its reader through client_data */
    struct jpeg_error_mgr error;
    struct jpeg_source_mgr input;
    struct jpeg_progress_mgr progress;
    jmp_buf jump;
    struct image_source *source;
    uint64_t offset;
    struct image *image;
    struct image_info *info;
    struct error *err;
    enum status status;
    JSAMPLE *row;
    JOCTET *profile;         /* ICC; libjpeg's (malloc) */
    struct color_inks *inks; /* NULL unless the picture is CMYK */
    float *ink_row;
    bool is_profile_damaged;
    struct color color;
    JOCTET buffer[16384];
};

static void stop(struct jpeg_reader *r, enum status status) {
    r->status = status;
    longjmp(r->jump, 1);
}

static void damaged(j_common_ptr common) {
    struct jpeg_reader *r = common->client_data;
    char message[JMSG_LENGTH_MAX];
    int which = common->err->msg_parm.i[0];
    /* Allocation failure; codes 1 and 3 are pictures that ask for too much (jmemmgr.c). */
    if (common->err->msg_code == JERR_OUT_OF_MEMORY && which != 1 && which != 3)
        mem_exhausted("libjpeg");
    common->err->format_message(common, message);
    stop(r, error_set(r->err, STATUS_INPUT, "%s: damaged JPEG: %s", r->source->name, message));
}

static void on_message(j_common_ptr common, int level) {
    struct jpeg_reader *r = common->client_data;
    if (level >= 0)
        return; /* a trace */
    switch (common->err->msg_code) {
    case JWRN_BOGUS_ICC: /* parts of a profile that do not make one */ r->is_profile_damaged = true; return;
    case JWRN_ADOBE_XFORM:     /* an unknown colour transform: the default is right */
    case JWRN_EXTRANEOUS_DATA: /* padding between segments, as some cameras write it */
    case JWRN_JFIF_MAJOR: return;
    default: damaged(common);
    }
}

static void init_source(j_decompress_ptr jpeg) { (void)jpeg; }

static boolean fill_buffer(j_decompress_ptr jpeg) {
    struct jpeg_reader *r = jpeg->client_data;
    size_t got = image_source_read(r->source, r->offset, r->buffer, sizeof r->buffer);
    if (got == 0)
        stop(r, error_set(r->err, STATUS_INPUT, "%s: damaged JPEG: the file is cut short", r->source->name));
    r->offset += got;
    r->input.next_input_byte = r->buffer;
    r->input.bytes_in_buffer = got;
    return TRUE;
}

static void skip_bytes(j_decompress_ptr jpeg, long count) {
    struct jpeg_reader *r = jpeg->client_data;
    if (count <= 0)
        return;
    size_t skip = (size_t)count;
    if (skip <= r->input.bytes_in_buffer) {
        r->input.next_input_byte += skip;
        r->input.bytes_in_buffer -= skip;
    } else {
        r->offset += skip - r->input.bytes_in_buffer;
        r->input.bytes_in_buffer = 0;
    }
}

static void end_source(j_decompress_ptr jpeg) { (void)jpeg; }

static void on_progress(j_common_ptr common) {
    struct jpeg_reader *r = common->client_data;
    if (r->jpeg.input_scan_number > MAX_SCANS)
        stop(r, error_set(r->err, STATUS_INPUT, "%s: damaged JPEG: more than %d scans", r->source->name, MAX_SCANS));
}

static void start(struct jpeg_reader *r) {
    jpeg_create_decompress(&r->jpeg);
    r->input = (struct jpeg_source_mgr){.init_source = init_source,
                                        .fill_input_buffer = fill_buffer,
                                        .skip_input_data = skip_bytes,
                                        .resync_to_restart = jpeg_resync_to_restart,
                                        .term_source = end_source};
    r->jpeg.src = &r->input;
    r->progress.progress_monitor = on_progress;
    r->jpeg.progress = &r->progress;
    jpeg_save_markers(&r->jpeg, JPEG_APP0 + 1, 0xffff);
    jpeg_save_markers(&r->jpeg, JPEG_APP0 + 2, 0xffff);
}

static void read_exif(struct jpeg_reader *r) {
    static const char start_of_exif[6] = "Exif\0";
    for (jpeg_saved_marker_ptr m = r->jpeg.marker_list; m; m = m->next)
        if (m->data_length > sizeof start_of_exif && memcmp(m->data, start_of_exif, sizeof start_of_exif) == 0) {
            image_parse_exif(m->data + sizeof start_of_exif, m->data_length - sizeof start_of_exif, r->info);
            return;
        }
}

static void read_header(struct jpeg_reader *r) {
    const char *name = r->source->name;
    jpeg_read_header(&r->jpeg, TRUE);
    int components = r->jpeg.num_components;
    if (components != 1 && components != 3 && components != 4)
        stop(r, error_set(r->err, STATUS_INPUT,
                          "%s: a JPEG of %d components is not a photograph; expected grey, YCbCr, RGB or CMYK", name,
                          components));
    uint64_t width = r->jpeg.image_width, height = r->jpeg.image_height;
    enum status status = image_header(r->image, name, width, height, 3, image_rgba, r->err);
    if (status != STATUS_OK)
        stop(r, status);
    if (width * height / MAX_PIXELS_PER_BYTE > r->source->size)
        stop(r,
             error_set(r->err, STATUS_INPUT, "%s: damaged JPEG: the file is too short for its picture's size", name));
    r->info->encoding = IMAGE_SRGB;
    r->info->bits = 8;
    read_exif(r);
}

/* Before decompression ends, which drops the segments. */
static void read_color(struct jpeg_reader *r) {
    unsigned length = 0;
    bool has_profile = jpeg_read_icc_profile(&r->jpeg, &r->profile, &length);
    color_init(&r->color);
    if (r->jpeg.num_components == 4)
        r->inks = color_inks_new(r->profile, has_profile ? length : 0, r->color.warning);
    else if (has_profile)
        color_set_profile(&r->color, r->profile, length, r->jpeg.num_components == 1, 8);
    else if (r->is_profile_damaged)
        snprintf(r->color.warning, sizeof r->color.warning, "the segments of its ICC profile do not fit together");
    else
        image_color_by_exif(r->info, &r->color);
}

static void put_row(const struct jpeg_reader *r, size_t width, float *to) {
    for (size_t i = 0; i < 3 * width; i++)
        to[i] = (float)r->row[i] / 255.0f;
}

/* Adobe's programs, which mark their files, write the share of white paper instead of ink. */
static void put_ink_row(const struct jpeg_reader *r, size_t width, float *to) {
    for (size_t i = 0; i < 4 * width; i++) {
        float stored = (float)r->row[i] / 255.0f;
        r->ink_row[i] = r->jpeg.saw_Adobe_marker ? 1.0f - stored : stored;
    }
    color_inks_convert(r->inks, r->ink_row, to, width);
}

static void read_pixels(struct jpeg_reader *r) {
    bool has_inks = r->jpeg.num_components == 4;
    r->jpeg.out_color_space = has_inks ? JCS_CMYK : JCS_RGB; /* grey too */
    jpeg_start_decompress(&r->jpeg);
    struct image *image = r->image;
    size_t width = image->width;
    r->row = mem_array((has_inks ? 4 : 3) * width, sizeof *r->row);
    if (has_inks) {
        r->ink_row = mem_array(4 * width, sizeof *r->ink_row);
        if (!r->inks) /* values as stored: a mask's */
            r->inks = color_inks_new(NULL, 0, r->color.warning);
    }
    image_allocate(image);
    while (r->jpeg.output_scanline < image->height) {
        float *to = image->pixel + r->jpeg.output_scanline * 3 * width;
        if (jpeg_read_scanlines(&r->jpeg, &r->row, 1) != 1)
            continue;
        if (has_inks)
            put_ink_row(r, width, to);
        else
            put_row(r, width, to);
    }
    jpeg_finish_decompress(&r->jpeg);
}

enum status image_read_jpeg(struct image_source *source, bool probe, struct image *image, struct image_info *info,
                            struct error *err) {
    struct jpeg_reader *r = mem_calloc(1, sizeof *r);
    r->source = source;
    r->image = image;
    r->info = info;
    r->err = err;
    r->jpeg.err = jpeg_std_error(&r->error);
    r->error.error_exit = damaged;
    r->error.emit_message = on_message;
    r->jpeg.client_data = r;
    if (setjmp(r->jump) == 0) {
        start(r);
        read_header(r);
        if (!probe && !source->as_stored)
            read_color(r);
        if (!probe)
            read_pixels(r);
        if (!probe && !source->as_stored)
            image_convert(r->image, r->info, &r->color);
    }
    jpeg_destroy_decompress(&r->jpeg);
    mem_free(r->row);
    mem_free(r->ink_row);
    if (r->inks)
        color_inks_free(r->inks);
    free(r->profile);
    color_release(&r->color);
    enum status status = r->status;
    mem_free(r);
    return status;
}

#define TEXT_OF(macro) TEXT(macro)
#define TEXT(words) #words
const char *image_jpeg_version(void) {
#ifdef LIBJPEG_TURBO_VERSION
    return TEXT_OF(LIBJPEG_TURBO_VERSION) " (as built)";
#else
    return TEXT_OF(JPEG_LIB_VERSION) " (as built)";
#endif
}
