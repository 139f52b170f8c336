/* test_scheduler.c -- the scheduler, its supervisor and the store with a worker that plays roles:
 * this program itself, started as `test_scheduler worker DIR`. A job's role is in its settings, a
 * scene's in its archive. */
#include "server/job/scheduler.h"

#include <dirent.h>
#include <fcntl.h>
#include <pthread.h>
#include <signal.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <time.h>

#include "common/file.h"
#include "common/mem.h"
#include "common/protocol.h"
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

static volatile sig_atomic_t told_to_stop;
static void on_term(int number) {
    (void)number;
    told_to_stop = 1;
}

static void announce(struct progress *p, const char *dir, const char *name, const char *claimed,
                     uint64_t bytes) {
    char *path = mem_printf("%s/out/%s", dir, name);
    if (file_replace(path, "data", 4, &err) != STATUS_OK)
        _exit(99);
    mem_free(path);
    progress_file(p, "output", claimed, bytes, SCENE_A, "text/plain");
}

/* What is left of files that were being written, and files that have their names. */
static const char *const scraps[] = {"job.json.tmp-a1B2c3", "out/a.exr.part", "out/compare/000.png.tmp-XYZxyz"};
static const char *const kept[] = {"checkpoint.db", "out/a.exr", "out/compare/000.png", "out/tmp-a1B2c3"};

static void litter(const char *dir) {
    char *inner = file_join(dir, "out/compare");
    OK(file_make_dirs(inner, &err));
    mem_free(inner);
    for (size_t i = 0; i < sizeof scraps / sizeof *scraps + sizeof kept / sizeof *kept; i++) {
        bool is_scrap = i < sizeof scraps / sizeof *scraps;
        char *path = file_join(dir, is_scrap ? scraps[i] : kept[i - sizeof scraps / sizeof *scraps]);
        int fd = open(path, O_WRONLY | O_CREAT | O_CLOEXEC, 0600);
        CHECK(fd >= 0);
        close(fd);
        mem_free(path);
    }
}

static bool is_tidy(const char *dir) {
    bool tidy = true;
    for (size_t i = 0; i < sizeof scraps / sizeof *scraps; i++)
        tidy = tidy && !file_is_in(dir, scraps[i]);
    for (size_t i = 0; i < sizeof kept / sizeof *kept; i++)
        CHECK_THAT(file_is_in(dir, kept[i]), "%s is gone", kept[i]);
    return tidy;
}

/* 0 when this process has only what a worker should have. */
static int check_surroundings(const char *dir) {
    int bad = 0;
    for (int fd = 4; fd < 1024; fd++)
        bad += fcntl(fd, F_GETFD) >= 0;
    bad += fcntl(PROGRESS_FD, F_GETFD) < 0;
    bad += getsid(0) != getpid();
    char text[16] = "";
    int fd = open("/proc/self/oom_score_adj", O_RDONLY);
    bad += read(fd, text, sizeof text - 1) <= 0 || atoi(text) != 500;
    close(fd);
    sigset_t blocked;
    sigprocmask(SIG_SETMASK, NULL, &blocked);
    bad += sigismember(&blocked, SIGTERM) != 0;
    char *log = file_join(dir, "worker.log");
    bad += access(log, F_OK) != 0;
    mem_free(log);
    return bad;
}

/* Says what no honest worker would: no JSON, too much of it, files that are not there, not its own or
 * of another size. An exit status where it cannot even lie. */
static int lie(struct progress *p, const char *dir) {
    static const char garbage[] = "\n{\"type\":\n[1,2]\n\"x\"\nnull\n{}\n{\"type\":7}\n\xff\xfe\n"
                                  "{\"type\":\"progress\",\"stage\":3}\n"
                                  "{\"type\":\"end\",\"status\":7}\n{\"type\":\"end\",\"status\":\"input\",\"message\":7}\n"
                                  "{\"type\":\"end\",\"status\":\"input\",\"hint\":7}\n"
                                  "{\"type\":\"checkpoint\",\"iteration\":\"x\"}\n{\"type\":\"checkpoint\",\"bytes\":\"x\"}\n"
                                  "{\"type\":\"checkpoint\",\"seconds\":\"x\"}\n{\"type\":\"metric\",\"series\":7}\n"
                                  "{\"type\":\"metric\",\"step\":\"x\"}\n{\"type\":\"metric\",\"value\":\"x\"}\n"
                                  "{\"type\":\"output\",\"name\":7}\n{\"type\":\"output\",\"sha256\":7}\n"
                                  "{\"type\":\"output\",\"content_type\":7}\n{\"type\":\"output\",\"bytes\":\"x\"}\n";
    if (write(PROGRESS_FD, garbage, sizeof garbage - 1) < 0)
        return 98;
    char *huge = mem_alloc(300000);
    memset(huge, 'x', 300000);
    huge[299999] = '\n';
    for (size_t at = 0; at < 300000;) {
        ssize_t wrote = write(PROGRESS_FD, huge + at, 300000 - at);
        if (wrote < 0)
            return 97;
        at += (size_t)wrote;
    }
    mem_free(huge);
    char *order = file_join(dir, "job.json");
    struct stat info;
    if (stat(order, &info) != 0)
        return 93;
    mem_free(order);
    announce(p, dir, "a.txt", "../job.json", (uint64_t)info.st_size);
    announce(p, dir, "a.txt", "missing.txt", 4);
    announce(p, dir, "a.txt", "a.txt", 5);
    char *link = mem_printf("%s/out/link.txt", dir);
    if (symlink("a.txt", link) == 0)
        progress_file(p, "output", "link.txt", 5, SCENE_A, "text/plain");
    mem_free(link);
    return 0;
}

static int play(const char *role, const char *dir, int attempt) {
    struct progress p = {PROGRESS_FD};
    signal(SIGTERM, on_term);
    if (strcmp(role, "once") == 0)
        role = attempt == 1 ? "segv" : "good";
    if (strcmp(role, "segv") == 0) {
        fprintf(stderr, "fatal: boom\n");
        signal(SIGSEGV, SIG_DFL); /* also under a sanitizer */
        raise(SIGSEGV);
    }
    if (strcmp(role, "hang") == 0) {
        progress_stage(&p, "refine");
        while (!told_to_stop)
            usleep(2000);
        return PROGRESS_EXIT_STOPPED;
    }
    if (strcmp(role, "stubborn") == 0) {
        progress_stage(&p, "refine");
        for (;;)
            usleep(10000);
    }
    if (strcmp(role, "input") == 0) {
        progress_end(&p, STATUS_INPUT, "the mesh is empty", "export it again");
        return PROGRESS_EXIT_INPUT;
    }
    if (strcmp(role, "full") == 0) {
        progress_end(&p, STATUS_NO_SPACE, "checkpoint.db: no space", "");
        return PROGRESS_EXIT_NO_SPACE;
    }
    if (strcmp(role, "memory") == 0) {
        fprintf(stderr, "out of memory: could not allocate 12345 bytes\n");
        return PROGRESS_EXIT_MEMORY;
    }
    if (strcmp(role, "killed") == 0) {
        litter(dir);
        kill(getpid(), SIGKILL);
    }
    if (strcmp(role, "silent") == 0)
        return 0;
    if (strcmp(role, "two-faced") == 0) {
        progress_end(&p, STATUS_IO, "the disk is broken", "");
        return 0;
    }
    if (strcmp(role, "broken") == 0) {
        progress_end(&p, STATUS_IO, "the disk is broken", "");
        return PROGRESS_EXIT_FAILED;
    }
    if (strcmp(role, "late") == 0) {
        progress_end(&p, STATUS_OK, "", "");
        return PROGRESS_EXIT_FAILED;
    }
    if (strcmp(role, "deserter") == 0)
        return PROGRESS_EXIT_STOPPED;
    if (strcmp(role, "surroundings") == 0) {
        int bad = check_surroundings(dir);
        progress_end(&p, bad ? STATUS_INPUT : STATUS_OK, "surroundings", "");
        return bad ? PROGRESS_EXIT_INPUT : 0;
    }
    if (strcmp(role, "liar") == 0) {
        int bad = lie(&p, dir);
        if (bad)
            return bad;
    }
    progress_stage(&p, "prepare");
    progress_step(&p, "refine", 3, 4, 1.5);
    progress_metric(&p, "loss", 3, 0.25);
    progress_log(&p, "info", "hello");
    progress_checkpoint(&p, 3, 1000000, 0.1);
    announce(&p, dir, "good.txt", "good.txt", 4);
    progress_end(&p, STATUS_OK, "", "");
    return 0;
}

/* "large" fits the disk once there is a file "room" in the data folder. */
static int play_check(const char *role, const char *dir) {
    struct progress p = {PROGRESS_FD};
    char *files = file_join(dir, "files"), *room = file_join(dir, "../../room");
    if (file_make_dirs(files, &err) != STATUS_OK)
        return 92;
    if (strcmp(role, "crash") == 0)
        abort();
    if (strcmp(role, "large") == 0 && access(room, F_OK) != 0) {
        progress_end(&p, STATUS_NO_SPACE, "cannot write mesh.ply", "");
        return PROGRESS_EXIT_NO_SPACE;
    }
    mem_free(files);
    mem_free(room);
    if (strcmp(role, "bad") == 0) {
        progress_problem(&p, "mesh.ply", "face 3 has no area", NULL);
        progress_problem(&p, "images/1.png", "is truncated", "copy it again");
        progress_end(&p, STATUS_INPUT, "2 problems", "");
        return PROGRESS_EXIT_INPUT;
    }
    cJSON *facts = cJSON_CreateObject();
    json_add_int(facts, "frame_count", 12);
    progress_scene(&p, facts);
    progress_end(&p, STATUS_OK, "", "");
    return 0;
}

static int worker(const char *dir) {
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

/* --- the daemon's side ------------------------------------------------------------------------ */

struct daemon {
    char *dir;
    struct store *store;
    struct scheduler *scheduler;
    pthread_t thread;
};

static void *run_scheduler(void *argument) {
    struct daemon *d = argument;
    struct error mine;
    if (scheduler_run(d->scheduler, &mine) != STATUS_OK)
        fprintf(stderr, "%s\n", mine.message);
    return NULL;
}

static void daemon_start(struct daemon *d, int max_running, const char *binary) {
    struct scheduler_config config = {
        .data_dir = d->dir, .worker_binary = binary, .max_running = max_running, .thread_count = 4,
        .checkpoint_interval_sec = 60, .stop_grace_sec = 0.2, .sandbox = false};
    OK(store_open(&d->store, d->dir, &err));
    OK(scheduler_new(&d->scheduler, &config, d->store, &err));
    CHECK(pthread_create(&d->thread, NULL, run_scheduler, d) == 0);
}

static void daemon_stop(struct daemon *d) {
    scheduler_stop(d->scheduler);
    pthread_join(d->thread, NULL);
    CHECK(scheduler_running(d->scheduler) == 0);
    scheduler_free(d->scheduler);
    store_close(d->store);
}

static void add_scene(struct daemon *d, const char *id, const char *role) {
    bool existed;
    char *path = mem_printf("%s/scenes/%s/archive", d->dir, id);
    char *dir = mem_printf("%s/scenes/%s", d->dir, id);
    OK(file_make_dirs(dir, &err));
    OK(file_replace(path, role, strlen(role), &err));
    OK(store_scene_add(d->store, id, "scene", strlen(role), 0, &existed, &err));
    scheduler_wake(d->scheduler);
    mem_free(path);
    mem_free(dir);
}

/* 0 when the store refuses because the scene has been rejected by now. */
static int64_t submit(struct daemon *d, const char *scene, const char *role) {
    char *settings = mem_printf("{\"role\":\"%s\"}", role);
    struct job_new new = {.scene_id = scene, .name = role, .labels = "{}", .settings = settings,
                          .max_attempts = 2};
    int64_t id = 0;
    bool replayed;
    enum status status = store_job_add(d->store, &new, 1000, &id, &replayed, &err);
    CHECK_THAT(status == STATUS_OK ||
                   (status == STATUS_CONFLICT && strstr(err.message, "was rejected") != NULL),
               "%s", err.message);
    scheduler_wake(d->scheduler);
    mem_free(settings);
    return id;
}

/* Waits until the job is in the state and, if given, in the stage; false when it does not come. */
static bool wait_for(struct daemon *d, int64_t id, enum job_state state, const char *stage) {
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

static bool wait_for_scene(struct daemon *d, const char *id, enum scene_state state) {
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

static void expect(struct daemon *d, int64_t id, enum job_state state, int attempt,
                   const char *reason, const char *hint) {
    struct job job;
    CHECK_THAT(wait_for(d, id, state, NULL), "job %lld is not %s", (long long)id,
               job_state_name(state));
    OK(store_job_get(d->store, id, &job, &err));
    CHECK_THAT(job.attempt == attempt, "job \"%s\": attempt %d", job.name, job.attempt);
    CHECK_THAT(strstr(job.reason, reason) != NULL, "job \"%s\": \"%s\"", job.name, job.reason);
    CHECK_THAT(strstr(job.hint, hint) != NULL, "job \"%s\": \"%s\"", job.name, job.hint);
    job_release(&job);
}

struct tally {
    int progress, metric, log, output, state;
};

static void tally_one(void *user, int64_t id, int64_t at_ms, int attempt, const char *type,
                      const char *data) {
    struct tally *t = user;
    (void)id, (void)at_ms, (void)attempt;
    t->progress += strcmp(type, EVENT_PROGRESS) == 0 && strstr(data, "\"done\":3") != NULL;
    t->metric += strcmp(type, EVENT_METRIC) == 0 && strstr(data, "0.25") != NULL;
    t->log += strcmp(type, EVENT_LOG) == 0;
    t->output += strcmp(type, EVENT_OUTPUT) == 0;
    t->state += strcmp(type, EVENT_STATE) == 0;
    CHECK(strstr(data, "\"type\"") == NULL);
}

static void check_whole_life(struct daemon *d, int64_t id, int states) {
    struct tally t = {0};
    OK(store_event_list(d->store, id, 0, 1000, tally_one, &t, &err));
    CHECK_THAT(t.progress == 1 && t.metric == 1 && t.log == 2 && t.output == 1 && t.state == states,
               "%d %d %d %d %d", t.progress, t.metric, t.log, t.output, t.state);
    struct output_row *rows;
    size_t count;
    OK(store_output_list(d->store, id, &rows, &count, &err));
    CHECK(count == 1 && strcmp(rows[0].name, "good.txt") == 0 && rows[0].bytes == 4);
    for (size_t i = 0; i < count; i++)
        output_row_release(&rows[i]);
    mem_free(rows);
}

/* A scene's problems, as soon as it has some. */
static void expect_problems(struct daemon *d, const char *id, enum scene_state state, const char *part) {
    struct scene_row row = {0};
    for (int i = 0; i < WAIT_TRIES; i++) {
        scene_row_release(&row);
        OK(store_scene_get(d->store, id, &row, &err));
        if (strcmp(row.problems, "[]") != 0)
            break;
        usleep(WAIT_US);
    }
    CHECK_THAT(row.state == state && strstr(row.problems, part), "scene %.3s is %s: %s", id,
               scene_state_name(row.state), row.problems);
    scene_row_release(&row);
    char *files = mem_printf("%s/scenes/%s/files", d->dir, id);
    CHECK_THAT(access(files, F_OK) != 0, "%s is left", files);
    mem_free(files);
}

/* A scene for which the disk has no room is not at fault: it waits, and so do its jobs, while others go
 * on; it can be removed; and it is checked again when it is sent again, when the daemon starts, and
 * when there is more room (tests/api/test_retention.sh). */
static void test_no_room(struct daemon *d) {
    bool is_gone;
    char *room = file_join(d->dir, "room");
    daemon_start(d, 1, "/proc/self/exe");
    add_scene(d, SCENE_D, "large");
    expect_problems(d, SCENE_D, SCENE_CHECKING, "disk full: cannot write mesh.ply");
    add_scene(d, SCENE_D, "large");
    expect_problems(d, SCENE_D, SCENE_CHECKING, "disk full");
    add_scene(d, SCENE_E, "crash");
    expect_problems(d, SCENE_E, SCENE_REJECTED, "crashed");
    OK(store_scene_delete(d->store, SCENE_D, -1, false, &is_gone, &err));
    add_scene(d, SCENE_D, "large");
    expect_problems(d, SCENE_D, SCENE_CHECKING, "disk full");
    int64_t job = submit(d, SCENE_D, "good");
    daemon_stop(d);
    OK(file_replace(room, "", 0, &err));
    daemon_start(d, 1, "/proc/self/exe");
    expect(d, job, JOB_SUCCEEDED, 1, "", "");
    daemon_stop(d);
    mem_free(room);
}

static void test_outcomes(struct daemon *d) {
    daemon_start(d, 2, "/proc/self/exe");
    add_scene(d, SCENE_A, "good");
    add_scene(d, SCENE_B, "bad");
    add_scene(d, SCENE_C, "crash");
    int64_t early = submit(d, SCENE_B, "good"); /* before the check is over, perhaps */
    CHECK(wait_for_scene(d, SCENE_A, SCENE_READY));
    CHECK(wait_for_scene(d, SCENE_B, SCENE_REJECTED));
    CHECK(wait_for_scene(d, SCENE_C, SCENE_REJECTED));
    struct scene_row row;
    OK(store_scene_get(d->store, SCENE_A, &row, &err));
    CHECK_STRING(row.facts, "{\"frame_count\":12}");
    scene_row_release(&row);
    OK(store_scene_get(d->store, SCENE_B, &row, &err));
    CHECK_STRING(row.problems, "[{\"file\":\"mesh.ply\",\"reason\":\"face 3 has no area\"},"
                               "{\"file\":\"images/1.png\",\"reason\":\"is truncated\",\"hint\":\"copy it again\"}]");
    scene_row_release(&row);
    OK(store_scene_get(d->store, SCENE_C, &row, &err));
    CHECK_THAT(strstr(row.problems, "crashed (Aborted") != NULL, "%s", row.problems);
    scene_row_release(&row);
    if (early)
        expect(d, early, JOB_FAILED, 1, "was rejected", "problems");

    int64_t good = submit(d, SCENE_A, "good"), once = submit(d, SCENE_A, "once");
    int64_t segv = submit(d, SCENE_A, "segv"), liar = submit(d, SCENE_A, "liar");
    int64_t input = submit(d, SCENE_A, "input"), full = submit(d, SCENE_A, "full");
    int64_t memory = submit(d, SCENE_A, "memory"), killed = submit(d, SCENE_A, "killed");
    int64_t silent = submit(d, SCENE_A, "silent"), deserter = submit(d, SCENE_A, "deserter");
    int64_t around = submit(d, SCENE_A, "surroundings"), damaged = submit(d, SCENE_A, "\"");
    int64_t two_faced = submit(d, SCENE_A, "two-faced"), broken = submit(d, SCENE_A, "broken"), late = submit(d, SCENE_A, "late");
    expect(d, good, JOB_SUCCEEDED, 1, "", "");
    check_whole_life(d, good, 3);
    expect(d, once, JOB_SUCCEEDED, 2, "", "");
    check_whole_life(d, once, 5);
    expect(d, segv, JOB_FAILED, 2, "crashed (Segmentation fault); its last words: fatal: boom", "");
    expect(d, liar, JOB_SUCCEEDED, 1, "", "");
    check_whole_life(d, liar, 3);
    expect(d, input, JOB_FAILED, 1, "the mesh is empty", "export it again");
    expect(d, full, JOB_PAUSED, 1, "disk full: checkpoint.db", "resume");
    expect(d, memory, JOB_FAILED, 2, "could not allocate 12345", "smaller texture_size");
    expect(d, killed, JOB_FAILED, 2, "killed from outside", "smaller texture_size");
    char *killed_dir = mem_printf("%s/jobs/%lld", d->dir, (long long)killed);
    CHECK(is_tidy(killed_dir));
    mem_free(killed_dir);
    expect(d, silent, JOB_FAILED, 2, "without a result", "");
    expect(d, deserter, JOB_FAILED, 2, "told to stop from outside", "");
    expect(d, around, JOB_SUCCEEDED, 1, "", "");
    expect(d, damaged, JOB_FAILED, 1, "the job's settings", "");
    expect(d, two_faced, JOB_FAILED, 2, "without a result", "");
    expect(d, broken, JOB_FAILED, 2, "the disk is broken", "");
    expect(d, late, JOB_FAILED, 2, "ended with status", "");
    daemon_stop(d);
}

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
        if (atoi(entry->d_name) > 0 && file_read(path, &line, NULL) == STATUS_OK &&
            line.length > strlen(dir) &&
            memmem(line.data, line.length, dir, strlen(dir)) != NULL &&
            memmem(line.data, line.length, "worker", 7) != NULL)
            found = atoi(entry->d_name);
        mem_free(path);
        buf_release(&line);
    }
    closedir(proc);
    return found;
}

/* The daemon is killed: its worker dies with it, and the next daemon takes up the job. */
static void test_daemon_killed(struct daemon *d) {
    int ends[2];
    CHECK(pipe(ends) == 0);
    pid_t child = fork();
    if (child == 0) {
        struct scheduler_config config = {.data_dir = d->dir, .worker_binary = "/proc/self/exe",
                                          .max_running = 1, .thread_count = 1,
                                          .stop_grace_sec = 1};
        if (store_open(&d->store, d->dir, &err) != STATUS_OK ||
            scheduler_new(&d->scheduler, &config, d->store, &err) != STATUS_OK)
            _exit(1);
        add_scene(d, SCENE_A, "good");
        int64_t id = submit(d, SCENE_A, "hang");
        if (write(ends[1], &id, sizeof id) != (ssize_t)sizeof id)
            _exit(1);
        scheduler_run(d->scheduler, &err);
        _exit(1);
    }
    close(ends[1]);
    int64_t id = 0;
    CHECK(read(ends[0], &id, sizeof id) == (ssize_t)sizeof id);
    close(ends[0]);
    char *job_dir = mem_printf("%s/jobs/%lld", d->dir, (long long)id);
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

    daemon_start(d, 1, "/proc/self/exe");
    struct job job = {0};
    for (int i = 0; i < WAIT_TRIES && job.attempt < 2; i++) {
        usleep(WAIT_US);
        job_release(&job);
        OK(store_job_get(d->store, id, &job, &err));
    }
    CHECK(job.attempt == 2 && job.attempts_left == 2);
    CHECK(is_tidy(job_dir));
    job_release(&job);
    OK(store_job_cancel(d->store, id, &err));
    scheduler_wake(d->scheduler);
    expect(d, id, JOB_CANCELLED, 2, "", "");
    daemon_stop(d);
    mem_free(job_dir);
}

int main(int argc, char **argv) {
    if (argc == 3 && strcmp(argv[1], "worker") == 0)
        _exit(worker(argv[2])); /* past the leak check: its roles do not tidy up */
    struct rlimit no_core = {0, 0};
    setrlimit(RLIMIT_CORE, &no_core);
    struct daemon d = {.dir = mem_strdup("/tmp/unbake-test-scheduler-XXXXXX")};
    if (!mkdtemp(d.dir))
        return 1;
    test_daemon_killed(&d); /* first: it forks, and this process has no threads yet */
    test_outcomes(&d);
    test_no_room(&d);
    test_wishes(&d);
    test_false_start(&d);
    OK(file_remove_tree(d.dir, &err));
    mem_free(d.dir);
    return check_result();
}
