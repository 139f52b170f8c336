/* test_attempt_folder.c -- the folders of attempts: a checkpoint has one owner, which it changes by one rename; what no
 * row names goes, and nothing else; folders of an older version become folders of attempts, wherever that is
 * interrupted. Calls of the system fail, one after the other. */
#include "server/data/attempt_cleanup.h"
#include "server/data/attempt_folder.h"

#include "server/data/layout.h"
#include "server/store/internal.h"
#include "tests/unit/fault_rig.h"

static void put(const char *path) {
    char *whole = file_join(dir, path), *slash = strrchr(whole, '/');
    *slash = '\0';
    OK(file_make_dirs(whole, &err));
    *slash = '/';
    OK(file_replace(whole, path, strlen(path), &err));
    mem_free(whole);
}

static bool is_there(const char *path) {
    char *whole = file_join(dir, path);
    bool there = access(whole, F_OK) == 0;
    mem_free(whole);
    return there;
}

static char *inside(int64_t id, const char *name) { return mem_printf("jobs/%lld/%s", (long long)id, name); }

static void put_in(int64_t id, const char *name) {
    char *path = inside(id, name);
    put(path);
    mem_free(path);
}

static bool has(int64_t id, const char *name) {
    char *path = inside(id, name);
    bool there = is_there(path);
    mem_free(path);
    return there;
}

static int start_attempt(int64_t id) {
    int number = 0;
    OK(store_job_start(store, id, "process", &number, &err));
    return number;
}

/* False where there is no n-th call of that name. */
static bool hand_over_once(const char *call, long n) {
    int64_t id = add_job("{}", NULL);
    CHECK(start_attempt(id) == 1);
    OK(attempt_folder_begin(dir, id, 1, &err));
    char *holder;
    OK(attempt_folder_with_checkpoint(dir, id, &holder, &err));
    CHECK(!holder);
    put_in(id, "attempt-1/checkpoint/checkpoint.db");
    put_in(id, "attempt-1/checkpoint/checkpoint.db-journal");
    strike_system(call, n, false);
    enum status status = attempt_folder_begin(dir, id, 2, &err);
    bool struck = lift();
    CHECK_THAT(struck || status == STATUS_OK, "%s %ld", call, n);
    bool first = has(id, "attempt-1/checkpoint/checkpoint.db"), second = has(id, "attempt-2/checkpoint/checkpoint.db");
    CHECK_THAT(first != second, "%s %ld: %d checkpoints", call, n, first + second);
    CHECK(has(id, first ? "attempt-1/checkpoint/checkpoint.db-journal" : "attempt-2/checkpoint/checkpoint.db-journal"));
    /* The next attempt has it, whichever had it before. */
    OK(attempt_folder_begin(dir, id, 12, &err));
    OK(attempt_folder_begin(dir, id, 12, &err));
    CHECK(has(id, "attempt-12/checkpoint/checkpoint.db") && has(id, "attempt-12/checkpoint/checkpoint.db-journal"));
    CHECK(has(id, "attempt-12/out"));
    OK(attempt_folder_with_checkpoint(dir, id, &holder, &err));
    char *wanted = inside(id, "attempt-12");
    CHECK_STRING(holder, wanted);
    mem_free(wanted);
    mem_free(holder);
    OK(attempt_folder_drop_checkpoint(dir, id, &err));
    OK(attempt_folder_with_checkpoint(dir, id, &holder, &err));
    CHECK(!holder);
    return struck;
}

static void test_hand_over(void) {
    static const char *const calls[] = {"rename", "mkdir", "fsync", "opendir", "lstat"};
    for (size_t i = 0; i < sizeof calls / sizeof *calls; i++)
        for (long n = 1; hand_over_once(calls[i], n) && check_failed_count == 0; n++) {
        }
}

static void announce(int64_t id, int attempt, const char *name) {
    OK(store_output_put(store, id, attempt, EVENT_OUTPUT, name, 1, SCENE_A, "x/y", &err));
}

static void test_tidy(void) {
    int64_t id = add_job("{}", NULL);
    CHECK(start_attempt(id) == 1);
    announce(id, 1, "a.exr");
    announce(id, 1, "preview/b.png");
    put_in(id, "attempt-1/out/a.exr");
    put_in(id, "attempt-1/out/preview/b.png");
    put_in(id, "attempt-1/out/preview/c.png"); /* announced by nobody */
    put_in(id, "attempt-1/out/deep/d.png");
    put_in(id, "attempt-1/job.json");
    put_in(id, "worker.log");
    char *link = mem_printf("%s/jobs/%lld/attempt-1/out/link", dir, (long long)id);
    CHECK(symlink(dir, link) == 0); /* is removed, not followed */
    OK(attempt_cleanup(dir, store, id, 1, &err));
    CHECK(has(id, "attempt-1/out/a.exr") && has(id, "attempt-1/out/preview/b.png") && has(id, "worker.log"));
    CHECK(!has(id, "attempt-1/out/preview/c.png") && !has(id, "attempt-1/out/deep") && access(link, F_OK) != 0);
    CHECK(is_there("state.db"));
    mem_free(link);
    /* The second attempt has written both anew, and one more; the first keeps nothing and goes. */
    OK(store_job_stop(store, id, 1, "", &err));
    CHECK(start_attempt(id) == 2);
    announce(id, 2, "a.exr");
    put_in(id, "attempt-2/out/a.exr");
    put_in(id, "attempt-2/out/preview/b.png");
    OK(attempt_cleanup(dir, store, id, 2, &err));
    CHECK(!has(id, "attempt-1/out/a.exr") && has(id, "attempt-1/out/preview/b.png"));
    CHECK(has(id, "attempt-2/out/a.exr") && !has(id, "attempt-2/out/preview/b.png"));
    put_in(id, "attempt-2/out/preview/b.png");
    announce(id, 2, "preview/b.png");
    OK(attempt_cleanup(dir, store, id, 2, &err));
    CHECK(!has(id, "attempt-1") && has(id, "attempt-2/out/preview/b.png"));
    /* One that has only a checkpoint stays, for the next attempt. */
    put_in(id, "attempt-3/checkpoint/checkpoint.db");
    put_in(id, "attempt-4/job.json");
    OK(attempt_cleanup(dir, store, id, 2, &err));
    CHECK(has(id, "attempt-3/checkpoint/checkpoint.db") && !has(id, "attempt-4"));
}

/* A job as version 16 of state.db had it. */
static int64_t make_former(bool runs) {
    int64_t id = add_job("{}", NULL);
    int number = start_attempt(id);
    OK(store_job_stop(store, id, number, "", &err));
    CHECK(start_attempt(id) == 2);
    announce(id, 2, "preview/a.png");
    if (!runs)
        OK(store_job_succeed(store, id, 2, "", &err));
    OK(sql_run(&store->sql, &err, "DELETE FROM attempts WHERE job_id = ?", "i", id));
    OK(sql_run(&store->sql, &err, "INSERT INTO attempts (job_id, number, executor, phase) VALUES (?, 2, 'process', 0)",
               "i", id));
    put_in(id, "out/preview/a.png");
    put_in(id, "checkpoint.db");
    put_in(id, "checkpoint.db-journal");
    put_in(id, "job.json");
    put_in(id, "worker.log");
    return id;
}

static bool adopt_once(const char *call, long n) {
    int64_t ids[] = {make_former(false), make_former(true)};
    struct attempt_row rows[4];
    size_t count, requeued;
    strike_system(call, n, false);
    enum status status = attempt_folder_adopt(dir, store, &err);
    bool struck = lift();
    CHECK_THAT(status == STATUS_OK || (struck && *err.message), "%s %ld", call, n);
    for (int i = 0; i < 2; i++) /* nobody sees a database without its journal */
        CHECK(!has(ids[i], "attempt-2/checkpoint/checkpoint.db") ||
              has(ids[i], "attempt-2/checkpoint/checkpoint.db-journal"));
    OK(attempt_folder_adopt(dir, store, &err));
    for (int i = 0; i < 2; i++) {
        CHECK(has(ids[i], "attempt-2/out/preview/a.png") && has(ids[i], "attempt-2/checkpoint/checkpoint.db"));
        CHECK(has(ids[i], "attempt-2/checkpoint/checkpoint.db-journal") && has(ids[i], "worker.log"));
        CHECK(!has(ids[i], "out") && !has(ids[i], "checkpoint.db") && !has(ids[i], "checkpoint.db-journal") &&
              !has(ids[i], "job.json") && !has(ids[i], "attempt-2/checkpoint.unready"));
        OK(store_attempt_list(store, ids[i], 4, rows, &count, &err));
        CHECK(count == 1 && rows[0].number == 2 && rows[0].phase == (i ? ATTEMPT_ROW_RUNNING : ATTEMPT_ROW_ENDED));
    }
    OK(store_reconcile(store, NULL, 0, &requeued, &err));
    OK(store_attempt_list(store, ids[1], 4, rows, &count, &err));
    CHECK(requeued > 0 && count == 1 && rows[0].phase == ATTEMPT_ROW_ENDED);
    CHECK_STRING(rows[0].ending, ENDING_RESTARTED);
    OK(store_job_cancel(store, ids[1], &err));
    return struck;
}

static void test_adopt(void) {
    static const char *const calls[] = {"rename", "mkdir", "fsync", "lstat", "unlinkat"};
    for (size_t i = 0; i < sizeof calls / sizeof *calls; i++)
        for (long n = 1; adopt_once(calls[i], n) && check_failed_count == 0; n++) {
        }
    /* A job of which nothing is left but its row; one that has never begun is no attempt's. */
    int64_t id = make_former(false);
    char *job = mem_printf("%s/jobs/%lld", dir, (long long)id);
    OK(file_remove_tree(job, &err));
    OK(attempt_folder_adopt(dir, store, &err));
    CHECK(!has(id, ""));
    mem_free(job);
}

int main(void) {
    rig_start();
    test_hand_over();
    test_tidy();
    test_adopt();
    rig_stop();
    return check_result();
}
