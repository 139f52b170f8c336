/* listing.h -- the plain files of a bundle, listed once: sources and meshes are recognised by their names.
 *
 * Paths are relative to the bundle's root, with "/" between folders, sorted by bytes. A "base" is a folder as "" (the
 * root) or "a/b/". Hidden files, those that operating systems leave (path_is_litter), and links are not listed. A test
 * may make a listing of files in memory. */
#ifndef UNBAKE_INGEST_LISTING_H
#define UNBAKE_INGEST_LISTING_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "common/error.h"
#include "server/ingest/mapping.h"

struct listed_file {
    char *path; /* owned */
    uint64_t bytes;
    const void *content; /* [bytes] of a file in memory; borrowed; NULL: it is on the disk */
};

struct listing {
    char *root; /* folder on the disk, or NULL; owned */
    size_t count;
    struct listed_file *file; /* [count] sorted by path; owned */
    size_t link_count;        /* links that were passed over */
    char *link;               /* path of the first of them, or NULL; owned */
    size_t folder_count;
    char **folder; /* [folder_count] bases, "" first, then the shallower first, then sorted; owned */
};

#define LISTING_MAX_DEPTH 8 /* folders below the root */
/* Lists folder `root` down to LISTING_MAX_DEPTH. *l is the caller's (listing_release) in any case. */
enum status listing_read(struct listing *l, const char *root, struct error *err);
/* Of files in memory; copies the paths. */
void listing_of_memory(struct listing *l, const struct listed_file *file, size_t count);
void listing_release(struct listing *l);

/* The file at base + name; NULL: there is none. */
const struct listed_file *listing_find(const struct listing *l, const char *base, const char *name);
/* The path of the first of the names that is there, the caller's; NULL: none is. */
char *listing_find_any(const struct listing *l, const char *base, const char *const *names, size_t count);
/* Whether any file lies in the folder base + name. */
bool listing_has_folder(const struct listing *l, const char *base, const char *name);
/* The folder that holds the folder `base`, the caller's; NULL for the root. */
char *listing_above(const char *base);
/* The next file below base whose path from there matches the pattern (fnmatch; "*" stands for no "/"; case is
 * ignored), from number *at on, which moves on; NULL: no more. Begin with *at = 0. */
const struct listed_file *listing_match(const struct listing *l, const char *base, const char *pattern, size_t *at);
/* The first of them; how many there are. */
const struct listed_file *listing_first(const struct listing *l, const char *base, const char *pattern);
size_t listing_match_count(const struct listing *l, const char *base, const char *pattern);

/* Path of the first of them that has both words in its first 4 KiB, the caller's; NULL: none. */
char *listing_first_with(const struct listing *l, const char *base, const char *pattern, const char *word,
                         const char *other);

/* Maps the file at `path` (from the root). `kind` as for mapping_open. */
enum status listing_open(const struct listing *l, const char *path, const char *kind, struct mapping *m,
                         struct error *err);
/* Its text as UTF-8, at most `limit` bytes, with a NUL and without the byte order mark that editors of Windows put
 * before it, or from UTF-16, as PowerShell writes it; the caller's (mem_free), NULL on error. */
enum status listing_text(const struct listing *l, const char *path, size_t limit, char **text, struct error *err);

#endif
