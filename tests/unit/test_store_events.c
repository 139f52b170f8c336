/* test_store_events.c -- what state.db holds of what jobs tell: events, outputs, messages. */
#include <limits.h>
#include <math.h>
#include <sqlite3.h>

#include "common/protocol.h"
#include "tests/unit/store_changes.h"

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
    test_events();
    test_outbox();
    test_pruned_twice();
    test_output_digest();
    return check_result();
}
