/* guard.h -- deadlines on connections: the library's own timeout is for silence only, which a
 * client that sends one byte every two seconds never trips.
 *
 *   connection ──> HEAD ──> BODY ──> REPLY ──> IDLE ──> HEAD ...   (HEAD after the first byte
 *                    └────────────────^          could not be seen: IDLE covers both)
 *
 * 1. HEAD: the whole head within head_sec. IDLE: within idle_sec + head_sec of the last reply.
 *    BODY: at least body_bytes_per_sec, over each window of window_sec, so that a body of known
 *    length has a deadline; SHORT_BODY, which no upload is: that, and the whole within idle_sec.
 *    REPLY: while there are bytes that the other side has not taken, it must take body_bytes_per_sec
 *    over each window. What we take for the reply itself is not its fault.
 * 2. A late connection's socket is shut down under the mutex that guard_remove takes too, so
 *    never one that was closed and given to somebody else. */
#ifndef UNBAKE_NET_GUARD_H
#define UNBAKE_NET_GUARD_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "common/error.h"

struct guard_limits {
    double head_sec, idle_sec, window_sec;
    double body_bytes_per_sec;
};

enum guard_phase { GUARD_HEAD, GUARD_BODY, GUARD_SHORT_BODY, GUARD_REPLY, GUARD_IDLE };

struct guard;   /* opaque; thread-safe */
struct guarded; /* one connection; opaque */

/* Starts a thread that checks all connections once a second, and then calls tick(user). It sleeps while there are
 * none. */
enum status guard_new(struct guard **g, const struct guard_limits *limits, void (*tick)(void *user), void *user,
                      struct error *err);
/* Stops the thread. All connections must be gone. */
void guard_free(struct guard *g);

struct guarded *guard_add(struct guard *g, int fd);
void guard_remove(struct guard *g, struct guarded *c);
void guard_enter(struct guard *g, struct guarded *c, enum guard_phase phase);
/* While a connection is held, its deadlines stand still: the delay is ours. guard_enter ends the hold. */
void guard_hold(struct guard *g, struct guarded *c, bool is_held);
void guard_body(struct guard *g, struct guarded *c, size_t bytes); /* bytes of a body have arrived */

/* Drops what the peer has not acknowledged when the connection is closed; the kernel would keep it for minutes.
 * Called by the thread that serves it. */
void guard_discard_unsent(struct guarded *c);

size_t guard_count(struct guard *g);        /* connections */
uint64_t guard_shut_count(struct guard *g); /* connections ever shut down for being late */

/* Checks all connections as of `now_sec` (CLOCK_MONOTONIC). The thread's step; for tests. */
void guard_check_all(struct guard *g, double now_sec);

#endif
