/* sse.h -- a stream of Server-Sent Events, cut into events (WHATWG HTML, section 9.2.6).
 *
 * Bytes come in pieces of any size; lines end in LF, CR or CR LF. An event whose text passes
 * SSE_EVENT_MAX is refused: the stream is then broken for good. */
#ifndef UNBAKE_CLIENT_SSE_H
#define UNBAKE_CLIENT_SSE_H

#include <stdbool.h>
#include <stddef.h>

#include "common/buf.h"

#define SSE_EVENT_MAX ((size_t)4 << 20) /* bytes of an event */
#define SSE_ID_MAX 128                  /* bytes of an id, with its NUL */

/* Receives each event; type is "message" where the stream names none. Returning false stops the stream. */
typedef bool sse_each(void *user, const char *type, const char *data, const char *id);

struct sse {
    struct buf line, data;
    char type[64];
    char pending_id[SSE_ID_MAX];
    char last_id[SSE_ID_MAX]; /* of the last event delivered; for Last-Event-ID */
    bool after_cr;            /* a following LF belongs to the line that has ended */
    bool begun;               /* no byte-order mark can follow */
    sse_each *each;
    void *user;
};

void sse_init(struct sse *s, sse_each *each, void *user);
void sse_release(struct sse *s);
/* Drops a half-received event after a broken connection; last_id stays. */
void sse_restart(struct sse *s);
/* False when `each` returned false or an event was too large. */
bool sse_feed(struct sse *s, const char *bytes, size_t length);

#endif
