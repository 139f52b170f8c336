/* findings.h -- what reading a bundle brings to light: problems, which reject it, and warnings,
 * which do not. All that can be found at once are, so a user mends a bundle in one go. */
#ifndef UNBAKE_INGEST_FINDINGS_H
#define UNBAKE_INGEST_FINDINGS_H

#include <stddef.h>

#include "common/json.h"

#define FINDINGS_MAX 50 /* of each kind that are kept; the rest are counted */

struct findings {
    cJSON *problems; /* array of {"file", "reason"} or with "hint" too; borrowed */
    size_t problem_count;
    size_t warning_count;
    char **warning;  /* [min(warning_count, FINDINGS_MAX)]; owned */
};

void findings_release(struct findings *f);
void findings_problem(struct findings *f, const char *file, const char *format, ...)
    __attribute__((format(printf, 3, 4)));
/* The message of an error, with its hint. */
void findings_error(struct findings *f, const char *file, const struct error *err);
/* A reader's status and error: faults of the bundle become a problem, and STATUS_OK; others become *err, which may be
 * NULL. */
enum status findings_settle(struct findings *f, const char *file, enum status status, const struct error *own,
                            struct error *err);
void findings_warning(struct findings *f, const char *format, ...)
    __attribute__((format(printf, 2, 3)));

#endif
