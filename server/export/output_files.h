/* output_files.h -- the folder of a job's files: each is put in place whole, listed and announced.
 *
 * Every file is written under a temporary name, synced and renamed, and only then announced: a
 * reader (or a crash) sees the old content or the new and never a part. */
#ifndef UNBAKE_EXPORT_OUTPUT_FILES_H
#define UNBAKE_EXPORT_OUTPUT_FILES_H

#include <stddef.h>

#include "common/error.h"
#include "common/image.h"
#include "common/json.h"
#include "common/parallel.h"

/* Called after each file is complete under its final name; `type` is EVENT_PREVIEW or EVENT_OUTPUT, `name` is
 * relative to the folder. A failure ends the export. NULL: no announcements. */
typedef enum status export_announce(void *user, const char *type, const char *name, const char *content_type,
                                    struct error *err);

#define OUTPUT_NOTES_MAX 3 /* lines of text in the header of an EXR */
struct output_files {
    const char *dir;       /* borrowed */
    struct parallel *pool; /* NULL: the caller's thread alone; borrowed */
    export_announce *announce;
    void *user;
    cJSON *written;  /* array of {"name", "content_type", "about"}; NULL: not listed. The caller's, as the next */
    cJSON *left_out; /* array of {"name", "reason"} of files that were not written */
    struct image_note note[OUTPUT_NOTES_MAX]; /* of all EXR files; borrowed */
    size_t note_count;
};

enum output_format { OUTPUT_PNG, OUTPUT_EXR_HALF, OUTPUT_EXR_FLOAT };

/* Writes a picture, lists and announces it as `type` (export_announce). `unit` of the values goes into an EXR's header;
 * NULL in a PNG's. */
enum status output_files_image(struct output_files *f, const char *type, const char *name, const struct image *image,
                               enum output_format format, const char *unit, const char *about, struct error *err);

/* A picture of several. */
struct output_picture {
    char name[64];
    const char *about;
};
/* Makes picture `index`, to be released by the caller. May be called by several threads at once. */
typedef void output_make(const void *user, size_t index, struct image *image);

#define OUTPUT_PICTURES_BYTES ((size_t)256 << 20) /* of pixels, of pictures that are made at the same time */
/* Makes and writes picture[count] as PNG files, several at a time: as many as fit into OUTPUT_PICTURES_BYTES where each
 * has `bytes` at most. They are listed and announced in their order. */
enum status output_files_pictures(struct output_files *f, const char *type, size_t count,
                                  const struct output_picture *picture, size_t bytes, output_make *make,
                                  const void *user, struct error *err);

/* Writes data[length], reads it back and announces it; lists it unless `about` is NULL. */
enum status output_files_bytes(struct output_files *f, const char *name, const char *content_type, const void *data,
                               size_t length, const char *about, struct error *err);

/* Lists and announces a file that is in place. */
enum status output_files_list(struct output_files *f, const char *type, const char *name, const char *content_type,
                              const char *about, struct error *err);

/* Records that a file exceeds a limit of its format, which `why` says, and removes that of an earlier attempt. */
void output_files_skip(struct output_files *f, const char *name, const struct error *why);

/* Makes a folder in the folder. */
enum status output_files_folder(const struct output_files *f, const char *name, struct error *err);

#endif
