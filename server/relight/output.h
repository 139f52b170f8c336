/* output.h -- the files of a render's pictures, and the record of which are done.
 *
 * NNNNN is the picture's number, with more digits where there are more pictures: names sort as numbers do. A pass is
 * NNNNN_radiance.png or .exr, a source alone NNNNN_light_27.exr, a multilayer EXR NNNNN.exr. views.jsonl has a line of
 * JSON for each picture that is done, with the sizes and digests of its files, appended when all of them have their
 * final names; a line that was cut off counts as none. When all are done it is put in their order, and views.json is
 * made of it, with the settings, the seed and the program's version. */
#ifndef UNBAKE_RELIGHT_OUTPUT_H
#define UNBAKE_RELIGHT_OUTPUT_H

#include <stdbool.h>

#include "common/sha256.h"
#include "server/relight/passes.h"
#include "server/relight/relight_job.h"

struct output {
    const struct relight_job *job;
    const struct relight_watch *watch;
    struct view_look look;
    int digits;                   /* of a picture's number in names */
    char digest[SHA256_HEX_SIZE]; /* of what the pictures depend on: settings, outputs */
    cJSON *done;                  /* records of this digest, by picture; owned */
    const char *note;             /* a comment in EXR headers; NULL: none; borrowed */
};

/* Of what the pictures of a job depend on. */
void output_digest(const struct relight_job *job, char digest[SHA256_HEX_SIZE]);

/* Reads the record, where there is one. */
enum status output_open(struct output *o, const struct relight_job *job, const struct relight_watch *watch,
                        struct error *err);
void output_close(struct output *o);
/* How many pictures the job has, for their names; before any of them. */
void output_count(struct output *o, uint64_t pictures);

/* Whether the picture's files are there as its record says; the watch is told of them. */
bool output_is_done(const struct output *o, uint64_t picture);

/* Writes a pass (or a source's light, `name`) in those formats; data are EXR even where only PNG is asked for. Its
 * files go to the array `files` of the picture's record. Changes *image. */
struct output_formats {
    bool is_exr, is_png;
};
enum status output_pass(struct output *o, uint64_t picture, const struct render_pass *pass, const char *name,
                        struct output_formats formats, struct image *image, cJSON *files, struct error *err);
/* An EXR with all channels as they are. */
enum status output_layers(struct output *o, uint64_t picture, const struct image *image, cJSON *files,
                          struct error *err);
/* A PNG of radiance so far, preview/NNNNN.png, which is no part of the record. Changes *image. */
enum status output_preview(struct output *o, uint64_t picture, struct image *image, struct error *err);

/* Appends the record of a picture; takes it. */
enum status output_record(struct output *o, uint64_t picture, cJSON *record, struct error *err);

/* Writes views.json: the settings and the records of all pictures; takes `head`. */
enum status output_views(struct output *o, uint64_t pictures, cJSON *head, struct error *err);

#endif
