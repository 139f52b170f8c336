/* test_http_global.c -- the stream of all jobs: who sees what, places, long polls; what is no longer
 * kept; replies that wait for a job. */
#include <pthread.h>

#include "common/clock.h"
#include "tests/api/rig.h"

static struct rig rig;
static struct error err;

static int get_as(const char *token, const char *path, struct buf *reply) {
    char *fields = mem_printf("Accept: application/x-ndjson\r\nAuthorization: Bearer %s\r\n", token);
    int status = rig_get(&rig, path, fields, reply);
    mem_free(fields);
    return status;
}

static int64_t job_of(int64_t owner) {
    struct job_new job = {
        .scene_id = RIG_SCENE, .name = "job", .labels = "{}", .settings = "{}", .max_attempts = 2, .owner_id = owner};
    bool replayed;
    int64_t id;
    rig_must(store_job_add(rig.store, &job, 1000, &id, &replayed, &err), &err, "store_job_add");
    return id;
}

static void add_metrics(int64_t job, int attempt, int count) {
    for (int i = 0; i < count; i++)
        rig_must(store_event_add(rig.store, job, attempt, EVENT_METRIC, "{\"series\":\"loss\",\"step\":1,\"value\":1}",
                                 &err),
                 &err, "store_event_add");
}

static int count_of(const struct buf *reply, const char *part) {
    int count = 0;
    for (const char *at = buf_text(reply); (at = strstr(at, part)) != NULL; at++)
        count++;
    return count;
}

static void check_who_sees_what(void) {
    char ann[TOKEN_SIZE], ben[TOKEN_SIZE], root[TOKEN_SIZE], part[40];
    struct caller who;
    struct buf reply;
    int64_t id;
    rig_must(store_token_add(rig.store, "ann", ROLE_USER, 0, ann, &id, &err), &err, "token");
    rig_must(store_token_add(rig.store, "ben", ROLE_VIEWER, 0, ben, &id, &err), &err, "token");
    rig_must(store_token_add(rig.store, "root", ROLE_ADMIN, 0, root, &id, &err), &err, "token");
    rig_must(store_token_find(rig.store, ann, &who, &err), &err, "find");
    int64_t before, hers = job_of(who.user_id), nobodys = job_of(0);
    rig_must(store_event_last(rig.store, 0, &before, &err), &err, "last");
    add_metrics(hers, rig_run_job(&rig, hers), 100);
    add_metrics(nobodys, rig_run_job(&rig, nobodys), 3);
    CHECK(rig_get(&rig, "/v1/events?after=0&follow=0", "", &reply) == 401);
    buf_release(&reply);
    CHECK(get_as(ann, "/v1/events?after=0&follow=0", &reply) == 200);
    snprintf(part, sizeof part, "\"job\":%lld,", (long long)hers);
    CHECK_THAT(count_of(&reply, part) == 102, "%d of hers", count_of(&reply, part));
    snprintf(part, sizeof part, "\"job\":%lld,", (long long)nobodys);
    CHECK(count_of(&reply, part) == 0);
    buf_release(&reply);
    CHECK(get_as(ben, "/v1/events?after=0&follow=0", &reply) == 200);
    CHECK(count_of(&reply, "\"event\":") == 0);
    buf_release(&reply);
    CHECK(get_as(root, "/v1/events?after=0&follow=0", &reply) == 200);
    CHECK(count_of(&reply, "\"event\":") == 107);
    buf_release(&reply);

    /* Sharing shows it from then on. */
    struct job_patch patch = {.priority = 0, .shared = 1};
    rig_must(store_job_patch(rig.store, hers, -1, &patch, &err), &err, "share");
    char *path = mem_printf("/v1/events?after=%lld&follow=0", (long long)before);
    CHECK(get_as(ben, path, &reply) == 200);
    CHECK(count_of(&reply, "\"event\":") == 101);
    mem_free(path);
    buf_release(&reply);
    CHECK(get_as(root, "/v1/events?after=x", &reply) == 400);
    buf_release(&reply);
    CHECK(get_as(root, "/v1/events?wait=301", &reply) == 400);
    buf_release(&reply);
}

static void *act_later(void *user) {
    usleep(300000);
    rig_run_job(&rig, *(int64_t *)user);
    return NULL;
}

static void check_waiting(void) {
    struct buf reply;
    pthread_t later;
    int64_t job = rig_job(&rig);
    char *path = mem_printf("/v1/jobs/%lld?wait=60", (long long)job);
    pthread_create(&later, NULL, act_later, &job);
    CHECK(rig_get(&rig, path, "If-None-Match: \"rev-1\"\r\n", &reply) == 200);
    CHECK(strstr(buf_text(&reply), "\"state\":\"running\""));
    buf_release(&reply);
    pthread_join(later, NULL);
    /* Another revision is there already: at once, with its ETag. */
    CHECK(rig_get(&rig, path, "If-None-Match: \"rev-1\"\r\n", &reply) == 200);
    CHECK(strstr(buf_text(&reply), "ETag: \"rev-2\""));
    buf_release(&reply);
    mem_free(path);
    /* Time passes, and the job is as it was. */
    path = mem_printf("/v1/jobs/%lld?wait=1", (long long)job);
    CHECK(rig_get(&rig, path, "", &reply) == 200);
    CHECK(strstr(buf_text(&reply), "\"state\":\"running\""));
    buf_release(&reply);
    mem_free(path);
    CHECK(rig_get(&rig, "/v1/jobs/1?wait=0", "", &reply) == 400);
    buf_release(&reply);

    /* Events: the poll ends with the first. */
    int64_t other = rig_job(&rig), last;
    rig_must(store_event_last(rig.store, 0, &last, &err), &err, "last");
    pthread_create(&later, NULL, act_later, &other);
    path = mem_printf("/v1/events?after=%lld&wait=60", (long long)last);
    CHECK(rig_get(&rig, path, "", &reply) == 200);
    CHECK(strstr(buf_text(&reply), "\"state\":\"running\"") && strstr(buf_text(&reply), "\r\n0\r\n\r\n"));
    buf_release(&reply);
    mem_free(path);
    pthread_join(later, NULL);
    path = mem_printf("/v1/jobs/%lld/events?wait=1", (long long)other);
    CHECK(rig_get(&rig, path, "", &reply) == 200); /* nothing came: the snapshot only */
    CHECK(count_of(&reply, "event: ") == 1 && strstr(buf_text(&reply), "\r\n0\r\n\r\n"));
    buf_release(&reply);
    mem_free(path);
}

/* The job is removed meanwhile: there is nothing to say, and that does not look like a whole reply. */
static void check_waiting_in_vain(void) {
    struct buf reply;
    struct job now;
    int64_t job = rig_job(&rig);
    rig_must(store_job_cancel(rig.store, job, &err), &err, "store_job_cancel");
    rig_must(store_job_get(rig.store, job, &now, &err), &err, "store_job_get");
    char *request =
        mem_printf("GET /v1/jobs/%lld?wait=60 HTTP/1.1\r\nHost: localhost\r\nIf-None-Match: \"rev-%lld\"\r\n\r\n",
                   (long long)job, (long long)now.revision);
    job_release(&now);
    int fd = rig_connect(&rig);
    buf_init(&reply, 1 << 16);
    rig_send(fd, request, strlen(request));
    rig_receive(fd, &reply, "\r\n\r\n");
    rig_must(store_job_delete(rig.store, job, &err), &err, "store_job_delete");
    rig_receive(fd, &reply, NULL);
    CHECK_STRING(rig_body(&reply), "");
    close(fd);
    buf_release(&reply);
    mem_free(request);
}

/* Whoever has seen more than there ever was, before a backup was put back, is told so, too. */
static void check_ahead(int64_t job) {
    struct buf reply;
    int64_t newest;
    rig_must(store_event_newest(rig.store, &newest, &err), &err, "newest");
    char *line = mem_printf("id: %lld\nevent: resync", (long long)newest);
    char *path = mem_printf("/v1/jobs/%lld/events?after=%lld&follow=0", (long long)job, (long long)newest + 1);
    CHECK(rig_get(&rig, path, "", &reply) == 200);
    CHECK_THAT(strstr(buf_text(&reply), line), "%s", buf_text(&reply));
    buf_release(&reply);
    CHECK(rig_get(&rig, "/v1/events?follow=0", "Last-Event-ID: 123456789012\r\n", &reply) == 200);
    CHECK_THAT(strstr(buf_text(&reply), line), "%s", buf_text(&reply));
    buf_release(&reply);
    mem_free(path);
    path = mem_printf("/v1/events?after=%lld&follow=0", (long long)newest);
    CHECK(rig_get(&rig, path, "", &reply) == 200 && count_of(&reply, "resync") == 0);
    buf_release(&reply);
    mem_free(path);
    mem_free(line);
}

/* Age: the last event of a job that has ended stays. */
static void check_age(int64_t job, int attempt) {
    struct buf reply;
    bool more = true;
    rig_must(store_job_succeed(rig.store, job, attempt, "", &err), &err, "succeed");
    for (int i = 0; i < 10 && more; i++)
        rig_must(store_event_prune(rig.store, INT64_MAX, &more, &err), &err, "prune");
    CHECK(!more);
    char *path = mem_printf("/v1/jobs/%lld/events?after=0", (long long)job);
    CHECK(rig_get(&rig, path, "", &reply) == 200);
    CHECK(count_of(&reply, "event: ") == 3); /* snapshot, resync, succeeded */
    CHECK(strstr(buf_text(&reply), "\r\n0\r\n\r\n"));
    buf_release(&reply);
    mem_free(path);
}

/* The oldest events are gone: whoever asks for them is told so, and goes on without a gap. */
static void check_resync(void) {
    struct buf reply;
    int64_t job = rig_job(&rig), first;
    rig_must(store_event_last(rig.store, job, &first, &err), &err, "last");
    int attempt = rig_run_job(&rig, job);
    store_keep_events(rig.store, 100);
    add_metrics(job, attempt, 500);
    char *path = mem_printf("/v1/jobs/%lld/events?after=%lld&follow=0", (long long)job, (long long)first);
    CHECK(rig_get(&rig, path, "", &reply) == 200);
    const char *resync = strstr(buf_text(&reply), "event: resync");
    CHECK(resync && strstr(buf_text(&reply), "\"snapshot\":true") < resync);
    int kept = count_of(&reply, "event: metric");
    CHECK_THAT(kept >= 100 && kept < 100 + 64, "%d events are kept", kept);
    /* The resync's id is the one before the first that is kept. */
    long long gone = 0, next = 0;
    const char *id = resync;
    while (id && id > buf_text(&reply) && strncmp(id, "id: ", 4) != 0)
        id--;
    CHECK(id && sscanf(id, "id: %lld", &gone) == 1);
    const char *after = strstr(resync, "\nid: ");
    CHECK(after && sscanf(after, "\nid: %lld", &next) == 1 && next == gone + 1);
    buf_release(&reply);
    mem_free(path);
    /* Who has that one gets no resync; the stream of all jobs has the same rule. */
    path = mem_printf("/v1/jobs/%lld/events?after=%lld&follow=0", (long long)job, gone);
    CHECK(rig_get(&rig, path, "", &reply) == 200);
    CHECK(count_of(&reply, "resync") == 0 && count_of(&reply, "event: metric") == kept);
    buf_release(&reply);
    mem_free(path);
    CHECK(rig_get(&rig, "/v1/events?after=1&follow=0", "", &reply) == 200);
    CHECK(count_of(&reply, "event: resync") == 1);
    buf_release(&reply);
    check_ahead(job);
    check_age(job, attempt);
}

int main(void) {
    rig_start(&rig, &rig_patient, 60);
    rig_scene(&rig);
    check_waiting();
    check_waiting_in_vain();
    check_resync();
    rig_stop(&rig);
    rig_start(&rig, &rig_patient, 60);
    rig_scene(&rig);
    check_who_sees_what();
    rig_stop(&rig);
    return check_result();
}
