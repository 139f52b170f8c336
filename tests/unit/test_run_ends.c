/* test_run_ends.c -- what becomes of a job when its run ends in one of the ways that a run may (server/job/run.h), on
 * an executor of the test's that does nothing else; and what the table of attempts says of it. */
#include "server/job/attempt.h"
#include "server/job/outcome.h"
#include "server/job/worker_messages.h"
#include "tests/unit/fault_rig.h"

struct planned {
    struct run run;
    bool has_ended;
};

static struct run_end next; /* how the next run ends */
static struct counters figures;

static void planned_read(struct run *run, run_line_fn *each, void *user) { (void)run, (void)each, (void)user; }
static void planned_ask(struct run *run, enum run_request request) { (void)run, (void)request; }
static bool planned_ended(struct run *run, struct run_end *end, run_line_fn *each, void *user) {
    struct planned *p = (struct planned *)(void *)run;
    static const char line[] = "{\"type\":\"end\",\"status\":\"ok\"}";
    if (p->has_ended)
        return false;
    if (next.way == RUN_EXIT && next.code == 0)
        each(user, line, sizeof line - 1);
    p->has_ended = true;
    *end = next;
    return true;
}
static double planned_cpu_sec(const struct run *run) {
    (void)run;
    return 1.0;
}
static char *planned_last_words(const struct run *run, size_t limit) {
    (void)run, (void)limit;
    return mem_strdup("its words");
}
static void planned_free(struct run *run) { mem_free(run); }

static enum status planned_start(const struct executor *executor, const struct run_work *work, struct run **run,
                                 struct error *why) {
    static const struct run_kind kind = {.read = planned_read,
                                         .ask = planned_ask,
                                         .ended = planned_ended,
                                         .cpu_sec = planned_cpu_sec,
                                         .log_tail = planned_last_words,
                                         .free = planned_free};
    (void)executor, (void)why;
    /* What it is told means the same anywhere. */
    CHECK(*work->folder != '/' && *work->log != '/' && (!work->scene_id || strlen(work->scene_id) == 64));
    char *text = json_text(work->order);
    CHECK_THAT(strstr(text, dir) == NULL, "%s", text);
    mem_free(text);
    struct planned *p = mem_calloc(1, sizeof *p);
    p->run.kind = &kind;
    *run = &p->run;
    return STATUS_OK;
}

static const struct executor elsewhere = {.name = "elsewhere", .start = planned_start};

/* One attempt of the job, which ends so; `stopping`: it was asked to. */
static void attempt_once(int64_t id, enum run_way way, int code, bool stopping) {
    struct scheduler_config with = config;
    struct attempt a = {0};
    with.executor = &elsewhere;
    next = (struct run_end){.way = way, .code = code, .reason = "the node is on fire"};
    OK(attempt_start_job(&a, &with, store, &figures, id, 2, &err));
    CHECK(a.phase == ATTEMPT_ALIVE);
    a.stopping = stopping;
    worker_messages_read(&a, store, &figures);
    CHECK(a.phase == ATTEMPT_ENDED);
    OK(outcome_settle(&a, store, NULL, &figures, &err));
}

static void expect(int64_t id, enum job_state state, int left, const char *reason, const char *ending) {
    struct job job;
    struct attempt_row row;
    size_t count;
    OK(store_job_get(store, id, &job, &err));
    CHECK_THAT(job.state == state && job.attempts_left == left, "%s, %d left: %s", job_state_name(job.state),
               job.attempts_left, job.reason);
    CHECK_THAT(strstr(job.reason, reason) != NULL, "%s", job.reason);
    OK(store_attempt_list(store, id, 1, &row, &count, &err));
    CHECK(count == 1 && row.number == job.attempt && row.phase == ATTEMPT_ROW_ENDED);
    CHECK_STRING(row.executor, "elsewhere");
    CHECK_STRING(row.ending, ending);
    job_release(&job);
}

static void test_ways(void) {
    int64_t id = add_job("{}", NULL);
    attempt_once(id, RUN_SIGNAL, SIGSEGV, false);
    expect(id, JOB_QUEUED, 2, "crashed (Segmentation fault); the end of its log: its words", ENDING_CRASHED);
    attempt_once(id, RUN_MEMORY, SIGKILL, false);
    expect(id, JOB_QUEUED, 1, "ran out of memory; the end of its log: its words; a further attempt works with",
           ENDING_CRASHED);
    attempt_once(id, RUN_LOST, 0, true); /* as one who was asked to stop may be */
    expect(id, JOB_QUEUED, 1, "", ENDING_STOPPED);
    attempt_once(id, RUN_REFUSED, 0, false);
    expect(id, JOB_PAUSED, 1, "the node is on fire", ENDING_BLOCKED);
    OK(store_job_resume(store, id, NULL, &err));
    attempt_once(id, RUN_EXIT, 0, false);
    expect(id, JOB_SUCCEEDED, 1, "", ENDING_SUCCEEDED);
    CHECK(figures.ends[END_LOST] == 0 && figures.ends[END_REFUSED] == 1 && figures.ends[END_MEMORY] == 1);
}

/* What is lost is not charged to the job, until too many are lost in a row. */
static void test_lost(void) {
    int64_t id = add_job("{}", NULL);
    for (int round = 0; round < 2; round++) {
        for (int i = 1; i < ATTEMPTS_LOST_MAX; i++) {
            attempt_once(id, RUN_LOST, 0, false);
            expect(id, JOB_QUEUED, 3 - round, "the node is on fire", ENDING_LOST);
        }
        if (round == 0)
            attempt_once(id, RUN_SIGNAL, SIGSEGV, false);
    }
    attempt_once(id, RUN_LOST, 0, false);
    expect(id, JOB_FAILED, 2, "the node is on fire", ENDING_LOST);
    CHECK(figures.ends[END_LOST] == 2 * ATTEMPTS_LOST_MAX - 1);
    /* A cancelled one is cancelled, however it ended. */
    id = add_job("{}", NULL);
    struct scheduler_config with = config;
    struct attempt a = {0};
    with.executor = &elsewhere;
    next = (struct run_end){.way = RUN_LOST};
    OK(attempt_start_job(&a, &with, store, &figures, id, 2, &err));
    OK(store_job_cancel(store, id, &err));
    worker_messages_read(&a, store, &figures);
    OK(outcome_settle(&a, store, NULL, &figures, &err));
    expect(id, JOB_CANCELLED, 3, "", ENDING_LOST);
}

/* The check of a scene that is lost is made again. */
static void test_check(void) {
    struct unchecked scene = {.id = "bbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbb"};
    struct scheduler_config with = config;
    struct attempt a = {0};
    struct scene_row row;
    bool existed;
    with.executor = &elsewhere;
    next = (struct run_end){.way = RUN_LOST};
    OK(store_scene_add(store, scene.id, "scene", 1, 0, &existed, &err));
    OK(attempt_start_check(&a, &with, store, &scene, 1, &err));
    worker_messages_read(&a, store, &figures);
    OK(outcome_settle(&a, store, NULL, &figures, &err));
    OK(store_scene_get(store, scene.id, &row, &err));
    CHECK(row.state == SCENE_CHECKING);
    CHECK_STRING(row.problems, "[]");
    scene_row_release(&row);
}

int main(void) {
    rig_start();
    test_ways();
    test_lost();
    test_check();
    rig_stop();
    return check_result();
}
