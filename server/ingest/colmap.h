/* colmap.h -- reads cameras and poses from a COLMAP reconstruction (colmap.github.io/format.html), .bin or .txt, into
 * struct transforms.
 *
 * COLMAP's poses are world-to-camera, with our axes. Its unit of length is arbitrary and must be that of the mesh,
 * which comes from the same reconstruction. Photographs are sorted by name; names are relative to images/ if that
 * folder exists. */
#ifndef UNBAKE_INGEST_COLMAP_H
#define UNBAKE_INGEST_COLMAP_H

#include "common/error.h"
#include "server/ingest/colmap_cameras.h"
#include "server/ingest/findings.h"
#include "server/ingest/transforms.h"

/* Path, below `root`, of the reconstruction's images file: searched at the top, in sparse/0, sparse, colmap/sparse/0
 * and dense/sparse; .bin before .txt, as in COLMAP. The caller's (mem_free); NULL when there is none. */
char *colmap_find(const char *root);

/* Reads it and the cameras file beside it. Faults become problems in *f; other statuses than STATUS_OK are failures
 * of the machine. *t is the caller's (transforms_release) in any case. */
enum status colmap_read(const char *root, const char *images, struct transforms *t, struct findings *f,
                        struct error *err);

/* Parses an images file in memory. `prefix` is prepended to the photographs' names. */
enum status colmap_images_parse(const void *data, size_t size, const char *name, bool binary,
                                const struct colmap_cameras *cameras, const char *prefix, struct transforms *t,
                                struct findings *f, struct error *err);

#endif
