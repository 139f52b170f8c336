/* test_store_content.c -- what state.db holds besides jobs: scenes, events, outputs. */
#include <limits.h>
#include <math.h>
#include <sqlite3.h>

#include "common/protocol.h"
#include "tests/unit/store_rig.h"

/* --- scenes ------------------------------------------------------------------------------------ */

/* A scene waits for its check, is rejected, checked again, and ready; a second upload changes nothing then. */
static void check_states(struct store *store) {
    struct scene_row row;
    struct unchecked waiting[2];
    bool existed, is_gone;
    size_t count;
    OK(store_scene_unchecked(store, NULL, 0, 2, waiting, &count, &err));
    CHECK(count == 0);
    OK(store_scene_add(store, SCENE_A, "one", 10, 0, &existed, &err));
    CHECK(!existed);
    OK(store_scene_unchecked(store, NULL, 0, 2, waiting, &count, &err));
    CHECK(count == 1 && waiting[0].owner_id == 0);
    CHECK_STRING(waiting[0].id, SCENE_A);
    OK(store_scene_unchecked(store, waiting, 1, 2, waiting, &count, &err));
    CHECK(count == 0);
    IS(store_scene_delete(store, SCENE_A, -1, false, &is_gone, &err), STATUS_CONFLICT);
    OK(store_scene_reject(store, SCENE_A, NULL, "[{\"file\":\"a\",\"reason\":\"b\"}]", "{}", &err));
    IS(store_scene_ready(store, SCENE_A, NULL, "{}", &err), STATUS_CONFLICT);
    OK(store_scene_add(store, SCENE_A, "one", 10, 0, &existed, &err)); /* checked again */
    CHECK(existed);
    OK(store_scene_get(store, SCENE_A, &row, &err));
    CHECK(row.state == SCENE_CHECKING && row.bytes == 10);
    CHECK_STRING(row.problems, "[]");
    scene_row_release(&row);
    OK(store_scene_ready(store, SCENE_A, NULL, "{\"n\":1}", &err));
    OK(store_scene_add(store, SCENE_A, "other name", 10, 0, &existed, &err));
    OK(store_scene_get(store, SCENE_A, &row, &err));
    CHECK(row.state == SCENE_READY);
    CHECK_STRING(row.name, "one");
    CHECK_STRING(row.facts, "{\"n\":1}");
    scene_row_release(&row);
}

/* By the beginning of its id. */
static void check_find(struct store *store) {
    struct scene_row row;
    bool existed, is_gone;
    OK(store_scene_find(store, NULL, "aaaa", &row, &err));
    scene_row_release(&row);
    IS(store_scene_find(store, NULL, "aaa", &row, &err), STATUS_NOT_FOUND);
    IS(store_scene_find(store, NULL, "bbbb", &row, &err), STATUS_NOT_FOUND);
    IS(store_scene_find(store, NULL, "aaaa%", &row, &err), STATUS_NOT_FOUND);
    OK(store_scene_add(store, SCENE_C, "odd", 1, 0, &existed, &err));
    IS(store_scene_find(store, NULL, "aaaa", &row, &err), STATUS_CONFLICT);
    OK(store_scene_reject(store, SCENE_C, NULL, "[]", "{}", &err));
    OK(store_scene_delete(store, SCENE_C, -1, false, &is_gone, &err));
}

/* Page by page, by cursor. */
static void check_pages(struct store *store, size_t scenes) {
    struct scene_row rows[2];
    char cursor[128] = "";
    size_t count, seen = 0;
    do {
        char at[128];
        memcpy(at, cursor, sizeof at);
        OK(store_scene_list(store, NULL, at, 1, rows, &count, cursor, &err));
        seen += count;
        for (size_t i = 0; i < count; i++)
            scene_row_release(&rows[i]);
    } while (cursor[0] && seen < 10);
    CHECK(seen == scenes);
    IS(store_scene_list(store, NULL, "1; DROP TABLE", 1, rows, &count, cursor, &err), STATUS_INPUT);
}

static void test_scenes(void) {
    char *dir = fresh_dir();
    struct store *store;
    struct scene_row row;
    bool existed, is_gone;
    OK(store_open(&store, dir, &err));
    check_states(store);
    check_find(store);
    OK(store_scene_add(store, SCENE_B, "two", 1, 0, &existed, &err));
    check_pages(store, 2);

    int64_t job = add_job(store, SCENE_A, 0);
    IS(store_scene_delete(store, SCENE_A, -1, false, &is_gone, &err), STATUS_CONFLICT);
    OK(store_job_cancel(store, job, &err));
    OK(store_scene_delete(store, SCENE_A, -1, false, &is_gone, &err));
    IS(store_scene_get(store, SCENE_A, &row, &err), STATUS_NOT_FOUND);
    IS(store_job_retry(store, job, 3, NULL, NULL, &err), STATUS_CONFLICT); /* nothing to work on */
    store_close(store);
    drop_dir(dir);
}

/* Of two who keep a scene one may go while it is checked: it stays, and so does the check. */
static void test_share(void) {
    char *dir = fresh_dir(), token[TOKEN_SIZE];
    struct store *store;
    struct caller who[2];
    struct scene_row row;
    int64_t id;
    bool existed, is_gone;
    OK(store_open(&store, dir, &err));
    for (int i = 0; i < 2; i++) {
        OK(store_token_add(store, i ? "bob" : "alice", ROLE_USER, 0, token, &id, &err));
        OK(store_token_find(store, token, &who[i], &err));
        OK(store_scene_add(store, SCENE_A, "one", 10, who[i].user_id, &existed, &err));
    }
    OK(store_scene_delete(store, SCENE_A, who[0].user_id, false, &is_gone, &err));
    CHECK(!is_gone);
    OK(store_scene_find(store, &who[1], SCENE_A, &row, &err));
    CHECK(row.state == SCENE_CHECKING);
    scene_row_release(&row);
    IS(store_scene_delete(store, SCENE_A, who[1].user_id, false, &is_gone, &err), STATUS_CONFLICT);
    CHECK_THAT(strstr(err.message, "being checked") && !is_gone, "%s", err.message);
    store_close(store);
    drop_dir(dir);
}

static int64_t changed_job;
static int changed_count;
static void on_change(void *user, int64_t job_id) {
    (void)user;
    changed_job = job_id;
    changed_count++;
}

#define OPENCV "{\"axes\":\"opencv\"}"

static enum status read_as(struct store *store, const struct caller *who, const char *reading) {
    return store_scene_patch(store, who, SCENE_A, &(struct scene_patch){.reading = reading}, &err);
}

static void check_scene(struct store *store, enum scene_state state, const char *reading, const char *facts) {
    struct scene_row row;
    OK(store_scene_get(store, SCENE_A, &row, &err));
    CHECK_THAT(row.state == state, "%s", scene_state_name(row.state));
    CHECK_STRING(row.reading, reading);
    CHECK_STRING(row.facts, facts);
    scene_row_release(&row);
}

/* A scene that is to be read otherwise is checked again; a check counts for the reading that it had. */
static void test_reading(void) {
    char *dir = fresh_dir();
    struct store *store;
    bool existed;
    OK(store_open(&store, dir, &err));
    OK(store_scene_add(store, SCENE_A, "one", 10, 0, &existed, &err));
    check_scene(store, SCENE_CHECKING, "{}", "{}");
    OK(store_scene_ready(store, SCENE_A, "{}", "{\"n\":1}", &err));
    OK(read_as(store, NULL, OPENCV));
    check_scene(store, SCENE_CHECKING, OPENCV, "{}");
    OK(store_scene_ready(store, SCENE_A, "{}", "{\"n\":1}", &err)); /* overtaken */
    OK(store_scene_reject(store, SCENE_A, "{}", "[{\"file\":\"a\"}]", "{}", &err));
    OK(store_scene_postpone(store, SCENE_A, "{}", "[{\"file\":\"a\"}]", &err));
    check_scene(store, SCENE_CHECKING, OPENCV, "{}");
    OK(store_scene_set_facts(store, SCENE_A, "{}", "{\"n\":1}", &err)); /* overtaken, too */
    check_scene(store, SCENE_CHECKING, OPENCV, "{}");
    OK(store_scene_set_facts(store, SCENE_A, OPENCV, "{\"n\":0}", &err)); /* seen while it is checked */
    check_scene(store, SCENE_CHECKING, OPENCV, "{\"n\":0}");
    OK(store_scene_reject(store, SCENE_A, OPENCV, "[{\"file\":\"a\"}]", "{\"warnings\":[\"w\"]}", &err));
    OK(store_scene_set_facts(store, SCENE_A, OPENCV, "{\"n\":0}", &err)); /* too late */
    check_scene(store, SCENE_REJECTED, OPENCV, "{\"warnings\":[\"w\"]}");
    OK(read_as(store, NULL, OPENCV)); /* the same, once more */
    check_scene(store, SCENE_CHECKING, OPENCV, "{}");
    OK(store_scene_ready(store, SCENE_A, OPENCV, "{\"n\":2}", &err));

    /* One that comes with the same content counts as well, where it is another. */
    const struct caller nobody = {.role = ROLE_USER};
    store_on_change(store, on_change, NULL);
    changed_count = 0;
    OK(store_scene_give_reading(store, &nobody, SCENE_A, OPENCV, &err));
    CHECK(changed_count == 0);
    check_scene(store, SCENE_READY, OPENCV, "{\"n\":2}");
    OK(store_scene_give_reading(store, &nobody, SCENE_A, "{}", &err));
    CHECK(changed_count == 1);
    check_scene(store, SCENE_CHECKING, "{}", "{}");
    store_close(store);
    drop_dir(dir);
}

/* A job reads its scene in one way to its end, and others' jobs find it as it was when they were queued. */
static void test_reading_and_jobs(void) {
    char *dir = fresh_dir(), token[TOKEN_SIZE];
    struct store *store;
    struct caller alice, admin = {.role = ROLE_ADMIN, .user_id = 77};
    int64_t id, job;
    int attempt;
    OK(store_open(&store, dir, &err));
    OK(store_token_add(store, "alice", ROLE_USER, 0, token, &id, &err));
    OK(store_token_find(store, token, &alice, &err));
    add_ready_scene(store, SCENE_A);
    job = add_job(store, SCENE_A, 0); /* nobody's */
    IS(read_as(store, &alice, OPENCV), STATUS_CONFLICT);
    CHECK_THAT(strstr(err.message, "another user") && *err.hint, "%s", err.message);
    OK(read_as(store, &admin, OPENCV));
    OK(read_as(store, &alice, OPENCV)); /* as it is about to be checked: nobody is held up by that */
    IS(store_job_start(store, job, "process", &attempt, &err), STATUS_CONFLICT); /* while it is checked */
    OK(store_scene_ready(store, SCENE_A, OPENCV, "{}", &err));
    OK(store_job_start(store, job, "process", &attempt, &err));
    IS(read_as(store, &admin, "{}"), STATUS_CONFLICT);
    CHECK_THAT(strstr(err.message, "has begun") && strstr(err.hint, "Cancel"), "%s", err.message);
    OK(store_job_stop(store, job, attempt, "", &err)); /* it waits, with a checkpoint */
    IS(read_as(store, &admin, "{}"), STATUS_CONFLICT);
    IS(store_scene_give_reading(store, &alice, SCENE_A, "{}", &err), STATUS_CONFLICT);
    check_scene(store, SCENE_READY, OPENCV, "{}");
    OK(store_job_cancel(store, job, &err));
    OK(read_as(store, &alice, "{}"));
    check_scene(store, SCENE_CHECKING, "{}", "{}");
    add_job(store, SCENE_A, 0);
    OK(store_scene_give_reading(store, &admin, SCENE_A, OPENCV, &err)); /* whoever's job waits */
    store_close(store);
    drop_dir(dir);
}

/* A scene is kept as long after its last owner has sent it as after the first. */
static void test_sent_again(void) {
    char *dir = fresh_dir(), *path = file_join(dir, "state.db");
    struct store *store;
    struct scene_row row;
    sqlite3 *db;
    bool existed;
    OK(store_open(&store, dir, &err));
    OK(store_retention_set_periods(store, 1000, 0, 1000, &err));
    OK(store_scene_add(store, SCENE_A, "one", 10, 1, &existed, &err));
    OK(store_scene_ready(store, SCENE_A, NULL, "{}", &err));
    store_close(store);
    CHECK(sqlite3_open(path, &db) == SQLITE_OK);
    CHECK(sqlite3_exec(db, "UPDATE scenes SET created_ms = 5000; UPDATE scene_owners SET created_ms = 5000", NULL, NULL,
                       NULL) == SQLITE_OK);
    sqlite3_close(db);
    OK(store_open(&store, dir, &err));
    OK(store_scene_get(store, SCENE_A, &row, &err));
    CHECK(row.expires_ms == 6000);
    scene_row_release(&row);
    OK(store_scene_add(store, SCENE_A, "two", 10, 2, &existed, &err));
    OK(store_scene_get(store, SCENE_A, &row, &err));
    CHECK(!existed && row.created_ms == 5000 && row.expires_ms > 1600000000000);
    scene_row_release(&row);
    store_close(store);
    mem_free(path);
    drop_dir(dir);
}

/* --- events and outputs ------------------------------------------------------------------------ */

/* Names are plain, a later output replaces an earlier one. */
static void check_outputs(struct store *store, int64_t id, int attempt) {
    static const char *const bad[] = {"",        "/etc/passwd", "../x", "a/../b", "a//b",
                                      ".hidden", "a/.b",        "a b",  "x/",     "caf\xc3\xa9"};
    for (size_t i = 0; i < sizeof bad / sizeof bad[0]; i++)
        IS(store_output_put(store, id, attempt, EVENT_OUTPUT, bad[i], 1, SCENE_A, "t", &err), STATUS_INPUT);
    IS(store_output_put(store, id, attempt, EVENT_OUTPUT, "a", 1, "short", "t", &err), STATUS_INPUT);
    OK(store_output_put(store, id, attempt, EVENT_PREVIEW, "preview/a.png", 1, SCENE_A, "image/png", &err));
    OK(store_output_put(store, id, attempt, EVENT_PREVIEW, "preview/a.png", 2, SCENE_B, "image/png", &err));
    OK(store_output_put(store, id, attempt, EVENT_OUTPUT, "base_color.exr", 3, SCENE_A, "image/x-exr", &err));
    struct output_row row, *rows;
    size_t count;
    OK(store_output_get(store, id, "preview/a.png", &row, &err));
    CHECK(row.bytes == 2 && row.attempt == attempt);
    CHECK_STRING(row.sha256, SCENE_B);
    output_row_release(&row);
    IS(store_output_get(store, id, "nothing", &row, &err), STATUS_NOT_FOUND);
    OK(store_output_list(store, id, &rows, &count, &err));
    CHECK(count == 2);
    CHECK_STRING(rows[0].name, "base_color.exr");
    for (size_t i = 0; i < count; i++)
        output_row_release(&rows[i]);
    mem_free(rows);
}

static void test_events(void) {
    char *dir = fresh_dir();
    struct store *store;
    int attempt;
    OK(store_open(&store, dir, &err));
    store_on_change(store, on_change, NULL);
    changed_count = 0;
    add_ready_scene(store, SCENE_A);
    CHECK(changed_job == 0 && changed_count == 2);
    int64_t id = add_job(store, SCENE_A, 0), other = add_job(store, SCENE_A, 0);
    OK(store_job_start(store, id, "process", &attempt, &err));
    CHECK(changed_job == id);
    for (int i = 0; i < 20; i++) {
        char text[128];
        snprintf(text, sizeof text, "{\"stage\":\"refine\",\"done\":%d,\"total\":20,\"eta_sec\":3}", i);
        OK(store_event_add(store, id, attempt, EVENT_PROGRESS, text, &err));
        OK(store_event_add(store, id, attempt, EVENT_METRIC, "{\"step\":1}", &err));
    }
    IS(store_event_add(store, id, attempt, EVENT_PROGRESS, "{\"done\":", &err), STATUS_INPUT);
    struct job job;
    OK(store_job_get(store, id, &job, &err));
    CHECK_STRING(job.stage, "refine");
    CHECK_NEAR(job.progress, 0.95, 1e-9);
    CHECK_NEAR(job.eta_sec, 3.0, 0);
    job_release(&job);

    /* Replay in pieces sees each event once and in order, and only the newest progress. */
    struct replay whole = {0}, pieces = {0};
    OK(store_event_list(store, id, 0, 1000, replay_one, &whole, &err));
    CHECK(whole.count == 2 + 20 + 1 && whole.progress_count == 1);
    size_t before;
    do {
        before = pieces.count;
        OK(store_event_list(store, id, pieces.last, 7, replay_one, &pieces, &err));
    } while (pieces.count > before);
    CHECK(pieces.count == whole.count && pieces.last == whole.last);
    int64_t last = -1;
    OK(store_event_last(store, id, &last, &err));
    CHECK(last == whole.last);
    OK(store_event_last(store, 12345, &last, &err));
    CHECK(last == 0);
    CHECK(events_of(store, other) == 1);

    check_outputs(store, id, attempt);
    CHECK(events_of(store, id) == (int64_t)whole.count + 3);
    store_close(store);
    drop_dir(dir);
}

/* --- messages ------------------------------------------------------------------------------------ */

static void check_delivery(struct store *store, int64_t id, const char *part) {
    struct job job;
    OK(store_job_get(store, id, &job, &err));
    CHECK_THAT(strstr(job.delivery, part), "%s", job.delivery);
    job_release(&job);
}

/* The job tells what became of its messages, and they can be sent again: those that wait, or one of its present
 * state. */
static void check_again(struct store *store, int64_t id) {
    struct outbox_row row;
    bool gave_up;
    double wait;
    const int64_t nobody = 0;
    check_delivery(store, id,
                   "\"state\":\"failed\",\"pending\":0,\"attempts\":30,\"last_status\":null,\"last_error\":\"no\"");
    OK(store_webhook_again(store, id, &err));
    check_delivery(store, id, "\"state\":\"pending\",\"pending\":1");
    IS(store_outbox_next(store, 0, &nobody, 1, &row, &err), STATUS_NOT_FOUND); /* whose turn it is not */
    OK(store_outbox_next(store, 0, NULL, 0, &row, &err));
    CHECK(strstr(row.body, "succeeded") && row.tries == 0 && row.owner_id == 0);
    OK(store_outbox_settle(store, row.id, &(struct outbox_outcome){.status = 500, .reason = "answered 500"}, &gave_up,
                           &err));
    OK(store_outbox_wait(store, &wait, &err));
    CHECK(!gave_up && wait > 0.1);
    check_delivery(store, id, "\"attempts\":1,\"last_status\":500,\"last_error\":\"answered 500\"");
    OK(store_webhook_again(store, id, &err)); /* the one that waits, now */
    check_delivery(store, id, "\"pending\":1");
    OK(store_outbox_settle(store, row.id, &(struct outbox_outcome){.delivered = true, .status = 204}, &gave_up, &err));
    check_delivery(store, id,
                   "\"state\":\"delivered\",\"pending\":0,\"attempts\":1,\"last_status\":204,\"last_error\":null");
    /* What cannot be otherwise is not tried again. */
    outbox_row_release(&row);
    OK(store_webhook_again(store, id, &err));
    OK(store_outbox_next(store, 0, NULL, 0, &row, &err));
    OK(store_outbox_settle(store, row.id, &(struct outbox_outcome){.is_final = true, .reason = "private"}, &gave_up,
                           &err));
    CHECK(gave_up);
    check_delivery(store, id, "\"state\":\"failed\"");
    outbox_row_release(&row);
    IS(store_webhook_again(store, 999, &err), STATUS_CONFLICT);
}

/* A message that is put off has its time, whatever else is due: the one who is called may hang. */
static void test_outbox(void) {
    char *dir = fresh_dir();
    struct store *store;
    struct outbox_row first, second;
    struct job_new new = {.scene_id = SCENE_A,
                          .name = "n",
                          .labels = "{}",
                          .settings = "{}",
                          .max_attempts = 2,
                          .webhook_url = "http://x/",
                          .webhook_secret = "0123456789abcdef"};
    int64_t id;
    int attempt;
    bool replayed, gave_up;
    double wait;
    OK(store_open(&store, dir, &err));
    add_ready_scene(store, SCENE_A);
    OK(store_outbox_wait(store, &wait, &err));
    CHECK(isinf(wait));
    OK(store_job_add(store, &new, 1000, &id, &replayed, &err));
    OK(store_job_start(store, id, "process", &attempt, &err));
    OK(store_job_succeed(store, id, attempt, "", &err));
    OK(store_outbox_next(store, 0, NULL, 0, &first, &err));
    OK(store_outbox_next(store, first.id, NULL, 0, &second, &err));
    CHECK(strstr(first.body, "running") && strstr(second.body, "succeeded"));
    OK(store_outbox_settle(store, first.id, &(struct outbox_outcome){.reason = "no"}, &gave_up, &err));
    CHECK(!gave_up);
    OK(store_outbox_wait(store, &wait, &err));
    CHECK_THAT(wait > 0.1 && wait <= 2.0, "%g s until the next time", wait);
    OK(store_outbox_settle(store, first.id, &(struct outbox_outcome){.delivered = true, .status = 200}, &gave_up,
                           &err));
    OK(store_outbox_wait(store, &wait, &err));
    CHECK(isinf(wait));

    /* Who never answers is given up one day, and not before. */
    int tries = 0;
    for (gave_up = false; !gave_up && tries < 100; tries++) {
        OK(store_outbox_settle(store, second.id, &(struct outbox_outcome){.reason = "no"}, &gave_up, &err));
        OK(store_outbox_wait(store, &wait, &err));
        CHECK(isinf(wait) == gave_up);
    }
    CHECK_THAT(tries == 30, "%d tries", tries);
    check_again(store, id);
    outbox_row_release(&first);
    outbox_row_release(&second);
    store_close(store);
    drop_dir(dir);
}

/* The events of a job that has ended long ago go, but for the last; and again, when it has lived anew. */
static void test_pruned_twice(void) {
    char *dir = fresh_dir();
    struct store *store;
    OK(store_open(&store, dir, &err));
    add_ready_scene(store, SCENE_A);
    int64_t id = add_job(store, SCENE_A, 0);
    for (int life = 0; life < 3; life++) {
        int attempt;
        bool more = true;
        OK(store_job_start(store, id, "process", &attempt, &err));
        for (int i = 0; i < 5; i++)
            OK(store_event_add(store, id, attempt, EVENT_LOG, "{}", &err));
        OK(store_job_fail(store, id, attempt, "x", "", &err));
        CHECK(events_of(store, id) > 5);
        for (int jobs = 0; more; jobs++) {
            OK(store_event_prune(store, INT64_MAX, &more, &err));
            CHECK_THAT(more == (jobs == 0), "life %d: %d jobs had events", life, jobs);
        }
        CHECK(events_of(store, id) == 1);
        CHECK(strstr(last_event, "failed"));
        OK(store_job_retry(store, id, 1, NULL, NULL, &err));
    }
    store_close(store);
    drop_dir(dir);
}

/* What an upload has on disk never becomes less, whoever counts late; and its hash is of so many bytes. */
static void test_upload_offset(void) {
    static const char id[] = "00112233445566778899aabbccddeeff";
    const struct {
        uint64_t counted, received;
        const char *hash, *kept;
    } steps[] = {
        {100, 100, "AAAA", "AAAA"}, {300, 300, "BBBB", "BBBB"}, {200, 300, "CCCC", "BBBB"}, {300, 300, "DDDD", "BBBB"}};
    struct upload_row row = {.name = (char[]){"u"}, .metadata = (char[]){""}, .length = 500};
    char *dir = fresh_dir(), hash[4];
    struct store *store;
    OK(store_open(&store, dir, &err));
    snprintf(row.id, sizeof row.id, "%s", id);
    OK(store_upload_add(store, &row, "0000", 4, &(struct count_limits){9, 9}, &err));
    for (size_t i = 0; i < sizeof steps / sizeof *steps; i++) {
        OK(store_upload_advance(store, id, steps[i].counted, steps[i].hash, 4, &err));
        OK(store_upload_get(store, id, &row, hash, sizeof hash, &err));
        CHECK_THAT(row.received == steps[i].received && memcmp(hash, steps[i].kept, 4) == 0, "step %zu: %llu", i,
                   (unsigned long long)row.received);
        upload_row_release(&row);
    }
    store_close(store);
    drop_dir(dir);
}

/* What was listed as expired and is not any more when it is to be removed stays. */
static void test_expired_no_more(void) {
    char *dir = fresh_dir();
    struct store *store;
    struct expired *list;
    size_t count;
    const int64_t later = INT64_MAX / 2;
    OK(store_open(&store, dir, &err));
    OK(store_retention_set_periods(store, 1000, 1000, 1000, &err));
    OK(store_retention_set_empty_upload(store, 1000, &err));
    add_ready_scene(store, SCENE_A);
    int64_t id = add_job(store, SCENE_A, 0), used;
    bool existed;
    OK(store_job_cancel(store, id, &err));
    OK(store_scene_add(store, SCENE_B, "b", 10, 0, &existed, &err));
    OK(store_scene_ready(store, SCENE_B, NULL, "{}", &err));
    struct upload_row row = {
        .id = "00112233445566778899aabbccddeeff", .name = (char[]){"u"}, .metadata = (char[]){""}, .length = 9};
    OK(store_upload_add(store, &row, "0000", 4, &(struct count_limits){9, 9}, &err));
    OK(store_expired_list(store, later, 9, &list, &count, &err));
    CHECK_THAT(count == 4, "%zu", count);
    const struct retention pinned = {.pin = KEEP_PIN_ON};
    const struct job_patch patch = {.priority = INT_MIN, .shared = -1, .retention = pinned};
    OK(store_job_patch(store, id, -1, &patch, &err));
    OK(store_upload_set_retention(store, row.id, &pinned, &err));
    OK(store_scene_patch(store, NULL, SCENE_A, &(struct scene_patch){NULL, pinned, NULL}, &err));
    used = add_job(store, SCENE_B, 0);
    for (size_t i = 0; i < count; i++) {
        IS(store_expired_delete(store, &list[i], later, &err), STATUS_CONFLICT);
        mem_free(list[i].name);
    }
    mem_free(list);
    CHECK(store_has_files(store, STORE_FILES_SCENE, SCENE_A) && store_has_files(store, STORE_FILES_SCENE, SCENE_B));
    CHECK(store_has_files(store, STORE_FILES_UPLOAD, row.id));
    struct job job;
    OK(store_job_get(store, id, &job, &err));
    job_release(&job);
    OK(store_job_get(store, used, &job, &err));
    job_release(&job);
    store_close(store);
    drop_dir(dir);
}

/* A digest is kept for the announcement that it was computed for, and no other. */
static void test_output_digest(void) {
    const struct file_version version = {.inode = 7, .bytes = 3, .modified_ns = 5, .changed_ns = 6};
    char *dir = fresh_dir();
    struct store *store;
    struct output_row first, row;
    int64_t of = 0;
    int attempt;
    OK(store_open(&store, dir, &err));
    add_ready_scene(store, SCENE_A);
    int64_t id = add_job(store, SCENE_A, 0);
    OK(store_job_start(store, id, "process", &attempt, &err));
    IS(store_output_next_digest(store, &of, &row, &err), STATUS_NOT_FOUND);
    OK(store_output_put(store, id, attempt, EVENT_OUTPUT, "a", 3, SCENE_A, "x/y", &err));
    OK(store_output_next_digest(store, &of, &first, &err));
    CHECK(of == id && strcmp(first.name, "a") == 0 && !*first.digest);
    OK(store_output_put(store, id, attempt, EVENT_OUTPUT, "a", 3, SCENE_B, "x/y", &err)); /* anew, meanwhile */
    OK(store_output_enter_digest(store, id, &first, &version, SCENE_A, &err));
    output_row_release(&first);
    OK(store_output_next_digest(store, &of, &row, &err));
    CHECK_THAT(!*row.digest, "%s", row.digest);
    OK(store_output_enter_digest(store, id, &row, &version, SCENE_C, &err));
    output_row_release(&row);
    IS(store_output_next_digest(store, &of, &row, &err), STATUS_NOT_FOUND);
    OK(store_output_get(store, id, "a", &row, &err));
    CHECK_STRING(row.digest, SCENE_C);
    CHECK(memcmp(&row.version, &version, sizeof version) == 0);
    output_row_release(&row);
    OK(store_output_want_digest(store, id, "a", &err));
    OK(store_output_next_digest(store, &of, &row, &err));
    OK(store_output_enter_digest(store, id, &row, NULL, NULL, &err)); /* there is none to be had */
    output_row_release(&row);
    IS(store_output_next_digest(store, &of, &row, &err), STATUS_NOT_FOUND);
    store_close(store);
    drop_dir(dir);
}

int main(void) {
    test_scenes();
    test_share();
    test_reading();
    test_reading_and_jobs();
    test_sent_again();
    test_events();
    test_outbox();
    test_pruned_twice();
    test_upload_offset();
    test_expired_no_more();
    test_output_digest();
    return check_result();
}
