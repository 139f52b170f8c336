/* photos.h -- loads the photographs named by transforms.json.
 *
 * EXR, Radiance and TIFF of floats are linear; others are sRGB unless an ICC profile or colour chunks say otherwise
 * (image.h), and are made linear; conversions are reported. EXIF orientation is applied where the stated sizes ask for
 * it (photo_fit.h), since otherwise poses refer to the stored pixels. HEIC and AVIF are read as every viewer shows
 * them: their rotation is part of the picture. */
#ifndef UNBAKE_INGEST_PHOTOS_H
#define UNBAKE_INGEST_PHOTOS_H

#include <stdint.h>

#include "common/error.h"
#include "common/parallel.h"
#include "common/spill.h"
#include "server/ingest/findings.h"
#include "server/ingest/frames.h"
#include "server/scene/scene.h"

#define PHOTOS_MIN_COUNT 3 /* fewer views do not constrain materials and light */

struct photos_options {
    uint64_t pixel_limit;  /* of one photograph */
    uint64_t decode_bytes; /* memory of pictures that are being decoded at the same time; 0: no limit. One is always */
    struct spill *spill;   /* for the pixels; NULL: memory; borrowed */
    uint64_t later_bytes;  /* that the caller will take of it for each pixel, beside what is loaded */
    double kept_pixels; /* of one photograph; larger ones are reduced to a whole fraction of their sides; 0: none is */
};

/* Loads the picture and mask of every frame from folder `dir` into scene->photograph, in the frames' order; missing
 * pictures are left out with a warning, and so are some that are broken. Faults of the files become problems in *f;
 * other statuses than STATUS_OK are failures of the machine. `name` is that of the transforms file. */
enum status photos_load(const char *dir, const char *name, const struct frames *t, const struct photos_options *options,
                        struct parallel *pool, struct scene *scene, struct findings *f, struct error *err);

#endif
