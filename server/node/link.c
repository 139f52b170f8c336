/* link.c -- see link.h: the claim, reports, the end, the lease. */
#include "server/node/link.h"

#include <math.h>
#include <poll.h>
#include <stdio.h>
#include <string.h>

#include "common/clock.h"
#include "common/log.h"
#include "common/mem.h"
#include "common/protocol.h"
#include "common/random_hex.h"
#include "common/source_digest.h"
#include "common/utf8.h"
#include "server/worker/progress.h"

#define LEASE_SEC 60.0 /* until the daemon has said another */
/* Seconds between reports with lines, which is what a user waits at most for news, and between those without, for a
 * cancellation. Of a short lease so many fit into it. */
#define REPORT_SEC 2.0
#define IDLE_REPORT_SEC 5.0
#define REPORTS_A_LEASE 10.0
#define REPORT_BYTES ((size_t)256 << 10) /* of lines; JSON may double them, and a body has at most 1 MiB */
#define SILENCE_SEC 10.0                 /* a report without an answer for so long, or half a lease, is sent again */
#define PAUSE_FIRST_SEC 0.5              /* before a request is repeated; doubled each time */
#define PAUSE_MAX_SEC 5.0                /* up to this */
#define BEAT_SEC 0.2                     /* between two beats during a pause */
#define CLAIMANT_DIGITS 64               /* hex, 256 bits: nobody guesses it */

static void draw_claimant(char field[128]) {
    char hex[CLAIMANT_DIGITS + 1];
    while (random_hex(hex, CLAIMANT_DIGITS, NULL) != STATUS_OK) /* interrupted by a signal */
        continue;
    snprintf(field, 128, NODE_CLAIMANT_FIELD ": %s", hex);
}

static const struct request_advice advice = {.url = "an example: unbaked node https://lab.example.org:7117",
                                             .ca = "--ca FILE (the key ca of the executor's file) names the"
                                                   " certificates to trust",
                                             .any = "can this machine reach the daemon's?"};

static struct http_request *connect_to(const struct link_config *config) {
    struct http_request *r = request_new(config->url, 0.0, -1);
    request_set_advice(r, &advice);
    request_set_token(r, config->token);
    if (config->ca)
        request_set_ca(r, config->ca);
    return r;
}

void link_init(struct attempt_link *l, const struct link_config *config) {
    *l = (struct attempt_link){.control = connect_to(config),
                               .bulk = connect_to(config),
                               .path = mem_printf("/v1/attempts/%lld/%d", (long long)config->job_id, config->number),
                               .beat = config->beat,
                               .may_begin = config->may_begin,
                               .user = config->user,
                               .lease_sec = LEASE_SEC,
                               .answered_at = clock_sec(),
                               .seq = 1};
    draw_claimant(l->claimant);
}

void link_release(struct attempt_link *l) {
    request_free(l->control);
    request_free(l->bulk);
    for (size_t i = 0; i < l->line_count; i++)
        mem_free(l->line[i]);
    mem_free(l->line);
    mem_free(l->path);
    *l = (struct attempt_link){0};
}

/* --- the state ------------------------------------------------------------------------------ */

enum link_state link_state(struct attempt_link *l) {
    if (l->state == LINK_OPEN && clock_sec() - l->answered_at > l->lease_sec) {
        l->state = LINK_EXPIRED;
        snprintf(l->why, sizeof l->why, "the daemon has not answered for %.0f s", l->lease_sec);
    }
    return l->state;
}

enum status link_read_reply(struct attempt_link *l, enum status status, const struct reply *reply,
                            const struct error *err) {
    bool is_refusal = reply->code == 401 || reply->code == 403 || reply->code == 409;
    if (status != STATUS_OK && is_refusal && l->state == LINK_OPEN) {
        l->state = LINK_REFUSED;
        snprintf(l->why, sizeof l->why, "%s", err->message);
    }
    return status;
}

bool link_is_busy(enum status status, const struct reply *reply) {
    return (status == STATUS_UNAVAILABLE && !reply->is_untrusted) || reply->code == 429;
}

static double pause_sec(int tries) { return fmin(PAUSE_FIRST_SEC * pow(2.0, tries), PAUSE_MAX_SEC); }

bool link_pause(struct attempt_link *l, int tries) {
    double until = clock_sec() + pause_sec(tries);
    while (link_state(l) == LINK_OPEN && clock_sec() < until) {
        poll(NULL, 0, (int)(1e3 * BEAT_SEC));
        l->beat(l->user);
    }
    return link_state(l) == LINK_OPEN;
}

enum status link_whole(const struct attempt_link *l, enum status status, const struct reply *reply, const char *member,
                       struct error *err) {
    return status != STATUS_OK || cJSON_HasObjectItem(reply->json, member)
               ? status
               : error_set(err, STATUS_UNAVAILABLE, "an answer of %s is not whole", request_server(l->control));
}

/* One POST of JSON; an answer has the member. *sent: when it was. */
static enum status post(struct attempt_link *l, const char *what, const cJSON *body, const char *member,
                        struct reply *reply, double *sent, struct error *err) {
    char *path = mem_printf("%s/%s", l->path, what);
    const struct request_call call = {.method = "POST",
                                      .path = path,
                                      .header = {l->claimant},
                                      .body = body,
                                      .silence_sec = fmax(1.0, fmin(SILENCE_SEC, l->lease_sec / 2.0)),
                                      .once = true};
    *sent = clock_sec();
    enum status status = link_whole(l, request_run(l->control, &call, reply, err), reply, member, err);
    mem_free(path);
    return link_read_reply(l, status, reply, err);
}

static void take_lease(struct attempt_link *l, const cJSON *reply, double sent) {
    double lease;
    if (json_number(reply, "lease_sec", "the reply", LEASE_SEC, &lease, NULL) == STATUS_OK && lease >= 1.0)
        l->lease_sec = lease;
    l->answered_at = sent;
}

enum status link_claim(struct attempt_link *l, const char *host, int threads, cJSON **order, struct error *err) {
    struct reply reply;
    double sent;
    cJSON *body = cJSON_CreateObject();
    json_add_string(body, "version", source_version);
    json_add_string(body, "host", host);
    json_add_int(body, "threads", threads);
    reply_init(&reply);
    *order = NULL;
    enum status status = post(l, "claim", body, "order", &reply, &sent, err);
    for (int tries = 0; (status == STATUS_NO_SPACE || link_is_busy(status, &reply)) && link_pause(l, tries); tries++)
        status = post(l, "claim", body, "order", &reply, &sent, err);
    if (status == STATUS_OK) {
        *order = cJSON_DetachItemFromObjectCaseSensitive(reply.json, "order");
        take_lease(l, reply.json, sent);
        l->is_claimed = true;
        if (!cJSON_IsObject(*order))
            status =
                error_set(err, STATUS_UNAVAILABLE, "%s does not answer as unbaked does", request_server(l->control));
    }
    reply_release(&reply);
    cJSON_Delete(body);
    return status;
}

/* --- reports -------------------------------------------------------------------------------- */

void link_add_line(struct attempt_link *l, const char *line, size_t length) {
    if (length >= PROGRESS_LINE_MAX || !utf8_valid(line, length, NULL) || memchr(line, '\0', length))
        return;
    if (l->line_count == l->line_room) {
        l->line_room = l->line_room ? 2 * l->line_room : 64;
        l->line = mem_realloc_array(l->line, l->line_room, sizeof *l->line);
    }
    l->line[l->line_count++] = mem_strndup(line, length);
}

bool link_all_lines_sent(const struct attempt_link *l) { return l->line_count == 0 && !l->is_pending; }

static double interval(const struct attempt_link *l, double most) { return fmin(most, l->lease_sec / REPORTS_A_LEASE); }

double link_next_report(const struct attempt_link *l) {
    bool has_news = l->line_count > 0 || l->is_pending;
    return l->next_report + (has_news || l->failures ? 0.0 : interval(l, IDLE_REPORT_SEC) - interval(l, REPORT_SEC));
}

/* The body of report `seq`; the lines that it takes are l->pending. */
static cJSON *make_report(struct attempt_link *l, double cpu_sec) {
    cJSON *body = cJSON_CreateObject(), *lines = cJSON_CreateArray();
    size_t bytes = 0, limit = l->is_pending ? l->pending : l->line_count;
    l->pending = 0;
    while (l->pending < limit && bytes < REPORT_BYTES) {
        bytes += strlen(l->line[l->pending]);
        cJSON_AddItemToArray(lines, cJSON_CreateString(l->line[l->pending++]));
    }
    json_add_int(body, "seq", l->seq);
    json_add(body, "lines", lines);
    json_add_number(body, "cpu_sec", cpu_sec);
    return body;
}

static void take_request(struct attempt_link *l, const cJSON *reply) {
    static const char *const words[] = {
        [LINK_CONTINUE] = "go_on", [LINK_PREVIEW] = "preview", [LINK_STOP] = "stop", [LINK_CANCEL] = "cancel"};
    const char *word;
    if (json_string(reply, "do", "the reply", "", &word, NULL) != STATUS_OK)
        return;
    for (size_t i = 0; i < sizeof words / sizeof *words; i++)
        if (strcmp(words[i], word) == 0)
            l->wanted = (enum link_request)i;
}

/* Report `seq` has been answered. */
static void answered(struct attempt_link *l) {
    for (size_t i = 0; i < l->pending; i++)
        mem_free(l->line[i]);
    l->line_count -= l->pending;
    if (l->line_count > 0)
        memmove(l->line, l->line + l->pending, l->line_count * sizeof *l->line);
    l->pending = 0;
    l->is_pending = false;
    l->failures = 0;
    l->seq++;
}

/* Whether the daemon has taken no more of it than that the node lives. */
static void put_off(struct attempt_link *l, const cJSON *reply) {
    double last = (double)l->seq;
    (void)json_number(reply, "last_seq", "the reply", last, &last, NULL);
    l->is_put_off = last < (double)l->seq;
    l->failures = 0;
}

void link_drop_lines(struct attempt_link *l) {
    if (l->line_count > 0)
        log_warning("%zu lines are dropped: the daemon's disk is full", l->line_count);
    for (size_t i = 0; i < l->line_count; i++)
        mem_free(l->line[i]);
    l->line_count = l->pending = 0;
    l->is_pending = l->is_put_off = false;
}

void link_report(struct attempt_link *l, double cpu_sec, bool now) {
    struct reply reply;
    struct error err;
    double sent;
    if (!l->is_claimed || link_state(l) != LINK_OPEN ||
        (l->failures || l->is_put_off ? clock_sec() < l->next_report : !now && clock_sec() < link_next_report(l)))
        return;
    cJSON *body = make_report(l, cpu_sec);
    reply_init(&reply);
    l->is_pending = true;
    if (post(l, "report", body, "do", &reply, &sent, &err) == STATUS_OK) {
        take_lease(l, reply.json, sent);
        take_request(l, reply.json);
        put_off(l, reply.json);
        if (!l->is_put_off)
            answered(l);
        l->next_report = clock_sec() + interval(l, REPORT_SEC);
    } else {
        l->next_report = clock_sec() + pause_sec(l->failures++);
    }
    reply_release(&reply);
    cJSON_Delete(body);
}

enum status link_end(struct attempt_link *l, const struct link_end *end, double cpu_sec, struct error *err) {
    struct reply reply;
    double sent;
    cJSON *body = cJSON_CreateObject();
    json_add_int(body, "seq", l->seq);
    json_add_string(body, "way", end->way);
    json_add_int(body, "code", end->code);
    json_add_string(body, "reason", end->reason);
    json_add_string(body, "last_words", end->log_tail);
    json_add_number(body, "cpu_sec", cpu_sec);
    reply_init(&reply);
    enum status status = post(l, "end", body, "last_seq", &reply, &sent, err);
    for (int tries = 0; status != STATUS_OK && link_state(l) == LINK_OPEN; tries++) {
        poll(NULL, 0, (int)(1e3 * pause_sec(tries)));
        status = post(l, "end", body, "last_seq", &reply, &sent, err);
    }
    reply_release(&reply);
    cJSON_Delete(body);
    return status;
}
