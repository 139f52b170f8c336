/* test_housekeeping.c -- what is of no use any more goes, and nothing else does; while a call of SQLite or of the
 * system fails, or all from one on, it stays, the log says why, and it goes the next time. */
#include "server/job/housekeeping.h"

#include <time.h>

#include "server/data/attempt_folder.h"

#include "tests/unit/fault_rig.h"

/* An hour and a minute from now, so that everything that has ended is old. */
time_t time(time_t *seconds) {
    struct timespec now;
    clock_gettime(CLOCK_REALTIME, &now);
    if (seconds)
        *seconds = now.tv_sec + 3660;
    return now.tv_sec + 3660;
}

struct job_files {
    int64_t id;
    char *dir, *checkpoint, *journal, *scrap, *output;
};

static void write_file(const char *path) { OK(file_replace(path, "x", 1, &err)); }

/* The files that a job has, and one that was being written. */
static struct job_files make_files(int64_t id) {
    struct job_files f = {.id = id, .dir = mem_printf("%s/jobs/%lld/attempt-1", dir, (long long)id)};
    f.checkpoint = file_join(f.dir, "checkpoint/checkpoint.db");
    f.journal = file_join(f.dir, "checkpoint/checkpoint.db-journal");
    f.scrap = file_join(f.dir, "out/compare/a.png.part");
    f.output = file_join(f.dir, "out/compare/a.png");
    char *out = file_join(f.dir, "out/compare"), *checkpoint = file_join(f.dir, "checkpoint");
    OK(file_make_dirs(out, &err));
    OK(file_make_dirs(checkpoint, &err));
    write_file(f.checkpoint);
    write_file(f.journal);
    write_file(f.scrap);
    write_file(f.output);
    OK(store_output_put(store, id, 1, EVENT_OUTPUT, "compare/a.png", 1, SCENE_A, "image/png", &err));
    mem_free(checkpoint);
    mem_free(out);
    return f;
}

static void release_files(struct job_files *f) {
    mem_free(f->dir);
    mem_free(f->checkpoint);
    mem_free(f->journal);
    mem_free(f->scrap);
    mem_free(f->output);
}

static bool is_there(const char *path) { return access(path, F_OK) == 0; }

static int64_t start_job(void) {
    int number;
    int64_t id = add_job("{}", NULL);
    OK(store_job_start(store, id, "process", &number, &err));
    OK(store_event_add(store, id, number, EVENT_LOG, "{\"level\":\"info\",\"message\":\"x\"}", &err));
    return id;
}

static void count_one(void *user, int64_t id, int64_t at_ms, int attempt, const char *type, const char *data) {
    (void)id, (void)at_ms, (void)attempt, (void)type, (void)data;
    ++*(int *)user;
}

static int count_events(int64_t id) {
    int count = 0;
    OK(store_event_list(store, id, 0, 1000, count_one, &count, &err));
    return count;
}

/* --- by time ----------------------------------------------------------------------------------------- */

static struct job_files running, failed;
static int running_events;

/* False where there is no n-th call. */
static bool run_once(bool is_sql, long n, bool stays) {
    int64_t id = start_job();
    struct job_files f = make_files(id);
    OK(store_job_succeed(store, id, 1, "", &err));
    log_forget();
    strike(is_sql, n, stays);
    housekeeping_run(&config, store);
    bool struck = lift(), is_left = is_there(f.checkpoint) || is_there(f.journal) || count_events(id) > 1;
    /* A job that cannot be looked up is in doubt: its checkpoint stays, and no word of it. */
    CHECK_THAT(struck || !is_left, "call %ld: something is left", n);
    CHECK_THAT(!is_left || is_sql || log_count("warning: ") > 0, "call %ld: something is left, and nobody knows", n);
    CHECK_THAT(log_count("warning: ") <= 4, "call %ld: the log is filled", n);
    CHECK(is_there(f.output) && is_there(running.checkpoint) && is_there(failed.checkpoint));
    housekeeping_run(&config, store);
    CHECK_THAT(!is_there(f.checkpoint) && !is_there(f.journal) && count_events(id) == 1, "call %ld: it does not go", n);
    CHECK(is_there(f.output) && is_there(running.checkpoint) && is_there(failed.checkpoint));
    CHECK(count_events(running.id) == running_events);
    char *job = mem_printf("%s/jobs/%lld", dir, (long long)id);
    OK(file_remove_tree(job, &err));
    mem_free(job);
    release_files(&f);
    return struck;
}

/* --- after a kill -------------------------------------------------------------------------------------- */

static bool kill_once(bool is_sql, long n, bool stays) {
    write_file(running.scrap);
    log_forget();
    strike(is_sql, n, stays);
    housekeeping_after_kill(&config, store);
    bool struck = lift();
    CHECK_THAT(struck || !is_there(running.scrap), "call %ld: something is left", n);
    CHECK(is_there(running.checkpoint) && is_there(running.output) && is_there(failed.scrap));
    /* It may be asked again what a file is; then none is removed by mistake. */
    CHECK_THAT(!is_there(running.scrap) || !is_sql || log_count("what killed jobs left cannot be removed") == 1,
               "call %ld: nobody knows", n);
    housekeeping_after_kill(&config, store);
    CHECK(!is_there(running.scrap) && is_there(running.checkpoint) && is_there(running.output));
    return struck;
}

static void check_words(void) {
    log_forget();
    write_file(running.scrap);
    strike_system("unlink", 1, false);
    housekeeping_drop_temporary(running.dir);
    CHECK(lift() && is_there(running.scrap) && log_count(running.scrap) == 1);
    housekeeping_drop_temporary(running.dir);
    CHECK(!is_there(running.scrap));
    strike_system("unlinkat", 1, false);
    err = (struct error){0};
    CHECK(attempt_folder_drop_checkpoint(dir, running.id, &err) == STATUS_IO && strstr(err.message, running.journal));
    CHECK(lift() && is_there(running.checkpoint) && is_there(running.journal));
    OK(attempt_folder_drop_checkpoint(dir, running.id, &err));
    OK(attempt_folder_drop_checkpoint(dir, running.id, &err)); /* there is none */
    CHECK(!is_there(running.checkpoint) && !is_there(running.journal) && is_there(running.output));
}

int main(void) {
    long strikes = 0;
    rig_start();
    running = make_files(start_job());
    failed = make_files(start_job());
    OK(store_job_fail(store, failed.id, 1, "no", "", &err));
    running_events = count_events(running.id);
    for (int way = 0; way < 4; way++) {
        for (long n = 1; run_once(way % 2, n, way / 2) && check_failed_count == 0; n++)
            strikes++;
        for (long n = 1; kill_once(way % 2, n, way / 2) && check_failed_count == 0; n++)
            strikes++;
    }
    check_words();
    release_files(&running);
    release_files(&failed);
    rig_stop();
    printf("%ld calls failed\n", strikes);
    return check_result();
}
