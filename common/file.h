/* file.h -- whole files and safe replacement of files. */
#ifndef UNBAKE_COMMON_FILE_H
#define UNBAKE_COMMON_FILE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "common/buf.h"
#include "common/error.h"

/* Appends the whole file to *out; STATUS_LIMIT when it does not fit out's limit. */
enum status file_read(const char *path, struct buf *out, struct error *err);

/* Replaces `path` atomically with `length` bytes: temporary file, fsync, rename, fsync of the folder. */
enum status file_replace(const char *path, const void *data, size_t length, struct error *err);

/* Gives a complete file its final name after syncing its content; removes it on failure. Both names are in one
 * folder. */
enum status file_put_in_place(const char *temporary, const char *path, struct error *err);

/* Renames within a folder; STATUS_CONFLICT when the new name exists. Not yet durable. */
enum status file_rename_new(const char *from, const char *to, struct error *err);

/* Writes all of `data` to fd, through short writes and EINTR. `path` is for the message. */
enum status file_write_all(int fd, const void *data, size_t length, const char *path, struct error *err);

/* fsync of the folder that holds `path`, so that a rename in it is durable. */
enum status file_sync_parent(const char *path, struct error *err);

/* Creates the folder and its parents (0750) durably; an existing folder is no error. */
enum status file_make_dirs(const char *path, struct error *err);

/* The names in a folder, sorted, without "." and ".."; the caller's (file_free_names). Where the disk gives
 * only some of them that is an error, and there are none. */
enum status file_list(const char *dir, char ***names, size_t *count, struct error *err);
void file_free_names(char **names, size_t count);
/* The numbers that are in the names of a folder, ascending; number_of gives that of a name, 0 where it has none.
 * *numbers is the caller's (mem_free), also on error. */
enum status file_list_numbered(const char *dir, int (*number_of)(const char *name), int **numbers, size_t *count,
                               struct error *err);

/* Whether a path stays below the folder that it is joined to: its parts are none of "", "." and "..". */
bool file_path_is_plain(const char *path);

/* Removes a file or a whole tree, never following a symbolic link; absent is no error. */
enum status file_remove_tree(const char *path, struct error *err);

/* Adds up the plain files below `path` and their disk usage; missing or vanishing files count as nothing. */
enum status file_tree_size(const char *path, uint64_t *files, uint64_t *bytes, struct error *err);

/* Bytes free to an unprivileged process on the file system of `path`. */
enum status file_free_bytes(const char *path, uint64_t *bytes, struct error *err);

/* Whether the folder has an entry of that name. True when that is unknown: whoever opens it gets the error. */
bool file_is_in(const char *dir, const char *name);

/* "a" + "b" -> "a/b"; the caller's (mem_free). */
char *file_join(const char *dir, const char *name);

#endif
