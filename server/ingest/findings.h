/* findings.h -- problems, which reject a bundle, and warnings, which do not. As many as possible are collected in one
 * go. */
#ifndef UNBAKE_INGEST_FINDINGS_H
#define UNBAKE_INGEST_FINDINGS_H

#include <stddef.h>

#include "common/json.h"

#define FINDINGS_MAX 50 /* kept of each kind; further ones are only counted */

struct findings {
    cJSON *problems; /* array of {"file", "reason"} or with "hint" too; borrowed */
    size_t problem_count;
    size_t warning_count;
    char **warning; /* [min(warning_count, FINDINGS_MAX)]; owned */
};

void findings_release(struct findings *f);
void findings_problem(struct findings *f, const char *file, const char *format, ...)
    __attribute__((format(printf, 3, 4)));
/* The message of an error, with its hint. */
void findings_error(struct findings *f, const char *file, const struct error *err);
/* Turns a reader's status and error into a problem and STATUS_OK if the bundle is at fault; copies other errors to
 * *err, which may be NULL. */
enum status findings_settle(struct findings *f, const char *file, enum status status, const struct error *own,
                            struct error *err);
void findings_warning(struct findings *f, const char *format, ...) __attribute__((format(printf, 2, 3)));

#endif
