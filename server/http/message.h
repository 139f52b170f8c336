/* message.h -- a request as the handlers see it and the response that they give: plain data, no
 * library's types. A handler is a function from the one to the other.
 *
 * 1. A request reaches a handler only when its head passed listener.c's and routes.c's checks.
 * 2. A response belongs to whoever holds it until the listener takes it. */
#ifndef UNBAKE_HTTP_MESSAGE_H
#define UNBAKE_HTTP_MESSAGE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <sys/types.h>

#include "common/buf.h"
#include "common/error.h"
#include "common/json.h"
#include "server/net/address.h"
#include "server/net/field.h"
#include "server/net/target.h"
#include "server/store/users.h"

enum method { METHOD_GET, METHOD_POST, METHOD_PATCH, METHOD_DELETE, METHOD_OPTIONS, METHOD_COUNT };

#define REQUEST_ID_SIZE 65
#define RESPONSE_FIELDS_MAX 12

struct route;
struct upload;
struct upload_patch;

struct request {
    int method;   /* enum method; METHOD_COUNT for a word that no route knows */
    bool is_head; /* HEAD: method is METHOD_GET and the body is left out */
    struct target target;
    struct field *fields; /* [field_count]; owned */
    size_t field_count;
    bool has_body;
    int64_t content_length;     /* -1: not known (chunked) */
    char id[REQUEST_ID_SIZE];   /* for X-Request-Id and logs */
    struct address address;     /* where it comes from (address.h) */
    bool is_throttled;          /* refused as one of too many wrong tokens */
    const struct route *route;  /* set by routes_begin; static storage */
    struct caller caller;       /* who asks; set by routes_begin */
    struct buf body;            /* what was collected of it, for routes that take JSON */
    struct upload *upload;      /* a body that goes to disk; owned */
    struct upload_patch *patch; /* a body that goes on with an upload in parts; owned */
};

/* After routes_drop_body, which knows what upload and patch are. */
void request_release(struct request *r);
/* The value of the first field of that name (case does not matter), NULL where absent; borrowed. */
const char *request_field(const struct request *r, const char *name);

/* A body that is made while it is sent. The listener makes one call at a time, and close exactly once, the last. */
struct stream {
    /* Bytes that are there already, put into to[size]; 0: fill must be called; -1: the end. Never waits. */
    ssize_t (*read)(struct stream *s, char *to, size_t size);
    /* Gets more, on a thread that may wait for a disk; false: there is nothing now, call again after `wake`. */
    bool (*fill)(struct stream *s);
    void (*close)(struct stream *s); /* frees s; as fill */
    bool is_sized; /* of as many bytes as the response says; else the connection is cut. It is never woken */
    bool must_say; /* without a byte it must not look whole: its connection is cut */
    /* Set by the listener before the first call; thread-safe; may be called until close, also
     * when the stream is not waiting. */
    void (*wake)(void *waker);
    void *waker;
};

struct response {
    int status;
    struct field fields[RESPONSE_FIELDS_MAX];
    size_t field_count;
    bool must_close; /* the connection cannot be used after this reply */
    /* The body: text[length]; or `length` bytes of fd from offset; or stream. */
    char *text; /* owned unless text_is_static */
    bool text_is_static;
    int fd; /* -1: none; owned */
    uint64_t offset, length;
    struct stream *stream; /* owned */
};

struct response *response_new(int status);
void response_free(struct response *r);
/* Sets a field; one of that name is replaced. */
void response_field(struct response *r, const char *name, const char *format, ...)
    __attribute__((format(printf, 3, 4)));
struct response *response_json(int status, cJSON *value); /* takes value */
/* Takes text (mem_free). */
struct response *response_text(int status, const char *content_type, char *text, size_t length);
struct response *response_static(const char *content_type, const void *text, size_t length);

#endif
