/* fault_rig.h -- for tests that let calls of SQLite or of the system fail below server/job/, without the scheduler's
 * loop: a folder with a store, scenes and jobs; what the log says; what is left over of a process. */
#ifndef UNBAKE_TESTS_FAULT_RIG_H
#define UNBAKE_TESTS_FAULT_RIG_H

#include <sys/wait.h>

#include "common/file.h"
#include "common/log.h"
#include "common/mem.h"
#include "common/protocol.h"
#include "server/job/process.h"
#include "server/job/scheduler_config.h"
#include "server/store/store.h"
#include "tests/check.h"
#include "tests/system_faults.h"

#define SCENE_A "aaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaa"

static struct error err;
#define OK(call) CHECK_THAT((call) == STATUS_OK, "%s", err.message)

static char dir[64];
static struct store *store;
static struct process_executor at_home;
static const struct scheduler_config config = {.data_dir = dir,
                                               .executor = &at_home.executor,
                                               .max_running = 1,
                                               .thread_count = 1,
                                               .checkpoint_interval_sec = 60,
                                               .stop_grace_sec = 1,
                                               .event_keep_sec = 3600,
                                               .checkpoint_keep_sec = 3600,
                                               .user_max_bytes = (uint64_t)1 << 40};

/* --- faults --------------------------------------------------------------------------------------- */

static bool sql_is_armed, system_is_armed;

/* The n-th call from now on fails, in this thread, and if `stays` all that follow: of statements with `only` in their
 * text (NULL: of all). */
static inline void strike_sql(const char *only, long n, bool stays) {
    faults_are_off = false;
    sql_is_armed = true;
    sql_faults_arm_only(only, n, stays);
}

/* The same for calls of the system of that name. */
static inline void strike_system(const char *only, long n, bool stays) {
    faults_are_off = false;
    system_is_armed = true;
    system_faults_arm_only(only, n, stays);
}

static inline void strike(bool is_sql, long n, bool stays) {
    if (is_sql)
        strike_sql(NULL, n, stays);
    else
        strike_system(NULL, n, stays);
}

/* No call fails from now on; whether one has. */
static inline bool lift(void) {
    bool sql = sql_faults_lift() && sql_is_armed, other = system_faults_lift() && system_is_armed;
    faults_are_off = true;
    sql_is_armed = system_is_armed = false;
    return sql || other;
}

/* --- the log -------------------------------------------------------------------------------------- */

static int log_fd = -1, real_stderr = -1;
static char log_text[1 << 18];
static size_t log_length;

/* From now on stderr goes to a pipe: writes to files fail. */
static inline void log_catch(void) {
    int ends[2];
    real_stderr = dup(STDERR_FILENO);
    CHECK(pipe2(ends, O_CLOEXEC | O_NONBLOCK) == 0 && dup2(ends[1], STDERR_FILENO) >= 0);
    close(ends[1]);
    log_fd = ends[0];
}

static inline const char *log_read(void) {
    ssize_t got;
    while (log_length < sizeof log_text - 1 &&
           (got = read(log_fd, log_text + log_length, sizeof log_text - 1 - log_length)) > 0)
        log_length += (size_t)got;
    log_text[log_length] = '\0';
    return log_text;
}

/* How often it has said so since log_forget. */
static inline int log_count(const char *text) {
    int count = 0;
    for (const char *at = log_read(); (at = strstr(at, text)) != NULL; at++)
        count++;
    return count;
}

static inline void log_forget(void) {
    log_read();
    if (check_failed_count == 0)
        log_length = 0;
}

/* --- the folder and the store ---------------------------------------------------------------------- */

static inline void rig_start(void) {
    bool existed;
    faults_are_off = true;
    log_catch();
    log_set_level(LOG_WARNING);
    snprintf(dir, sizeof dir, "%s/unbake-test-faults-XXXXXX", check_fast_dir());
    if (!mkdtemp(dir))
        exit(1);
    process_executor_init(&at_home, "/proc/self/exe", dir);
    OK(store_open(&store, dir, &err));
    OK(store_scene_add(store, SCENE_A, "scene", 1, 0, &existed, &err));
    OK(store_scene_ready(store, SCENE_A, NULL, "{}", &err));
}

static inline int64_t add_job(const char *settings, const char *webhook) {
    struct job_new new = {.scene_id = SCENE_A,
                          .name = "job",
                          .labels = "{}",
                          .settings = settings,
                          .max_attempts = 3,
                          .webhook_url = webhook,
                          .webhook_secret = webhook ? "secret" : NULL};
    int64_t id = 0;
    bool replayed;
    OK(store_job_add(store, &new, 100000, &id, &replayed, &err));
    return id;
}

static inline enum job_state state_of(int64_t id) {
    struct job job;
    OK(store_job_get(store, id, &job, &err));
    enum job_state state = job.state;
    job_release(&job);
    return state;
}

static inline void rig_stop(void) {
    store_close(store);
    OK(file_remove_tree(dir, &err));
    dup2(real_stderr, STDERR_FILENO);
    if (check_failed_count)
        fputs(log_read(), stderr);
    close(real_stderr);
    close(log_fd);
}

/* --- what is left over ------------------------------------------------------------------------------ */

static inline int count_descriptors(void) {
    int count = 0;
    for (int fd = 0; fd < 1024; fd++)
        count += syscall(SYS_fcntl, fd, F_GETFD) >= 0;
    return count;
}

static inline bool has_child(void) { return waitpid(-1, NULL, WNOHANG) >= 0; }

#endif
