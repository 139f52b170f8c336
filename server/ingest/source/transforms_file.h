/* transforms_file.h -- files of the form of transforms.json, for the sources that have them. */
#ifndef UNBAKE_INGEST_SOURCE_TRANSFORMS_FILE_H
#define UNBAKE_INGEST_SOURCE_TRANSFORMS_FILE_H

#include "server/ingest/source/source.h"

/* Reads the file at `path`; results and errors as source->read has them, with paths as the file has them. */
enum status transforms_file_read(const struct source_place *place, const char *path, struct frames *t,
                                 struct findings *f, struct error *err);

#endif
