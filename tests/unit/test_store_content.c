/* test_store_content.c -- what state.db holds besides jobs: scenes, uploads. */
#include <limits.h>
#include <math.h>
#include <sqlite3.h>

#include "common/protocol.h"
#include "tests/unit/store_changes.h"

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

int main(void) {
    test_scenes();
    test_share();
    test_reading();
    test_reading_and_jobs();
    test_sent_again();
    test_upload_offset();
    test_expired_no_more();
    return check_result();
}
