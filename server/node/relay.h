/* relay.h -- between the worker on this node and the daemon: its lines, its files, the daemon's wishes, the machine's
 * signals.
 *
 *   worker ──lines──> queue ──(its file has been sent)──> link ──reports──> daemon
 *
 * 1. The order of lines is kept. A line that announces a file is passed on after the file lies at the daemon's, whole;
 *    one whose file has been replaced meanwhile is dropped, since another follows.
 * 2. A part of a checkpoint is sent, then removed here; a record of what is done is sent; their lines are for the node
 *    only.
 * 3. Once the lease is over, or the daemon says that the attempt is, the worker is killed and nothing is sent.
 * 4. SIGTERM and SIGUSR1 (blocked; from the scheduler that wants its machine back) stop the worker: it has STOP_SEC for
 *    a checkpoint, then it is killed. */
#ifndef UNBAKE_NODE_RELAY_H
#define UNBAKE_NODE_RELAY_H

#include <stdbool.h>

#include "server/job/run.h"
#include "server/node/link.h"

struct relay {
    struct attempt_link link;
    struct run *run;      /* owned; NULL before its start */
    const char *data_dir; /* in which it works; borrowed */
    const char *host;     /* of this machine; borrowed */
    int64_t job_id;
    int number;
    bool has_ended; /* the run */
    struct run_end end;
    char **line; /* [line_count] lines that have not been passed on; owned */
    size_t line_count, line_room;
    bool has_stopped, has_killed; /* asked it to */
    bool gives_up;                /* it ends without a result: what is not said yet need not be */
    bool is_taken_back;           /* by the machine's scheduler */
    double kill_at;               /* clock_sec; 0: never */
    size_t part_count;            /* sent */
    double part_bytes;
};

/* Connects; the signals must be blocked. */
void relay_init(struct relay *r, const struct link_config *config);
void relay_release(struct relay *r); /* kills a run that has not ended */

/* Whether the attempt should still begin: STATUS_CANCELLED, with why, where it was stopped, cancelled or given up. */
enum status relay_may_begin(struct relay *r, struct error *err);
/* Follows the run to its end, and passes everything on. STATUS_OK: the end may be told. Otherwise the run was killed:
 * STATUS_CANCELLED where the link is not open any more, or the daemon has asked to stop while a file could not be sent;
 * else a file could not be sent, and *err says why. */
enum status relay_follow(struct relay *r, struct error *err);
/* Adds to the error of a full disk that it is this machine's, and what its users can do. */
void relay_name_disk(const struct relay *r, struct error *err);
/* Sends the end of the worker's log. A failure is logged: nothing depends on it. */
void relay_send_log(struct relay *r);
/* Reports all that the link has to say; false when it is not open any more. */
bool relay_flush(struct relay *r);

#endif
