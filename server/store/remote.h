/* remote.h -- attempts that run on other machines: what the scheduler wishes of them, and what their nodes report. The
 * two never meet but here, so that a daemon that dies forgets nothing. As for all of the store, see store.h.
 *
 *      (none) ──begin──> SUBMITTING ──submitted──> WAITING ──claim──> CLAIMED ──end, close──> ENDED
 *                             │                       │                             ▲
 *                             ├───────── claim ───────│─────────────────────────────┤
 *                             └──── close, refuse ────┴─────────────────────────────┘
 *
 * 1. The row is on disk before anything is submitted, with the name under which the site will know it: whoever finds it
 *    after a crash looks for that name first.
 * 2. Who holds the attempt's token may claim it, once. A claim is repeated by the same claimant (its reply may have
 *    been lost); every other one is refused.
 * 3. All that a node says carries the attempt's token and its claimant, and is refused with STATUS_CONFLICT once the
 *    row is ENDED, or another attempt of the job runs, or none.
 * 4. Reports are numbered from 1 without gaps. One is entered with its number in one transaction; one that is repeated
 *    changes nothing and has the same reply. The end is a report too, the last, and there is one end.
 * 5. Lines are read in the order of their reports, each at least once: after a crash of the daemon those of one report
 *    may be read again.
 * 6. Who writes files for an attempt enters first (store_remote_enter) and leaves after. After the end nobody enters;
 *    what is ENDED and has no writer will not be written to any more. */
#ifndef UNBAKE_STORE_REMOTE_H
#define UNBAKE_STORE_REMOTE_H

#include <stddef.h>
#include <stdint.h>

#include "common/error.h"
#include "common/sha256.h"

struct store; /* store.h */

#define REMOTE_NAME_SIZE 64        /* bytes with the NUL */
#define REMOTE_CLAIMANT_SIZE 65    /* hex digits that a node draws at random when it starts, and the NUL */
#define REMOTE_LINES_MAX (1 << 20) /* bytes of one report */
#define REMOTE_REPORTS_MAX 256     /* of an attempt that are not read yet */
#define REMOTE_LOG_TAIL_SIZE 1024  /* of a log's last lines, with the NUL */

/* Stored as numbers in state.db: the order is part of its schema. */
enum remote_phase { REMOTE_SUBMITTING, REMOTE_WAITING, REMOTE_CLAIMED, REMOTE_ENDED };
enum remote_request {
    REMOTE_GO_ON,
    REMOTE_PREVIEW,
    REMOTE_STOP,
    REMOTE_CANCEL
};                                                            /* a later one outdoes an earlier one */
const char *remote_request_name(enum remote_request request); /* "go_on", "preview", "stop", "cancel" */

/* How an attempt ended, as its node says. */
struct remote_end {
    char way[16];     /* "exit", "signal", "memory", "lost", "refused" or "preempted"; "": it has not ended */
    int code;         /* exit: the status; signal: its number */
    char reason[256]; /* in words for users; may be "" */
    char log_tail[REMOTE_LOG_TAIL_SIZE]; /* the last lines that its worker printed; may be "" */
};

struct remote_row {
    int64_t job_id;
    int number;
    enum remote_phase phase;
    char executor[32], name[REMOTE_NAME_SIZE];
    char external_id[64];      /* the site's; "": not known */
    char external_reason[128]; /* why it waits, in the site's words; "": unknown */
    char host[64];             /* where it runs, as its node says; "" before */
    int lease_sec;
    int64_t begun_ms, claimed_ms, heard_ms; /* Unix time, 0: not yet */
    int64_t heard_count;                    /* grows by one with every claim, report and end that is accepted */
    int64_t refused_count;                  /* claims of others: the site has started it more than once */
    int64_t last_seq;
    enum remote_request wanted;
    double cpu_sec;
    struct remote_end end;
};

/* --- the scheduler's side ------------------------------------------------------------------ */

/* An attempt that the job runs begins to be submitted. */
enum status store_remote_begin(struct store *store, const struct remote_row *row, const char *token_sha256,
                               struct error *err);
/* It is submitted once more, and whatever came of it before does not count: that knows another name and token.
 * STATUS_CONFLICT where it is claimed or over. */
enum status store_remote_rename(struct store *store, int64_t job_id, int number, const char *name,
                                const char *token_sha256, struct error *err);
/* The site has it under that id. Nothing changes where it is claimed or ended already, but for an unknown id. */
enum status store_remote_submitted(struct store *store, int64_t job_id, int number, const char *external_id,
                                   struct error *err);
/* Why it waits; the job shows "waiting in EXECUTOR: REASON" until it is claimed. Without a change nothing is
 * written. */
enum status store_remote_explain(struct store *store, int64_t job_id, int number, const char *reason,
                                 struct error *err);
/* What is the matter with one that is claimed, which the job shows; "": nothing any more. Without a change nothing is
 * written. */
enum status store_remote_trouble(struct store *store, int64_t job_id, int number, const char *reason,
                                 struct error *err);
enum status store_remote_request(struct store *store, int64_t job_id, int number, enum remote_request request,
                                 struct error *err);
enum status store_remote_get(struct store *store, int64_t job_id, int number, struct remote_row *row,
                             struct error *err);
/* Those of an executor that have not ended, in no order; of all executors where it is NULL. *rows: [*count], the
 * caller's (mem_free). */
enum status store_remote_list(struct store *store, const char *executor, struct remote_row **rows, size_t *count,
                              struct error *err);
/* Grows whenever a node has said something: while it stands still there is nothing to read. */
uint64_t store_remote_changes(struct store *store);
/* Reads the oldest report: passes its lines, each with its newline, to `each`, and removes it. What `each` enters into
 * the store is one transaction with that: a report is entered whole, once, or not at all and read again.
 * STATUS_NOT_FOUND when there is none. */
typedef void remote_lines_fn(void *user, const char *lines);
enum status store_remote_read(struct store *store, int64_t job_id, int number, remote_lines_fn *each, void *user,
                              struct error *err);
/* Nothing more is accepted; works on a full disk. *writers: how many are still at it. */
enum status store_remote_close(struct store *store, int64_t job_id, int number, size_t *writers, struct error *err);

/* --- the node's side ----------------------------------------------------------------------- */

struct remote_key {
    int64_t job_id;
    int number;
    const char *token_sha256; /* of the token that it has shown, SHA256_HEX_SIZE */
    const char *claimant;
};
/* STATUS_NOT_FOUND: no such attempt, or another token; who asks need not know which. STATUS_CONFLICT: it is over, or
 * somebody else's. All of the following say this. */
enum status store_remote_claim(struct store *store, const struct remote_key *key, const char *host,
                               struct remote_row *row, struct error *err);
/* Before the claim: who holds the token is not fit for it (another version). The attempt ends as "refused" for that
 * reason; once it is claimed, STATUS_CONFLICT. */
enum status store_remote_refuse(struct store *store, const struct remote_key *key, const char *reason,
                                struct error *err);
struct remote_reply {
    enum remote_request wanted;
    int lease_sec;
    int64_t last_seq;
};
/* `lines`: complete lines, at most REMOTE_LINES_MAX bytes. STATUS_INPUT where seq leaves a gap; STATUS_LIMIT while
 * REMOTE_REPORTS_MAX reports are unread. On a full disk the report is not entered, which reply->last_seq shows, but the
 * lease is kept and the reply says what is wanted. */
enum status store_remote_report(struct store *store, const struct remote_key *key, int64_t seq, const char *lines,
                                double cpu_sec, struct remote_reply *reply, struct error *err);
/* The last report; works on a full disk. */
enum status store_remote_end(struct store *store, const struct remote_key *key, int64_t seq,
                             const struct remote_end *end, double cpu_sec, struct error *err);
/* May its node read what it needs, at this moment? */
enum status store_remote_may_read(struct store *store, const struct remote_key *key, struct error *err);
/* May it write? After STATUS_OK store_remote_leave must follow, when the last byte is written. */
enum status store_remote_enter(struct store *store, const struct remote_key *key, struct error *err);
void store_remote_leave(struct store *store, const struct remote_key *key);

#endif
