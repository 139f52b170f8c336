/* admission.h -- whether the job whose turn it is begins beside those that run, or waits for memory.
 *
 * 1. What it needs is what the check of its scene foretells (check/estimate.h), for the job's own texture size, at most
 *    worker_memory_mib; with all pixels of the photographs where it keeps more than those foretold for. Nothing is
 *    foretold of scenes that an older version has checked: jobs on them begin. A render needs what its source's outputs
 *    and the files that were sent to it become in memory, by their sizes.
 * 2. A job that runs alone is always admitted, whatever it needs.
 * 3. While one waits, none behind it begins: small jobs would keep a large one waiting for ever. */
#ifndef UNBAKE_JOB_ADMISSION_H
#define UNBAKE_JOB_ADMISSION_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "server/store/store.h"

#define ADMISSION_REASON "waits for memory" /* the beginning of the reason of a job that waits */

struct admission {
    uint64_t limit_bytes;        /* for all jobs; 0: what is free when none runs */
    uint64_t worker_limit_bytes; /* of one job; 0: none */
    double total_bytes;          /* for all jobs, as found when none ran; 0: not known, and all are admitted */
    int64_t told_id;             /* the job that was told that it waits; 0: none, -1: what an earlier daemon told */
};

void admission_init(struct admission *a, uint64_t limit_bytes, uint64_t worker_limit_bytes);

/* Bytes that the job's next attempt needs by the facts of its scene; 0: not foretold. */
double admission_need(const struct admission *a, const char *facts, const struct job *job);
/* The same for a job of any kind: what a render needs, the files tell that it reads. */
enum status admission_foretell(const struct admission *a, struct store *store, const struct job *job, double *need,
                               struct error *err);

/* *may: the job may begin beside `running` others, which need `used` bytes; *need: its own. One that may not is told
 * why; one that was told and need not wait any more is told, too. */
enum status admission_decide(struct admission *a, struct store *store, int64_t id, size_t running, double used,
                             bool *may, double *need, struct error *err);

#endif
