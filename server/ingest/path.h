/* path.h -- names of files inside a bundle, as archives and transforms.json give them. */
#ifndef UNBAKE_INGEST_PATH_H
#define UNBAKE_INGEST_PATH_H

#include <stdbool.h>

#include "common/error.h"

#define PATH_MAX_BYTES 1024
#define PATH_MAX_DEPTH 32

/* Brings a name to its plain form, "a/b/c" without "." or empty parts; the caller's (mem_free),
 * NULL on error. It may be "" (the bundle's own folder). Refused with STATUS_INPUT: absolute
 * names ("C:/x" too, but not "a:b"), "..", backslashes, what is no name by utf8_is_name, and
 * names too long or too deep. The message begins with the name, made fit to print. */
enum status path_clean(const char *name, char **clean, struct error *err);

/* Whether the name is litter that operating systems leave in archives: __MACOSX, ._name,
 * .DS_Store, Thumbs.db. `clean` as path_clean gives it. */
bool path_is_litter(const char *clean);

/* The part behind the last '/' and, of that, the part behind the last '.', "" if none. */
const char *path_base(const char *path);
const char *path_extension(const char *path);

#endif
