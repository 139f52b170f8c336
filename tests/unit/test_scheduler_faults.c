/* test_scheduler_faults.c -- while scenes are checked, jobs run and webhooks are called, a call of SQLite or of the
 * system fails the scheduler, once in each life of a job: the job succeeds all the same, if need be once it is resumed,
 * and so does its start. As worker stands in this program itself: `test_scheduler_faults worker DIR`. */
#include "server/job/scheduler.h"

#include <limits.h>
#include <time.h>

#include "common/file.h"
#include "common/log.h"
#include "common/mem.h"
#include "common/protocol.h"
#include "server/job/process.h"
#include "server/worker/progress.h"
#include "tests/check.h"
#include "tests/system_faults.h"

#define LIVES 60    /* of each kind */
#define TRIES 30000 /* of 2 ms: others may have the machine */
#define SHA "aaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaa"

static struct error err;
#define OK(call) CHECK_THAT((call) == STATUS_OK, "%s", err.message)

/* --- the worker's side ---------------------------------------------------------------------------- */

static int reconstruct(struct progress *p, const char *dir) {
    char *path = file_join(dir, "out/a.txt");
    if (file_replace(path, "data", 4, &err) != STATUS_OK)
        return PROGRESS_EXIT_FAILED;
    mem_free(path);
    progress_stage(p, "refine");
    progress_metric(p, "loss", 3, 0.25);
    progress_checkpoint(p, 3, 1000, 0.1);
    progress_file(p, "output", "a.txt", 4, SHA, "text/plain");
    progress_end(p, STATUS_OK, "", "");
    return PROGRESS_EXIT_OK;
}

static int check(struct progress *p, const char *dir) {
    char *files = file_join(dir, "files");
    cJSON *facts = cJSON_CreateObject();
    if (file_make_dirs(files, &err) != STATUS_OK)
        return PROGRESS_EXIT_FAILED;
    mem_free(files);
    json_add_int(facts, "frame_count", 12);
    progress_scene(p, facts);
    progress_end(p, STATUS_OK, "", "");
    return PROGRESS_EXIT_OK;
}

static int deliver(struct progress *p) {
    static const char garbage[] = "\nx\n{}\n{\"type\":7}\n{\"type\":\"log\"}\n{\"type\":\"end\",\"message\":7}\n";
    if (write(PROGRESS_FD, garbage, sizeof garbage - 1) < 0)
        return PROGRESS_EXIT_FAILED;
    progress_end(p, STATUS_OK, "", "");
    return PROGRESS_EXIT_OK;
}

static int worker(const char *dir) {
    struct progress p = {.fd = PROGRESS_FD};
    const char *kind;
    cJSON *order;
    char *path = file_join(dir, "job.json");
    if (json_read(path, 1 << 20, &order, &err) != STATUS_OK ||
        json_string(order, "kind", "job.json", "", &kind, &err) != STATUS_OK)
        return PROGRESS_EXIT_FAILED;
    return strcmp(kind, "check") == 0     ? check(&p, dir)
           : strcmp(kind, "deliver") == 0 ? deliver(&p)
                                          : reconstruct(&p, dir);
}

/* --- the daemon's side ------------------------------------------------------------------------------ */

static char dir[64];
static struct store *store;
static struct scheduler *scheduler;
static atomic_int run_status; /* -1: it runs */

static void *run(void *user) {
    struct error why = {0};
    (void)user;
    enum status status = scheduler_run(scheduler, &why);
    CHECK(status == STATUS_OK || *why.message);
    atomic_store(&run_status, (int)status);
    return NULL;
}

static void nap(void) { nanosleep(&(struct timespec){.tv_nsec = 2000000}, NULL); }

static void arm(bool is_sql, long n) {
    if (is_sql)
        sql_faults_arm(n);
    else
        system_faults_arm(n);
}

/* What is left of n calls; none fails from now on. */
static long lift(bool is_sql) { return atomic_exchange(is_sql ? &sql_faults_left : &system_faults_left, 0); }

static bool begin(pthread_t *thread) {
    static struct process_executor at_home;
    struct scheduler_config config = {.data_dir = dir,
                                      .executor = process_executor_init(&at_home, "/proc/self/exe", dir),
                                      .max_running = 1,
                                      .thread_count = 1,
                                      .checkpoint_interval_sec = 60,
                                      .stop_grace_sec = 1,
                                      .event_keep_sec = 1,
                                      .webhook_private = true};
    if (scheduler_new(&scheduler, &config, store, &err) != STATUS_OK)
        return false;
    faults_are_off = true;
    atomic_store(&run_status, -1);
    CHECK(pthread_create(thread, NULL, run, NULL) == 0);
    return true;
}

static void end(pthread_t thread) {
    scheduler_stop(scheduler);
    pthread_join(thread, NULL);
    scheduler_free(scheduler);
}

/* A start either says why it does not come to anything, or does without; false where nothing failed. */
static bool start_once(bool is_sql, long n) {
    pthread_t thread;
    faults_are_off = false;
    arm(is_sql, n);
    bool began = begin(&thread);
    faults_are_off = true;
    CHECK(began || *err.message);
    for (int i = 0; began && i < TRIES && atomic_load(&run_status) < 0 && scheduler_rounds(scheduler) == 0; i++)
        nap();
    bool struck = lift(is_sql) <= 0;
    if (began)
        end(thread);
    return struck;
}

static int64_t submit(long number) {
    char id[SCENE_ID_SIZE];
    bool existed;
    int64_t job = 0;
    snprintf(id, sizeof id, "%08lx%.56s", number, SHA);
    char *scene = mem_printf("%s/scenes/%s", dir, id), *archive = file_join(scene, "archive");
    struct job_new new = {.scene_id = id, .name = "job", .labels = "{}", .settings = "{}", .max_attempts = 9};
    if (number % 4 == 0)
        new.webhook_url = "http://127.0.0.1:1/", new.webhook_secret = "secret";
    OK(file_make_dirs(scene, &err));
    OK(file_replace(archive, "x", 1, &err));
    OK(store_scene_add(store, id, "scene", 1, 0, &existed, &err));
    OK(store_job_add(store, &new, 1000, &job, &existed, &err));
    mem_free(archive);
    mem_free(scene);
    return job;
}

/* Its messages are sent, too. */
static bool is_over(int64_t id, enum job_state *state) {
    struct job job;
    struct store_counts counts;
    OK(store_job_get(store, id, &job, &err));
    *state = job.state;
    if (job.state == JOB_PAUSED)
        OK(store_job_resume(store, id, NULL, &err));
    job_release(&job);
    OK(store_count(store, &counts, &err));
    return job_is_terminal(*state) && counts.outbox == 0;
}

/* How many calls there were. */
static long live_once(bool is_sql, long n) {
    static long number;
    enum job_state state = JOB_QUEUED;
    arm(is_sql, n);
    int64_t job = submit(++number);
    for (int i = 0; i < TRIES && !is_over(job, &state); i++) {
        scheduler_wake(scheduler);
        nap();
    }
    long left = lift(is_sql);
    CHECK_THAT(state == JOB_SUCCEEDED, "call %ld of %s fails: the job is %s", n, is_sql ? "SQLite" : "the system",
               job_state_name(state));
    return n - left;
}

int main(int argc, char **argv) {
    if (argc == 3 && strcmp(argv[1], "worker") == 0)
        _exit(worker(argv[2]));
    pthread_t thread;
    snprintf(dir, sizeof dir, "%s/unbake-test-scheduler-XXXXXX", check_fast_dir());
    if (!mkdtemp(dir))
        return 1;
    log_set_level(LOG_ERROR);
    faults_are_off = true; /* in this thread */
    OK(store_open(&store, dir, &err));
    for (long n = 1; n <= 9 && check_failed_count == 0; n++) {
        start_once(true, n);
        start_once(false, n);
    }
    CHECK(begin(&thread));
    for (int is_sql = 0; is_sql < 2; is_sql++) {
        long calls = live_once(is_sql, LONG_MAX / 2), step = calls / LIVES + 1;
        for (long n = 1; n <= calls && check_failed_count == 0; n += step)
            live_once(is_sql, n);
        printf("%ld calls of %s\n", calls, is_sql ? "SQLite" : "the system");
    }
    end(thread);
    store_close(store);
    OK(file_remove_tree(dir, &err));
    return check_result();
}
