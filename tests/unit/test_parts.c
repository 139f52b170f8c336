/* test_parts.c -- jobs that are split: which attempt begins next, what becomes of a part and of the job when one ends,
 * and what an older data folder, a restart and a user's wishes do to them. */
#include <math.h>
#include <string.h>
#include <unistd.h>

#include "server/store/remote.h"

#include "common/output_names.h"
#include "server/store/store.h"
#include "tests/unit/store_rig.h"

#define DIGEST "0123456789abcdef0123456789abcdef0123456789abcdef0123456789abcdef"

static struct store *store;

static int64_t add_render(void) {
    int64_t source = add_job(store, SCENE_A, 9), id = 0;
    int attempt;
    bool replayed;
    OK(store_job_start(store, source, "process", &attempt, &err));
    OK(store_output_put(store, source, attempt, EVENT_OUTPUT, OUTPUT_MESH, 100, DIGEST, "model/x", &err));
    OK(store_job_succeed(store, source, attempt, "", &err));
    struct job_new new = {.kind = JOB_RENDER,
                          .source_id = source,
                          .scene_id = SCENE_A,
                          .name = "n",
                          .labels = "{}",
                          .settings = "{\"executor\":\"slurm\"}",
                          .max_attempts = 2};
    OK(store_job_add(store, &new, 1000, &id, &replayed, &err));
    return id;
}

static struct job_part part_of(int64_t id, int attempt) {
    struct job_part part;
    OK(store_part_of(store, id, attempt, &part, &err));
    return part;
}

static int start(int64_t id, int wanted_part) {
    int attempt = 0;
    OK(store_job_start(store, id, "process", &attempt, &err));
    int found = part_of(id, attempt).part;
    CHECK_THAT(found == wanted_part, "attempt %d is of part %d, wanted %d", attempt, found, wanted_part);
    return attempt;
}

static void check_job(int64_t id, enum job_state state, int done, const char *reason) {
    struct job job;
    OK(store_job_get(store, id, &job, &err));
    CHECK_THAT(job.state == state && job.parts_done == done, "%s, %d parts done: %s", job_state_name(job.state),
               job.parts_done, job.reason);
    CHECK_THAT(strncmp(job.reason, reason, strlen(reason)) == 0 && (*reason || !job.reason[0]), "\"%s\"", job.reason);
    job_release(&job);
}

static int64_t next(const char *executors) {
    const struct job_lane lane = {.executors = executors};
    int64_t id = 0;
    return store_job_next(store, 0, &lane, &id, &err) == STATUS_OK ? id : 0;
}

/* A job with `parts` parts of 10 pictures, none begun. */
static int64_t add_split(int parts) {
    int64_t id = add_render();
    int attempt = start(id, 0);
    OK(store_job_split(store, id, attempt, 10, parts, DIGEST, &err));
    check_job(id, JOB_RUNNING, 0, "");
    return id;
}

static void test_ranges(void) {
    int64_t id = add_render(), at = 0;
    int attempt = start(id, 0), number;
    IS(store_job_split(store, id, attempt, 10, 1, DIGEST, &err), STATUS_INPUT);
    IS(store_job_split(store, id, attempt, 2, 3, DIGEST, &err), STATUS_INPUT);
    IS(store_job_split(store, id, attempt, 10, 3, "abc", &err), STATUS_INPUT);
    IS(store_job_split(store, id, attempt + 1, 10, 3, DIGEST, &err), STATUS_CONFLICT);
    OK(store_job_split(store, id, attempt, 10, 3, DIGEST, &err));
    for (int i = 1; i <= 3; i++) {
        struct job_part part = part_of(id, start(id, i));
        CHECK(part.first == at && part.count >= 3 && part.pictures == 10 && strcmp(part.digest, DIGEST) == 0);
        at += part.count;
    }
    CHECK(at == 10);
    IS(store_job_start(store, id, "process", &number, &err), STATUS_CONFLICT); /* every part has its attempt */
    IS(store_job_split(store, id, 2, 10, 2, DIGEST, &err), STATUS_CONFLICT);
    OK(store_job_cancel(store, id, &err));
    for (int i = 2; i <= 4; i++)
        OK(store_job_stop(store, id, i, "", &err));
    check_job(id, JOB_CANCELLED, 0, "");
}

/* A part begins on another machine: the job has run since it was split. */
static void claim(int64_t id, int attempt) {
    struct job before, after;
    struct remote_row row = {.job_id = id, .number = attempt, .executor = "slurm", .name = "name", .lease_sec = 60};
    const struct remote_key key = {id, attempt, DIGEST, "aa"};
    OK(store_job_get(store, id, &before, &err));
    OK(store_remote_begin(store, &row, DIGEST, &err));
    usleep(5000);
    OK(store_remote_claim(store, &key, "node7", &row, &err));
    OK(store_job_get(store, id, &after, &err));
    CHECK(before.started_ms > 0 && after.started_ms == before.started_ms);
    job_release(&before);
    job_release(&after);
}

/* Its parts run anywhere its user wants, itself here; whoever waits for a place waits for its parts too. */
static void test_turns(void) {
    int64_t id = add_render(), wanted = 0;
    CHECK(next(" process ") == id && next(" slurm ") == 0);
    OK(store_job_split(store, id, start(id, 0), 10, 2, DIGEST, &err));
    CHECK(next(" process ") == 0 && next(" slurm ") == id);
    OK(store_attempts_wanted(store, &wanted, &err));
    CHECK(wanted == 2);
    int first = start(id, 1), second = start(id, 2);
    CHECK(next(" slurm ") == 0);
    claim(id, second);
    OK(store_job_succeed(store, id, first, "", &err));
    check_job(id, JOB_RUNNING, 1, "");
    CHECK(next(NULL) == 0); /* the whole waits for the last of them */
    IS(store_event_add(store, id, first, EVENT_LOG, "{}", &err), STATUS_CONFLICT);
    OK(store_event_add(store, id, second, EVENT_LOG, "{}", &err));
    OK(store_job_succeed(store, id, second, "", &err));
    check_job(id, JOB_RUNNING, 2, "");
    CHECK(next(" process ") == id);
    OK(store_job_yield(store, id, "", &err)); /* its place was taken */
    check_job(id, JOB_QUEUED, 2, "");
    CHECK(next(" process ") == id);
    int whole = start(id, 0);
    IS(store_job_yield(store, id, "", &err), STATUS_CONFLICT);
    IS(store_job_split(store, id, whole, 10, 2, DIGEST, &err), STATUS_CONFLICT);
    OK(store_job_succeed(store, id, whole, "", &err));
    check_job(id, JOB_SUCCEEDED, 2, "");
    OK(store_job_retry(store, id, 2, "render", NULL, &err)); /* it is split anew */
    check_job(id, JOB_QUEUED, 0, "");
    start(id, 0);
    OK(store_job_cancel(store, id, &err));
    OK(store_job_stop(store, id, whole + 1, "", &err));
}

/* One part that crashes too often takes the job with it, after the others have ended. */
static void test_failure(void) {
    int64_t id = add_split(3);
    struct running list[4];
    size_t count;
    int first = start(id, 1), second = start(id, 2);
    OK(store_job_crash(store, id, first, "why", "", 0, &err));
    check_job(id, JOB_RUNNING, 0, "");
    first = start(id, 1);
    CHECK(first == second + 1);
    OK(store_job_crash(store, id, first, "why", "hint", 1, &err));
    check_job(id, JOB_RUNNING, 0, "");
    CHECK(next(NULL) == 0);
    OK(store_job_running(store, 4, list, &count, &err));
    CHECK(count == 1 && list[0].key.number == second && list[0].wanted == JOB_WANT_PAUSE);
    OK(store_job_stop(store, id, second, "", &err));
    check_job(id, JOB_FAILED, 0, "part 1 of 3: why");
    OK(store_job_retry(store, id, 2, NULL, NULL, &err));
    CHECK(start(id, 0) == first + 1);
    OK(store_job_cancel(store, id, &err));
    OK(store_job_stop(store, id, first + 1, "", &err));
    check_job(id, JOB_CANCELLED, 0, "");

    /* Lost ones are counted by part. */
    id = add_split(2);
    for (int i = 0; i < ATTEMPTS_LOST_MAX; i++) {
        int other = i == 0 ? 0 : start(id, 1);
        first = i == 0 ? start(id, 1) : other;
        OK(store_job_lose(store, id, first, "gone", &err));
    }
    check_job(id, JOB_FAILED, 0, "part 1 of 2: gone");
}

/* What blocks a part pauses the job; a resume tries it again. Its parts that are done stay so. */
static void test_block(void) {
    int64_t id = add_split(2);
    int first = start(id, 1), second = start(id, 2);
    OK(store_job_succeed(store, id, first, "", &err));
    OK(store_job_block(store, id, second, "disk full", "hint", &err));
    check_job(id, JOB_PAUSED, 1, "part 2 of 2: disk full");
    OK(store_job_resume(store, id, NULL, &err));
    start(id, 2);
    OK(store_job_pause(store, id, &err));
    CHECK(next(NULL) == 0);
    OK(store_job_stop(store, id, second + 1, "", &err));
    check_job(id, JOB_PAUSED, 1, "");
    OK(store_job_resume(store, id, NULL, &err));
    start(id, 2);
    OK(store_job_fail(store, id, second + 2, "bad input", "", &err));
    check_job(id, JOB_FAILED, 1, "part 2 of 2: bad input");
}

/* Of a job one of whose attempts outlives the daemon, only the others end. */
static void test_restart(void) {
    int64_t id = add_split(3);
    size_t requeued, count;
    struct running list[4];
    const struct attempt_key kept = {id, 3};
    CHECK(start(id, 1) == 2 && start(id, 2) == 3 && start(id, 3) == 4);
    OK(store_reconcile(store, &kept, 1, &requeued, &err));
    CHECK(requeued == 0);
    OK(store_job_running(store, 4, list, &count, &err));
    CHECK(count == 1 && list[0].key.number == 3 && list[0].wanted == JOB_WANT_RUN);
    CHECK(start(id, 1) == 5);
    OK(store_reconcile(store, NULL, 0, &requeued, &err));
    CHECK(requeued == 1);
    check_job(id, JOB_QUEUED, 0, "the daemon was restarted");
    IS(store_event_add(store, id, 3, EVENT_LOG, "{}", &err), STATUS_CONFLICT);
    OK(store_job_cancel(store, id, &err));
}

static void test_progress(void) {
    int64_t id = add_split(2);
    struct parts_progress all;
    int first = start(id, 1), second = start(id, 2);
    OK(store_part_progress(store, id, first, 1.0, 8.0, &all, &err)); /* 4 pictures in 8 s */
    CHECK(all.done == 1.0 && all.total == 10.0 && fabs(all.eta_sec - 18.0) < 1e-9);
    OK(store_part_progress(store, id, second, 2.0, 3.0, &all, &err)); /* 3 in 3 s */
    CHECK(all.done == 3.0 && fabs(all.eta_sec - 7.0 / 1.5) < 1e-9);
    OK(store_job_succeed(store, id, second, "", &err));
    OK(store_part_progress(store, id, first, 99.0, -1.0, &all, &err));
    CHECK(all.done == 10.0 && all.eta_sec < 0.0);
    IS(store_part_progress(store, id, second, 1.0, 1.0, &all, &err), STATUS_CONFLICT);
}

int main(void) {
    char *dir = fresh_dir();
    OK(store_open(&store, dir, &err));
    add_ready_scene(store, SCENE_A);
    test_ranges();
    test_turns();
    test_failure();
    test_block();
    test_restart();
    test_progress();
    store_close(store);
    drop_dir(dir);
    return check_result();
}
