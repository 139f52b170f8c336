/* copy.h -- copies of files that others may remove, or replace by rename, meanwhile: the parts of a backup.
 *
 * Paths are relative to an open folder and taken part by part without following a link: what a worker has left in
 * its folder must not lead root elsewhere. */
#ifndef UNBAKE_ADMIN_COPY_H
#define UNBAKE_ADMIN_COPY_H

#include <stdbool.h>
#include <stdint.h>
#include <sys/types.h>

#include "common/error.h"

struct copy {
    int from, to;  /* open folders */
    bool may_link; /* files are never changed in place, so hard links are allowed */
    uid_t owner;   /* of new files; (uid_t)-1: the process's */
    gid_t group;
    uint64_t file_count, byte_count, shared_count; /* shared: by reflink or hard link */
};

/* Whether the path is plain: parts that are names (utf8_is_name), none of them "", "." or "..". */
bool copy_path_is_plain(const char *path);

/* Copies the regular file `path`, with mode and time, unless a copy of the same size and time exists; creates
 * folders on the way. Shares the blocks (FICLONE) if possible, else makes a hard link if allowed, else copies the
 * bytes. *exists: there was a source. */
enum status copy_file(struct copy *c, const char *path, bool *exists, struct error *err);
/* Copies all regular files below the folder `path`; skips files that disappear meanwhile and names that are not
 * valid. */
enum status copy_tree(struct copy *c, const char *path, struct error *err);

#endif
