/* path.h -- names of files inside a bundle, as in archives and transforms.json. */
#ifndef UNBAKE_INGEST_PATH_H
#define UNBAKE_INGEST_PATH_H

#include <stdbool.h>

#include "common/error.h"

#define PATH_MAX_BYTES 1024 /* of a whole name */
#define PATH_FOLDERS_MAX 32 /* folders in each other */

/* Normalises a name to "a/b/c" without "." or empty components; the caller's (mem_free), NULL on error. It may be ""
 * (the bundle's root). STATUS_INPUT for absolute names ("C:/x" too, but not "a:b"), "..", backslashes, names that
 * fail utf8_is_name, and names too long or too deep. The message begins with the name, made printable. */
enum status path_clean(const char *name, char **clean, struct error *err);

/* The same for a name as a tool wrote it on another machine, which stands for a file of the bundle: backslashes are
 * slashes; a drive, a root, "." and leading ".." are dropped, inner ".." resolved. STATUS_INPUT, with the name: nothing
 * is left, or path_clean refuses the rest. */
enum status path_clean_foreign(const char *name, char **clean, struct error *err);

/* Whether the name is a file that operating systems leave in archives: __MACOSX, ._name, .DS_Store, Thumbs.db.
 * `clean` is from path_clean. */
bool path_is_litter(const char *clean);

/* The part after the last '/'; and of that, the part after the last '.', "" if none. */
const char *path_base(const char *path);
const char *path_extension(const char *path);

#endif
