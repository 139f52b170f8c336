/* test_supervisor.c -- a worker process from its start to its burial: what it finds, what of its
 * lines is heard, its log and its last words, and what keeps it from starting. Scripts stand in for
 * the worker. */
#include "server/job/supervisor.h"

#include <errno.h>
#include <poll.h>
#include <signal.h>
#include <sys/stat.h>
#include <sys/wait.h>

#include "common/file.h"
#include "common/mem.h"
#include "server/data/layout.h"
#include "server/worker/progress.h"
#include "tests/check.h"

static struct error err;
static char dir[] = "/tmp/unbake-test-supervisor-XXXXXX";

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

/* Runs it to its end; its wait status. The worker is the caller's (supervisor_release). */
static int run(struct worker *w, const char *lines, struct heard *heard) {
    char *path = script(lines);
    int wait_status = -1;
    *heard = (struct heard){0};
    OK(supervisor_start(w, path, dir, &err));
    while (!supervisor_reap(w, &wait_status, hear, heard)) {
        supervisor_read(w, hear, heard);
        poll(NULL, 0, 5);
    }
    mem_free(path);
    return wait_status;
}

static int exit_code(const char *lines, struct heard *heard) {
    struct worker w;
    int wait_status = run(&w, lines, heard);
    CHECK(supervisor_cpu_sec(&w) >= 0.0 && w.pid == 0);
    supervisor_release(&w);
    return WIFEXITED(wait_status) ? WEXITSTATUS(wait_status) : -WTERMSIG(wait_status);
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
    struct worker w;
    struct heard heard;
    run(&w, "echo 'not a word of mine' >&2; printf 'caf\\303\\251\\nis \\033[31mred \\n\\n' >&2", &heard);
    char *words = supervisor_last_words(&w, 400);
    CHECK_STRING(words, "not a word of mine caf?? is ?[31mred");
    mem_free(words);
    words = supervisor_last_words(&w, 20); /* from the first whole line on */
    CHECK_STRING(words, "is ?[31mred");
    mem_free(words);
    supervisor_release(&w);
    run(&w, "exit 3", &heard); /* an earlier process's words are not its own */
    words = supervisor_last_words(&w, 400);
    CHECK_STRING(words, "");
    mem_free(words);
    supervisor_release(&w);
}

/* What was left of the log when it had grown large: its tail, then what comes. */
static void test_large_log(void) {
    struct worker w;
    struct heard heard;
    struct stat info;
    char *log = layout_log(dir);
    run(&w, "head -c 1100000 /dev/zero | tr '\\0' a >&2; echo end >&2", &heard);
    supervisor_release(&w);
    CHECK(stat(log, &info) == 0 && info.st_size > 1100000);
    run(&w, "echo more >&2", &heard);
    char *words = supervisor_last_words(&w, 400);
    CHECK_STRING(words, "more");
    CHECK(stat(log, &info) == 0 && info.st_size < 100000 && info.st_size > 60000);
    mem_free(words);
    supervisor_release(&w);
    mem_free(log);
}

static void test_refusals(void) {
    struct worker w;
    int wait_status = 0;
    struct heard heard = {0};
    CHECK(supervisor_start(&w, "/bin/true", "/nonexistent/folder", &err) == STATUS_NOT_FOUND);
    CHECK(w.pid == 0 && !supervisor_reap(&w, &wait_status, hear, &heard));
    supervisor_signal(&w, SIGKILL); /* nobody */
    supervisor_release(&w);
    /* A log that is a link leads elsewhere. */
    char *log = layout_log(dir);
    unlink(log);
    CHECK(symlink("/dev/null", log) == 0);
    CHECK(supervisor_start(&w, "/bin/true", dir, &err) == STATUS_IO);
    supervisor_release(&w);
    unlink(log);
    mem_free(log);
    /* A program that is not there: the child says so. */
    OK(supervisor_start(&w, "/nonexistent/unbaked", dir, &err));
    while (!supervisor_reap(&w, &wait_status, hear, &heard))
        poll(NULL, 0, 5);
    CHECK(WIFEXITED(wait_status) && WEXITSTATUS(wait_status) == 127);
    char *words = supervisor_last_words(&w, 400);
    CHECK_STRING(words, "cannot execute the worker's program");
    mem_free(words);
    supervisor_release(&w);
}

/* What a worker has left running in its session ends with it. */
static void test_session(void) {
    struct worker w;
    struct heard heard;
    run(&w, "sleep 1000 & echo $! >&3", &heard);
    supervisor_release(&w);
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
    test_start();
    test_lines();
    test_last_words();
    test_large_log();
    test_refusals();
    test_session();
    file_remove_tree(dir, NULL);
    return check_result();
}
