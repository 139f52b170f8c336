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
    bool may_link; /* the files are never changed in place: a hard link will do */
    uid_t owner;   /* of what is made; (uid_t)-1: whoever makes it */
    gid_t group;
    uint64_t file_count, byte_count, shared_count; /* shared: by reflink or hard link */
};

/* Whether the path is plain: parts that are names (utf8_is_name), none of them "", "." or "..". */
bool copy_path_is_plain(const char *path);

/* Copies the plain file `path`, with its mode and time, unless a copy of the same size and time is there; makes
 * folders on the way. Shares the blocks (FICLONE) where the file system can, else links where that may be, else copies
 * the bytes. *exists: the file was there. */
enum status copy_file(struct copy *c, const char *path, bool *exists, struct error *err);
/* All plain files below the folder `path`; what goes meanwhile, or is no name, is left out. */
enum status copy_tree(struct copy *c, const char *path, struct error *err);

#endif
