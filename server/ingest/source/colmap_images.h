/* colmap_images.h -- poses of a COLMAP reconstruction, from images.bin or images.txt. */
#ifndef UNBAKE_INGEST_SOURCE_COLMAP_IMAGES_H
#define UNBAKE_INGEST_SOURCE_COLMAP_IMAGES_H

#include "common/error.h"
#include "server/ingest/findings.h"
#include "server/ingest/frames.h"
#include "server/ingest/source/colmap_cameras.h"

/* Parses an images file in memory. `prefix` is prepended to the photographs' names. */
enum status colmap_images_parse(const void *data, size_t size, const char *name, bool binary,
                                const struct colmap_cameras *cameras, const char *prefix, struct frames *t,
                                struct findings *f, struct error *err);

#endif
