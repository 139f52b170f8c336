/* source.h -- a kind of capture as a tool writes it to the disk: how it is recognised, and how its cameras are read.
 *
 * Each kind is one file of this folder and one line of the table in sources.c. A source looks for its files below a
 * base (listing.h); sources.c offers each folder of the bundle. Paths that it returns are relative to the bundle's
 * root. */
#ifndef UNBAKE_INGEST_SOURCE_SOURCE_H
#define UNBAKE_INGEST_SOURCE_SOURCE_H

#include "common/error.h"
#include "server/ingest/findings.h"
#include "server/ingest/frames.h"
#include "server/ingest/listing.h"

/* What a source works on. */
struct source_place {
    const struct listing *listing;
    const char *base;  /* folder where its layout begins, "" or "a/b/" */
    const char *found; /* what recognise returned */
};

struct source {
    const char *name; /* for the user: "COLMAP" */
    /* Path of the file, or folder of files, that holds the poses, the caller's (mem_free); NULL: not of this kind.
     * Goes by names only. */
    char *(*recognise)(const struct listing *l, const char *base);
    /* Reads cameras and poses. Frames name photographs by path from the root, as the file names them: photo_folder.h
     * finds the files. Faults become problems in *f; other statuses than STATUS_OK are failures of the machine. *t is
     * the caller's (frames_release) in any case. */
    enum status (*read)(const struct source_place *place, struct frames *t, struct findings *f, struct error *err);
};

#endif
