/* photo_fit.h -- how pictures relate to the sizes for which their cameras are stated.
 *
 * Tools write intrinsics for the picture that they worked on, which is not always the file in the bundle: turned
 * upright by its EXIF orientation, or of full size where the bundle has halves or quarters. Pictures are turned, and
 * intrinsics scaled, where the stated sizes say so; each is reported. */
#ifndef UNBAKE_INGEST_PHOTO_FIT_H
#define UNBAKE_INGEST_PHOTO_FIT_H

#include "common/image.h"
#include "common/parallel.h"
#include "server/ingest/findings.h"
#include "server/ingest/frames.h"

/* Of one frame. */
struct photo_fit {
    enum status status;                   /* whether the file's header could be read */
    struct error err;                     /* why not */
    uint32_t width, height;               /* as stored */
    uint32_t window_width, window_height; /* image_info.stored_width, stored_height */
    int orientation;                      /* EXIF */
    int turn;                             /* orientation that is applied to the pixels; 1: none */
    double scale;                         /* of the intrinsics; 1: none */
    struct lens lens;                     /* of the turned picture */
};

/* Reads the headers of the pictures at path[] (below dir; NULL: absent) and decides; fit[frame_count]. `name` is that
 * of the file of cameras. Warns of what is turned or scaled. */
void photo_fit_all(const char *dir, const char *name, char *const *path, const struct frames *t, struct parallel *pool,
                   struct photo_fit *fit, struct findings *f);

/* The camera of the frame's picture, once turned; as frame_camera. */
enum status photo_fit_camera(const struct photo_fit *fit, const struct frame *frame, const double offset[3],
                             struct camera *camera, struct error *err);

/* Turns the pixels; those that an EXR's data window leaves out become NaN, which is no observation. */
void photo_fit_apply(const struct photo_fit *fit, const struct image_info *info, struct image *image);

#endif
