/* test_store_kill.c -- a process that writes to the store is killed at random moments, again and
 * again: every change that was acknowledged is there, nothing is there twice, the file is whole.
 * UNBAKE_KILLS sets how often (25). */
#include <poll.h>
#include <signal.h>
#include <sqlite3.h>
#include <sys/ioctl.h>
#include <sys/wait.h>

#include "common/file.h"
#include "common/mem.h"
#include "common/protocol.h"
#include "server/store/store.h"
#include "tests/check.h"

#define SCENE "aaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaa"
#define KEYS_MAX 20000

static struct error err;

#define OK(call) CHECK_THAT((call) == STATUS_OK, "%s", err.message)

/* What the child says, after the store said that it is so. */
struct acknowledged {
    int key; /* of the job */
    int64_t id;
    enum job_state state;
    int attempt;
    int metric_count;
};

static void tell(int fd, const struct acknowledged *a) {
    if (write(fd, a, sizeof *a) != (ssize_t)sizeof *a)
        _exit(1);
}

/* Makes jobs and takes each a part of the way that its key asks for. */
static void child(const char *dir, int first_key, int fd) {
    struct store *store;
    size_t requeued;
    bool existed, replayed;
    if (store_open(&store, dir, &err) != STATUS_OK || store_reconcile(store, NULL, 0, &requeued, &err) != STATUS_OK ||
        store_scene_add(store, SCENE, "s", 1, 0, &existed, &err) != STATUS_OK)
        _exit(2);
    if (!existed)
        store_scene_ready(store, SCENE, NULL, "{}", &err);
    for (int key = first_key; key < KEYS_MAX; key++) {
        char text[32];
        snprintf(text, sizeof text, "key-%d", key);
        struct job_new new = {.scene_id = SCENE,
                              .name = text,
                              .labels = "{}",
                              .settings = "{}",
                              .max_attempts = 3,
                              .idempotency_key = text,
                              .request_sha256 = text};
        struct acknowledged a = {.key = key, .state = JOB_QUEUED};
        if (store_job_add(store, &new, 1000000, &a.id, &replayed, &err) != STATUS_OK)
            _exit(3);
        tell(fd, &a);
        if (key % 4 == 0)
            continue;
        if (store_job_start(store, a.id, "process", &a.attempt, &err) != STATUS_OK)
            _exit(4);
        a.state = JOB_RUNNING;
        tell(fd, &a);
        for (int i = 0; i < key % 5; i++) {
            if (store_event_add(store, a.id, a.attempt, EVENT_METRIC, "{\"step\":1}", &err) != STATUS_OK)
                _exit(5);
            a.metric_count++;
            tell(fd, &a);
        }
        if (key % 4 == 1)
            continue;
        a.state = key % 4 == 2 ? JOB_SUCCEEDED : JOB_FAILED;
        if ((key % 4 == 2 ? store_job_succeed(store, a.id, a.attempt, "", &err)
                          : store_job_fail(store, a.id, a.attempt, "r", "h", &err)) != STATUS_OK)
            _exit(6);
        tell(fd, &a);
    }
    for (;;)
        pause(); /* enough */
}

struct found {
    int metric_count, state_count;
};

static void count_event(void *user, int64_t id, int64_t at_ms, int attempt, const char *type, const char *data) {
    struct found *found = user;
    (void)id, (void)at_ms, (void)attempt, (void)data;
    found->metric_count += strcmp(type, EVENT_METRIC) == 0;
    found->state_count += strcmp(type, EVENT_STATE) == 0;
}

/* What was acknowledged may have gone further, never back, but for the restart of what ran. */
static void verify(struct store *store, const struct acknowledged *a) {
    struct job job;
    struct found found = {0};
    OK(store_job_get(store, a->id, &job, &err));
    char name[32];
    snprintf(name, sizeof name, "key-%d", a->key);
    CHECK_STRING(job.name, name);
    CHECK_THAT(job.attempt >= a->attempt, "%s: attempt %d, was %d", name, job.attempt, a->attempt);
    if (job_is_terminal(a->state))
        CHECK_THAT(job.state == a->state, "%s: %s", name, job_state_name(job.state));
    OK(store_event_list(store, a->id, 0, 1000, count_event, &found, &err));
    CHECK_THAT(found.metric_count >= a->metric_count, "%s: %d metrics of %d", name, found.metric_count,
               a->metric_count);
    CHECK(found.state_count >= 1);
    job_release(&job);
}

static void check_integrity(const char *dir) {
    char *path = file_join(dir, "state.db");
    sqlite3 *db;
    sqlite3_stmt *stmt;
    CHECK(sqlite3_open(path, &db) == SQLITE_OK);
    CHECK(sqlite3_prepare_v2(db, "PRAGMA integrity_check", -1, &stmt, NULL) == SQLITE_OK);
    CHECK(sqlite3_step(stmt) == SQLITE_ROW);
    CHECK_STRING((const char *)sqlite3_column_text(stmt, 0), "ok");
    sqlite3_finalize(stmt);
    sqlite3_close(db);
    mem_free(path);
}

/* What the killed children have acknowledged. */
struct history {
    struct acknowledged *last; /* [KEYS_MAX] by key */
    int next_key, count;
};

/* A child works on the store until it is killed, after `sleep_us`; where `is_late`, not before it has done some work,
 * however slow the machine is. */
static void kill_once(const char *dir, struct history *h, bool is_late, unsigned sleep_us) {
    int ends[2];
    CHECK(pipe(ends) == 0);
    pid_t pid = fork();
    if (pid == 0) {
        close(ends[0]);
        child(dir, h->next_key, ends[1]);
    }
    close(ends[1]);
    for (int told = 0, i = 0; is_late && told < 3 && i < 60000; i++, poll(NULL, 0, 1)) {
        int waiting = 0;
        CHECK(ioctl(ends[0], FIONREAD, &waiting) == 0);
        told = waiting / (int)sizeof(struct acknowledged);
    }
    usleep(sleep_us);
    kill(pid, SIGKILL);
    int status;
    CHECK(waitpid(pid, &status, 0) == pid);
    CHECK_THAT(WIFSIGNALED(status), "the child ended by itself: %x", (unsigned)status);
    struct acknowledged a;
    while (read(ends[0], &a, sizeof a) == (ssize_t)sizeof a && a.key < KEYS_MAX) {
        h->last[a.key] = a;
        h->count++;
        h->next_key = a.key + 1;
    }
    close(ends[0]);
}

/* The next daemon finds all that was acknowledged. */
static void check_store(const char *dir, const struct history *h) {
    struct store *store;
    struct store_counts counts;
    size_t requeued;
    OK(store_open(&store, dir, &err));
    OK(store_reconcile(store, NULL, 0, &requeued, &err));
    for (int key = 0; key < h->next_key; key++)
        verify(store, &h->last[key]);
    /* At most the one job that was written but not acknowledged; its key is used again. */
    OK(store_count(store, &counts, &err));
    int64_t jobs = 0;
    for (int i = 0; i < JOB_STATE_COUNT; i++)
        jobs += counts.jobs_by_state[i];
    CHECK_THAT(jobs == h->next_key || jobs == h->next_key + 1, "%lld jobs, %d keys", (long long)jobs, h->next_key);
    CHECK(counts.jobs_by_state[JOB_RUNNING] == 0);
    store_close(store);
    check_integrity(dir);
}

int main(void) {
    char dir[] = "/tmp/unbake-test-store-kill-XXXXXX";
    if (!mkdtemp(dir))
        return 1;
    struct history h = {.last = mem_calloc(KEYS_MAX, sizeof *h.last)};
    const char *kills = getenv("UNBAKE_KILLS");
    int rounds = kills ? atoi(kills) : 25;
    uint32_t random = 4711;
    for (int round = 0; round < rounds; round++) {
        random = random * 1664525u + 1013904223u;
        kill_once(dir, &h, round % 2 == 0, 5000 + (random >> 8) % 35000);
        check_store(dir, &h);
    }
    printf("%d kills, %d acknowledged changes, none lost\n", rounds, h.count);
    CHECK(h.count > rounds);
    OK(file_remove_tree(dir, &err));
    mem_free(h.last);
    return check_result();
}
