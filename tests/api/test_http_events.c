/* Event streams: snapshot, replay without gap or repetition, end, keep-alives, idle. */
#include <pthread.h>

#include "common/json.h"
#include "tests/api/event_rig.h"

/* Undoes the chunked coding of what came so far, in place; whole chunks only. */
static char *unchunk(const struct buf *reply) {
    const char *at = rig_body(reply), *end = buf_text(reply) + reply->length;
    char *out = mem_alloc(reply->length + 1), *to = out;
    for (;;) {
        char *digits_end;
        size_t size = strtoul(at, &digits_end, 16);
        if (digits_end == at || size == 0 || digits_end + 2 + size + 2 > end)
            break;
        memcpy(to, digits_end + 2, size);
        to += size;
        at = digits_end + 2 + size + 2;
    }
    *to = '\0';
    return out;
}

static void check_life(struct rig *rig) {
    struct error err;
    struct buf reply;
    int64_t job = rig_job(rig);
    buf_init(&reply, 1 << 20);
    int fd = open_stream(rig, job, "", "");
    rig_receive(fd, &reply, "\"snapshot\":true");
    CHECK(rig_status(&reply) == 200);
    CHECK(strstr(buf_text(&reply), "Content-Type: text/event-stream\r\n"));
    CHECK(strstr(buf_text(&reply), "X-Accel-Buffering: no\r\n"));
    CHECK(strstr(buf_text(&reply), "retry: 3000\nid: "));
    CHECK(strstr(buf_text(&reply), "event: state\ndata: {\""));
    CHECK(strstr(buf_text(&reply), "\"state\":\"queued\""));

    int attempt = rig_run_job(rig, job);
    rig_receive(fd, &reply, "\"state\":\"running\"");
    add_metric(rig, job, attempt, 7);
    rig_receive(fd, &reply, "\"step\":7");
    CHECK(strstr(buf_text(&reply), "event: metric\n"));
    rig_must(store_job_succeed(rig->store, job, attempt, "", &err), &err, "store_job_succeed");
    rig_receive(fd, &reply, "\r\n0\r\n\r\n"); /* the end of the body, without closing */
    CHECK(strstr(buf_text(&reply), "\"state\":\"succeeded\""));
    CHECK(strstr(buf_text(&reply), "\r\n0\r\n\r\n"));
    close(fd);
    buf_release(&reply);

    /* Too late for anything: 204 stops an EventSource; one that never saw it gets the snapshot. */
    int64_t last = 0;
    char fields[64], path[64];
    rig_must(store_event_last(rig->store, job, &last, &err), &err, "store_event_last");
    snprintf(path, sizeof path, "/v1/jobs/%lld/events", (long long)job);
    snprintf(fields, sizeof fields, "Last-Event-ID: %lld\r\n", (long long)last);
    CHECK(rig_get(rig, path, fields, &reply) == 204);
    buf_release(&reply);
    CHECK(rig_get(rig, path, "", &reply) == 200);
    CHECK(strstr(buf_text(&reply), "\"state\":\"succeeded\"") && strstr(buf_text(&reply), "\"snapshot\":true"));
    buf_release(&reply);
    CHECK(rig_get(rig, path, "Last-Event-ID: x\r\n", &reply) == 400);
    buf_release(&reply);
    CHECK(rig_get(rig, "/v1/jobs/999/events", "", &reply) == 404);
    buf_release(&reply);
    CHECK(rig_get(rig, "/v1/jobs/9x/events", "", &reply) == 404);
    buf_release(&reply);
}

/* Without following, the stream of a job that goes on ends after what is stored. */
static void check_past(struct rig *rig) {
    struct buf reply;
    int64_t job = rig_job(rig);
    int attempt = rig_run_job(rig, job);
    for (int i = 0; i < 200; i++) /* more than one batch */
        add_metric(rig, job, attempt, i);
    char path[64];
    snprintf(path, sizeof path, "/v1/jobs/%lld/events?after=0&follow=0", (long long)job);
    CHECK(rig_get(rig, path, "", &reply) == 200);
    CHECK(strstr(buf_text(&reply), "\"step\":199") && strstr(buf_text(&reply), "\r\n0\r\n\r\n"));
    buf_release(&reply);
    snprintf(path, sizeof path, "/v1/jobs/%lld/events?follow=2", (long long)job);
    CHECK(rig_get(rig, path, "", &reply) == 400);
    buf_release(&reply);
    struct error err;
    rig_must(store_job_succeed(rig->store, job, attempt, "", &err), &err, "store_job_succeed");
}

/* All that is stored, as JSON lines: each parses, ids grow, the snapshot has the asked-for id. */
static void check_ndjson(struct rig *rig) {
    struct error err;
    struct buf reply;
    int64_t job = rig_job(rig);
    int attempt = rig_run_job(rig, job);
    for (int i = 0; i < 200; i++)
        add_metric(rig, job, attempt, i);
    /* As an attempt of an earlier release may have left it: only the row says which job and attempt it is of. */
    rig_must(store_event_add(rig->store, job, attempt, EVENT_LOG,
                             "{\"message\":\"forged\",\"job\":99999,\"attempt\":77,"
                             "\"at\":\"1970-01-01T00:00:00.000Z\"}",
                             &err),
             &err, "store_event_add");
    rig_must(store_job_fail(rig->store, job, attempt, "no", "why", &err), &err, "store_job_fail");
    char path[64];
    snprintf(path, sizeof path, "/v1/jobs/%lld/events?after=0", (long long)job);
    CHECK(rig_get(rig, path, "Accept: application/x-ndjson\r\n", &reply) == 200);
    char *text = unchunk(&reply), *rest = text;
    double previous = -1;
    int count = 0, metrics = 0;
    while (*rest) {
        char *line = strsep(&rest, "\n");
        cJSON *event;
        CHECK_THAT(json_parse(line, strlen(line), "line", &event, &err) == STATUS_OK, "%s", line);
        double id = cJSON_GetNumberValue(cJSON_GetObjectItem(event, "id"));
        const cJSON *data = cJSON_GetObjectItem(event, "data");
        CHECK_THAT(id > previous && (count > 0 || id == 0), "id %.0f after %.0f", id, previous);
        const char *at = cJSON_GetStringValue(cJSON_GetObjectItem(data, "at"));
        CHECK_THAT(at && strncmp(at, "1970", 4) != 0 &&
                       cJSON_GetNumberValue(cJSON_GetObjectItem(data, "job")) == (double)job &&
                       cJSON_GetNumberValue(cJSON_GetObjectItem(data, "attempt")) <= attempt,
                   "%s", line);
        metrics += strcmp(cJSON_GetStringValue(cJSON_GetObjectItem(event, "event")), EVENT_METRIC) == 0;
        previous = id;
        count++;
        cJSON_Delete(event);
        if (!rest)
            break;
    }
    CHECK_THAT(metrics == 200, "%d of 200", metrics);
    mem_free(text);
    buf_release(&reply);
}

#define STORM_EVENTS 1000

struct publisher {
    struct rig *rig;
    int64_t job;
    int attempt;
};

static void *publish(void *user) {
    struct publisher *p = user;
    struct error err;
    for (int i = 0; i < STORM_EVENTS; i++)
        add_metric(p->rig, p->job, p->attempt, i);
    rig_must(store_job_succeed(p->rig->store, p->job, p->attempt, "", &err), &err, "store_job_succeed");
    return NULL;
}

/* Takes the ids of events out of text, checks that they are the next ones, returns the last. */
static int64_t follow(char *text, int64_t last, int *metrics) {
    for (char *at = text; (at = strstr(at, "id: ")) != NULL; at += 4) {
        long long id = strtoll(at + 4, NULL, 10);
        char *end = strstr(at, "\n\n");
        if (!end)
            break; /* cut off: comes again */
        *end = '\0';
        bool is_snapshot = strstr(at, "\"snapshot\":true") != NULL;
        if (is_snapshot)
            CHECK_THAT(id == last, "snapshot %lld after %lld", id, (long long)last);
        else
            CHECK_THAT(id > last, "event %lld after %lld", id, (long long)last);
        if (strstr(at, "event: metric")) {
            int step = -1;
            sscanf(strstr(at, "\"step\":"), "\"step\":%d", &step);
            CHECK_THAT(step == *metrics, "step %d where %d was due", step, *metrics);
            (*metrics)++;
        }
        last = id;
        at = end - 3;
    }
    return last;
}

/* Connections that break off at any byte while events pour in: the parts make the whole. */
static void check_reconnects(struct rig *rig) {
    struct publisher p = {rig, rig_job(rig), 0};
    p.attempt = rig_run_job(rig, p.job);
    pthread_t thread;
    pthread_create(&thread, NULL, publish, &p);
    int64_t last = 0;
    int metrics = 0, connections = 0;
    for (int status = 200; status == 200; connections++) {
        char fields[64];
        struct buf reply;
        buf_init(&reply, 1 << 24);
        snprintf(fields, sizeof fields, "Last-Event-ID: %lld\r\n", (long long)last);
        int fd = open_stream(rig, p.job, "", fields);
        rig_receive(fd, &reply, "\r\n\r\n");
        /* Some more, a different amount each time; a late one reads to the end. */
        status = rig_status(&reply);
        size_t enough = reply.length + (status == 200 ? (size_t)(connections * 977 % 9000) : 0);
        char chunk[4096];
        ssize_t got = 1;
        while (got > 0 && reply.length < enough && !strstr(buf_text(&reply), "\r\n0\r\n\r\n")) {
            got = recv(fd, chunk, sizeof chunk, 0);
            buf_append(&reply, chunk, got > 0 ? (size_t)got : 0);
        }
        close(fd);
        char *text = unchunk(&reply);
        last = follow(text, last, &metrics);
        mem_free(text);
        buf_release(&reply);
        CHECK(status == 200 || status == 204);
        if (connections > 5000)
            break;
    }
    pthread_join(thread, NULL);
    CHECK_THAT(metrics == STORM_EVENTS, "%d of %d events, %d connections", metrics, STORM_EVENTS, connections);
}

/* What an EventSource keeps over its connections to one URL (HTML, 9.2). */
struct event_source {
    const char *path;
    char last_id[24]; /* "": none yet */
    int64_t newest;   /* id of the last event that was not a snapshot */
    int events, repeated, connections;
};

/* One connection, read to its end or cut after `most` bytes; its status. */
static int source_connect(struct rig *rig, struct event_source *source, size_t most) {
    char fields[96] = "Accept: text/event-stream\r\n", chunk[512];
    struct buf reply;
    size_t used = strlen(fields);
    if (*source->last_id)
        snprintf(fields + used, sizeof fields - used, "Last-Event-ID: %s\r\n", source->last_id);
    int fd = rig_connect(rig);
    char *text = mem_printf("GET %s HTTP/1.1\r\nHost: localhost\r\n%s\r\n", source->path, fields);
    rig_send(fd, text, strlen(text));
    mem_free(text);
    buf_init(&reply, 1 << 24);
    rig_receive(fd, &reply, "\r\n\r\n");
    for (ssize_t got = 1;
         rig_status(&reply) == 200 && got > 0 && reply.length < most && !strstr(buf_text(&reply), "\r\n0\r\n\r\n");) {
        got = recv(fd, chunk, sizeof chunk, 0);
        buf_append(&reply, chunk, got > 0 ? (size_t)got : 0);
    }
    close(fd);
    source->connections++;
    text = unchunk(&reply);
    for (char *at = text, *end; (at = strstr(at, "id: ")) && (end = strstr(at, "\n\n")); at = end) {
        int64_t id = strtoll(at + 4, NULL, 10);
        snprintf(source->last_id, sizeof source->last_id, "%lld", (long long)id);
        *end++ = '\0';
        if (strstr(at, "\"snapshot\":true"))
            continue;
        source->events++;
        source->repeated += id <= source->newest;
        source->newest = id > source->newest ? id : source->newest;
    }
    mem_free(text);
    int status = rig_status(&reply);
    buf_release(&reply);
    return status;
}

/* A page asks for everything with ?after=0, once: its EventSource comes back with the same URL and what
 * it saw last, after each cut and after the end, where 204 tells it to stay away. */
static void check_event_source(struct rig *rig) {
    struct error err;
    int64_t job = rig_job(rig);
    int attempt = rig_run_job(rig, job);
    for (int i = 0; i < 100; i++)
        add_metric(rig, job, attempt, i);
    rig_must(store_job_succeed(rig->store, job, attempt, "", &err), &err, "store_job_succeed");
    char path[64], fields[64];
    snprintf(path, sizeof path, "/v1/jobs/%lld/events?after=0", (long long)job);
    struct event_source source = {.path = path};
    int status = 200;
    while (status == 200 && source.connections < 100)
        status = source_connect(rig, &source, (size_t)3000 + 500 * (size_t)source.connections);
    CHECK_THAT(status == 204, "still %d after %d connections", status, source.connections);
    /* queued, running, the metrics, succeeded */
    CHECK_THAT(source.events == 103 && source.repeated == 0, "%d events, %d of them again", source.events,
               source.repeated);

    /* Of all jobs, where nothing ends. */
    struct event_source all = {.path = "/v1/events?after=0&follow=0"};
    for (int i = 0; i < 3; i++)
        CHECK(source_connect(rig, &all, SIZE_MAX) == 200);
    CHECK_THAT(all.events >= 103 && all.repeated == 0, "%d events, %d of them again", all.events, all.repeated);

    /* An empty one is none; both must be well formed. */
    struct buf reply;
    snprintf(fields, sizeof fields, "Last-Event-ID: %lld\r\n", (long long)source.newest);
    CHECK(rig_get(rig, path, fields, &reply) == 204);
    buf_release(&reply);
    CHECK(rig_get(rig, path, "Last-Event-ID:\r\n", &reply) == 200 && strstr(buf_text(&reply), "\"step\":0,"));
    buf_release(&reply);
    CHECK(rig_get(rig, "/v1/events?after=x", fields, &reply) == 400);
    buf_release(&reply);
}

int main(void) {
    struct rig rig;
    rig_start(&rig, &rig_patient, 1);
    check_life(&rig);
    check_past(&rig);
    check_ndjson(&rig);
    check_reconnects(&rig);
    check_event_source(&rig);
    return check_result();
}
