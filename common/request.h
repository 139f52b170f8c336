/* request.h -- requests to the daemon, by the client and by `unbaked node`. request.c is the only include of
 * <curl/curl.h>.
 *
 * 1. A request that cannot be sent, or that meets 502, 503 or 504, is tried again with growing
 *    pauses for `retry_sec`. One whose effect is not the same twice is tried again only when the
 *    server cannot have got it.
 * 2. SIGINT and SIGTERM (blocked by main, read from signal_fd; -1: none) end a request or a pause at once
 *    with STATUS_CANCELLED.
 * 3. Redirects are not followed; a loopback address is reached without a proxy.
 * One request at a time; not thread-safe. */
#ifndef UNBAKE_COMMON_REQUEST_H
#define UNBAKE_COMMON_REQUEST_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "common/buf.h"
#include "common/error.h"
#include "common/json.h"
#include "common/reply.h"

struct http_request; /* a server and the connection to it; opaque */

/* `server_url` is http://, https:// or unix:PATH, a socket on which HTTP is spoken. */
struct http_request *request_new(const char *server_url, double retry_sec, int signal_fd);
/* What an error advises when no server could be reached; static text. */
struct request_advice {
    const char *url; /* it is no URL */
    const char *ca;  /* its certificate is not trusted */
    const char *any; /* anything else */
};
void request_set_advice(struct http_request *r, const struct request_advice *advice); /* borrowed */
/* Sent with every request from now on; NULL: none. Never printed. */
void request_set_token(struct http_request *r, const char *token);
/* A file of certificates to trust instead of the system's. */
void request_set_ca(struct http_request *r, const char *path);
bool request_is_loopback(const struct http_request *r); /* the server's address */
void request_free(struct http_request *r);
const char *request_server(const struct http_request *r); /* the URL, without a trailing slash */
const char *request_library_version(void);                /* libcurl's */

/* True once SIGINT or SIGTERM has come. */
bool request_interrupted(struct http_request *r);
/* Pauses before another try (0, 1, ...): 0.1 s, doubled each time, at most 5 s; or `asked_sec`, by the server's
 * request (negative: none). False when interrupted. */
bool request_pause(struct http_request *r, int tries, double asked_sec);

struct request_call {
    const char *method;    /* NULL: GET */
    const char *path;      /* "/v1/jobs?limit=1", percent-encoded */
    const char *header[4]; /* more headers, "Name: value"; unused ones NULL */

    const cJSON *body; /* sent as JSON; NULL: none */
    /* Or a body that is pulled: `read` as pack_read; `rewind` is called before every try. */
    enum status (*read)(void *user, void *bytes, size_t room, size_t *got, struct error *err);
    enum status (*rewind)(void *user, struct error *err);
    uint64_t read_length;
    const char *content_type; /* of a pulled body; NULL: application/octet-stream */

    /* Receives the body of a 200 or 206 piece by piece; returning false ends the request successfully. */
    bool (*sink)(void *user, const struct reply *reply, const char *bytes, size_t length);
    /* Called a few times a second during the request, with the bytes sent so far. */
    void (*tick)(void *user, double sent);
    /* Asked as often; false ends the request with STATUS_CANCELLED. */
    bool (*go_on)(void *user);
    void *user;

    double silence_sec; /* the connection is dead after this long without traffic; 0: 300 s */
    bool once;          /* no retries here; the caller does them */
    bool same_twice;    /* a repeated request does no harm (always true of GET) */
};

/* Runs a request. Status codes of 400 and above become an error with the problem's detail and hint: 404
 * STATUS_NOT_FOUND, 409 and 412 STATUS_CONFLICT, 502 to 504 STATUS_UNAVAILABLE, 507 STATUS_NO_SPACE, 413 and 429
 * STATUS_LIMIT, other 5xx STATUS_INTERNAL, else STATUS_INPUT. reply->code is 0 for local errors. *reply is emptied
 * first. */
enum status request_run(struct http_request *r, const struct request_call *call, struct reply *reply,
                        struct error *err);

/* GET of a JSON document. */
enum status request_get(struct http_request *r, const char *path, struct reply *reply, struct error *err);

#endif
