/* test_process.c -- a run on this machine from its start to its end: what the process finds, what of its lines is
 * heard, what it can be asked, its log and its last words, how its end is told, and what keeps it from starting.
 * Scripts stand in for the worker. */
#include "server/job/process.h"

#include <errno.h>
#include <math.h>
#include <poll.h>
#include <signal.h>
#include <sys/stat.h>
#include <sys/wait.h>

#include "common/file.h"
#include "common/mem.h"
#include "server/worker/progress.h"
#include "tests/check.h"

static struct error err;
static char dir[] = "/tmp/unbake-test-process-XXXXXX";

#define OK(call) CHECK_THAT((call) == STATUS_OK, "%s", err.message)

struct heard {
    int count;
    size_t longest;
    char last[256];
};

static void hear(void *user, const char *line, size_t length) {
    struct heard *heard = user;
    heard->count++;
    heard->longest = length > heard->longest ? length : heard->longest;
    snprintf(heard->last, sizeof heard->last, "%s", line);
}

/* A program that runs these lines of shell; the caller's. */
static char *script(const char *lines) {
    char *path = file_join(dir, "script"), *text = mem_printf("#!/bin/sh\n%s\n", lines);
    OK(file_replace(path, text, strlen(text), &err));
    CHECK(chmod(path, 0700) == 0);
    mem_free(text);
    return path;
}

static const char folder[] = "jobs/1/attempt-1", log_name[] = "jobs/1/worker.log";

/* Starts the program in the data folder `data`. */
static enum status begin(struct run **run, const char *binary, const char *data, const char *scene_id) {
    static struct process_executor home;
    const struct executor *executor = process_executor_init(&home, binary, data);
    cJSON *order = cJSON_CreateObject();
    json_add_int(order, "thread_count", 3);
    const struct run_work work = {.folder = folder, .log = log_name, .scene_id = scene_id, .order = order};
    CHECK_STRING(executor->name, "process");
    enum status status = executor->start(executor, &work, run, &err);
    CHECK((status == STATUS_OK) == (*run != NULL));
    cJSON_Delete(order);
    return status;
}

static struct run_end wait_for_end(struct run *run, struct heard *heard) {
    struct run_end end = {0};
    while (!run_ended(run, &end, hear, heard)) {
        run_read(run, hear, heard);
        poll(NULL, 0, 5);
    }
    CHECK(!run_ended(run, &end, hear, heard) && run_cpu_sec(run) >= 0.0);
    return end;
}

/* Runs it to its end. The run is the caller's (run_free). */
static struct run_end run(struct run **out, const char *lines, struct heard *heard) {
    char *path = script(lines);
    *heard = (struct heard){0};
    OK(begin(out, path, dir, NULL));
    mem_free(path);
    return wait_for_end(*out, heard);
}

/* Its status, or minus the signal. */
static int exit_code(const char *lines, struct heard *heard) {
    struct run *r;
    struct run_end end = run(&r, lines, heard);
    CHECK(end.way == RUN_EXIT || end.way == RUN_SIGNAL);
    run_free(r);
    return end.way == RUN_EXIT ? end.code : -end.code;
}

static void test_start(void) {
    struct heard heard;
    CHECK(exit_code("[ \"$1\" = worker ] && [ -d \"$2\" ] && echo '{}' >&3 && read line || exit 7", &heard) == 7);
    CHECK(heard.count == 1); /* standard input is empty */
    CHECK(exit_code("ls /proc/self/fd | while read fd; do [ $fd -le 4 ] || echo $fd; done >&3", &heard) == 0);
    CHECK_THAT(heard.count == 0, "descriptor %s was left open", heard.last); /* 4 is that of ls itself */
    setenv("UNBAKE_TOKEN", "secret", 1);
    setenv("LC_TIME", "C", 1);
    CHECK(exit_code("[ -z \"$UNBAKE_TOKEN\" ] && [ \"$LC_TIME\" = C ] && [ -n \"$PATH\" ]", &heard) == 0);
    CHECK(exit_code("[ $(ps -o sid= -p $$) = $$ ] && [ $(cat /proc/self/oom_score_adj) -ge 500 ]", &heard) == 0 ||
          access("/bin/ps", X_OK) != 0);
    CHECK(exit_code("kill -SEGV $$", &heard) == -SIGSEGV);
}

static void test_lines(void) {
    struct heard heard;
    CHECK(exit_code("printf 'one\\n\\nthree\\nbroken off' >&3", &heard) == 0);
    CHECK(heard.count == 3);
    CHECK_STRING(heard.last, "three");
    /* A line that is too long is dropped, the next one is heard. */
    CHECK(exit_code("head -c 200000 /dev/zero | tr '\\0' x >&3; printf '\\nafter\\n' >&3", &heard) == 0);
    CHECK(heard.count == 1 && heard.longest <= PROGRESS_LINE_MAX);
    CHECK_STRING(heard.last, "after");
}

static void test_last_words(void) {
    struct run *r;
    struct heard heard;
    run(&r, "echo 'not a word of mine' >&2; printf 'caf\\303\\251\\nis \\033[31mred \\n\\n' >&2", &heard);
    char *words = run_log_tail(r, 400);
    CHECK_STRING(words, "not a word of mine caf?? is ?[31mred");
    mem_free(words);
    words = run_log_tail(r, 20); /* from the first whole line on */
    CHECK_STRING(words, "is ?[31mred");
    mem_free(words);
    run_free(r);
    run(&r, "exit 3", &heard); /* an earlier process's words are not its own */
    words = run_log_tail(r, 400);
    CHECK_STRING(words, "");
    mem_free(words);
    run_free(r);
}

/* What was left of the log when it had grown large: its tail, then what comes. */
static void test_large_log(void) {
    struct run *r;
    struct heard heard;
    struct stat info;
    char *log = file_join(dir, log_name);
    run(&r, "head -c 1100000 /dev/zero | tr '\\0' a >&2; echo end >&2", &heard);
    run_free(r);
    CHECK(stat(log, &info) == 0 && info.st_size > 1100000);
    run(&r, "echo more >&2", &heard);
    char *words = run_log_tail(r, 400);
    CHECK_STRING(words, "more");
    CHECK(stat(log, &info) == 0 && info.st_size < 100000 && info.st_size > 60000);
    mem_free(words);
    run_free(r);
    mem_free(log);
}

static void test_refusals(void) {
    struct run *r;
    struct heard heard = {0};
    CHECK(begin(&r, "/bin/true", "/nonexistent/folder", NULL) == STATUS_NOT_FOUND);
    /* A log that is a link leads elsewhere. */
    char *log = file_join(dir, log_name);
    unlink(log);
    CHECK(symlink("/dev/null", log) == 0);
    CHECK(begin(&r, "/bin/true", dir, NULL) == STATUS_IO);
    unlink(log);
    mem_free(log);
    /* A program that is not there: the child says so. */
    OK(begin(&r, "/nonexistent/unbaked", dir, NULL));
    struct run_end end = wait_for_end(r, &heard);
    CHECK(end.way == RUN_EXIT && end.code == 127);
    char *words = run_log_tail(r, 400);
    CHECK_STRING(words, "cannot execute the worker's program");
    mem_free(words);
    run_free(r);
}

/* A run that never was. */
static void test_none(void) {
    struct run_end end;
    struct heard heard = {0};
    struct pollfd fds[RUN_FDS];
    double look;
    run_read(NULL, hear, &heard);
    run_ask(NULL, RUN_KILL);
    CHECK(!run_ended(NULL, &end, hear, &heard) && run_cpu_sec(NULL) == 0.0 && heard.count == 0);
    CHECK(run_poll(NULL, fds, &look) == 0 && isinf(look));
    char *words = run_log_tail(NULL, 400);
    CHECK_STRING(words, "");
    mem_free(words);
    run_free(NULL);
}

/* The order lies in the folder, and has where this machine keeps the scene. */
static void test_order(void) {
    struct run *r;
    struct heard heard = {0};
    const char *scene;
    double threads;
    cJSON *order;
    char *path = file_join(dir, "jobs/1/attempt-1/job.json"), *wanted = file_join(dir, "scenes/abc/files");
    OK(begin(&r, "/bin/true", dir, "abc"));
    wait_for_end(r, &heard);
    run_free(r);
    OK(json_read(path, 1 << 16, &order, &err));
    OK(json_string(order, "scene", "order", "", &scene, &err));
    OK(json_number(order, "thread_count", "order", 0, &threads, &err));
    CHECK_STRING(scene, wanted);
    CHECK(threads == 3.0);
    cJSON_Delete(order);
    mem_free(wanted);
    mem_free(path);
}

/* Each request reaches it as what it is; the descriptors say when there is something to hear. */
static void test_requests(void) {
    static const char lines[] = "trap 'echo preview >&3' USR1; trap 'echo stop >&3; exit 85' TERM; echo ready >&3\n"
                                "while :; do sleep .01; done";
    struct run *r;
    struct heard heard = {0};
    char *path = script(lines);
    double look;
    struct pollfd fds[RUN_FDS];
    OK(begin(&r, path, dir, NULL));
    static const char *const said[] = {"ready", "preview"};
    for (int i = 0; i < 2; i++) {
        while (heard.count <= i) {
            size_t count = run_poll(r, fds, &look);
            CHECK(count > 0 && poll(fds, count, 60000) > 0);
            run_read(r, hear, &heard);
        }
        CHECK_STRING(heard.last, said[i]);
        run_ask(r, i == 0 ? RUN_PREVIEW : RUN_STOP);
    }
    struct run_end end = wait_for_end(r, &heard);
    CHECK(end.way == RUN_EXIT && end.code == 85);
    CHECK_STRING(heard.last, "stop");
    run_ask(r, RUN_KILL); /* nobody */
    run_free(r);
    OK(begin(&r, path, dir, NULL));
    run_ask(r, RUN_KILL);
    end = wait_for_end(r, &heard);
    CHECK(end.way == RUN_SIGNAL && end.code == SIGKILL);
    run_free(r);
    mem_free(path);
}

/* A process that somebody else has reaped is lost, not for ever alive. */
static void test_lost(void) {
    struct run *r;
    struct heard heard = {0};
    struct run_end end = {0};
    char *path = script("echo word >&3");
    OK(begin(&r, path, dir, NULL));
    CHECK(waitpid(-1, NULL, 0) > 0);
    CHECK(run_ended(r, &end, hear, &heard) && end.way == RUN_LOST && *end.reason);
    CHECK_STRING(heard.last, "word");
    CHECK(!run_ended(r, &end, hear, &heard));
    run_free(r);
    mem_free(path);
}

/* What a worker has left running in its session ends with it. */
static void test_session(void) {
    struct run *r;
    struct heard heard;
    run(&r, "sleep 1000 & echo $! >&3", &heard);
    run_free(r);
    pid_t left = (pid_t)strtol(heard.last, NULL, 10);
    bool is_gone = false;
    for (int i = 0; i < 2000 && !is_gone; i++) {
        char *path = mem_printf("/proc/%d/stat", (int)left);
        FILE *file = fopen(path, "r");
        char state = 'X';
        is_gone = !file || fscanf(file, "%*d (%*[^)]) %c", &state) != 1 || state == 'Z' || state == 'X';
        if (file)
            fclose(file);
        mem_free(path);
        poll(NULL, 0, 5);
    }
    CHECK(left > 0 && is_gone);
}

int main(void) {
    if (!mkdtemp(dir))
        CHECK_SKIP("cannot make a folder in /tmp");
    char *work = file_join(dir, folder);
    OK(file_make_dirs(work, &err));
    mem_free(work);
    test_start();
    test_lines();
    test_last_words();
    test_large_log();
    test_refusals();
    test_session();
    test_none();
    test_order();
    test_requests();
    test_lost();
    file_remove_tree(dir, NULL);
    return check_result();
}
