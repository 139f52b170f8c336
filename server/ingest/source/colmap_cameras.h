/* colmap_cameras.h -- lenses of a COLMAP reconstruction, from cameras.bin or cameras.txt.
 *
 * Camera models: SIMPLE_PINHOLE, PINHOLE, SIMPLE_RADIAL, RADIAL, OPENCV, FULL_OPENCV, OPENCV_FISHEYE,
 * SIMPLE_RADIAL_FISHEYE, RADIAL_FISHEYE, THIN_PRISM_FISHEYE, FOV. Counts in a file are checked against its size. */
#ifndef UNBAKE_INGEST_SOURCE_COLMAP_CAMERAS_H
#define UNBAKE_INGEST_SOURCE_COLMAP_CAMERAS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "common/error.h"
#include "server/ingest/frames.h"

struct colmap_cameras; /* opaque */

/* From data[size]; `name` is for messages. NULL on error, which is STATUS_INPUT. */
struct colmap_cameras *colmap_cameras_parse(const void *data, size_t size, const char *name, bool binary,
                                            struct error *err);
void colmap_cameras_free(struct colmap_cameras *c); /* NULL is fine */

/* Lens of the camera with that id; borrowed; NULL when there is none. */
const struct lens *colmap_cameras_find(const struct colmap_cameras *c, uint32_t id);

#endif
