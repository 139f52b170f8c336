/* nodes.c -- the node's side of an attempt that runs elsewhere: it claims it, reports, ends it. What it reads and
 * writes besides: node_files.c. The protocol as a whole: server/node/README.md. */
#include <limits.h>
#include <stdio.h>
#include <string.h>

#include "common/log.h"
#include "common/mem.h"
#include "common/source_digest.h"
#include "server/data/layout.h"
#include "server/http/handlers.h"
#include "server/http/nodes/node.h"
#include "server/transport/body.h"
#include "server/transport/problem.h"

#define ORDER_MAX ((size_t)1 << 20) /* as order.c reads it */
#define HOST_MAX 63                 /* bytes of a node's name that are kept */

/* --- the claim ------------------------------------------------------------------------------- */

static enum status read_order(struct api *api, const struct node_key *key, cJSON **order, struct error *err) {
    char *dir = layout_attempt(api->config.data_dir, key->key.job_id, key->key.number), *path = layout_order(dir);
    enum status status = json_read(path, ORDER_MAX, order, err);
    if (status == STATUS_OK) /* where it lies here means nothing there */
        cJSON_DeleteItemFromObjectCaseSensitive(*order, "scene");
    mem_free(path);
    mem_free(dir);
    return status;
}

/* A node whose program is another one may read the state of the job otherwise, or not at all. */
static struct response *refuse_version(struct api *api, struct request *r, const struct node_key *key,
                                       const char *version, const char *host) {
    struct error err;
    char *reason = mem_printf("unbaked on %s has version %.60s, the daemon has %s", host, version, source_version);
    enum status status = store_remote_refuse(api->store, &key->key, reason, &err);
    struct response *reply = status != STATUS_OK
                                 ? node_refusal(api, r, &err)
                                 : problem_full(r, 409, reason, "the same version belongs on all machines", NULL);
    if (status == STATUS_OK)
        scheduler_wake(api->scheduler);
    mem_free(reason);
    return reply;
}

static struct response *claim(struct api *api, struct request *r, const struct node_key *key, const char *host) {
    struct remote_row row;
    struct error err;
    cJSON *order;
    if (store_remote_claim(api->store, &key->key, host, &row, &err) != STATUS_OK)
        return node_refusal(api, r, &err);
    if (read_order(api, key, &order, &err) != STATUS_OK)
        return problem_from(r, &err);
    log_info("job %lld: attempt %d is claimed by %s", (long long)key->key.job_id, key->key.number, host);
    scheduler_wake(api->scheduler);
    cJSON *reply = cJSON_CreateObject();
    json_add(reply, "order", order);
    json_add_int(reply, "lease_sec", row.lease_sec);
    return response_json(200, reply);
}

struct response *nodes_claim(struct api *api, struct request *r) {
    const char *version, *name;
    char host[HOST_MAX + 1];
    struct node_key key;
    struct error err;
    struct response *reply = node_key(r, &key);
    cJSON *body = reply ? NULL : body_object(r, &reply);
    if (!body)
        return reply;
    if (json_string(body, "version", "the claim", "", &version, &err) != STATUS_OK ||
        json_string(body, "host", "the claim", "", &name, &err) != STATUS_OK) {
        reply = problem_from(r, &err);
    } else {
        snprintf(host, sizeof host, "%s", *name ? name : "a machine without a name");
        for (char *at = host; *at; at++)
            if (*at < ' ' || *at > '~')
                *at = '?';
        reply = strcmp(version, source_version) == 0 ? claim(api, r, &key, host)
                                                     : refuse_version(api, r, &key, version, host);
    }
    cJSON_Delete(body);
    return reply;
}

/* --- reports --------------------------------------------------------------------------------- */

/* The members that reports and ends share. */
static enum status read_common(const cJSON *body, int64_t *seq, double *cpu_sec, struct error *err) {
    double number;
    enum status status = json_number(body, "seq", "the report", 0.0, &number, err);
    if (status == STATUS_OK)
        status = json_number(body, "cpu_sec", "the report", 0.0, cpu_sec, err);
    if (status == STATUS_OK && !(number >= 1.0 && number <= 0x1p53))
        status = error_set(err, STATUS_INPUT, "seq must be a number from 1 on");
    if (status == STATUS_OK && !(*cpu_sec >= 0.0 && *cpu_sec < 1e12))
        status = error_set(err, STATUS_INPUT, "cpu_sec is no time");
    *seq = status == STATUS_OK ? (int64_t)number : 0;
    return status;
}

/* Joins the lines, each with a newline. */
static enum status read_lines(const cJSON *body, struct buf *lines, struct error *err) {
    const cJSON *list = cJSON_GetObjectItemCaseSensitive(body, "lines"), *line;
    if (list && !cJSON_IsArray(list))
        return error_set(err, STATUS_INPUT, "lines is not a list");
    cJSON_ArrayForEach(line, list) {
        const char *text = cJSON_GetStringValue(line);
        if (!text || strchr(text, '\n'))
            return error_set(err, STATUS_INPUT, "lines has a member that is not one line of text");
        if (!buf_printf(lines, "%s\n", text))
            return error_set(err, STATUS_INPUT, "the lines have more than %d bytes", REMOTE_LINES_MAX);
    }
    return STATUS_OK;
}

static struct response *answer(const struct remote_reply *from) {
    cJSON *reply = cJSON_CreateObject();
    json_add_string(reply, "do", remote_request_name(from->wanted));
    json_add_int(reply, "lease_sec", from->lease_sec);
    json_add_int(reply, "last_seq", from->last_seq);
    return response_json(200, reply);
}

static struct response *report(struct api *api, struct request *r, const struct node_key *key, const cJSON *body) {
    struct remote_reply told;
    struct buf lines;
    struct error err;
    int64_t seq;
    double cpu_sec;
    buf_init(&lines, REMOTE_LINES_MAX);
    struct response *reply = NULL;
    if (read_common(body, &seq, &cpu_sec, &err) != STATUS_OK || read_lines(body, &lines, &err) != STATUS_OK)
        reply = problem_from(r, &err);
    else if (store_remote_report(api->store, &key->key, seq, buf_text(&lines), cpu_sec, &told, &err) != STATUS_OK)
        reply = node_refusal(api, r, &err);
    else
        reply = answer(&told);
    if (reply->status == 200 && lines.length > 0)
        scheduler_wake(api->scheduler);
    buf_release(&lines);
    return reply;
}

/* Copies a text of the body; what is longer than there is room for is cut off. */
static enum status copy_text(const cJSON *body, const char *name, char *to, size_t size, struct error *err) {
    const char *text;
    enum status status = json_string(body, name, "the end", "", &text, err);
    if (status == STATUS_OK)
        snprintf(to, size, "%s", text);
    return status;
}

static struct response *end(struct api *api, struct request *r, const struct node_key *key, const cJSON *body) {
    static const char *const ways[] = {"exit", "signal", "memory", "lost", "refused", "preempted"};
    struct remote_end told = {0};
    struct error err;
    int64_t seq;
    double cpu_sec, code = 0.0;
    enum status status = read_common(body, &seq, &cpu_sec, &err);
    if (status == STATUS_OK)
        status = copy_text(body, "way", told.way, sizeof told.way, &err);
    if (status == STATUS_OK)
        status = copy_text(body, "reason", told.reason, sizeof told.reason, &err);
    if (status == STATUS_OK)
        status = copy_text(body, "last_words", told.log_tail, sizeof told.log_tail, &err);
    if (status == STATUS_OK)
        status = json_number(body, "code", "the end", 0.0, &code, &err);
    size_t way = 0;
    while (way < sizeof ways / sizeof *ways && strcmp(ways[way], told.way) != 0)
        way++;
    if (status == STATUS_OK && way == sizeof ways / sizeof *ways)
        status = error_set(&err, STATUS_INPUT, "\"%s\" is no way in which an attempt ends", told.way);
    if (status == STATUS_OK && !(code >= 0.0 && code <= 255.0))
        status = error_set(&err, STATUS_INPUT, "code must be a number from 0 to 255");
    if (status != STATUS_OK)
        return problem_from(r, &err);
    told.code = (int)code;
    if (store_remote_end(api->store, &key->key, seq, &told, cpu_sec, &err) != STATUS_OK)
        return node_refusal(api, r, &err);
    scheduler_wake(api->scheduler);
    cJSON *reply = cJSON_CreateObject();
    json_add_int(reply, "last_seq", seq);
    return response_json(200, reply);
}

static struct response *with_body(struct api *api, struct request *r,
                                  struct response *(*handle)(struct api *api, struct request *r,
                                                             const struct node_key *key, const cJSON *body)) {
    struct node_key key;
    struct response *reply = node_key(r, &key);
    r->is_routine = true;
    cJSON *body = reply ? NULL : body_object(r, &reply);
    if (body)
        reply = handle(api, r, &key, body);
    cJSON_Delete(body);
    return reply;
}

struct response *nodes_report(struct api *api, struct request *r) {
    return with_body(api, r, report);
}

struct response *nodes_end(struct api *api, struct request *r) {
    return with_body(api, r, end);
}
