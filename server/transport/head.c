/* head.c -- see head.h. */
#include "server/transport/head.h"

#include <stdio.h>
#include <string.h>
#include <strings.h>
#include <sys/random.h>

#include "server/net/field.h"
#include "server/transport/problem.h"

static size_t field_occurrences(const struct request *r, const char *name) {
    size_t count = 0;
    for (size_t i = 0; i < r->field_count; i++)
        count += strcasecmp(r->fields[i].name, name) == 0;
    return count;
}

static struct response *refuse(const struct request *r, int status, const char *detail) {
    struct response *reply = problem(r, status, "%s", detail);
    reply->must_close = true;
    return reply;
}

/* libmicrohttpd 0.9.75 appends a folded line to the field's name: "Content-Length: 3" followed by " 0" becomes a
 * field Content-Length0, and the request loses its length. */
static bool is_lost_framing(const char *name) {
    return (strncasecmp(name, "Content-Length", 14) == 0 && name[14] != '\0') ||
           (strncasecmp(name, "Transfer-Encoding", 17) == 0 && name[17] != '\0');
}

static struct response *check_fields(const struct request *r) {
    static const char *const singles[] = {"Content-Length",  "Content-Type",    "Host",
                                          "Range",           "If-Match",        "If-Range",
                                          "Authorization",   "Idempotency-Key", "Last-Event-ID",
                                          "Expect",          "Origin",          "X-Content-SHA256",
                                          "Tus-Resumable",   "Upload-Offset",   "Upload-Length",
                                          "Upload-Metadata", "Upload-Checksum", "X-HTTP-Method-Override"};
    for (size_t i = 0; i < r->field_count; i++) {
        if (!field_is_token(r->fields[i].name))
            return refuse(r, 400, "a header field's name is not a word");
        if (is_lost_framing(r->fields[i].name))
            return refuse(r, 400, "the body's length is given in a field that is continued on another line");
        for (const char *at = r->fields[i].value; *at; at++)
            if (((unsigned char)*at < 0x20 && *at != '\t') || *at == 0x7f)
                return refuse(r, 400, "a header field's value holds a control byte");
    }
    for (size_t i = 0; i < sizeof singles / sizeof *singles; i++)
        if (field_occurrences(r, singles[i]) > 1)
            return refuse(r, 400, "a header field that must be single comes twice");
    return NULL;
}

static struct response *check_framing(const struct request *r) {
    const char *length = request_field(r, "Content-Length");
    const char *coding = request_field(r, "Transfer-Encoding");
    const char *expect = request_field(r, "Expect");
    int64_t value;
    if (length && coding)
        return refuse(r, 400, "Content-Length and Transfer-Encoding exclude each other");
    if (length && !field_number(length, 0, INT64_MAX, &value))
        return refuse(r, 400, "Content-Length is not a number");
    if (coding && (field_occurrences(r, "Transfer-Encoding") > 1 || strcasecmp(coding, "chunked") != 0))
        return refuse(r, 400, "Transfer-Encoding must be \"chunked\" or absent");
    if (expect && *expect && strcasecmp(expect, "100-continue") != 0) /* a list, which may be empty */
        return refuse(r, 417, "the only expectation known here is 100-continue");
    return NULL;
}

/* True when host[length] is one of the names in the list. */
static bool is_server_name(const char *names, const char *host, size_t length) {
    while (*names) {
        names += strspn(names, " ,\t");
        size_t name = strcspn(names, " ,\t");
        if (name == length && length > 0 && strncasecmp(names, host, length) == 0)
            return true;
        names += name;
    }
    return false;
}

static struct response *check_host(const struct request *r, const char *version, const char *server_names) {
    const char *host = request_field(r, "Host"), *authority = r->target.authority;
    size_t length;
    if (!host && strcmp(version, "HTTP/1.0") != 0)
        return refuse(r, 400, "the Host field is missing");
    if (host && !field_host(host, &length))
        return refuse(r, 400, "the Host field is not a host");
    if (authority && !field_host(authority, &length))
        return refuse(r, 400, "the request target's authority is not a host");
    if (authority)
        host = authority; /* RFC 9112, 3.2.2: overrides the Host field */
    if (!host)
        return NULL;
    if (server_names && !field_is_loopback_host(host, length) && !is_server_name(server_names, host, length)) {
        struct response *reply =
            problem_full(r, 403, "this daemon does not answer for that Host",
                         "behind a proxy, list the public name in server_names of the configuration", NULL);
        reply->must_close = true;
        return reply;
    }
    const char *origin = request_field(r, "Origin");
    if (!origin || r->method == METHOD_GET)
        return NULL;
    const char *separator = strstr(origin, "://");
    if (!separator || strcasecmp(separator + 3, host) != 0)
        return refuse(r, 403, "a page of another origin must not change anything here");
    return NULL;
}

struct response *head_check(const struct request *r, const char *version, const char *server_names) {
    if (strcmp(version, "HTTP/1.1") != 0 && strcmp(version, "HTTP/1.0") != 0)
        return refuse(r, 400, "the HTTP version is neither 1.1 nor 1.0");
    struct response *refusal = check_fields(r);
    if (!refusal)
        refusal = check_framing(r);
    if (!refusal)
        refusal = check_host(r, version, server_names);
    return refusal;
}

void head_request_id(struct request *r) {
    const char *given = request_field(r, "X-Request-Id");
    if (given) {
        size_t length = strspn(given, "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789-_.");
        if (length > 0 && length < REQUEST_ID_SIZE && given[length] == '\0') {
            memcpy(r->id, given, length + 1);
            return;
        }
    }
    uint64_t random = 0;
    /* Eight bytes never block or fail once the machine is up; an id of zeros would be harmless. */
    if (getrandom(&random, sizeof random, 0) != sizeof random)
        random = 0;
    snprintf(r->id, sizeof r->id, "%016llx", (unsigned long long)random);
}
