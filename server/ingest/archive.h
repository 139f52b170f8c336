/* archive.h -- unpacking an uploaded archive into a folder. archive.c is the only include of
 * libarchive in the server. */
#ifndef UNBAKE_INGEST_ARCHIVE_H
#define UNBAKE_INGEST_ARCHIVE_H

#include <stdint.h>

#include "common/error.h"

struct archive_limits {
    uint64_t file_count;  /* entries, folders included */
    uint64_t total_bytes; /* unpacked */
    double ratio;         /* unpacked / packed, looked at beyond ARCHIVE_RATIO_FREE_BYTES */
};

/* Small archives may well be mostly zeros; only a large result is worth calling a bomb. */
#define ARCHIVE_RATIO_FREE_BYTES ((uint64_t)256 << 20)

/* Unpacks `path` (zip; tar as such, gzip or zstd) into the new folder `dir`; `name` is the
 * archive's name in messages. Nothing is written outside `dir`, only regular files and folders
 * come out, with our own modes and times; litter (path_is_litter) is left out. On failure
 * nothing of `dir` is left.
 * STATUS_INPUT: no archive of these kinds, damaged, encrypted, unsafe or duplicate names, links
 * or devices; STATUS_LIMIT: a limit; STATUS_NO_SPACE: the disk is full. */
enum status archive_unpack(const char *path, const char *name, const char *dir,
                           const struct archive_limits *limits, struct error *err);

#endif
