/* reply.h -- what a server answers to a request (request.h), and the error that it means. */
#ifndef UNBAKE_COMMON_REPLY_H
#define UNBAKE_COMMON_REPLY_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "common/buf.h"
#include "common/error.h"
#include "common/json.h"

#define REPLY_BODY_MAX ((size_t)64 << 20) /* bytes, of what does not go to a sink */

struct reply {
    long code;       /* HTTP status; 0: no reply at all */
    struct buf body; /* except what went to a sink */
    cJSON *json;     /* the body if it is JSON, including problems; else NULL */
    char content_type[128];
    double retry_after_sec; /* negative: absent */
    int64_t range_first;    /* of Content-Range; -1: absent */
    char location[256];     /* "": absent */
    int64_t upload_offset;  /* -1: absent */
    bool is_untrusted;      /* code 0: the server's certificate, or the file of those to trust, cannot be used */
};
void reply_init(struct reply *reply);
void reply_release(struct reply *reply);

/* Takes what is of use from one line of the head, as bytes with or without its end. */
void reply_take_header(struct reply *reply, const char *bytes, size_t length);

/* Parses a body of JSON, and says what the reply means: STATUS_OK, or the error of request_run. `server` is its URL,
 * for messages. */
enum status reply_judge(struct reply *reply, const char *server, struct error *err);

#endif
