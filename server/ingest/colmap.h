/* colmap.h -- cameras and poses from a COLMAP reconstruction (colmap.github.io/format.html): cameras
 * and images, as .bin or .txt, into what transforms.json would give.
 *
 * COLMAP's poses are world-to-camera and its axes ours. Its unit of length is arbitrary: it must be
 * that of the mesh, which comes out of the same reconstruction. Photographs are sorted by name; their
 * names are below images/ where there is such a folder. */
#ifndef UNBAKE_INGEST_COLMAP_H
#define UNBAKE_INGEST_COLMAP_H

#include "common/error.h"
#include "server/ingest/colmap_cameras.h"
#include "server/ingest/findings.h"
#include "server/ingest/transforms.h"

/* The name, below the folder `root`, of the reconstruction's file of images: at the top, in sparse/0,
 * sparse, colmap/sparse/0 or dense/sparse; .bin before .txt, as COLMAP itself prefers. The caller's
 * (mem_free); NULL where there is none. */
char *colmap_find(const char *root);

/* Reads it and the file of cameras beside it. Faults become problems in *f; another status than
 * STATUS_OK is a failure of the machine. *t is the caller's (transforms_release) in any case. */
enum status colmap_read(const char *root, const char *images, struct transforms *t, struct findings *f,
                        struct error *err);

/* The file of images from memory. `prefix` goes before the photographs' names. */
enum status colmap_images_parse(const void *data, size_t size, const char *name, bool binary,
                                const struct colmap_cameras *cameras, const char *prefix,
                                struct transforms *t, struct findings *f, struct error *err);

#endif
