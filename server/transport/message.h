/* message.h -- a request as the handlers see it and the response that they give: plain data, no
 * library's types. A handler is a function from the one to the other.
 *
 * 1. A request reaches a handler only when its head passed head.c's and the application's checks.
 * 2. A response belongs to whoever holds it until the transport takes it. */
#ifndef UNBAKE_TRANSPORT_MESSAGE_H
#define UNBAKE_TRANSPORT_MESSAGE_H

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

enum method { METHOD_GET, METHOD_POST, METHOD_PATCH, METHOD_DELETE, METHOD_OPTIONS, METHOD_PUT, METHOD_COUNT };

/* Which threads work on a request; see listener.h. */
enum request_pace {
    PACE_AT_ONCE, /* uses neither store, disk nor caller */
    PACE_QUICK,   /* uses the store, opens a file */
    PACE_SLOW     /* syncs, hashes, or reads files whose size users choose */
};

#define REQUEST_ID_SIZE 65     /* 64 characters and the NUL */
#define RESPONSE_FIELDS_MAX 12 /* header fields that a handler may add */

struct route;
struct upload;
struct upload_patch;

struct request {
    int method;   /* enum method; METHOD_COUNT for a method that no route has */
    bool is_head; /* HEAD: method is METHOD_GET and the body is left out */
    struct target target;
    struct field *fields; /* [field_count]; owned */
    size_t field_count;
    bool has_body;
    int64_t content_length;     /* -1: not known (chunked) */
    char id[REQUEST_ID_SIZE];   /* for X-Request-Id and logs */
    struct address address;     /* the client's address (address.h) */
    bool is_throttled;          /* refused after too many invalid tokens */
    bool is_routine;            /* comes every few seconds: the log tells of it only where it tells of reading */
    const struct route *route;  /* what follows is set by the application's `find`; static storage */
    enum request_pace pace;     /* which threads run begin and finish */
    bool is_body_stored;        /* its body is written to disk as it arrives */
    struct caller caller;       /* set by the application's `begin` */
    struct buf body;            /* the part collected in memory, for routes that take JSON */
    struct upload *upload;      /* an uploaded bundle; owned */
    struct upload_patch *patch; /* a part of a resumable upload; owned */
};

/* The application has freed upload and patch. */
void request_release(struct request *r);
/* The value of the first field with that name (case-insensitive), NULL where absent; borrowed. */
const char *request_field(const struct request *r, const char *name);

/* A body that is produced while it is sent. One call at a time; close is the last and is called exactly once. */
struct stream {
    /* Copies available bytes into to[size]; 0: fill must be called; -1: the end. Never blocks. */
    ssize_t (*read)(struct stream *s, char *to, size_t size);
    /* Produces more; may block. false: there is nothing now, call again after `wake`. */
    bool (*fill)(struct stream *s);
    void (*close)(struct stream *s); /* frees s; may block */
    bool is_sized; /* must deliver the response's length, else the connection is cut; is never woken */
    bool must_say; /* must deliver at least a byte, else the connection is cut */
    /* Set by the listener before the first call. Thread-safe. May be called until close, also when the stream is not
     * waiting. */
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
/* Sets a field; replaces one of that name. */
void response_field(struct response *r, const char *name, const char *format, ...)
    __attribute__((format(printf, 3, 4)));
struct response *response_json(int status, cJSON *value); /* takes value */
/* Takes text (mem_free). */
struct response *response_text(int status, const char *content_type, char *text, size_t length);
struct response *response_static(const char *content_type, const void *text, size_t length);

#endif
