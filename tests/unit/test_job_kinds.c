/* test_job_kinds.c -- renders and evaluations in the store: what they read stays, files come before they begin, and
 * small renders have a lane of their own. */
#include "server/store/job_files.h"

#include "common/output_names.h"
#include "tests/unit/store_rig.h"

#define HEX "0123456789abcdef0123456789abcdef0123456789abcdef0123456789abcdef"

static struct store *store;

static int64_t next_in(const struct job_lane *lane) {
    int64_t id = 0;
    return store_job_next(store, 0, lane, &id, &err) == STATUS_OK ? id : 0;
}

/* A reconstruction that has succeeded. */
static int64_t add_source(void) {
    int64_t id = add_job(store, SCENE_A, 0);
    int attempt;
    OK(store_job_start(store, id, "process", &attempt, &err));
    OK(store_output_put(store, id, attempt, EVENT_OUTPUT, OUTPUT_MESH, 100, HEX, "model/x", &err));
    OK(store_job_succeed(store, id, attempt, "", &err));
    return id;
}

static enum status try_reader(enum job_kind kind, int64_t source, double cost, const char *const *file, size_t count,
                              int64_t *id) {
    struct job_new new = {.kind = kind,
                          .source_id = source,
                          .cost = cost,
                          .file = file,
                          .file_count = count,
                          .scene_id = SCENE_A,
                          .name = "n",
                          .labels = "{}",
                          .settings = "{}",
                          .max_attempts = 2};
    bool replayed;
    return store_job_add(store, &new, 1000, id, &replayed, &err);
}

static int64_t add_reader(enum job_kind kind, int64_t source, double cost) {
    int64_t id = 0;
    OK(try_reader(kind, source, cost, NULL, 0, &id));
    return id;
}

static void run(int64_t id) {
    int attempt;
    OK(store_job_start(store, id, "process", &attempt, &err));
    OK(store_job_succeed(store, id, attempt, "", &err));
}

static void check_sources(void) {
    int64_t source = add_source(), unfinished = add_job(store, SCENE_A, 0), id;
    IS(try_reader(JOB_RENDER, 4711, 0.0, NULL, 0, &id), STATUS_NOT_FOUND);
    IS(try_reader(JOB_RENDER, unfinished, 0.0, NULL, 0, &id), STATUS_CONFLICT);
    CHECK(strstr(err.message, "it is queued"));
    OK(store_job_cancel(store, unfinished, &err));
    int64_t render = add_reader(JOB_RENDER, source, 0.0);
    IS(try_reader(JOB_RENDER, render, 0.0, NULL, 0, &id), STATUS_CONFLICT);
    CHECK(strstr(err.message, "its kind is render"));
    struct job job;
    OK(store_job_get(store, render, &job, &err));
    CHECK(job.kind == JOB_RENDER && job.source_id == source && job.state == JOB_QUEUED);
    CHECK_STRING(job.files, "[]");
    job_release(&job);

    /* What it reads stays as it is, as long as it has not ended. */
    for (int i = 0; i < 2; i++) {
        IS(store_job_delete(store, source, &err), STATUS_CONFLICT);
        CHECK(strstr(err.message, "reads the outputs"));
        IS(store_job_retry(store, source, 2, "report", NULL, &err), STATUS_CONFLICT);
        IS(store_job_extend(store, source, 2, "{}", NULL, &err), STATUS_CONFLICT);
        OK(store_retention_set_periods(store, 1, 1, 1, &err)); /* everything expires a millisecond after its end */
        OK(store_job_get(store, source, &job, &err));
        CHECK(job.expires_ms == 0);
        job_release(&job);
        if (i == 0)
            OK(store_job_pause(store, render, &err)); /* paused jobs read, too */
    }
    OK(store_job_resume(store, render, NULL, &err));
    run(render);
    OK(store_job_get(store, source, &job, &err));
    CHECK(job.expires_ms > 0);
    job_release(&job);
    OK(store_retention_set_periods(store, 0, 0, 86400000, &err));
    OK(store_job_delete(store, source, &err));
    IS(store_job_retry(store, render, 2, "render", NULL, &err), STATUS_CONFLICT);
    CHECK_THAT(strstr(err.message, "there is no job"), "%s", err.message);
    OK(store_job_delete(store, render, &err));
}

/* A render needs its scene no more; an evaluation does. */
static void check_scenes(void) {
    bool existed, is_gone;
    OK(store_scene_add(store, SCENE_B, "other", 10, 0, &existed, &err));
    OK(store_scene_ready(store, SCENE_B, NULL, "{}", &err));
    int64_t source = add_job(store, SCENE_B, 0), id = 0;
    int attempt;
    OK(store_job_start(store, source, "process", &attempt, &err));
    OK(store_output_put(store, source, attempt, EVENT_OUTPUT, OUTPUT_MESH, 100, HEX, "model/x", &err));
    OK(store_job_succeed(store, source, attempt, "", &err));
    struct job_new new = {.kind = JOB_RENDER,
                          .source_id = source,
                          .scene_id = SCENE_B,
                          .name = "n",
                          .labels = "{}",
                          .settings = "{}",
                          .max_attempts = 2};
    bool replayed;
    OK(store_job_add(store, &new, 1000, &id, &replayed, &err));
    OK(store_scene_delete(store, SCENE_B, -1, false, &is_gone, &err));
    CHECK(is_gone && next_in(NULL) == id);
    run(id);
    OK(store_job_retry(store, id, 2, "render", NULL, &err));
    run(id);
    new.kind = JOB_EVALUATE;
    IS(store_job_add(store, &new, 1000, &id, &replayed, &err), STATUS_NOT_FOUND);
}

static void check_files(void) {
    static const char *const names[] = {"sky.hdr", "chair.glb"};
    int64_t source = add_source(), id = 0;
    struct job job;
    bool queued;
    OK(try_reader(JOB_RENDER, source, 0.0, names, 2, &id));
    OK(store_job_get(store, id, &job, &err));
    CHECK(job.state == JOB_PAUSED && next_in(NULL) == 0);
    CHECK_STRING(job.files, "[{\"name\":\"chair.glb\",\"bytes\":null,\"sha256\":null},"
                            "{\"name\":\"sky.hdr\",\"bytes\":null,\"sha256\":null}]");
    CHECK_STRING(job.reason, JOB_FILES_REASON);
    job_release(&job);
    IS(store_job_resume(store, id, NULL, &err), STATUS_CONFLICT);
    CHECK(strstr(err.message, "chair.glb, sky.hdr"));
    IS(store_job_file_check(store, id, "none.hdr", &err), STATUS_NOT_FOUND);
    CHECK(strstr(err.hint, "chair.glb, sky.hdr"));
    OK(store_job_file_check(store, id, "sky.hdr", &err));
    OK(store_job_file_put(store, id, "sky.hdr", 5, HEX, NULL, &queued, &err));
    CHECK(!queued && next_in(NULL) == 0);
    OK(store_job_file_put(store, id, "sky.hdr", 7, HEX, NULL, &queued, &err)); /* sent again */
    CHECK(!queued);

    /* The last one queues it; where the queue is full it is there all the same. */
    const struct count_limits none = {0, 0};
    IS(store_job_file_put(store, id, "chair.glb", 9, HEX, &none, &queued, &err), STATUS_LIMIT);
    CHECK(!queued && next_in(NULL) == 0);
    IS(store_job_file_put(store, id, "sky.hdr", 8, HEX, NULL, &queued, &err), STATUS_CONFLICT);
    CHECK(strstr(err.message, "has all its files"));
    OK(store_job_resume(store, id, NULL, &err));
    CHECK(next_in(NULL) == id);
    IS(store_job_file_check(store, id, "sky.hdr", &err), STATUS_CONFLICT);
    OK(store_job_get(store, id, &job, &err));
    CHECK_STRING(job.files, "[{\"name\":\"chair.glb\",\"bytes\":9,\"sha256\":\"" HEX "\"},"
                            "{\"name\":\"sky.hdr\",\"bytes\":7,\"sha256\":\"" HEX "\"}]");
    job_release(&job);
    run(id);

    OK(try_reader(JOB_RENDER, source, 0.0, names, 1, &id));
    OK(store_job_file_put(store, id, "sky.hdr", 5, HEX, NULL, &queued, &err));
    CHECK(queued && next_in(NULL) == id);
    OK(store_job_delete(store, id, &err));
}

static void check_lanes(void) {
    const struct job_lane small = {.small_cost = 1000.0, .is_small = true}, others = {.small_cost = 1000.0};
    int64_t source = add_source(), large = add_reader(JOB_RENDER, source, 1001.0);
    int64_t unknown = add_reader(JOB_RENDER, source, 0.0), quick = add_reader(JOB_RENDER, source, 1000.0);
    int64_t evaluation = add_reader(JOB_EVALUATE, source, 0.0), room = add_job(store, SCENE_A, 0);
    CHECK(next_in(&small) == quick && next_in(NULL) == large);
    const int64_t wanted[] = {large, unknown, evaluation, room, 0};
    for (size_t i = 0; i < sizeof wanted / sizeof *wanted; i++) {
        CHECK_THAT(next_in(&others) == wanted[i], "%zu: %lld", i, (long long)next_in(&others));
        if (wanted[i])
            OK(store_job_cancel(store, wanted[i], &err));
    }
    run(quick);
    CHECK(next_in(&small) == 0);
}

/* One user's jobs of one lane do not count in the other. */
static void check_limits(void) {
    const struct job_lane small = {.small_cost = 1000.0, .is_small = true}, others = {.small_cost = 1000.0};
    int64_t source = add_source(), user, id, jobs[4];
    int attempt;
    char token[TOKEN_SIZE];
    OK(store_token_add(store, "alice", ROLE_USER, 0, token, &id, &err));
    struct caller who;
    OK(store_token_find(store, token, &who, &err));
    user = who.user_id;
    for (size_t i = 0; i < 4; i++) {
        struct job_new new = {.kind = JOB_RENDER,
                              .source_id = source,
                              .cost = i < 2 ? 10.0 : 2000.0,
                              .scene_id = SCENE_A,
                              .owner_id = user,
                              .name = "n",
                              .labels = "{}",
                              .settings = "{}",
                              .max_attempts = 2};
        bool replayed;
        OK(store_job_add(store, &new, 1000, &jobs[i], &replayed, &err));
    }
    OK(store_job_next(store, 1, &others, &id, &err));
    CHECK(id == jobs[2]);
    OK(store_job_start(store, id, "process", &attempt, &err));
    IS(store_job_next(store, 1, &others, &id, &err), STATUS_NOT_FOUND);
    OK(store_job_next(store, 1, &small, &id, &err));
    CHECK(id == jobs[0]);
    OK(store_job_start(store, id, "process", &attempt, &err));
    IS(store_job_next(store, 1, &small, &id, &err), STATUS_NOT_FOUND);
}

static void check_lists(void) {
    struct job jobs[4];
    size_t count;
    int64_t source = add_source(), render = add_reader(JOB_RENDER, source, 0.0);
    OK(store_job_list(store, NULL, &(struct job_filter){.state = -1, .kind = -1, .source_id = source}, 0, 4, jobs,
                      &count, &err));
    CHECK(count == 1 && jobs[0].id == render);
    for (size_t i = 0; i < count; i++)
        job_release(&jobs[i]);
    OK(store_job_list(store, NULL, &(struct job_filter){.state = JOB_SUCCEEDED, .kind = JOB_EVALUATE}, 0, 4, jobs,
                      &count, &err));
    CHECK(count == 0);
    OK(store_job_cancel(store, render, &err));
}

int main(void) {
    char *dir = fresh_dir();
    OK(store_open(&store, dir, &err));
    add_ready_scene(store, SCENE_A);
    check_sources();
    check_scenes();
    check_files();
    check_lanes();
    check_lists();
    check_limits();
    store_close(store);
    drop_dir(dir);
    return check_result();
}
