/* photos.c -- see photos.h. */
#include "server/ingest/photos.h"

#include <inttypes.h>
#include <math.h>
#include <pthread.h>
#include <stdbool.h>
#include <string.h>

#include "common/file.h"
#include "common/image.h"
#include "common/mem.h"
#include "server/ingest/photo_color.h"
#include "server/ingest/photo_faults.h"
#include "server/ingest/photo_fit.h"
#include "server/ingest/photo_pixels.h"
#include "server/scene/photograph_reduce.h"

/* Memory of a picture that is being decoded, bytes a pixel: 16 of four channels as float, 6 that are kept of it, and
 * the decoder's own coefficients or planes. An estimate; it only bounds how many are decoded at the same time. */
#define DECODE_PIXEL_BYTES 32

/* Result of loading one frame; written by that frame's work item only. */
struct photo_outcome {
    enum status status;
    struct error err;
    bool mask_failed; /* err is about the mask */
    bool is_broken;   /* the picture, or its mask, could not be decoded */
    int orientation;
    enum exposure_source source;
};

/* Memory that decoders use at the same time. */
struct gate {
    pthread_mutex_t mutex;
    pthread_cond_t freed;
    uint64_t used, limit; /* bytes; limit 0: none */
};

#define ALL "the photographs" /* in messages */

struct loading {
    const char *dir;
    const struct frames *transforms;
    const double *offset; /* [3] of the mesh */
    const struct photos_options *options;
    struct gate gate;
    uint64_t pixels;               /* that are kept of all pictures together */
    uint32_t *step;                /* [frame_count] of its pixels, in each direction, one is made */
    char **path;                   /* [frame_count] of the picture, below dir; NULL where absent; of the frames */
    struct photograph *photograph; /* [frame_count] */
    struct photo_outcome *outcome; /* [frame_count] */
    struct photo_color *color;     /* [frame_count] */
    struct photo_fit *fit;         /* [frame_count] */
    struct photo_faults *faults;   /* [frame_count] */
    uint16_t *half_of_srgb;        /* [65536] linear half value of a 16-bit sRGB code value */
    float clip;
};

/* --- one photograph ---------------------------------------------------------------------- */

static void set_exposure(const struct frame *frame, const struct image_info *info, struct photograph *photo,
                         struct photo_outcome *outcome) {
    double exposure = frame->exposure;
    outcome->source = frame->exposure_source;
    if (exposure <= 0.0 && photo->is_hdr) {
        exposure = 1.0;
        outcome->source = EXPOSURE_HDR;
    } else if (exposure <= 0.0) {
        exposure = frame_exposure(info->exposure_time_sec, info->iso, info->f_number);
        outcome->source = exposure > 0.0 ? EXPOSURE_EXIF : EXPOSURE_UNKNOWN;
    }
    float single = (float)exposure;
    photo->exposure_known = single > 0.0f && isfinite(single) && isfinite(1.0f / single);
    photo->exposure = photo->exposure_known ? single : 1.0f;
    double settings = frame->settings_exposure;
    if (settings <= 0.0)
        settings = frame_settings_exposure(info->exposure_time_sec, info->iso, info->f_number);
    photo->settings_exposure = isfinite((float)settings) ? (float)settings : 0.0f;
}

/* Sets the camera, by the size of the picture. */
static enum status check_size(const struct loading *l, size_t index, struct camera *camera,
                              struct photo_outcome *outcome) {
    const struct photo_fit *fit = &l->fit[index];
    uint64_t pixels = (uint64_t)fit->width * fit->height;
    if (fit->status != STATUS_OK) {
        outcome->is_broken = fit->status == STATUS_INPUT;
        outcome->err = fit->err;
        return fit->status;
    }
    if (pixels > l->options->pixel_limit)
        return error_set(&outcome->err, STATUS_LIMIT,
                         "the picture has %" PRIu64 " pixels, more than the limit of %" PRIu64, pixels,
                         l->options->pixel_limit);
    return photo_fit_camera(fit, &l->transforms->frame[index], l->offset, camera, &outcome->err);
}

/* Takes over the clip value and names the colour space. */
static void set_clip(const struct loading *l, const struct image_info *info, struct photograph *photo) {
    photo->is_hdr = info->encoding == IMAGE_LINEAR;
    photo->clip = photo->is_hdr ? INFINITY : info->encoding == IMAGE_CONVERTED ? info->clip : l->clip;
    if (info->color_space[0])
        photo->color_space = mem_strdup(info->color_space);
}

/* The arrays of a decoded picture. Only now is known whether it has others than its pixels. */
static enum status keep_pixels(const struct loading *l, size_t index, const struct image *image,
                               const struct image_info *info, struct photograph *photo, struct error *err) {
    size_t count = (size_t)image->width * image->height;
    double crop_radius = l->fit[index].lens.crop_radius;
    bool is_masked = l->transforms->frame[index].mask || crop_radius > 0.0 || image_channel(image, "A") >= 0;
    size_t others = (size_t)(image->clipped != NULL) + (size_t)is_masked;
    enum status status =
        spill_reserve(photo->spill, ALL, others, others * count, l->options->later_bytes * l->pixels, err);
    if (status != STATUS_OK)
        return status;
    photo->pixel = spill_take(photo->spill, count, sizeof *photo->pixel);
    if (image->clipped) {
        photo->clipped = spill_take(photo->spill, count, sizeof *photo->clipped);
        memcpy(photo->clipped, image->clipped, count);
    }
    if (info->encoding == IMAGE_SRGB)
        photo_pixels_from_srgb(l->half_of_srgb, image, photo);
    else
        photo_pixels_from_linear(image, info, photo, &l->faults[index]);
    if (!photo->is_hdr)
        photo_pixels_mask_by_alpha(image, photo);
    if (crop_radius > 0.0)
        photo_pixels_mask_by_circle(crop_radius, photo);
    return photo_faults_judge(&l->faults[index], err);
}

/* Puts means of its pixels, in the caller's memory, in place of a photograph that is in memory whole. A pixel that some
 * of its pixels saturate is excluded, so that "clipped" is all that there is to say of one. */
static enum status reduce(const struct loading *l, size_t index, struct error *err) {
    struct photograph whole = l->photograph[index], *photo = &l->photograph[index];
    struct camera camera = camera_reduced(&whole.camera, l->step[index]);
    size_t count = (size_t)camera.width * camera.height;
    enum status status = spill_reserve(l->options->spill, ALL, 2, 2 * count, l->options->later_bytes * l->pixels, err);
    if (status != STATUS_OK)
        return status;
    photograph_reduce(&whole, l->step[index], l->options->spill, photo);
    photo->clipped = photo->saturated;
    photo->saturated = NULL;
    photo->name = whole.name;
    photo->color_space = whole.color_space;
    photo->file.step = l->step[index];
    photo->file.width = whole.camera.width;
    photo->file.height = whole.camera.height;
    whole.name = whole.color_space = NULL;
    photograph_release(&whole);
    return STATUS_OK;
}

static enum status load_photograph(const struct loading *l, size_t index) {
    const struct frame *frame = &l->transforms->frame[index];
    struct photograph *photo = &l->photograph[index];
    struct photo_outcome *outcome = &l->outcome[index];
    char *path = file_join(l->dir, l->path[index]);
    struct image image;
    struct image_info info;
    enum status status = image_read_photograph(path, &image, &info, &outcome->err);
    outcome->is_broken = status == STATUS_INPUT;
    mem_free(path);
    if (status != STATUS_OK)
        return status;
    photo->name = mem_strdup(frame->file);
    photo->is_test = frame->is_test;
    photo->gain = rgb_gray(1.0f);
    photo->spill = l->step[index] > 1 ? NULL : l->options->spill;
    photo_fit_apply(&l->fit[index], &info, &image);
    set_clip(l, &info, photo);
    photo_color_note(&l->color[index], frame->file, &image, &info);
    photo_faults_begin(&l->faults[index], frame->file, &image, &info);
    outcome->orientation = l->fit[index].turn > 1 ? 1 : info.orientation;
    set_exposure(frame, &info, photo, outcome);
    /* image_read puts R, G, B first */
    if (image_channel(&image, "B") != 2)
        status = error_set(&outcome->err, STATUS_INPUT, "the picture has no red, green and blue");
    else {
        status = keep_pixels(l, index, &image, &info, photo, &outcome->err);
        outcome->is_broken = status == STATUS_INPUT;
    }
    image_release(&image);
    if (status == STATUS_OK && frame->mask) {
        status =
            photo_pixels_load_mask(l->dir, frame->mask, l->fit[index].turn, photo, &outcome->is_broken, &outcome->err);
        outcome->mask_failed = status != STATUS_OK;
    }
    photo->file.has_mask = photo->mask != NULL;
    return status == STATUS_OK && l->step[index] > 1 ? reduce(l, index, &outcome->err) : status;
}

/* --- on all threads ---------------------------------------------------------------------- */

/* Waits until the decoders have memory for one more, which is the first where nothing else fits. */
static void gate_enter(struct gate *gate, uint64_t bytes) {
    pthread_mutex_lock(&gate->mutex);
    while (gate->limit > 0 && gate->used > 0 && gate->used + bytes > gate->limit)
        pthread_cond_wait(&gate->freed, &gate->mutex);
    gate->used += bytes;
    pthread_mutex_unlock(&gate->mutex);
}

static void gate_leave(struct gate *gate, uint64_t bytes) {
    pthread_mutex_lock(&gate->mutex);
    gate->used -= bytes;
    pthread_cond_broadcast(&gate->freed);
    pthread_mutex_unlock(&gate->mutex);
}

/* Of a picture that is read; else 0. */
static uint64_t pixels_of(const struct loading *l, size_t index) {
    const struct camera *camera = &l->photograph[index].camera;
    bool is_read = l->path[index] && l->outcome[index].status == STATUS_OK;
    return is_read ? (uint64_t)camera->width * camera->height : 0;
}

static void load_body(void *user, size_t index, int thread) {
    struct loading *l = user;
    (void)thread;
    uint64_t bytes = DECODE_PIXEL_BYTES * pixels_of(l, index);
    if (bytes == 0)
        return;
    gate_enter(&l->gate, bytes);
    l->outcome[index].status = load_photograph(l, index);
    gate_leave(&l->gate, bytes);
}

/* Sets the cameras and how far each is reduced, makes room, then reads the pixels. */
static enum status load_all(struct loading *l, struct parallel *pool, struct error *err) {
    size_t count = l->transforms->frame_count;
    for (size_t i = 0; i < count; i++) {
        if (l->path[i])
            l->outcome[i].status = check_size(l, i, &l->photograph[i].camera, &l->outcome[i]);
        if (pixels_of(l, i) == 0)
            continue;
        l->step[i] = camera_step_to(&l->photograph[i].camera, l->options->kept_pixels);
        struct camera camera = camera_reduced(&l->photograph[i].camera, l->step[i]);
        l->pixels += (uint64_t)camera.width * camera.height;
    }
    enum status status = spill_reserve(l->options->spill, ALL, count, PHOTOGRAPH_PIXEL_BYTES * l->pixels,
                                       l->options->later_bytes * l->pixels, err);
    if (status == STATUS_OK)
        parallel_for(pool, count, load_body, l);
    return status;
}

/* --- all of them ------------------------------------------------------------------------- */

/* Removes the bundle's folder from the path that readers put first in their messages. */
static void make_relative(struct error *err, const char *dir) {
    char *prefix = file_join(dir, ""), *at;
    size_t length = strlen(prefix);
    while (length > 1 && (at = strstr(err->message, prefix)) != NULL)
        memmove(at, at + length, strlen(at + length) + 1);
    mem_free(prefix);
}

static void warn_of_metadata(const struct loading *l, struct findings *f) {
    size_t rotated = 0, sources[EXPOSURE_HDR + 1] = {0};
    for (size_t i = 0; i < l->transforms->frame_count; i++) {
        const struct photo_outcome *o = &l->outcome[i];
        if (!l->path[i])
            continue;
        sources[o->source]++;
        rotated += o->orientation > 1;
    }
    if (rotated > 0)
        findings_warning(f,
                         "the EXIF orientation of %zu photographs was ignored: poses are taken to "
                         "be for the pixels as stored",
                         rotated);
    size_t given = sources[EXPOSURE_FACTOR] + sources[EXPOSURE_CAMERA] + sources[EXPOSURE_EXIF] + sources[EXPOSURE_HDR];
    for (int s = EXPOSURE_FACTOR; s <= EXPOSURE_HDR; s++) {
        if (sources[s] > 0 && sources[s] < given) {
            findings_warning(f,
                             "exposures come from different sources (%zu from \"exposure\", %zu "
                             "from \"exposure_time\", %zu from EXIF, %zu HDR taken as 1): they may "
                             "not agree in units",
                             sources[EXPOSURE_FACTOR], sources[EXPOSURE_CAMERA], sources[EXPOSURE_EXIF],
                             sources[EXPOSURE_HDR]);
            break;
        }
    }
}

/* Files that cannot be decoded (cut short, another kind) are left out, as missing ones are, while at least half of the
 * photographs and PHOTOS_MIN_COUNT remain: a few come broken from cards and transfers, and the rest reconstructs the
 * room. Where more are broken something is wrong with all: each is a problem. */
static bool leaves_out_broken(const struct loading *l) {
    size_t broken = 0, usable = 0;
    for (size_t i = 0; i < l->transforms->frame_count; i++) {
        broken += l->outcome[i].is_broken;
        usable += l->path[i] && l->outcome[i].status == STATUS_OK;
    }
    return broken <= usable && usable >= PHOTOS_MIN_COUNT;
}

/* Turns each frame's outcome into problems and warnings, in the frames' order. */
static enum status collect(struct loading *l, const char *name, struct findings *f, struct error *err) {
    enum status status = STATUS_OK;
    bool leaves_out = leaves_out_broken(l);
    for (size_t i = 0; i < l->transforms->frame_count; i++) {
        const struct frame *frame = &l->transforms->frame[i];
        struct photo_outcome *o = &l->outcome[i];
        if (!l->path[i])
            findings_warning(f,
                             "%s: frames[%zu] names %s, which is not in the bundle; it was left "
                             "out",
                             name, frame->number, frame->file);
        if (o->status == STATUS_OK)
            continue;
        make_relative(&o->err, l->dir);
        if (o->is_broken && leaves_out) {
            findings_warning(f, "%s; %s was left out", o->err.message, o->mask_failed ? l->path[i] : "it");
        } else if (o->status == STATUS_INPUT || o->status == STATUS_LIMIT) {
            findings_error(f, o->mask_failed ? frame->mask : l->path[i], &o->err);
        } else if (status == STATUS_OK) {
            status = o->status;
            if (err)
                *err = o->err;
        }
    }
    return status;
}

/* Moves the loaded photographs to the scene, in order. */
static void move_photographs(struct loading *l, struct scene *scene) {
    size_t kept = 0;
    for (size_t i = 0; i < l->transforms->frame_count; i++) {
        if (l->path[i] && l->outcome[i].status == STATUS_OK)
            l->photograph[kept++] = l->photograph[i];
        else
            photograph_release(&l->photograph[i]);
    }
    scene->spill = l->options->spill;
    scene->photograph = l->photograph;
    scene->photograph_count = kept;
}

static void check_count(const struct scene *scene, const char *name, size_t named_count, struct findings *f) {
    size_t train_count = 0;
    for (size_t i = 0; i < scene->photograph_count; i++)
        train_count += !scene->photograph[i].is_test;
    if (scene->photograph_count < PHOTOS_MIN_COUNT)
        findings_problem(f, name, "only %zu of its %zu frames can be used; at least %d are needed",
                         scene->photograph_count, named_count, PHOTOS_MIN_COUNT);
    else if (train_count == 0)
        findings_problem(f, name, "every frame is held out as test: none is left to reconstruct from");
}

enum status photos_load(const char *dir, const char *name, const struct frames *t, const struct photos_options *options,
                        struct parallel *pool, struct scene *scene, struct findings *f, struct error *err) {
    struct loading l = {
        .dir = dir,
        .transforms = t,
        .offset = scene->mesh.offset,
        .options = options,
        .gate = {.limit = options->decode_bytes},
        .path = mem_calloc(t->frame_count, sizeof *l.path),
        .photograph = mem_calloc(t->frame_count, sizeof *l.photograph),
        .outcome = mem_calloc(t->frame_count, sizeof *l.outcome),
        .half_of_srgb = photo_pixels_table(),
    };
    /* through the table, so that a pixel of this code value is not below it after rounding */
    l.clip = image_float_from_half(l.half_of_srgb[(size_t)(IMAGE_CLIP_SHARE * 65535.0f + 0.5f)]);
    for (size_t i = 0; i < t->frame_count; i++)
        l.path[i] = file_is_in(dir, t->frame[i].file) ? t->frame[i].file : NULL;
    l.color = mem_calloc(t->frame_count, sizeof *l.color);
    l.fit = mem_calloc(t->frame_count, sizeof *l.fit);
    l.faults = mem_calloc(t->frame_count, sizeof *l.faults);
    l.step = mem_calloc(t->frame_count, sizeof *l.step);
    photo_fit_all(dir, name, l.path, t, pool, l.fit, f);
    pthread_mutex_init(&l.gate.mutex, NULL);
    pthread_cond_init(&l.gate.freed, NULL);
    enum status status = load_all(&l, pool, err);
    if (status == STATUS_OK)
        status = collect(&l, name, f, err);
    move_photographs(&l, scene);
    check_count(scene, name, t->named_count, f);
    warn_of_metadata(&l, f);
    photo_faults_warn(l.faults, t->frame_count, f);
    photo_color_warn(l.color, t->frame_count, f);
    pthread_cond_destroy(&l.gate.freed);
    pthread_mutex_destroy(&l.gate.mutex);
    mem_free(l.path);
    mem_free(l.color);
    mem_free(l.fit);
    mem_free(l.faults);
    mem_free(l.step);
    mem_free(l.outcome);
    mem_free(l.half_of_srgb);
    return status;
}
