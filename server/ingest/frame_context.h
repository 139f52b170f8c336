/* frame_context.h -- values of a file of frames as JSON, each of the frame or else of the top level; faults are told
 * once, with their place. */
#ifndef UNBAKE_INGEST_FRAME_CONTEXT_H
#define UNBAKE_INGEST_FRAME_CONTEXT_H

#include <stdbool.h>
#include <stddef.h>

#include "common/json.h"
#include "server/ingest/findings.h"

/* State of reading a file. */
struct frame_context {
    const cJSON *root, *frame; /* frame: NULL while the top level is read */
    const char *name;          /* of the file */
    char place[256];           /* "frames[3] (images/003.png)" */
    struct findings *findings;
    bool ok; /* no problem so far in this frame */
    size_t scaled_count;
    size_t bad_count;
    const cJSON *list[3]; /* train_filenames, val_filenames, test_filenames or NULL */
    size_t unlisted_count;
};

/* A problem of the frame, or of the file while its top level is read. */
__attribute__((format(printf, 2, 3))) void frame_context_problem(struct frame_context *c, const char *format, ...);

/* The object that has the value: the frame or the file; NULL when neither does. Faults at the top level are reported
 * once, when that is read. */
const cJSON *frame_context_holder(const struct frame_context *c, const char *key);

/* A number, also in quotes, as some scripts write it. */
bool frame_context_plain_number(const cJSON *item, double *value);
double frame_context_number(struct frame_context *c, const char *key, double fallback);
/* A value that must be positive if present; else NAN. */
double frame_context_positive(struct frame_context *c, const char *key);
/* NULL where it is absent or no string. */
const char *frame_context_string(struct frame_context *c, const cJSON *object, const char *key);

#endif
