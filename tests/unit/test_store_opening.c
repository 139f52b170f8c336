/* test_store_opening.c -- state.db: older schemas, a second one that opens it, threads, the order of turns. */
#include "server/store/store.h"

#include <fcntl.h>
#include <limits.h>
#include <pthread.h>
#include <sqlite3.h>

#include "common/buf.h"
#include "common/protocol.h"
#include "tests/unit/store_rig.h"

/* --- opening ----------------------------------------------------------------------------------- */

static void run_sql(const char *dir, const char *sql) {
    char *path = file_join(dir, "state.db"), *message = NULL;
    sqlite3 *db;
    CHECK(sqlite3_open(path, &db) == SQLITE_OK);
    CHECK_THAT(sqlite3_exec(db, sql, NULL, NULL, &message) == SQLITE_OK, "%s", message);
    sqlite3_free(message);
    sqlite3_close(db);
    mem_free(path);
}

/* What a database of the first schema did not know yet. */
static void check_migrated(struct store *store) {
    struct disk_use unknown[4];
    size_t count;
    OK(store_disk_unknown(store, 0, 4, unknown, &count, &err));
    CHECK(count == 2 && unknown[0].job_id == 0 && unknown[0].scene_id[0] && unknown[1].job_id == 7);
    CHECK(unknown[0].bytes == -1 && unknown[1].bytes == -1);
    struct scene_row scene;
    OK(store_scene_get(store, SCENE_A, &scene, &err));
    CHECK_STRING(scene.name, "room");
    scene_row_release(&scene);
}

static void test_opening(void) {
    char *dir = fresh_dir();
    struct store *store, *second;
    OK(store_open(&store, dir, &err));
    IS(store_open(&second, dir, &err), STATUS_UNAVAILABLE); /* one connection, ever */
    CHECK(second == NULL);
    store_close(store);

    run_sql(dir, "PRAGMA user_version=1000");
    IS(store_open(&store, dir, &err), STATUS_CONFLICT);
    CHECK(strstr(err.message, "1000") != NULL && err.hint[0]);
    drop_dir(dir);

    /* A folder of the first schema. */
    dir = fresh_dir();
    struct buf text;
    buf_init(&text, 1 << 20);
    OK(file_read("tests/data/state_v1.sql", &text, &err));
    run_sql(dir, buf_text(&text));
    buf_release(&text);
    OK(store_open(&store, dir, &err));
    struct job job;
    OK(store_job_get(store, 7, &job, &err));
    CHECK_STRING(job.name, "first");
    CHECK(job.priority == 5 && job.attempt == 2 && job.state == JOB_RUNNING);
    job_release(&job);
    struct output_row row;
    OK(store_output_get(store, 7, "base_color.exr", &row, &err));
    output_row_release(&row);
    OK(store_event_add(store, 7, 2, EVENT_LOG, "{}", &err));
    struct replay replay = {0};
    OK(store_event_list(store, 7, 0, 10, replay_one, &replay, &err));
    CHECK(replay.count == 2 && replay.last == 42);
    check_migrated(store);
    store_close(store);
    drop_dir(dir);

    /* Damage in the middle of the file is found at the start. */
    dir = fresh_dir();
    OK(store_open(&store, dir, &err));
    add_ready_scene(store, SCENE_A);
    for (int i = 0; i < 50; i++)
        add_job(store, SCENE_A, 0);
    store_close(store);
    char *path = file_join(dir, "state.db");
    int fd = open(path, O_RDWR);
    char noise[8192];
    memset(noise, 0x5a, sizeof noise);
    CHECK(pwrite(fd, noise, sizeof noise, 12288) == (ssize_t)sizeof noise);
    close(fd);
    IS(store_open(&store, dir, &err), STATUS_CORRUPT);
    fd = open(path, O_RDWR | O_TRUNC);
    CHECK(write(fd, noise, sizeof noise) == (ssize_t)sizeof noise);
    close(fd);
    IS(store_open(&store, dir, &err), STATUS_CORRUPT);
    mem_free(path);
    drop_dir(dir);
}

/* Many threads submit with one key: one job comes of it. */
struct race {
    struct store *store;
    int64_t id[50];
    int made;
};

static void *submit_many(void *argument) {
    struct race *race = argument;
    struct job_new new = {
        .scene_id = SCENE_A, .name = "n", .labels = "{}", .settings = "{}", .max_attempts = 3, .request_sha256 = "r"};
    for (int i = 0; i < 50; i++) {
        char key[16];
        bool replayed;
        struct error mine;
        snprintf(key, sizeof key, "key-%d", i);
        new.idempotency_key = key;
        if (store_job_add(race->store, &new, 1000, &race->id[i], &replayed, &mine) != STATUS_OK)
            abort();
        race->made += !replayed;
    }
    return NULL;
}

static void test_threads(void) {
    char *dir = fresh_dir();
    struct store *store;
    OK(store_open(&store, dir, &err));
    add_ready_scene(store, SCENE_A);
    struct race race[4] = {{0}};
    pthread_t thread[4];
    int made = 0;
    for (int i = 0; i < 4; i++) {
        race[i].store = store;
        CHECK(pthread_create(&thread[i], NULL, submit_many, &race[i]) == 0);
    }
    for (int i = 0; i < 4; i++) {
        pthread_join(thread[i], NULL);
        made += race[i].made;
        CHECK(memcmp(race[i].id, race[0].id, sizeof race[0].id) == 0);
    }
    CHECK(made == 50);
    store_close(store);
    drop_dir(dir);
}

/* The waiting jobs in the order in which they would start. */
static void check_turns(struct store *store, const int64_t *wanted, size_t count) {
    for (size_t i = 0; i < count; i++) {
        int64_t id;
        OK(store_job_next(store, 0, NULL, &id, &err));
        CHECK_THAT(id == wanted[i], "place %zu: job %lld, wanted %lld", i, (long long)id, (long long)wanted[i]);
        OK(store_job_pause(store, id, &err));
    }
    for (size_t i = 0; i < count; i++)
        OK(store_job_resume(store, wanted[i], NULL, &err));
}

static void test_order(void) {
    char *dir = fresh_dir();
    struct store *store;
    OK(store_open(&store, dir, &err));
    add_ready_scene(store, SCENE_A);
    int64_t a = add_job(store, SCENE_A, 0), b = add_job(store, SCENE_A, 0);
    int64_t c = add_job(store, SCENE_A, 0), d = add_job(store, SCENE_A, 5);
    check_turns(store, (int64_t[]){d, a, b, c}, 4);
    struct job_patch patch = {.priority = INT_MIN, .shared = -1, .place = JOB_PLACE_FIRST};
    OK(store_job_patch(store, c, -1, &patch, &err));
    check_turns(store, (int64_t[]){d, c, a, b}, 4);
    patch.place = JOB_PLACE_LAST;
    OK(store_job_patch(store, a, -1, &patch, &err));
    check_turns(store, (int64_t[]){d, c, b, a}, 4);
    patch.place = JOB_PLACE_BEFORE;
    patch.before_id = b;
    OK(store_job_patch(store, a, -1, &patch, &err));
    check_turns(store, (int64_t[]){d, c, a, b}, 4);
    OK(store_job_patch(store, d, -1, &patch, &err)); /* leaves its priority for b's */
    check_turns(store, (int64_t[]){c, a, d, b}, 4);
    int64_t e = add_job(store, SCENE_A, 0);
    check_turns(store, (int64_t[]){c, a, d, b, e}, 5);
    IS(store_job_patch(store, b, -1, &patch, &err), STATUS_INPUT);
    OK(store_job_cancel(store, e, &err));
    patch.before_id = e;
    IS(store_job_patch(store, a, -1, &patch, &err), STATUS_INPUT);
    store_close(store);
    drop_dir(dir);
}

int main(void) {
    test_order();
    test_opening();
    test_threads();
    return check_result();
}
