/* scheduler_rig.h -- for tests of the scheduler: the scheduler and a store in a thread of the test, with a worker that
 * plays roles: the test's program itself, started as `TEST worker DIR`. A job's role is in its settings, a scene's in
 * its archive; the test says what the roles do (play, play_check). */
#ifndef UNBAKE_TESTS_SCHEDULER_RIG_H
#define UNBAKE_TESTS_SCHEDULER_RIG_H

#include "server/job/scheduler.h"

#include <fcntl.h>
#include <pthread.h>
#include <signal.h>
#include <sys/resource.h>

#include "common/file.h"
#include "common/mem.h"
#include "common/protocol.h"
#include "server/job/process.h"
#include "server/worker/progress.h"
#include "tests/check.h"

#define SCENE_A "aaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaa"
#define SCENE_B "bbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbb"
#define SCENE_C "cccccccccccccccccccccccccccccccccccccccccccccccccccccccccccccccc"
#define SCENE_D "dddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddd"
#define SCENE_E "eeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeee"

/* Whoever waits for another process looks this often, WAIT_US apart: five minutes, since a disk
 * that is busy with others' work makes each commit wait. */
#define WAIT_TRIES 150000
#define WAIT_US 2000

static struct error err;

#define OK(call) CHECK_THAT((call) == STATUS_OK, "%s", err.message)

/* --- the worker's side ----------------------------------------------------------------------- */

/* The test's: an exit status. */
static int play(const char *role, const char *dir, int attempt);
static int play_check(const char *role, const char *dir);

static volatile sig_atomic_t told_to_stop;
static inline void on_term(int number) {
    (void)number;
    told_to_stop = 1;
}

/* What a killed worker has left that is of no use, and what is: out/tmp-a1B2c3 is announced. */
static const char *const scraps[] = {"job.json.tmp-a1B2c3", "out/a.exr.part", "out/compare/000.png.tmp-XYZxyz",
                                     "out/unannounced.exr"};
static const char *const kept[] = {"checkpoint/checkpoint.db", "out/tmp-a1B2c3"};

static inline void litter(const char *dir) {
    static const char *const folders[] = {"out/compare", "checkpoint"};
    for (size_t i = 0; i < sizeof folders / sizeof *folders; i++) {
        char *inner = file_join(dir, folders[i]);
        OK(file_make_dirs(inner, &err));
        mem_free(inner);
    }
    for (size_t i = 0; i < sizeof scraps / sizeof *scraps + sizeof kept / sizeof *kept; i++) {
        bool is_scrap = i < sizeof scraps / sizeof *scraps;
        char *path = file_join(dir, is_scrap ? scraps[i] : kept[i - sizeof scraps / sizeof *scraps]);
        int fd = open(path, O_WRONLY | O_CREAT | O_CLOEXEC, 0600);
        CHECK(fd >= 0);
        close(fd);
        mem_free(path);
    }
}

static inline bool is_tidy(const char *dir) {
    bool tidy = true;
    for (size_t i = 0; i < sizeof scraps / sizeof *scraps; i++)
        tidy = tidy && !file_is_in(dir, scraps[i]);
    for (size_t i = 0; i < sizeof kept / sizeof *kept; i++)
        CHECK_THAT(file_is_in(dir, kept[i]), "%s is gone", kept[i]);
    return tidy;
}

/* The scene is good. */
static inline void check_out(struct progress *p) {
    cJSON *facts = cJSON_CreateObject();
    json_add_int(facts, "frame_count", 12);
    progress_scene(p, facts);
    progress_end(p, STATUS_OK, "", "");
}

static inline int worker(const char *dir) {
    char *path = file_join(dir, "job.json");
    cJSON *order;
    const char *kind, *role;
    double attempt;
    if (json_read(path, 1 << 20, &order, &err) != STATUS_OK ||
        json_string(order, "kind", "job.json", "", &kind, &err) != STATUS_OK)
        return 96;
    if (strcmp(kind, "check") == 0) {
        struct buf archive;
        buf_init(&archive, 100);
        char *name = file_join(dir, "archive");
        if (file_read(name, &archive, &err) != STATUS_OK)
            return 95;
        return play_check(buf_text(&archive), dir);
    }
    cJSON *settings = cJSON_GetObjectItem(order, "settings");
    if (json_string(settings, "role", "settings", "", &role, &err) != STATUS_OK ||
        json_number(order, "attempt", "job.json", 0, &attempt, &err) != STATUS_OK)
        return 94;
    return play(role, dir, (int)attempt);
}

#define RIG_EVENTS_MAX 100 /* of one attempt; see worker_messages.c */

/* --- the daemon's side ------------------------------------------------------------------------ */

static struct process_executor at_home; /* borrowed by the scheduler */

struct daemon {
    char *dir;
    struct store *store;
    struct scheduler *scheduler;
    struct trash *trash; /* of those to come; NULL: none */
    pthread_t thread;
};

static inline void *run_scheduler(void *argument) {
    struct daemon *d = argument;
    struct error mine;
    if (scheduler_run(d->scheduler, &mine) != STATUS_OK)
        fprintf(stderr, "%s\n", mine.message);
    return NULL;
}

static inline void daemon_start(struct daemon *d, int max_running, const char *binary) {
    struct scheduler_config config = {.data_dir = d->dir,
                                      .executor = process_executor_init(&at_home, binary, d->dir),
                                      .max_running = max_running,
                                      .thread_count = 4,
                                      .checkpoint_interval_sec = 60,
                                      .stop_grace_sec = 0.2,
                                      .attempt_events_max = RIG_EVENTS_MAX,
                                      .sandbox = false};
    OK(store_open(&d->store, d->dir, &err));
    OK(scheduler_new(&d->scheduler, &config, d->store, &err));
    scheduler_use_trash(d->scheduler, d->trash);
    CHECK(pthread_create(&d->thread, NULL, run_scheduler, d) == 0);
}

static inline void daemon_stop(struct daemon *d) {
    scheduler_stop(d->scheduler);
    pthread_join(d->thread, NULL);
    CHECK(scheduler_running(d->scheduler) == 0);
    scheduler_free(d->scheduler);
    store_close(d->store);
}

static inline void add_scene_of(struct daemon *d, const char *id, const char *role, int64_t owner) {
    bool existed;
    char *path = mem_printf("%s/scenes/%s/archive", d->dir, id);
    char *dir = mem_printf("%s/scenes/%s", d->dir, id);
    OK(file_make_dirs(dir, &err));
    OK(file_replace(path, role, strlen(role), &err));
    OK(store_scene_add(d->store, id, "scene", strlen(role), owner, &existed, &err));
    scheduler_wake(d->scheduler);
    mem_free(path);
    mem_free(dir);
}

static inline void add_scene(struct daemon *d, const char *id, const char *role) { add_scene_of(d, id, role, 0); }

/* 0 when the store refuses because the scene has been rejected by now. */
static inline int64_t submit(struct daemon *d, const char *scene, const char *role) {
    char *settings = mem_printf("{\"role\":\"%s\"}", role);
    struct job_new new = {.scene_id = scene, .name = role, .labels = "{}", .settings = settings, .max_attempts = 2};
    int64_t id = 0;
    bool replayed;
    enum status status = store_job_add(d->store, &new, 1000, &id, &replayed, &err);
    CHECK_THAT(status == STATUS_OK || (status == STATUS_CONFLICT && strstr(err.message, "was rejected") != NULL), "%s",
               err.message);
    scheduler_wake(d->scheduler);
    mem_free(settings);
    return id;
}

/* Waits until the job is in the state and, if given, in the stage; false when it does not come. */
static inline bool wait_for(struct daemon *d, int64_t id, enum job_state state, const char *stage) {
    for (int i = 0; i < WAIT_TRIES; i++) {
        struct job job;
        if (store_job_get(d->store, id, &job, &err) != STATUS_OK)
            return false;
        bool there = job.state == state && (!stage || strcmp(job.stage, stage) == 0);
        job_release(&job);
        if (there)
            return true;
        usleep(WAIT_US);
    }
    return false;
}

static inline bool wait_for_scene(struct daemon *d, const char *id, enum scene_state state) {
    for (int i = 0; i < WAIT_TRIES; i++) {
        struct scene_row row;
        if (store_scene_get(d->store, id, &row, &err) != STATUS_OK)
            return false;
        bool there = row.state == state;
        scene_row_release(&row);
        if (there)
            return true;
        usleep(WAIT_US);
    }
    return false;
}

static inline void expect(struct daemon *d, int64_t id, enum job_state state, int attempt, const char *reason,
                          const char *hint) {
    struct job job;
    CHECK_THAT(wait_for(d, id, state, NULL), "job %lld is not %s", (long long)id, job_state_name(state));
    OK(store_job_get(d->store, id, &job, &err));
    CHECK_THAT(job.attempt == attempt, "job \"%s\": attempt %d", job.name, job.attempt);
    CHECK_THAT(strstr(job.reason, reason) != NULL, "job \"%s\": \"%s\"", job.name, job.reason);
    CHECK_THAT(strstr(job.hint, hint) != NULL, "job \"%s\": \"%s\"", job.name, job.hint);
    job_release(&job);
}

/* main, but for the tests: takes the part of a worker where it is one; else *d gets a folder. */
static inline void daemon_begin(struct daemon *d, int argc, char **argv) {
    if (argc == 3 && strcmp(argv[1], "worker") == 0)
        _exit(worker(argv[2])); /* past the leak check: its roles do not tidy up */
    struct rlimit no_core = {0, 0};
    setrlimit(RLIMIT_CORE, &no_core);
    *d = (struct daemon){.dir = mem_printf("%s/unbake-test-scheduler-XXXXXX", check_fast_dir())};
    if (!mkdtemp(d->dir))
        exit(1);
}

static inline void daemon_end(struct daemon *d) {
    OK(file_remove_tree(d->dir, &err));
    mem_free(d->dir);
}

#endif
