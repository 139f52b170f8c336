/* parts.h -- the parts of a render of many pictures: ranges of its pictures, each of which is rendered by attempts of
 * its own, at once where there are places. As for all of the store, see store.h.
 *
 *      (none) ──store_job_split──> OPEN ──store_job_start──> OPEN, with an attempt ──store_job_succeed──> DONE
 *                                   ▲                           │   │    └──store_job_fail, or too many ends──> FAILED
 *                                   │◀─────crash, lose, stop────┘   └──store_job_block──> BLOCKED
 *                                   └───────────────────────store_job_resume────────────────┘
 *      DONE, FAILED, BLOCKED ──store_job_retry, store_job_extend──> (none)
 *
 * 1. Part 0 is the whole. A job begins with an attempt of it, which may end by splitting the job; from then on attempts
 *    are of OPEN parts. When all are DONE, one more attempt of part 0 puts together what they have made, and renders
 *    what it finds missing: its success is the job's.
 * 2. An attempt of part 0 is alone. Of every other part there is at most one at a time.
 * 3. While one part is FAILED or BLOCKED no other begins; those that run are asked to stop, and the last of them takes
 *    the job to where that part belongs.
 * 4. A job whose last attempt has ended, and whose parts go on, stays RUNNING until the next one begins; where none
 *    can, store_job_yield puts it back into the queue.
 * 5. Each part has as many crashes as the job has attempts left, and is lost as often as a job may be: more of these
 *    ends are too many. */
#ifndef UNBAKE_STORE_PARTS_H
#define UNBAKE_STORE_PARTS_H

#include <stdbool.h>
#include <stdint.h>

#include "common/error.h"
#include "common/sha256.h"

struct store; /* store.h */

#define JOB_PARTS_MAX 1000    /* of one job */
#define PICTURES_MAX 10000000 /* of a job that is split */

struct job_part {
    int part;                     /* 0: the whole */
    int64_t first, count;         /* its pictures; of part 0: 0, 0 */
    int64_t pictures;             /* of the job; 0: it is not split */
    char digest[SHA256_HEX_SIZE]; /* with which its pictures are recorded (relight/output.h); "": not split */
};

/* The attempt has found that the job is better done in so many parts of nearly the same size, and ends. STATUS_INPUT
 * for fewer than 2, more than JOB_PARTS_MAX or than pictures. */
enum status store_job_split(struct store *store, int64_t id, int attempt, int64_t pictures, int parts,
                            const char *digest, struct error *err);
/* Which part the attempt is of. STATUS_NOT_FOUND: there is no such attempt. */
enum status store_part_of(struct store *store, int64_t id, int attempt, struct job_part *part, struct error *err);

/* How far the whole job is, when an attempt of a part has done so many of its pictures, and will need so much more time
 * (negative: not known). Remembers that. */
struct parts_progress {
    double done, total, eta_sec; /* pictures; eta_sec negative: not known */
};
enum status store_part_progress(struct store *store, int64_t id, int attempt, double done, double eta_sec,
                                struct parts_progress *all, struct error *err);

/* A running job of which no attempt runs goes back into the queue, or where its user wants it. STATUS_CONFLICT: one
 * runs. */
enum status store_job_yield(struct store *store, int64_t id, const char *reason, struct error *err);

/* Attempts that run or could begin at this moment if there were places. */
enum status store_attempts_wanted(struct store *store, int64_t *count, struct error *err);

#endif
