/* test_store_faults.c -- each call of SQLite that the store makes fails once: what was asked says so by the right
 * status and a sentence, has changed nothing, and works when it is asked again. */
#include "tests/sql_faults.h"
#include "tests/unit/store_steps.h"

/* --- the rounds -------------------------------------------------------------------------------- */

/* The hash of all that the database has. */
static void hash_content(char hex[SHA256_HEX_SIZE]) {
    struct sha256 hash;
    sqlite3_stmt *tables, *rows;
    sqlite3 *db = store->sql.db;
    sha256_init(&hash);
    CHECK(sqlite3_prepare_v2(db, "SELECT name FROM sqlite_schema WHERE type = 'table' ORDER BY name", -1, &tables,
                             NULL) == 0);
    while (sqlite3_step(tables) == SQLITE_ROW) {
        char *query = mem_printf("SELECT * FROM %s", (const char *)sqlite3_column_text(tables, 0));
        CHECK(sqlite3_prepare_v2(db, query, -1, &rows, NULL) == 0);
        while (sqlite3_step(rows) == SQLITE_ROW)
            for (int i = 0; i < sqlite3_column_count(rows); i++) {
                const unsigned char *text = sqlite3_column_text(rows, i);
                sha256_update(&hash, text ? (const char *)text : "NULL",
                              text ? (size_t)sqlite3_column_bytes(rows, i) + 1 : 4);
            }
        sqlite3_finalize(rows);
        mem_free(query);
    }
    sqlite3_finalize(tables);
    sha256_hex(&hash, hex);
}

/* They are prepared anew, which can fail as well. */
static void forget_statements(void) {
    for (size_t i = 0; i < store->sql.statement_count; i++)
        sqlite3_finalize(store->sql.statement[i].stmt);
    store->sql.statement_count = 0;
}

/* Its n-th call fails; false where it has fewer. */
static bool strike(const struct step *step, long n) {
    char before[SHA256_HEX_SIZE], after[SHA256_HEX_SIZE];
    err = (struct error){0};
    hash_content(before);
    forget_statements();
    sql_faults_arm(n);
    enum status status = step->ask();
    if (!sql_faults_lift()) {
        CHECK_THAT(status == STATUS_OK, "%s: %s", step->name, err.message);
        return false;
    }
    enum status wanted = step->kind == IS_VAGUE ? STATUS_IO : sql_fault->status;
    hash_content(after);
    CHECK_THAT(status == wanted || (status != STATUS_OK && step->kind == IS_VAGUE), "%s, call %ld: %s, not %s: %s",
               step->name, n, status_name(status), status_name(wanted), err.message);
    CHECK_THAT(err.status == status && *err.message, "%s, call %ld: no sentence", step->name, n);
    CHECK_THAT(sqlite3_get_autocommit(store->sql.db), "%s, call %ld: its transaction is left open", step->name, n);
    CHECK_THAT(step->kind == IS_MANY || strcmp(before, after) == 0, "%s, call %ld: half of it is done", step->name, n);
    return true;
}

/* Opening: of a folder where there is nothing, and where there is a database. */
static long strike_open(void) {
    bool struck = true;
    long n = 0;
    while (struck && check_failed_count == 0) {
        sql_faults_arm(++n);
        enum status status = store_open(&store, dir, &err);
        struck = sql_faults_lift();
        CHECK_THAT((status == STATUS_OK) == !struck, "opening, call %ld: %s", n, status_name(status));
        if (status == STATUS_OK)
            store_close(store);
    }
    return n;
}

/* What is not there, and what makes no sense. */
static void check_refusals(void) {
    static const char *const progress_[] = {"{", "{\"stage\":7}", "{\"done\":\"x\"}", "{\"total\":\"x\"}",
                                            "{\"eta_sec\":\"x\"}"};
    struct scene_row scenes[1];
    struct upload_row row;
    size_t count;
    char cursor[128], hash[2];
    int number;
    bool is_gone;
    IS(store_job_start(store, 77, "process", &number, &err), STATUS_NOT_FOUND);
    IS(store_job_delete(store, 77, &err), STATUS_NOT_FOUND);
    IS(store_event_add(store, 77, 1, EVENT_LOG, "{}", &err), STATUS_NOT_FOUND);
    IS(store_event_list(store, 77, 0, 9, no_event, NULL, &err), STATUS_OK);
    IS(store_scene_ready(store, SCENE_C, NULL, "{}", &err), STATUS_NOT_FOUND);
    IS(store_scene_patch(store, NULL, SCENE_C, &(struct scene_patch){.name = "x"}, &err), STATUS_NOT_FOUND);
    IS(store_scene_delete(store, SCENE_C, -1, false, &is_gone, &err), STATUS_NOT_FOUND);
    IS(store_scene_list(store, NULL, "yesterday", 1, scenes, &count, cursor, &err), STATUS_INPUT);
    IS(store_upload_list(store, NULL, "", "yesterday", 1, &row, &count, cursor, &err), STATUS_INPUT);
    IS(expire(EXPIRED_SCENE, SCENE_C), STATUS_CONFLICT);
    OK(add_scene());
    IS(store_scene_delete(store, SCENE_A, -1, false, &is_gone, &err), STATUS_CONFLICT);
    OK(ready());
    IS(ready(), STATUS_CONFLICT);
    OK(add_upload());
    IS(store_upload_get(store, UPLOAD, &row, hash, sizeof hash, &err), STATUS_CORRUPT);
    OK(submit());
    OK(start_job());
    for (size_t i = 0; i < sizeof progress_ / sizeof *progress_; i++)
        IS(store_event_add(store, job, attempt, EVENT_PROGRESS, progress_[i], &err), STATUS_INPUT);
}

int main(void) {
    dir = fresh_dir();
    long calls = strike_open();
    calls += strike_open();
    OK(store_open(&store, dir, &err));
    store_keep_events(store, 2);
    for (size_t i = 0; i < sizeof steps / sizeof *steps && check_failed_count == 0; i++)
        for (long n = 1; strike(&steps[i], n) && check_failed_count == 0; n++)
            calls++;
    printf("%ld calls failed\n", calls);
    check_refusals();
    store_close(store);
    drop_dir(dir);
    return check_result();
}
