/* archive.h -- unpacking an uploaded archive into a folder. archive.c is the only include of
 * libarchive in the server. */
#ifndef UNBAKE_INGEST_ARCHIVE_H
#define UNBAKE_INGEST_ARCHIVE_H

#include <stdint.h>

#include "common/error.h"

struct archive_limits {
    uint64_t file_count;  /* entries, folders included */
    uint64_t total_bytes; /* unpacked */
    double ratio;         /* unpacked / packed, checked beyond ARCHIVE_RATIO_FREE_BYTES */
};

/* Below this size the compression ratio is not checked: small archives may be mostly zeros. */
#define ARCHIVE_RATIO_FREE_BYTES ((uint64_t)256 << 20)

/* Unpacks `path` (zip, or tar: plain, gzip or zstd) into the new folder `dir`; `name` is the archive's name in
 * messages. Writes nothing outside `dir`, only regular files and folders, with our modes and times; skips files of
 * operating systems (path_is_litter). On failure `dir` is removed. STATUS_INPUT: not such an archive, damaged,
 * encrypted, unsafe or duplicate names, links or devices; STATUS_LIMIT: a limit; STATUS_NO_SPACE: the disk is full. */
enum status archive_unpack(const char *path, const char *name, const char *dir, const struct archive_limits *limits,
                           struct error *err);

#endif
