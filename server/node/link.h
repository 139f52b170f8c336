/* link.h -- what a node and the daemon say to each other about one attempt, over HTTP, and the lease on it. README.md
 * has the protocol.
 *
 *      claim ──> OPEN ──(a lease without an answer)──> EXPIRED
 *                  └────(the daemon says that it is over)──> REFUSED
 *
 * 1. The lease runs from the moment at which the last report that was answered was sent (CLOCK_MONOTONIC): the daemon's
 *    own clock for it started later. Once it is over, nothing is written any more.
 * 2. Reports are numbered. One is repeated, as it was, until it is answered.
 * 3. While a long request is under way, `beat` is called a few times a second: it keeps the lease by link_report, over
 *    a connection of its own. Not thread-safe. */
#ifndef UNBAKE_NODE_LINK_H
#define UNBAKE_NODE_LINK_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "common/buf.h"
#include "common/error.h"
#include "common/json.h"
#include "common/request.h"

enum link_state { LINK_OPEN, LINK_EXPIRED, LINK_REFUSED };
enum link_request { LINK_CONTINUE, LINK_PREVIEW, LINK_STOP, LINK_CANCEL };

struct link_config {
    const char *url, *token;
    const char *ca; /* file of certificates; NULL: the system's */
    int64_t job_id;
    int number;
    void (*beat)(void *user);
    /* Asked as often while something is fetched; false, with *err set, ends that with STATUS_CANCELLED. NULL: never. */
    bool (*may_begin)(void *user, struct error *err);
    void *user;
};

struct attempt_link {
    struct http_request *control, *bulk;
    char *path;         /* "/v1/attempts/JOB/NUMBER" */
    char claimant[128]; /* the header field */
    void (*beat)(void *user);
    bool (*may_begin)(void *user, struct error *err);
    void *user;
    enum link_state state;
    bool is_claimed;
    char why[1024];                /* once it is not OPEN */
    double lease_sec, answered_at; /* when the last report that was answered was sent; clock_sec */
    enum link_request wanted;      /* the newest reply's */
    int64_t seq;                   /* of the next report */
    char **line;                   /* [line_count] to be reported, oldest first; owned */
    size_t line_count, line_room;
    size_t pending;     /* of them in report `seq`, which may have arrived already; 0: it was not sent yet */
    bool is_pending;    /* report `seq` was sent and not answered */
    bool is_put_off;    /* it was answered, but not entered: the daemon's disk is full. It is sent again */
    double next_report; /* clock_sec */
    int failures;       /* reports in a row that were not answered */
    bool is_full_there; /* the last file that was sent met the daemon's full disk */
    double full_until;  /* how long such a file is tried; clock_sec, 0: none has met one */
    uint64_t sent_bytes, fetched_bytes; /* of files */
};

void link_init(struct attempt_link *l, const struct link_config *config);
void link_release(struct attempt_link *l);
/* Looks at the clock, too. */
enum link_state link_state(struct attempt_link *l);

/* Claims the attempt; tries for as long as a lease is, but only once where the daemon's certificate is not trusted.
 * *order is the caller's. STATUS_CONFLICT: another has it, it is over, or the versions differ; the message says so. */
enum status link_claim(struct attempt_link *l, const char *host, int threads, cJSON **order, struct error *err);

/* A line for the next report; longer ones than a line may be, or what is no UTF-8, are dropped. */
void link_add_line(struct attempt_link *l, const char *line, size_t length);
bool link_all_lines_sent(const struct attempt_link *l);
/* Reports where that is due: when there are lines every 2 s, otherwise every 5 s; at once if `now`. */
void link_report(struct attempt_link *l, double cpu_sec, bool now);
/* Forgets what has not been entered: the daemon has no room for it, and the next attempt says it again. */
void link_drop_lines(struct attempt_link *l);
/* When the next report is due (clock_sec). */
double link_next_report(const struct attempt_link *l);

struct link_end {
    const char *way; /* "exit", "signal", "memory", "lost", "preempted" */
    int code;
    const char *reason, *log_tail;
};
/* Everything has been said: the end, tried until it is answered or the lease is over. */
enum status link_end(struct attempt_link *l, const struct link_end *end, double cpu_sec, struct error *err);

/* link_files.c: files. They are tried again while the link is open; what is fetched, while the attempt may begin. */

/* GET of "scene" or "checkpoint": {"files":[{"name","bytes","sha256"},...]}; the caller's. */
enum status link_list(struct attempt_link *l, const char *what, cJSON **list, struct error *err);
/* Appends to the open file what is missing of the daemon's: "scene", "images/1.png". STATUS_NO_SPACE: the disk here. */
enum status link_fetch(struct attempt_link *l, const char *what, const char *name, int fd, struct error *err);
/* Sends the whole open file, whose SHA-256 is `hex`; `query` is "" or "?first=1". While the disk there is full it is
 * tried again for a while, in which the daemon finds room or asks to stop. STATUS_NO_SPACE: it did neither, and
 * is_full_there is set; STATUS_CANCELLED: it has asked. */
enum status link_send(struct attempt_link *l, const char *what, const char *name, const char *query, int fd,
                      const char *hex, struct error *err);

/* For link_files.c: what the reply to any request tells of the link; returns `status`. */
enum status link_read_reply(struct attempt_link *l, enum status status, const struct reply *reply,
                            const struct error *err);
/* Where a head is cut off on the way, what is left may look like an answer without content: STATUS_UNAVAILABLE where
 * the answer to a successful request is not JSON with that member. */
enum status link_whole(const struct attempt_link *l, enum status status, const struct reply *reply, const char *member,
                       struct error *err);
/* Whether the next try may fare better: the daemon was not reached, or had too much to do at once, as for one of many
 * nodes that share an address. Not where its certificate is not trusted. */
bool link_is_busy(enum status status, const struct reply *reply);
/* Waits before try number `tries`, with beats; false when the link is not open any more. */
bool link_pause(struct attempt_link *l, int tries);

#endif
