/* test_scheduler.c -- how attempts of jobs and checks of scenes end, and what the scheduler makes of it; a worker plays
 * all that may happen (scheduler_rig.h). */
#include <stdatomic.h>
#include <sys/stat.h>

#include "server/data/layout.h"
#include "server/data/trash.h"
#include "tests/unit/scheduler_rig.h"

#define TRASH_SCENE "7777777777777777777777777777777777777777777777777777777777777777"

/* --- the worker's side ----------------------------------------------------------------------- */

static void announce(struct progress *p, const char *dir, const char *name, const char *claimed, uint64_t bytes) {
    char *path = mem_printf("%s/out/%s", dir, name);
    if (file_replace(path, "data", 4, &err) != STATUS_OK)
        _exit(99);
    mem_free(path);
    progress_file(p, "output", claimed, bytes, SCENE_A, "text/plain");
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
    char *log = file_join(dir, "../worker.log");
    bad += access(log, F_OK) != 0;
    mem_free(log);
    return bad;
}

/* Says what no honest worker would: no JSON, too much of it, files that are not there, not its own or
 * of another size. An exit status where it cannot even lie. */
static int lie(struct progress *p, const char *dir) {
    static const char garbage[] =
        "\n{\"type\":\n[1,2]\n\"x\"\nnull\n{}\n{\"type\":7}\n\xff\xfe\n"
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

/* More than is heard, and then what must be. */
static int talk(struct progress *p, const char *dir) {
    progress_stage(p, "refine");
    for (int i = 0; i < 3 * RIG_EVENTS_MAX; i++) {
        progress_metric(p, "loss", i, 0.5);
        progress_log(p, "info", "so far so good");
        progress_step(p, "refine", i, 1000, 1);
    }
    announce(p, dir, "a.txt", "a.txt", 5); /* not so large */
    announce(p, dir, "b.txt", "b.txt", 4);
    announce(p, dir, "a.txt", "a.txt", 4);
    progress_step(p, "export", 7, 7, 0);
    progress_end(p, STATUS_OK, "", "");
    return 0;
}

/* An attempt that goes well. */
static int play_whole(struct progress *p, const char *dir) {
    progress_stage(p, "prepare");
    progress_step(p, "refine", 3, 4, 1.5);
    progress_metric(p, "loss", 3, 0.25);
    /* As progress_log, and what is for the daemon to say. */
    static const char hello[] = "{\"type\":\"log\",\"level\":\"info\",\"message\":\"hello\",\"job\":1,\"attempt\":9,"
                                "\"at\":\"1970-01-01T00:00:00.000Z\",\"snapshot\":true}\n";
    if (write(PROGRESS_FD, hello, sizeof hello - 1) != sizeof hello - 1)
        return 92;
    progress_checkpoint(p, 3, 1000000, 0.1);
    announce(p, dir, "good.txt", "good.txt", 4);
    progress_end(p, STATUS_OK, "", "");
    return 0;
}

/* Roles that only say how they end. */
static const struct {
    const char *role;
    bool says; /* an end, by these: */
    enum status status;
    const char *message, *hint;
    int code; /* exit status */
} ends[] = {
    {"input", true, STATUS_INPUT, "the mesh is empty", "export it again", PROGRESS_EXIT_INPUT},
    {"full", true, STATUS_NO_SPACE, "checkpoint.db: no space", "", PROGRESS_EXIT_NO_SPACE},
    {"silent", false, STATUS_OK, "", "", 0},
    {"two-faced", true, STATUS_IO, "the disk is broken", "", 0},
    {"broken", true, STATUS_IO, "the disk is broken", "", PROGRESS_EXIT_FAILED},
    {"late", true, STATUS_OK, "", "", PROGRESS_EXIT_FAILED},
    {"deserter", false, STATUS_OK, "", "", PROGRESS_EXIT_STOPPED},
};

static int play(const char *role, const char *dir, int attempt) {
    struct progress p = {.fd = PROGRESS_FD};
    for (size_t i = 0; i < sizeof ends / sizeof *ends; i++) {
        if (strcmp(role, ends[i].role) != 0)
            continue;
        if (ends[i].says)
            progress_end(&p, ends[i].status, ends[i].message, ends[i].hint);
        return ends[i].code;
    }
    if (strcmp(role, "talker") == 0)
        return talk(&p, dir);
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
    if (strcmp(role, "memory") == 0) {
        fprintf(stderr, "out of memory: could not allocate 12345 bytes\n");
        return PROGRESS_EXIT_MEMORY;
    }
    if (strcmp(role, "killed") == 0) {
        litter(dir);
        progress_file(&p, "output", "tmp-a1B2c3", 0, SCENE_A, "text/plain");
        kill(getpid(), SIGKILL);
    }
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
    return play_whole(&p, dir);
}

/* "large" fits the disk once there is a file "room" in the data folder. */
static int play_check(const char *role, const char *dir) {
    struct progress p = {.fd = PROGRESS_FD};
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
    if (strcmp(role, "ruin") == 0) {
        for (int i = 0; i < 1005; i++)
            progress_problem(&p, "images/1.png", "is truncated", NULL);
        progress_end(&p, STATUS_INPUT, "1005 problems", "");
        return PROGRESS_EXIT_INPUT;
    }
    if (strcmp(role, "bad") == 0) {
        progress_problem(&p, "mesh.ply", "face 3 has no area", NULL);
        progress_problem(&p, "images/1.png", "is truncated", "copy it again");
        progress_end(&p, STATUS_INPUT, "2 problems", "");
        return PROGRESS_EXIT_INPUT;
    }
    check_out(&p);
    return 0;
}

/* --- the daemon's side ------------------------------------------------------------------------ */

struct request_counts {
    int progress, metric, log, output, state;
};

static void tally_one(void *user, int64_t id, int64_t at_ms, int attempt, const char *type, const char *data) {
    struct request_counts *t = user;
    (void)id, (void)at_ms, (void)attempt;
    t->progress += strcmp(type, EVENT_PROGRESS) == 0 && strstr(data, "\"done\":3") != NULL;
    t->metric += strcmp(type, EVENT_METRIC) == 0 && strstr(data, "0.25") != NULL;
    t->log += strcmp(type, EVENT_LOG) == 0;
    t->output += strcmp(type, EVENT_OUTPUT) == 0;
    t->state += strcmp(type, EVENT_STATE) == 0;
    static const char *const daemons[] = {"\"type\"", "\"job\"", "\"attempt\"", "\"at\"", "\"snapshot\""};
    for (size_t i = 0; i < sizeof daemons / sizeof *daemons; i++)
        CHECK_THAT(strstr(data, daemons[i]) == NULL, "%s", data);
}

static void tally_talk(void *user, int64_t id, int64_t at_ms, int attempt, const char *type, const char *data) {
    struct request_counts *t = user;
    (void)id, (void)at_ms, (void)attempt;
    t->metric += strcmp(type, EVENT_METRIC) == 0;
    t->log += strcmp(type, EVENT_LOG) == 0 && strstr(data, "has reported 100 events: from here on") != NULL;
    t->output += strcmp(type, EVENT_OUTPUT) == 0;
}

/* What is too much is left out, and one event says so; outputs and the newest progress are not. */
static void check_talker(struct daemon *d) {
    struct request_counts t = {0};
    struct output_row *rows;
    struct job job;
    size_t count;
    int64_t id = submit(d, SCENE_A, "talker");
    expect(d, id, JOB_SUCCEEDED, 1, "", "");
    OK(store_event_list(d->store, id, 0, 100000, tally_talk, &t, &err));
    CHECK_THAT(t.log == 1 && t.metric > 10 && t.metric < RIG_EVENTS_MAX && t.output == 2, "%d, %d, %d", t.log, t.metric,
               t.output);
    OK(store_output_list(d->store, id, &rows, &count, &err));
    CHECK_THAT(count == 2, "%zu outputs", count);
    for (size_t i = 0; i < count; i++)
        output_row_release(&rows[i]);
    mem_free(rows);
    OK(store_job_get(d->store, id, &job, &err));
    CHECK_STRING(job.stage, "export");
    CHECK_NEAR(job.progress, 1.0, 1e-9);
    job_release(&job);
}

/* So with the problems of a scene. */
static void check_ruin(struct daemon *d) {
    static const char id[] = "1111111111111111111111111111111111111111111111111111111111111111";
    struct scene_row row;
    add_scene(d, id, "ruin");
    CHECK(wait_for_scene(d, id, SCENE_REJECTED));
    OK(store_scene_get(d->store, id, &row, &err));
    CHECK(strstr(row.problems, "\"5 more problems are not listed\"") != NULL);
    scene_row_release(&row);
}

static void check_whole_life(struct daemon *d, int64_t id, int states) {
    struct request_counts t = {0};
    OK(store_event_list(d->store, id, 0, 1000, tally_one, &t, &err));
    CHECK_THAT(t.progress == 1 && t.metric == 1 && t.log == 2 && t.output == 1 && t.state == states, "%d %d %d %d %d",
               t.progress, t.metric, t.log, t.output, t.state);
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

    check_talker(d);
    check_ruin(d);
    int64_t good = submit(d, SCENE_A, "good"), once = submit(d, SCENE_A, "once");
    int64_t segv = submit(d, SCENE_A, "segv"), liar = submit(d, SCENE_A, "liar");
    int64_t input = submit(d, SCENE_A, "input"), full = submit(d, SCENE_A, "full");
    int64_t memory = submit(d, SCENE_A, "memory"), killed = submit(d, SCENE_A, "killed");
    int64_t silent = submit(d, SCENE_A, "silent"), deserter = submit(d, SCENE_A, "deserter");
    int64_t around = submit(d, SCENE_A, "surroundings"), damaged = submit(d, SCENE_A, "\"");
    int64_t two_faced = submit(d, SCENE_A, "two-faced"), broken = submit(d, SCENE_A, "broken"),
            late = submit(d, SCENE_A, "late");
    expect(d, good, JOB_SUCCEEDED, 1, "", "");
    check_whole_life(d, good, 3);
    expect(d, once, JOB_SUCCEEDED, 2, "", "");
    check_whole_life(d, once, 5);
    expect(d, segv, JOB_FAILED, 2, "crashed (Segmentation fault); the end of its log: fatal: boom", "");
    expect(d, liar, JOB_SUCCEEDED, 1, "", "");
    check_whole_life(d, liar, 3);
    expect(d, input, JOB_FAILED, 1, "the mesh is empty", "export it again");
    expect(d, full, JOB_PAUSED, 1, "disk full: checkpoint.db", "resume");
    expect(d, memory, JOB_FAILED, 2, "could not allocate 12345", "smaller texture_size");
    expect(d, killed, JOB_FAILED, 2, "killed from outside", "smaller texture_size");
    char *killed_dir = mem_printf("%s/jobs/%lld/attempt-2", d->dir, (long long)killed);
    CHECK(is_tidy(killed_dir));
    mem_free(killed_dir);
    expect(d, silent, JOB_FAILED, 2, "without a result", "");
    expect(d, deserter, JOB_FAILED, 2, "stopped from outside", "");
    expect(d, around, JOB_SUCCEEDED, 1, "", "");
    expect(d, damaged, JOB_FAILED, 1, "the job's settings", "");
    expect(d, two_faced, JOB_FAILED, 2, "without a result", "");
    expect(d, broken, JOB_FAILED, 2, "the disk is broken", "");
    expect(d, late, JOB_FAILED, 2, "ended with status", "");
    daemon_stop(d);
}

/* What a check that crashed has unpacked is removed by the trash, which the scheduler does not wait for. */
static void count_emptied(void *user) { atomic_fetch_add((atomic_int *)user, 1); }

static void test_trash(struct daemon *d) {
    atomic_int emptied = 0;
    char *folder = layout_trash(d->dir);
    OK(file_make_dirs(folder, &err));
    OK(trash_new(&d->trash, d->dir, count_emptied, &emptied, &err));
    trash_wait(d->trash);
    int before = atomic_load(&emptied);
    daemon_start(d, 1, "/proc/self/exe");
    add_scene(d, TRASH_SCENE, "crash");
    expect_problems(d, TRASH_SCENE, SCENE_REJECTED, "");
    trash_wait(d->trash);
    CHECK_THAT(atomic_load(&emptied) > before, "the trash had nothing to do");
    daemon_stop(d);
    trash_free(d->trash);
    d->trash = NULL;
    mem_free(folder);
}

int main(int argc, char **argv) {
    struct daemon d;
    daemon_begin(&d, argc, argv);
    test_outcomes(&d);
    test_no_room(&d);
    test_trash(&d);
    daemon_end(&d);
    return check_result();
}
