/* test_backup.c -- a copy of the database while others write it: whole, openable, and holding
 * everything that was acknowledged before it began. */
#include <pthread.h>
#include <signal.h>
#include <stdatomic.h>
#include <sys/resource.h>

#include "tests/sql_faults.h"
#include "tests/unit/store_rig.h"

#define JOBS_BEFORE 50
#define WRITERS 2

struct shared {
    struct store *store;
    atomic_bool stop;
    atomic_int written;
};

static void *write_jobs(void *user) {
    struct shared *s = user;
    struct error mine;
    char labels[4096];
    memset(labels, ' ', sizeof labels);
    memcpy(labels, "{}", 2);
    labels[sizeof labels - 1] = '\0';
    struct job_new new = {.scene_id = SCENE_A, .name = "n", .labels = labels, .settings = "{}", .max_attempts = 2};
    while (!atomic_load(&s->stop)) {
        int64_t id;
        bool replayed;
        if (store_job_add(s->store, &new, 1000000, &id, &replayed, &mine) == STATUS_OK)
            atomic_fetch_add(&s->written, 1);
        usleep(500); /* the lock of the store is not a fair one */
    }
    return NULL;
}

static int64_t count_jobs(struct store *store) {
    struct store_counts counts;
    OK(store_count(store, &counts, &err));
    return counts.jobs_by_state[JOB_QUEUED];
}

/* Files of more than 32 KiB cannot be written, so SQLite tells of a failed write, not of a full disk. */
static void test_full_disk(struct store *store, const char *path) {
    struct rlimit before, small;
    CHECK(getrlimit(RLIMIT_FSIZE, &before) == 0);
    small = before;
    small.rlim_cur = 32768;
    signal(SIGXFSZ, SIG_IGN);
    CHECK(setrlimit(RLIMIT_FSIZE, &small) == 0);
    IS(store_backup(store, path, &err), STATUS_NO_SPACE);
    CHECK(setrlimit(RLIMIT_FSIZE, &before) == 0);
    CHECK_THAT(strstr(err.message, path) && strstr(err.message, "disk is full") && *err.hint, "%s", err.message);
    CHECK(unlink(path) == 0);
    OK(store_backup(store, path, &err));
    CHECK(unlink(path) == 0);
}

/* As the library itself cannot be made to fail: the call that opens the copy, copies pages, makes it one file. */
static void test_calls(struct store *store, const char *path) {
    static const long calls[] = {1, 3, 4};
    for (size_t i = 0; i < 3; i++)
        for (size_t fault = 0; fault < SQL_FAULTS; fault++) {
            sql_faults_arm(calls[i]);
            sql_fault = &sql_faults[fault];
            enum status status = store_backup(store, path, &err);
            CHECK(sql_faults_lift());
            CHECK_THAT(status == (sql_faults[fault].status == STATUS_NO_SPACE ? STATUS_NO_SPACE : STATUS_IO),
                       "call %ld, fault %zu: %s", calls[i], fault, status_name(status));
            unlink(path);
        }
}

int main(void) {
    char *dir = fresh_dir(), *to = fresh_dir(), token[TOKEN_SIZE];
    char *path = file_join(to, "state.db"), *nowhere = file_join(to, "none/state.db");
    struct shared shared = {.written = 0};
    struct store *copy;
    struct caller who;
    pthread_t threads[WRITERS];
    int64_t id;
    OK(store_open(&shared.store, dir, &err));
    add_ready_scene(shared.store, SCENE_A);
    OK(store_token_add(shared.store, "alice", ROLE_USER, 0, token, &id, &err));
    for (int i = 0; i < JOBS_BEFORE; i++)
        add_job(shared.store, SCENE_A, 0);
    for (int i = 0; i < WRITERS; i++)
        CHECK(pthread_create(&threads[i], NULL, write_jobs, &shared) == 0);
    while (atomic_load(&shared.written) < 5)
        sched_yield();
    int64_t before = count_jobs(shared.store);
    OK(store_backup(shared.store, path, &err));
    int64_t after = count_jobs(shared.store);
    IS(store_backup(shared.store, nowhere, &err), STATUS_IO);
    atomic_store(&shared.stop, true);
    for (int i = 0; i < WRITERS; i++)
        pthread_join(threads[i], NULL);
    CHECK(access(path, R_OK) == 0);
    char *wal = mem_printf("%s-wal", path);
    CHECK(access(wal, F_OK) != 0); /* one file is all of it */
    mem_free(wal);
    OK(store_open(&copy, to, &err));
    int64_t copied = count_jobs(copy);
    CHECK_THAT(copied >= before && copied <= after, "%lld jobs in the copy; %lld before it, %lld after",
               (long long)copied, (long long)before, (long long)after);
    OK(store_token_find(copy, token, &who, &err)); /* who could come in before can after a restore */
    store_close(copy);
    mem_free(path);
    path = file_join(to, "second.db");
    test_full_disk(shared.store, path);
    test_calls(shared.store, path);
    store_close(shared.store);
    mem_free(path);
    mem_free(nowhere);
    drop_dir(dir);
    drop_dir(to);
    return check_result();
}
