/* test_store_content.c -- what state.db holds besides jobs: scenes, events, outputs. */
#include <math.h>
#include <sqlite3.h>

#include "common/protocol.h"
#include "tests/unit/store_rig.h"

/* --- scenes ------------------------------------------------------------------------------------ */

static void test_scenes(void) {
    char *dir = fresh_dir();
    struct store *store;
    struct scene_row row, rows[2];
    bool existed, is_gone;
    char cursor[128];
    size_t count;
    OK(store_open(&store, dir, &err));
    struct unchecked waiting[2];
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
    OK(store_scene_reject(store, SCENE_A, "[{\"file\":\"a\",\"reason\":\"b\"}]", &err));
    IS(store_scene_ready(store, SCENE_A, "{}", &err), STATUS_CONFLICT);
    OK(store_scene_add(store, SCENE_A, "one", 10, 0, &existed, &err)); /* checked again */
    CHECK(existed);
    OK(store_scene_get(store, SCENE_A, &row, &err));
    CHECK(row.state == SCENE_CHECKING && row.bytes == 10);
    CHECK_STRING(row.problems, "[]");
    scene_row_release(&row);
    OK(store_scene_ready(store, SCENE_A, "{\"n\":1}", &err));
    OK(store_scene_add(store, SCENE_A, "other name", 10, 0, &existed, &err));
    OK(store_scene_get(store, SCENE_A, &row, &err));
    CHECK(row.state == SCENE_READY);
    CHECK_STRING(row.name, "one");
    CHECK_STRING(row.facts, "{\"n\":1}");
    scene_row_release(&row);

    OK(store_scene_find(store, NULL, "aaaa", &row, &err));
    scene_row_release(&row);
    IS(store_scene_find(store, NULL, "aaa", &row, &err), STATUS_NOT_FOUND);
    IS(store_scene_find(store, NULL, "bbbb", &row, &err), STATUS_NOT_FOUND);
    IS(store_scene_find(store, NULL, "aaaa%", &row, &err), STATUS_NOT_FOUND);
    OK(store_scene_add(store, SCENE_C, "odd", 1, 0, &existed, &err));
    IS(store_scene_find(store, NULL, "aaaa", &row, &err), STATUS_CONFLICT);
    OK(store_scene_reject(store, SCENE_C, "[]", &err));
    OK(store_scene_delete(store, SCENE_C, -1, false, &is_gone, &err));

    OK(store_scene_add(store, SCENE_B, "two", 1, 0, &existed, &err));
    cursor[0] = '\0';
    size_t seen = 0;
    do {
        char at[128];
        memcpy(at, cursor, sizeof at);
        OK(store_scene_list(store, NULL, at, 1, rows, &count, cursor, &err));
        seen += count;
        for (size_t i = 0; i < count; i++)
            scene_row_release(&rows[i]);
    } while (cursor[0] && seen < 10);
    CHECK(seen == 2);
    IS(store_scene_list(store, NULL, "1; DROP TABLE", 1, rows, &count, cursor, &err), STATUS_INPUT);

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
        OK(store_token_add(store, i ? "bob" : "alice", ROLE_USER, token, &id, &err));
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

/* A scene is kept as long after its last owner has sent it as after the first. */
static void test_sent_again(void) {
    char *dir = fresh_dir(), *path = file_join(dir, "state.db");
    struct store *store;
    struct scene_row row;
    sqlite3 *db;
    bool existed;
    OK(store_open(&store, dir, &err));
    OK(store_keep(store, 1000, 0, 1000, &err));
    OK(store_scene_add(store, SCENE_A, "one", 10, 1, &existed, &err));
    OK(store_scene_ready(store, SCENE_A, "{}", &err));
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
    CHECK(existed && row.created_ms == 5000 && row.expires_ms > 1600000000000);
    scene_row_release(&row);
    store_close(store);
    mem_free(path);
    drop_dir(dir);
}

/* --- events and outputs ------------------------------------------------------------------------ */

static int64_t changed_job;
static int changed_count;
static void on_change(void *user, int64_t job_id) {
    (void)user;
    changed_job = job_id;
    changed_count++;
}

static void test_events(void) {
    char *dir = fresh_dir();
    struct store *store;
    int attempt;
    OK(store_open(&store, dir, &err));
    store_on_change(store, on_change, NULL);
    add_ready_scene(store, SCENE_A);
    CHECK(changed_job == 0 && changed_count == 2);
    int64_t id = add_job(store, SCENE_A, 0), other = add_job(store, SCENE_A, 0);
    OK(store_job_start(store, id, &attempt, &err));
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

    /* Outputs: names are plain, a later one replaces an earlier one, each has its event. */
    static const char *const bad[] = {"", "/etc/passwd", "../x", "a/../b", "a//b", ".hidden",
                                      "a/.b", "a b", "x/", "caf\xc3\xa9"};
    for (size_t i = 0; i < sizeof bad / sizeof bad[0]; i++)
        IS(store_output_put(store, id, attempt, EVENT_OUTPUT, bad[i], 1, SCENE_A, "t", &err),
           STATUS_INPUT);
    IS(store_output_put(store, id, attempt, EVENT_OUTPUT, "a", 1, "short", "t", &err), STATUS_INPUT);
    OK(store_output_put(store, id, attempt, EVENT_PREVIEW, "preview/a.png", 1, SCENE_A, "image/png",
                        &err));
    OK(store_output_put(store, id, attempt, EVENT_PREVIEW, "preview/a.png", 2, SCENE_B, "image/png",
                        &err));
    OK(store_output_put(store, id, attempt, EVENT_OUTPUT, "base_color.exr", 3, SCENE_A,
                        "image/x-exr", &err));
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
    CHECK(events_of(store, id) == (int64_t)whole.count + 3);
    store_close(store);
    drop_dir(dir);
}

/* --- messages ------------------------------------------------------------------------------------ */

/* A message that is put off has its time, whatever else is due: the one who is called may hang. */
static void test_outbox(void) {
    char *dir = fresh_dir();
    struct store *store;
    struct outbox_row first, second;
    struct job_new new = {.scene_id = SCENE_A, .name = "n", .labels = "{}", .settings = "{}", .max_attempts = 2,
                          .webhook_url = "http://x/", .webhook_secret = "0123456789abcdef"};
    int64_t id;
    int attempt;
    bool replayed, gave_up;
    double wait;
    OK(store_open(&store, dir, &err));
    add_ready_scene(store, SCENE_A);
    OK(store_outbox_wait(store, &wait, &err));
    CHECK(isinf(wait));
    OK(store_job_add(store, &new, 1000, &id, &replayed, &err));
    OK(store_job_start(store, id, &attempt, &err));
    OK(store_job_succeed(store, id, attempt, &err));
    OK(store_outbox_next(store, 0, &first, &err));
    OK(store_outbox_next(store, first.id, &second, &err));
    CHECK(strstr(first.body, "running") && strstr(second.body, "succeeded"));
    OK(store_outbox_settle(store, first.id, false, &gave_up, &err));
    CHECK(!gave_up);
    OK(store_outbox_wait(store, &wait, &err));
    CHECK_THAT(wait > 0.1 && wait <= 2.0, "%g s until the next time", wait);
    OK(store_outbox_settle(store, first.id, true, &gave_up, &err));
    OK(store_outbox_wait(store, &wait, &err));
    CHECK(isinf(wait));

    /* Who never answers is given up one day, and not before. */
    int tries = 0;
    for (gave_up = false; !gave_up && tries < 100; tries++) {
        OK(store_outbox_settle(store, second.id, false, &gave_up, &err));
        OK(store_outbox_wait(store, &wait, &err));
        CHECK(isinf(wait) == gave_up);
    }
    CHECK_THAT(tries == 30, "%d tries", tries);
    outbox_row_release(&first);
    outbox_row_release(&second);
    store_close(store);
    drop_dir(dir);
}

int main(void) {
    test_scenes();
    test_share();
    test_sent_again();
    test_events();
    test_outbox();
    return check_result();
}
