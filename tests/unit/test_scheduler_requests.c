/* test_scheduler_requests.c -- what users ask of the scheduler while jobs run, and what the machine does to it: workers
 * that do not start, a daemon that is killed (scheduler_rig.h). */
#include <dirent.h>
#include <sys/wait.h>

#include "tests/unit/scheduler_rig.h"

#define LARGE_BYTES 3e9

/* --- the worker's side ----------------------------------------------------------------------- */

static int play(const char *role, const char *dir, int attempt) {
    struct progress p = {.fd = PROGRESS_FD};
    (void)dir, (void)attempt;
    signal(SIGTERM, on_term);
    if (strcmp(role, "good") != 0) {
        progress_stage(&p, "refine");
        while (!told_to_stop || strcmp(role, "stubborn") == 0)
            usleep(2000);
        return PROGRESS_EXIT_STOPPED;
    }
    progress_end(&p, STATUS_OK, "", "");
    return 0;
}

static int play_check(const char *role, const char *dir) {
    struct progress p = {.fd = PROGRESS_FD};
    (void)dir;
    if (strcmp(role, "large") == 0) {
        cJSON *facts = cJSON_CreateObject();
        json_add_number(facts, "memory_bytes", LARGE_BYTES);
        progress_scene(&p, facts);
        progress_end(&p, STATUS_OK, "", "");
    } else {
        check_out(&p);
    }
    return 0;
}

/* --- the daemon's side ------------------------------------------------------------------------ */

static void test_wishes(struct daemon *d) {
    daemon_start(d, 1, "/proc/self/exe");
    int64_t first = submit(d, SCENE_A, "hang"), second = submit(d, SCENE_A, "good");
    CHECK(wait_for(d, first, JOB_RUNNING, "refine"));
    CHECK(wait_for(d, second, JOB_QUEUED, NULL)); /* one at a time */
    OK(store_job_pause(d->store, first, &err));
    scheduler_wake(d->scheduler);
    expect(d, first, JOB_PAUSED, 1, "", "");
    expect(d, second, JOB_SUCCEEDED, 1, "", "");
    OK(store_job_resume(d->store, first, NULL, &err));
    scheduler_wake(d->scheduler);
    CHECK(wait_for(d, first, JOB_RUNNING, "refine"));
    OK(store_job_cancel(d->store, first, &err));
    scheduler_wake(d->scheduler);
    expect(d, first, JOB_CANCELLED, 2, "", "");

    /* One that does not listen is killed when its grace is over, and still only paused. */
    int64_t deaf = submit(d, SCENE_A, "stubborn");
    CHECK(wait_for(d, deaf, JOB_RUNNING, "refine"));
    OK(store_job_pause(d->store, deaf, &err));
    scheduler_wake(d->scheduler);
    expect(d, deaf, JOB_PAUSED, 1, "", "");
    OK(store_job_cancel(d->store, deaf, &err));

    /* A stop of the daemon is no failed attempt. */
    int64_t last = submit(d, SCENE_A, "hang");
    CHECK(wait_for(d, last, JOB_RUNNING, "refine"));
    daemon_stop(d);
    OK(store_open(&d->store, d->dir, &err));
    struct job job;
    OK(store_job_get(d->store, last, &job, &err));
    CHECK(job.state == JOB_QUEUED && job.attempt == 1 && job.attempts_left == 2);
    job_release(&job);
    OK(store_job_cancel(d->store, last, &err));
    store_close(d->store);
}

/* No program to run: the machine's fault, so nothing fails and nobody spins. */
static void test_false_start(struct daemon *d) {
    char *jobs = file_join(d->dir, "jobs"), *away = file_join(d->dir, "jobs-away");
    daemon_start(d, 1, "/nonexistent/unbaked");
    int64_t id = submit(d, SCENE_A, "good");
    expect(d, id, JOB_FAILED, 2, "cannot execute the worker's program", "");
    daemon_stop(d);

    CHECK(rename(jobs, away) == 0);
    int fd = open(jobs, O_WRONLY | O_CREAT, 0600); /* a file where the folder should be */
    close(fd);
    daemon_start(d, 1, "/proc/self/exe");
    id = submit(d, SCENE_A, "good");
    for (int i = 0; i < WAIT_TRIES; i++) {
        struct job job;
        OK(store_job_get(d->store, id, &job, &err));
        bool tried = job.state == JOB_QUEUED && job.attempt > 0;
        CHECK(!tried || (job.reason[0] && job.attempts_left == 2));
        job_release(&job);
        if (tried)
            break;
        usleep(WAIT_US);
    }
    CHECK(unlink(jobs) == 0 && rename(away, jobs) == 0);
    scheduler_wake(d->scheduler);
    CHECK(wait_for(d, id, JOB_SUCCEEDED, NULL));
    daemon_stop(d);
    mem_free(jobs);
    mem_free(away);
}

static pid_t worker_pid(const char *dir) {
    /* Whose only argument after "worker" is this folder. */
    DIR *proc = opendir("/proc");
    struct dirent *entry;
    pid_t found = 0;
    while (!found && (entry = readdir(proc)) != NULL) {
        struct buf line;
        buf_init(&line, 4096);
        char *path = mem_printf("/proc/%s/cmdline", entry->d_name);
        if (atoi(entry->d_name) > 0 && file_read(path, &line, NULL) == STATUS_OK && line.length > strlen(dir) &&
            memmem(line.data, line.length, dir, strlen(dir)) != NULL &&
            memmem(line.data, line.length, "worker", 7) != NULL)
            found = atoi(entry->d_name);
        mem_free(path);
        buf_release(&line);
    }
    closedir(proc);
    return found;
}

/* A daemon in a process of its own, with one job that hangs, whose number it writes to `to`. */
static void be_daemon(struct daemon *d, int to) {
    struct scheduler_config config = {.data_dir = d->dir,
                                      .executor = process_executor_init(&at_home, "/proc/self/exe", d->dir),
                                      .max_running = 1,
                                      .thread_count = 1,
                                      .stop_grace_sec = 1};
    if (store_open(&d->store, d->dir, &err) != STATUS_OK ||
        scheduler_new(&d->scheduler, &config, d->store, &err) != STATUS_OK)
        _exit(1);
    add_scene(d, SCENE_A, "good");
    int64_t id = submit(d, SCENE_A, "hang");
    if (write(to, &id, sizeof id) != (ssize_t)sizeof id)
        _exit(1);
    scheduler_run(d->scheduler, &err);
    _exit(1);
}

/* The second attempt has the checkpoint of the first, whose folder is `job_dir`; one that it had lost is not used. */
static void check_taken_checkpoint(const char *job_dir) {
    char *former = file_join(job_dir, "checkpoint"), *present = mem_printf("%s/../attempt-2/checkpoint", job_dir);
    for (int i = 0; i < WAIT_TRIES && access(former, F_OK) == 0; i++)
        usleep(WAIT_US);
    CHECK(file_is_in(present, "checkpoint.db"));
    OK(file_make_dirs(former, &err));
    char *there = file_join(former, "checkpoint.db");
    OK(file_replace(there, "", 0, &err));
    CHECK(is_tidy(job_dir));
    OK(file_remove_tree(former, &err));
    mem_free(there);
    mem_free(present);
    mem_free(former);
}

/* The daemon is killed: its worker dies with it, and the next daemon takes up the job. */
static void test_daemon_killed(struct daemon *d) {
    int ends[2];
    CHECK(pipe(ends) == 0);
    pid_t child = fork();
    if (child == 0)
        be_daemon(d, ends[1]);
    close(ends[1]);
    int64_t id = 0;
    CHECK(read(ends[0], &id, sizeof id) == (ssize_t)sizeof id);
    close(ends[0]);
    char *job_dir = mem_printf("%s/jobs/%lld/attempt-1", d->dir, (long long)id);
    pid_t pid = 0;
    for (int i = 0; i < WAIT_TRIES && !pid; i++) {
        usleep(WAIT_US);
        pid = worker_pid(job_dir);
    }
    CHECK(pid > 0);
    kill(child, SIGKILL);
    waitpid(child, NULL, 0);
    for (int i = 0; i < WAIT_TRIES && worker_pid(job_dir); i++)
        usleep(WAIT_US);
    CHECK_THAT(worker_pid(job_dir) == 0, "worker %d outlived its daemon", (int)pid);
    litter(job_dir);
    OK(store_open(&d->store, d->dir, &err));
    OK(store_output_put(d->store, id, 1, EVENT_OUTPUT, "tmp-a1B2c3", 0, SCENE_A, "text/plain", &err));
    store_close(d->store);

    daemon_start(d, 1, "/proc/self/exe");
    struct job job = {0};
    for (int i = 0; i < WAIT_TRIES && job.attempt < 2; i++) {
        usleep(WAIT_US);
        job_release(&job);
        OK(store_job_get(d->store, id, &job, &err));
    }
    CHECK(job.attempt == 2 && job.attempts_left == 2);
    check_taken_checkpoint(job_dir);
    job_release(&job);
    OK(store_job_cancel(d->store, id, &err));
    scheduler_wake(d->scheduler);
    expect(d, id, JOB_CANCELLED, 2, "", "");
    daemon_stop(d);
    mem_free(job_dir);
}

/* Where there is memory for one and a half of them, one of three large jobs runs at a time, and what is behind them
 * waits for its turn though it would fit. */
static void test_memory(struct daemon *d) {
    struct scheduler_config config = {.data_dir = d->dir,
                                      .executor = process_executor_init(&at_home, "/proc/self/exe", d->dir),
                                      .max_running = 3,
                                      .thread_count = 4,
                                      .jobs_memory_bytes = (uint64_t)(1.5 * LARGE_BYTES),
                                      .stop_grace_sec = 1};
    OK(store_open(&d->store, d->dir, &err));
    OK(scheduler_new(&d->scheduler, &config, d->store, &err));
    CHECK(pthread_create(&d->thread, NULL, run_scheduler, d) == 0);
    add_scene(d, SCENE_A, "good");
    add_scene(d, SCENE_C, "large");
    CHECK(wait_for_scene(d, SCENE_C, SCENE_READY));
    int64_t first = submit(d, SCENE_C, "hang");
    CHECK(wait_for(d, first, JOB_RUNNING, "refine"));
    int64_t small = submit(d, SCENE_A, "hang"); /* of which nothing is foretold */
    CHECK(wait_for(d, small, JOB_RUNNING, "refine"));
    int64_t second = submit(d, SCENE_C, "good"), third = submit(d, SCENE_A, "good");
    struct job job = {0};
    for (int i = 0; i < WAIT_TRIES && !(job.reason && *job.reason); i++) {
        usleep(WAIT_US);
        job_release(&job);
        OK(store_job_get(d->store, second, &job, &err));
    }
    CHECK_THAT(job.state == JOB_QUEUED && strstr(job.reason, "waits for memory"), "%s", job.reason);
    job_release(&job);
    expect(d, third, JOB_QUEUED, 0, "", "");
    OK(store_job_cancel(d->store, first, &err));
    scheduler_wake(d->scheduler);
    expect(d, second, JOB_SUCCEEDED, 1, "", "");
    expect(d, third, JOB_SUCCEEDED, 1, "", "");
    OK(store_job_cancel(d->store, small, &err));
    scheduler_wake(d->scheduler);
    expect(d, small, JOB_CANCELLED, 1, "", "");
    daemon_stop(d);
}

int main(int argc, char **argv) {
    struct daemon d;
    daemon_begin(&d, argc, argv);
    test_daemon_killed(&d); /* first: it forks, and this process has no threads yet */
    test_wishes(&d);
    test_false_start(&d);
    test_memory(&d);
    daemon_end(&d);
    return check_result();
}
