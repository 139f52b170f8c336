/* photo_fit.c -- see photo_fit.h. */
#include "server/ingest/photo_fit.h"

#include <math.h>
#include <string.h>

#include "common/file.h"
#include "common/mem.h"

/* Sizes are of one aspect when they differ by rounding to whole pixels, or by less than this: ScanNet's pictures of
 * 1296 x 968 are handed on as 640 x 480, which is 0.4 %. */
#define ASPECT_TOLERANCE 0.005
/* A principal point is within this share of the centre: where no size is stated, it tells the size. Phones and cameras
 * are within 0.03. */
#define CENTRE_TOLERANCE 0.06
/* Pictures are made smaller by whole factors up to this. */
#define MAX_FACTOR 8

/* --- sizes ------------------------------------------------------------------------------------ */

static bool is_size(const struct lens *lens, uint32_t width, uint32_t height) {
    return lens->width == width && lens->height == height;
}

/* Whether the picture is the stated one, made smaller or larger. One side alone that differs is a crop. */
static bool is_scaled(const struct lens *lens, uint32_t width, uint32_t height) {
    double w = width, h = height, off = fabs(h * lens->width - w * lens->height);
    if (isnan(off) || lens->width == w || lens->height == h)
        return false;
    return off <= fmax(lens->width, lens->height) || off <= ASPECT_TOLERANCE * h * lens->width;
}

static void scale_lens(struct lens *lens, double x, double y) {
    lens->width *= x;
    lens->height *= y;
    lens->fl_x *= x;
    lens->cx *= x;
    lens->fl_y *= y;
    lens->cy *= y;
    lens->crop_radius *= x;
}

/* Whether the principal point is at the centre of such a picture. */
static bool is_centred(const struct lens *lens, double factor, uint32_t width, uint32_t height) {
    return fabs(2.0 * lens->cx / (factor * width) - 1.0) < CENTRE_TOLERANCE &&
           fabs(2.0 * lens->cy / (factor * height) - 1.0) < CENTRE_TOLERANCE;
}

static bool has_no_size(const struct lens *lens) { return isnan(lens->width) && isnan(lens->height); }

/* The picture of the fit's size after `turn`, if the stated size is that or a multiple of it or, where none is stated,
 * if only that has the principal point at its centre. */
static bool try_turn(struct photo_fit *fit, const struct lens *stated, int turn) {
    bool swaps = image_orientation_swaps(turn);
    uint32_t width = swaps ? fit->height : fit->width, height = swaps ? fit->width : fit->height;
    bool is_told = has_no_size(stated)
                       ? is_centred(stated, 1.0, width, height) && !is_centred(stated, 1.0, height, width)
                       : is_size(stated, width, height) || is_scaled(stated, width, height);
    if (!is_told)
        return false;
    fit->turn = turn;
    fit->lens = *stated;
    if (!has_no_size(stated) && !is_size(stated, width, height)) {
        fit->scale = width / stated->width;
        scale_lens(&fit->lens, fit->scale, height / stated->height);
    }
    fit->lens.width = width;
    fit->lens.height = height;
    return true;
}

/* --- the whole bundle ------------------------------------------------------------------------- */

struct probing {
    const char *dir;
    char *const *path;
    const struct frames *t;
    struct photo_fit *fit;
};

static void probe_body(void *user, size_t index, int thread) {
    const struct probing *p = user;
    struct photo_fit *fit = &p->fit[index];
    struct image image;
    struct image_info info;
    (void)thread;
    *fit = (struct photo_fit){.status = STATUS_NOT_FOUND, .turn = 1, .scale = 1.0, .lens = p->t->frame[index].lens};
    if (!p->path[index])
        return;
    char *path = file_join(p->dir, p->path[index]);
    fit->status = image_probe_photograph(path, &image, &info, &fit->err);
    if (fit->status == STATUS_OK) {
        fit->width = image.width;
        fit->height = image.height;
        fit->window_width = info.stored_width;
        fit->window_height = info.stored_height;
        fit->orientation = info.orientation;
        image_release(&image);
        if (!try_turn(fit, &p->t->frame[index].lens, 1) && info.orientation > 1)
            try_turn(fit, &p->t->frame[index].lens, info.orientation);
    }
    mem_free(path);
}

/* Sizes show of landscape and portrait whether EXIF was applied, but not of pictures that are upside down or mirrored:
 * those are turned where all others are that EXIF turns by a quarter. */
static void turn_alike(const struct frames *t, struct photo_fit *fit, struct findings *f) {
    size_t turned = 0, kept = 0;
    for (size_t i = 0; i < t->frame_count; i++) {
        turned += fit[i].turn > 1;
        kept += fit[i].turn == 1 && image_orientation_swaps(fit[i].orientation) && fit[i].width != fit[i].height;
    }
    for (size_t i = 0; i < t->frame_count && turned > 0 && kept == 0; i++)
        if (fit[i].status == STATUS_OK && fit[i].turn == 1 && fit[i].orientation > 1 &&
            try_turn(&fit[i], &t->frame[i].lens, fit[i].orientation))
            turned++;
    if (turned > 0)
        findings_warning(f,
                         "%zu photographs were turned by their EXIF orientation: the size or principal point that is "
                         "stated for them is that of the upright picture",
                         turned);
}

/* n or 1 / n, by which the principal point's picture is larger than the frame's; 0: neither. */
static double factor_of(const struct photo_fit *fit) {
    for (int n = 2; n <= MAX_FACTOR; n++)
        for (int k = 0; k < 2; k++) {
            double factor = k == 0 ? n : 1.0 / n;
            if (is_centred(&fit->lens, factor, fit->width, fit->height))
                return factor;
        }
    return 0.0;
}

/* Without any w and h, principal points at the corner of all pictures are those of pictures twice as large. */
static void scale_by_centres(const char *name, const struct frames *t, struct photo_fit *fit, struct findings *f) {
    double factor = 0.0;
    size_t count = 0, first = 0;
    for (size_t i = 0; i < t->frame_count; i++) {
        if (fit[i].status != STATUS_OK)
            continue;
        const struct lens *lens = &fit[i].lens;
        double own = has_no_size(lens) ? factor_of(&fit[i]) : 0.0;
        if (own == 0.0 || (count > 0 && own != factor))
            return;
        first = count == 0 ? i : first;
        factor = own;
        count++;
    }
    if (count == 0)
        return;
    findings_warning(f,
                     "%s: it says no w and h, and its principal point %.6g, %.6g is that of pictures of %.4g times the "
                     "size of these, which are %u x %u: focal lengths and principal points were multiplied by %.4g",
                     name, fit[first].lens.cx, fit[first].lens.cy, factor, fit[first].width, fit[first].height,
                     1.0 / factor);
    for (size_t i = 0; i < t->frame_count; i++)
        if (fit[i].status == STATUS_OK) {
            scale_lens(&fit[i].lens, 1.0 / factor, 1.0 / factor);
            fit[i].scale = 1.0 / factor;
        }
}

static void tell_scaled(const char *name, const struct frames *t, const struct photo_fit *fit, struct findings *f) {
    size_t count = 0, first = 0;
    for (size_t i = 0; i < t->frame_count; i++) {
        const struct lens *stated = &t->frame[i].lens;
        if (fit[i].status != STATUS_OK || isnan(stated->width) ||
            (fit[i].lens.width == stated->width && fit[i].lens.height == stated->height))
            continue;
        first = count == 0 ? i : first;
        count++;
    }
    if (count > 0)
        findings_warning(
            f,
            "%s: %zu pictures are smaller or larger than it says (%s: %.0f x %.0f instead of %.0f x %.0f): "
            "their focal lengths and principal points were multiplied by %.4g",
            name, count, t->frame[first].file, fit[first].lens.width, fit[first].lens.height,
            t->frame[first].lens.width, t->frame[first].lens.height, fit[first].scale);
}

void photo_fit_all(const char *dir, const char *name, char *const *path, const struct frames *t, struct parallel *pool,
                   struct photo_fit *fit, struct findings *f) {
    struct probing p = {dir, path, t, fit};
    parallel_for(pool, t->frame_count, probe_body, &p);
    turn_alike(t, fit, f);
    tell_scaled(name, t, fit, f);
    scale_by_centres(name, t, fit, f);
}

/* --- one frame -------------------------------------------------------------------------------- */

enum status photo_fit_camera(const struct photo_fit *fit, const struct frame *frame, const double offset[3],
                             struct camera *camera, struct error *err) {
    struct frame fitted = *frame; /* what it points to is borrowed */
    bool swaps = image_orientation_swaps(fit->turn);
    fitted.lens = fit->lens;
    const struct lens *stated = &frame->lens;
    if (fit->window_width > 0 && !is_size(stated, fit->width, fit->height) &&
        is_size(stated, fit->window_width, fit->window_height)) {
        error_set(err, STATUS_INPUT,
                  "frames[%zu] says %.0f x %.0f, the size of the EXR's data window; its picture is %u x %u",
                  frame->number, stated->width, stated->height, fit->width, fit->height);
        return error_hint(err, "save the pictures without overscan");
    }
    if (fit->turn == 1 && fit->width != fit->height && is_size(stated, fit->height, fit->width)) {
        error_set(err, STATUS_INPUT,
                  "w and h are exchanged: frames[%zu] says w %.0f and h %.0f, the picture is %u x %u and has no EXIF "
                  "orientation that turns it",
                  frame->number, stated->width, stated->height, fit->width, fit->height);
        return error_hint(err,
                          "exchange w and h, if the poses belong to the pictures as they are; else turn the pictures");
    }
    return frame_camera(&fitted, swaps ? fit->height : fit->width, swaps ? fit->width : fit->height, offset, camera,
                        err);
}

void photo_fit_apply(const struct photo_fit *fit, const struct image_info *info, struct image *image) {
    const struct image_window *in = &info->window;
    bool is_whole = in->width == 0 || (in->width == image->width && in->height == image->height);
    for (uint32_t y = 0; y < image->height && !is_whole; y++)
        for (uint32_t x = 0; x < image->width; x++)
            if (x < in->x || x - in->x >= in->width || y < in->y || y - in->y >= in->height)
                image->pixel[((size_t)y * image->width + x) * image->channel_count] = NAN;
    image_orient(image, fit->turn);
}
