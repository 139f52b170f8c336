/* test_store.c -- state.db: transitions against the table, fencing, the queue. */
#include "server/store/store.h"

#include <limits.h>

#include "common/buf.h"
#include "common/protocol.h"
#include "tests/unit/store_rig.h"

/* --- transitions ----------------------------------------------------------------------------- */

/* A job in each condition it can be in: the states, and running with each wish. */
enum condition { QUEUED, RUNNING, PAUSING, CANCELLING, PAUSED, SUCCEEDED, FAILED, CANCELLED, CONDITIONS };

static int64_t job_in(struct store *store, enum condition condition, int *attempt) {
    int64_t id = add_job(store, SCENE_A, 0);
    *attempt = 0;
    if (condition == PAUSED)
        OK(store_job_pause(store, id, &err));
    if (condition == CANCELLED)
        OK(store_job_cancel(store, id, &err));
    if (condition == QUEUED || condition == PAUSED || condition == CANCELLED)
        return id;
    OK(store_job_start(store, id, "process", attempt, &err));
    if (condition == PAUSING)
        OK(store_job_pause(store, id, &err));
    if (condition == CANCELLING)
        OK(store_job_cancel(store, id, &err));
    if (condition == SUCCEEDED)
        OK(store_job_succeed(store, id, *attempt, "", &err));
    if (condition == FAILED)
        OK(store_job_fail(store, id, *attempt, "why", "do", &err));
    return id;
}

static enum condition condition_of(struct store *store, int64_t id) {
    static const enum condition plain[] = {
        [JOB_QUEUED] = QUEUED,       [JOB_RUNNING] = RUNNING, [JOB_PAUSED] = PAUSED,
        [JOB_SUCCEEDED] = SUCCEEDED, [JOB_FAILED] = FAILED,   [JOB_CANCELLED] = CANCELLED};
    struct job job;
    OK(store_job_get(store, id, &job, &err));
    enum condition found = plain[job.state];
    if (job.wanted != JOB_WANT_RUN) {
        CHECK(job.state == JOB_RUNNING);
        found = job.wanted == JOB_WANT_PAUSE ? PAUSING : CANCELLING;
    }
    job_release(&job);
    return found;
}

/* For each action, the condition it leads to from each condition; '-' is STATUS_CONFLICT and
 * nothing changed, '=' is STATUS_OK and nothing changed. Letters: Queued Running paUsing
 * caNcelling Paused Succeeded Failed Cancelled. */
static void test_transitions(void) {
    enum action { CANCEL, PAUSE, RESUME, RETRY, AGAIN, EXTEND, START, SUCCEED, FAIL, CRASH, STOP, BLOCK, ACTIONS };
    static const char letters[] = "QRUNPSFC";
    static const char *const table[ACTIONS] = {
        /*           QRUNPSFC */
        [CANCEL] = "CNN=C--=", [PAUSE] = "PU=-=---",  [RESUME] = "==R-Q---", [RETRY] = "------QQ",
        [AGAIN] = "-----QQQ",  [EXTEND] = "-----QQQ", [START] = "R-------",  [SUCCEED] = "-SSC----",
        [FAIL] = "-FFC----",   [CRASH] = "-QPC----",  [STOP] = "-QPC----",   [BLOCK] = "-PPC----",
    };
    char *dir = fresh_dir();
    struct store *store;
    OK(store_open(&store, dir, &err));
    add_ready_scene(store, SCENE_A);
    for (int action = 0; action < ACTIONS; action++) {
        for (int from = 0; from < CONDITIONS; from++) {
            int attempt, started;
            int64_t id = job_in(store, (enum condition)from, &attempt);
            int64_t before = events_of(store, id);
            enum status status = STATUS_INTERNAL;
            switch ((enum action)action) {
            case CANCEL: status = store_job_cancel(store, id, &err); break;
            case PAUSE: status = store_job_pause(store, id, &err); break;
            case RESUME: status = store_job_resume(store, id, NULL, &err); break;
            case RETRY: status = store_job_retry(store, id, 3, NULL, NULL, &err); break;
            case AGAIN: status = store_job_retry(store, id, 3, "report", NULL, &err); break;
            case EXTEND: status = store_job_extend(store, id, 3, "{\"seed\":2}", NULL, &err); break;
            case START: status = store_job_start(store, id, "process", &started, &err); break;
            case SUCCEED: status = store_job_succeed(store, id, attempt, "", &err); break;
            case FAIL: status = store_job_fail(store, id, attempt, "r", "h", &err); break;
            case CRASH: status = store_job_crash(store, id, attempt, "r", "h", 0, &err); break;
            case STOP: status = store_job_stop(store, id, attempt, "r", &err); break;
            case BLOCK: status = store_job_block(store, id, attempt, "r", "h", &err); break;
            case ACTIONS: break;
            }
            char wanted = table[action][from];
            CHECK_THAT((status == STATUS_CONFLICT) == (wanted == '-'), "action %d from %c: %s", action, letters[from],
                       err.message);
            CHECK(status == STATUS_OK || status == STATUS_CONFLICT);
            bool same = wanted == '-' || wanted == '=';
            char found = letters[condition_of(store, id)];
            CHECK_THAT(found == (same ? letters[from] : wanted), "action %d from %c gave %c", action, letters[from],
                       found);
            CHECK_THAT(events_of(store, id) == before + !same, "action %d from %c: events", action, letters[from]);
        }
    }
    store_close(store);
    drop_dir(dir);
}

/* --- the life of attempts -------------------------------------------------------------------- */

static void test_attempts(void) {
    char *dir = fresh_dir();
    struct store *store;
    OK(store_open(&store, dir, &err));
    add_ready_scene(store, SCENE_A);
    int64_t id = add_job(store, SCENE_A, 0);
    int first, second, third;
    struct job job;
    OK(store_job_start(store, id, "process", &first, &err));
    OK(store_job_crash(store, id, first, "signal 11", "", 0, &err));
    OK(store_job_start(store, id, "process", &second, &err));
    CHECK(second == first + 1);

    /* The first attempt's process is still there and reports: every report is refused. */
    IS(store_event_add(store, id, first, EVENT_LOG, "{}", &err), STATUS_CONFLICT);
    IS(store_output_put(store, id, first, EVENT_OUTPUT, "a.exr", 1, SCENE_A, "x/y", &err), STATUS_CONFLICT);
    IS(store_job_succeed(store, id, first, "", &err), STATUS_CONFLICT);
    IS(store_job_fail(store, id, first, "", "", &err), STATUS_CONFLICT);
    IS(store_job_crash(store, id, first, "", "", 0, &err), STATUS_CONFLICT);
    IS(store_job_stop(store, id, first, "", &err), STATUS_CONFLICT);
    IS(store_job_block(store, id, first, "", "", &err), STATUS_CONFLICT);
    CHECK(condition_of(store, id) == RUNNING);

    /* A stop that we asked for costs no attempt, the second crash is the last. */
    OK(store_job_stop(store, id, second, "shutdown", &err));
    OK(store_job_start(store, id, "process", &third, &err));
    OK(store_job_crash(store, id, third, "signal 6", "try less", 0, &err));
    OK(store_job_get(store, id, &job, &err));
    CHECK(job.state == JOB_FAILED && job.attempt == third && job.attempts_left == 0);
    CHECK_STRING(job.reason, "signal 6");
    CHECK_STRING(job.hint, "try less");
    CHECK(job.finished_ms > 0);
    job_release(&job);
    CHECK(strstr((events_of(store, id), last_event), "\"reason\":\"signal 6\"") != NULL);

    /* A retry is a new life, but numbers of attempts are not used again. */
    OK(store_job_retry(store, id, 2, NULL, NULL, &err));
    OK(store_job_start(store, id, "process", &first, &err));
    CHECK(first == third + 1);
    OK(store_job_get(store, id, &job, &err));
    CHECK(job.attempts_left == 2 && job.reason[0] == '\0' && job.finished_ms == 0);
    job_release(&job);
    store_close(store);
    drop_dir(dir);
}

static void test_reconcile(void) {
    char *dir = fresh_dir();
    struct store *store;
    size_t requeued;
    int attempt;
    int64_t id[CONDITIONS];
    OK(store_open(&store, dir, &err));
    add_ready_scene(store, SCENE_A);
    for (int i = 0; i < CONDITIONS; i++)
        id[i] = job_in(store, (enum condition)i, &attempt);
    store_close(store);
    OK(store_open(&store, dir, &err));
    OK(store_reconcile(store, NULL, 0, &requeued, &err));
    CHECK(requeued == 3);
    static const enum condition after[CONDITIONS] = {
        [QUEUED] = QUEUED, [RUNNING] = QUEUED,      [PAUSING] = PAUSED, [CANCELLING] = CANCELLED,
        [PAUSED] = PAUSED, [SUCCEEDED] = SUCCEEDED, [FAILED] = FAILED,  [CANCELLED] = CANCELLED};
    for (int i = 0; i < CONDITIONS; i++)
        CHECK_THAT(condition_of(store, id[i]) == after[i], "condition %d", i);
    struct job job;
    OK(store_job_get(store, id[RUNNING], &job, &err));
    CHECK(job.attempts_left == 2); /* a restart is not the job's fault */
    job_release(&job);
    OK(store_reconcile(store, NULL, 0, &requeued, &err));
    CHECK(requeued == 0);
    store_close(store);
    drop_dir(dir);
}

/* --- jobs -------------------------------------------------------------------------------------- */

/* What the checks of the queue hand on to each other. */
struct queue {
    struct store *store;
    int64_t low, old, young; /* running; by priority -1, 1, 1 */
    int64_t id;              /* waits */
};

static void check_order(struct queue *q) {
    struct store *store = q->store;
    bool existed;
    int64_t next = 0;
    struct running list[8];
    size_t count;
    int attempt;
    IS(store_job_next(store, 0, NULL, &next, &err), STATUS_NOT_FOUND);
    add_ready_scene(store, SCENE_A);
    OK(store_scene_add(store, SCENE_B, "unchecked", 1, 0, &existed, &err));
    int64_t waits = add_job(store, SCENE_B, 100);
    q->low = add_job(store, SCENE_A, -1);
    q->old = add_job(store, SCENE_A, 1);
    q->young = add_job(store, SCENE_A, 1);
    int64_t order[] = {q->old, q->young, q->low};
    for (size_t i = 0; i < 3; i++) {
        OK(store_job_next(store, 0, NULL, &next, &err));
        CHECK(next == order[i]);
        OK(store_job_start(store, next, "process", &attempt, &err));
    }
    IS(store_job_next(store, 0, NULL, &next, &err), STATUS_NOT_FOUND);
    OK(store_scene_reject(store, SCENE_B, NULL, "[]", "{}", &err));
    OK(store_job_next(store, 0, NULL, &next, &err));
    CHECK(next == waits);
    OK(store_job_pause(store, q->young, &err));
    OK(store_job_running(store, 8, list, &count, &err));
    CHECK(count == 3 && list[0].key.job_id == q->low && list[2].wanted == JOB_WANT_PAUSE &&
          list[0].wanted == JOB_WANT_RUN);
    CHECK(list[0].key.number == 1);
}

/* Limits, keys, unknown and rejected scenes. */
static void check_adding(struct queue *q) {
    struct job_new new = {.scene_id = SCENE_A,
                          .name = "n",
                          .labels = "{}",
                          .settings = "{}",
                          .max_attempts = 3,
                          .idempotency_key = "k1",
                          .request_sha256 = "r1"};
    bool replayed;
    int64_t again;
    IS(store_job_add(q->store, &new, 1, &q->id, &replayed, &err), STATUS_LIMIT);
    OK(store_job_add(q->store, &new, 2, &q->id, &replayed, &err));
    CHECK(!replayed);
    /* The same key answers with the same job, even when the queue is full. */
    OK(store_job_add(q->store, &new, 1, &again, &replayed, &err));
    CHECK(replayed && again == q->id);
    new.request_sha256 = "r2";
    IS(store_job_add(q->store, &new, 100, &again, &replayed, &err), STATUS_CONFLICT);
    new.idempotency_key = NULL;
    new.scene_id = SCENE_B;
    IS(store_job_add(q->store, &new, 100, &again, &replayed, &err), STATUS_CONFLICT);
    new.scene_id = "nothing";
    IS(store_job_add(q->store, &new, 100, &again, &replayed, &err), STATUS_NOT_FOUND);
}

static void check_edits(const struct queue *q) {
    struct job job;
    OK(store_job_get(q->store, q->id, &job, &err));
    int64_t revision = job.revision;
    job_release(&job);
    struct job_patch patch = {.name = "new", .priority = INT_MIN, .shared = -1};
    OK(store_job_patch(q->store, q->id, revision, &patch, &err));
    patch.name = "newer";
    IS(store_job_patch(q->store, q->id, revision, &patch, &err), STATUS_CONFLICT);
    patch = (struct job_patch){.labels = "{\"a\":\"b\"}", .priority = 7, .shared = -1};
    OK(store_job_patch(q->store, q->id, -1, &patch, &err));
    OK(store_job_get(q->store, q->id, &job, &err));
    CHECK_STRING(job.name, "new");
    CHECK_STRING(job.labels, "{\"a\":\"b\"}");
    CHECK(job.priority == 7 && job.revision == revision + 2);
    job_release(&job);
    IS(store_job_patch(q->store, 999, -1, &patch, &err), STATUS_NOT_FOUND);
}

static void check_pages(const struct queue *q) {
    struct job jobs[3];
    size_t count;
    OK(store_job_list(q->store, NULL, NULL, 0, 3, jobs, &count, &err));
    CHECK(count == 3 && jobs[0].id == q->id && jobs[2].id == q->old);
    for (size_t i = 0; i < count; i++)
        job_release(&jobs[i]);
    OK(store_job_list(q->store, NULL, &(struct job_filter){.state = JOB_RUNNING, .kind = -1}, q->young, 3, jobs, &count,
                      &err));
    CHECK(count == 2 && jobs[0].id == q->old && jobs[1].id == q->low);
    for (size_t i = 0; i < count; i++)
        job_release(&jobs[i]);
}

static void check_removal(const struct queue *q) {
    struct store *store = q->store;
    struct store_counts counts;
    struct job job;
    IS(store_job_delete(store, q->young, &err), STATUS_CONFLICT);
    OK(store_job_delete(store, q->id, &err));
    IS(store_job_get(store, q->id, &job, &err), STATUS_NOT_FOUND);
    CHECK(events_of(store, q->id) == 0);
    int64_t fresh = add_job(store, SCENE_A, 0);
    CHECK(fresh > q->id);
    OK(store_count(store, &counts, &err));
    CHECK(counts.jobs_by_state[JOB_RUNNING] == 3 && counts.jobs_by_state[JOB_QUEUED] == 2);
    CHECK(counts.scenes_by_state[SCENE_REJECTED] == 1 && counts.attempts == 3);
}

static void test_queue(void) {
    char *dir = fresh_dir();
    struct queue queue;
    OK(store_open(&queue.store, dir, &err));
    check_order(&queue);
    check_adding(&queue);
    check_edits(&queue);
    check_pages(&queue);
    check_removal(&queue);
    OK(store_probe(queue.store, &err));
    store_close(queue.store);
    drop_dir(dir);
}

int main(void) {
    test_transitions();
    test_attempts();
    test_reconcile();
    test_queue();
    return check_result();
}
