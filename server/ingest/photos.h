/* photos.h -- loading the photographs that transforms.json names.
 *
 * EXR and Radiance are linear light; PNG and JPEG are taken as sRGB and made linear, or as what their
 * ICC profile or their numbers say (image.h), which is told. The stored
 * pixels are what the poses are for: an EXIF orientation is not applied. */
#ifndef UNBAKE_INGEST_PHOTOS_H
#define UNBAKE_INGEST_PHOTOS_H

#include <stdint.h>

#include "common/error.h"
#include "common/parallel.h"
#include "server/ingest/findings.h"
#include "server/ingest/transforms.h"
#include "server/scene/scene.h"

#define PHOTOS_MIN_COUNT 3 /* with fewer nothing can be told from one view's light */

/* Loads every frame's picture and mask from the folder `dir` into scene->photograph, in the
 * frames' order, the absent ones left out with a warning. Faults of the files become problems
 * in *f; another status than STATUS_OK is a failure of the machine. `name` is that of the
 * transforms file. */
enum status photos_load(const char *dir, const char *name, const struct transforms *t,
                        uint64_t pixel_limit, struct parallel *pool, struct scene *scene,
                        struct findings *f, struct error *err);

#endif
