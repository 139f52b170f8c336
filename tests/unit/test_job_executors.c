/* test_job_executors.c -- where jobs run: whose turn it is when some places are full, and which place a job gets. */
#include <string.h>

#include "server/job/dispatch.h"
#include "server/store/remote.h"
#include "tests/unit/store_rig.h"

static int64_t add_on(struct store *store, const char *settings) {
    struct job_new new = {.scene_id = SCENE_A, .name = "n", .labels = "{}", .settings = settings, .max_attempts = 2};
    int64_t id = 0;
    bool replayed;
    OK(store_job_add(store, &new, 1000, &id, &replayed, &err));
    return id;
}

/* The next job when these have a place. */
static int64_t next_on(struct store *store, const char *names, bool anywhere) {
    const struct job_lane lane = {.executors = names, .anywhere = anywhere};
    int64_t id = 0;
    return store_job_next(store, 0, &lane, &id, &err) == STATUS_OK ? id : 0;
}

static void check_wish(struct store *store, int64_t id, const char *wanted) {
    char *found;
    OK(store_job_executor(store, id, &found, &err));
    CHECK_STRING(found, wanted);
    mem_free(found);
}

static void test_turns(struct store *store) {
    int64_t slurm = add_on(store, "{\"executor\":\"slurm\"}"), any = add_on(store, "{}"),
            here = add_on(store, "{\"executor\":\"process\"}"), broken = add_on(store, "{\"executor\":");
    check_wish(store, slurm, "slurm");
    check_wish(store, any, "");
    check_wish(store, broken, "");
    CHECK(next_on(store, NULL, true) == slurm);
    CHECK(next_on(store, " process slurm ", true) == slurm);
    CHECK(next_on(store, " process ", true) == any); /* a full cluster holds up none that may run here */
    CHECK(next_on(store, " process ", false) == here);
    CHECK(next_on(store, " pbs ", true) == any);
    CHECK(next_on(store, " slur ", false) == 0);
    CHECK(next_on(store, " slurm-2 ", false) == 0);
    /* Extended, it may be somewhere else. */
    OK(store_job_cancel(store, slurm, &err));
    OK(store_job_extend(store, slurm, 2, "{\"executor\":\"pbs\"}", NULL, &err));
    check_wish(store, slurm, "pbs");
    OK(store_job_cancel(store, slurm, &err));
    OK(store_job_cancel(store, any, &err));
    OK(store_job_cancel(store, here, &err));
    OK(store_job_cancel(store, broken, &err));
}

static void test_places(void) {
    const struct executor here = {.name = "process"}, slurm = {.name = "slurm", .max_running = 2};
    const struct executor *both[] = {&slurm, &here}, *only[] = {&slurm};
    struct scheduler_config config = {.executor = &here, .max_running = 1, .places = both, .place_count = 2};
    struct attempt slots[3] = {{.phase = ATTEMPT_ALIVE, .executor = &slurm},
                               {.phase = ATTEMPT_ENDED, .executor = &slurm}};
    struct executors e;
    executors_init(&e, &config);
    CHECK(e.slots == 3);
    executors_count(&e, slots, 1);
    CHECK(executors_for(&e, "")->executor == &slurm && executors_for(&e, "process")->executor == &here);
    CHECK(!executors_for(&e, "pbs") && executors_find(&e, "slurm") && !executors_find(&e, "pbs"));
    executors_count(&e, slots, 3); /* one that is still to be settled has its place */
    CHECK(executors_for(&e, "")->executor == &here && !executors_for(&e, "slurm"));
    char *names = executors_available(&e);
    CHECK_STRING(names, " process ");
    mem_free(names);
    executors_add(&e, &here);
    CHECK(!executors_for(&e, "") && !executors_available(&e));
    executors_release(&e);

    /* This machine is not in the list: it takes what must run here, and nothing else. */
    config.places = only;
    config.place_count = 1;
    executors_init(&e, &config);
    executors_count(&e, slots, 3);
    CHECK(e.slots == 3 && !executors_for(&e, "") && executors_for(&e, "process")->executor == &here);
    executors_release(&e);
}

/* A submission that did not come through is repeated under another name and token: the first has no say any more. */
static void test_rename(struct store *store) {
    static const char first[] = "1111111111111111111111111111111111111111111111111111111111111111",
                      second[] = "2222222222222222222222222222222222222222222222222222222222222222";
    struct remote_row row = {.executor = "slurm", .name = "unbake-a", .lease_sec = 60};
    struct remote_key key = {.token_sha256 = first, .claimant = "aa"};
    key.job_id = row.job_id = add_on(store, "{}");
    OK(store_job_start(store, row.job_id, "slurm", &row.number, &err));
    key.number = row.number;
    OK(store_remote_begin(store, &row, first, &err));
    OK(store_remote_rename(store, row.job_id, row.number, "unbake-b", second, &err));
    IS(store_remote_claim(store, &key, "late", &row, &err), STATUS_NOT_FOUND);
    key.token_sha256 = second;
    OK(store_remote_claim(store, &key, "node", &row, &err));
    CHECK_STRING(row.name, "unbake-b");
    IS(store_remote_rename(store, key.job_id, key.number, "unbake-c", first, &err), STATUS_CONFLICT);
    /* It outlives a start of the daemon that keeps it; one that does not, queues it. */
    size_t requeued;
    const struct attempt_key kept = {key.job_id, key.number};
    OK(store_reconcile(store, &kept, 1, &requeued, &err));
    CHECK(requeued == 0);
    OK(store_reconcile(store, NULL, 0, &requeued, &err));
    CHECK(requeued == 1);
    IS(store_remote_may_read(store, &key, &err), STATUS_CONFLICT);
}

static void check_reason(struct store *store, int64_t id, const char *wanted) {
    struct job job;
    OK(store_job_get(store, id, &job, &err));
    CHECK_STRING(job.reason, wanted);
    job_release(&job);
}

/* A round of a scheduler that has the executors `process` and, if `has_slurm`, `slurm`, of which none has a place. */
static void play_round(struct store *store, bool has_slurm) {
    const struct executor here = {.name = "process"}, slurm = {.name = "slurm", .max_running = 1};
    const struct executor *places[] = {&here, &slurm};
    const struct scheduler_config config = {
        .executor = &here, .max_running = 1, .places = places, .place_count = has_slurm ? 2 : 1};
    struct counters counters = {0};
    struct dispatch dispatch;
    dispatch_init(&dispatch, &config, store, &counters);
    dispatch.slot = mem_calloc(dispatch.job_slots, sizeof *dispatch.slot);
    for (size_t i = 0; i < dispatch.job_slots; i++)
        dispatch.slot[i] = (struct attempt){.phase = ATTEMPT_ENDED, .executor = places[i % 2]};
    OK(dispatch_start(&dispatch, &err));
    OK(dispatch_start(&dispatch, &err));
    mem_free(dispatch.slot);
    dispatch_release(&dispatch);
}

/* A job whose executor was removed from the configuration says why it waits, until it is there again. */
static void test_removed(struct store *store) {
    int64_t gone = add_on(store, "{\"executor\":\"slurm\"}"), other = add_on(store, "{\"executor\":\"process\"}");
    play_round(store, true);
    check_reason(store, gone, "");
    play_round(store, false);
    check_reason(store, gone, "its executor is not configured: slurm");
    check_reason(store, other, "");
    play_round(store, true);
    check_reason(store, gone, "");
    OK(store_job_cancel(store, gone, &err));
    OK(store_job_cancel(store, other, &err));
}

int main(void) {
    struct store *store;
    char *dir = fresh_dir();
    OK(store_open(&store, dir, &err));
    add_ready_scene(store, SCENE_A);
    test_turns(store);
    test_places();
    test_rename(store);
    test_removed(store);
    store_close(store);
    drop_dir(dir);
    return check_result();
}
