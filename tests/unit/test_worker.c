/* test_worker.c -- the worker's entry: orders, the folder's lock, refusals, and their exit
 * statuses. What a whole reconstruction does is tests/api/test_resume.sh's. */
#include "server/worker/worker.h"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <sys/wait.h>

#include "common/file.h"
#include "common/mem.h"
#include "server/worker/progress.h"
#include "tests/check.h"

static struct error err;

#define OK(call) CHECK_THAT((call) == STATUS_OK, "%s", err.message)

/* Starts worker_main on `dir` in a child; its pipe's other end goes to *from. */
static pid_t start(const char *dir, int *from) {
    int ends[2];
    CHECK(pipe2(ends, O_CLOEXEC) == 0);
    pid_t child = fork();
    if (child == 0) {
        char name[] = "worker", *copy = mem_strdup(dir), *argv[] = {name, copy, NULL};
        int quiet = open("/dev/null", O_WRONLY);
        dup2(quiet, STDERR_FILENO);
        if (ends[1] != PROGRESS_FD)
            dup2(ends[1], PROGRESS_FD);
        else
            fcntl(PROGRESS_FD, F_SETFD, 0);
        exit(worker_main(2, argv)); /* make coverage: its counts are written */
    }
    close(ends[1]);
    *from = ends[0];
    return child;
}

/* Waits for its end; what it said goes to `said`. */
static int finish(pid_t child, int from, struct buf *said) {
    char chunk[4096];
    ssize_t got;
    buf_clear(said);
    while ((got = read(from, chunk, sizeof chunk)) > 0)
        buf_append(said, chunk, (size_t)got);
    close(from);
    int status = 0;
    CHECK(waitpid(child, &status, 0) == child && WIFEXITED(status));
    return WEXITSTATUS(status);
}

static void write_text(const char *dir, const char *name, const char *text) {
    char *path = file_join(dir, name);
    OK(file_replace(path, text, strlen(text), &err));
    mem_free(path);
}

int main(void) {
    char dir[] = "/tmp/unbake-test-worker-XXXXXX";
    if (!mkdtemp(dir))
        return 1;
    struct buf said;
    int from;
    buf_init(&said, 1 << 20);

    pid_t child = start(dir, &from);
    CHECK(finish(child, from, &said) == PROGRESS_EXIT_FAILED);
    CHECK_THAT(strstr(buf_text(&said), "job.json") != NULL, "%s", buf_text(&said));

    static const char *const wrong[] = {
        "{",
        "[]",
        "{\"kind\":\"dance\"}",
        "{\"kind\":7}",
        "{\"kind\":\"reconstruct\",\"thread_count\":1}",
        "{\"kind\":\"reconstruct\",\"scene\":\"x\",\"settings\":3}",
    };
    for (size_t i = 0; i < sizeof wrong / sizeof wrong[0]; i++) {
        write_text(dir, "job.json", wrong[i]);
        child = start(dir, &from);
        CHECK_THAT(finish(child, from, &said) == PROGRESS_EXIT_FAILED, "%s", wrong[i]);
        CHECK_THAT(strstr(buf_text(&said), "\"status\":\"internal\"") != NULL, "%s: %s", wrong[i], buf_text(&said));
    }

    /* What is no archive is the input's fault; nothing of it stays. */
    write_text(dir, "job.json", "{\"kind\":\"check\",\"scene_id\":\"x\",\"thread_count\":1}");
    write_text(dir, "archive", "this is no archive, whatever it says");
    child = start(dir, &from);
    CHECK(finish(child, from, &said) == PROGRESS_EXIT_INPUT);
    CHECK_THAT(strstr(buf_text(&said), "\"status\":\"input\"") != NULL, "%s", buf_text(&said));
    CHECK(strstr(buf_text(&said), "sandbox:") != NULL);
    char *files = file_join(dir, "files");
    CHECK(access(files, F_OK) != 0);
    mem_free(files);

    /* While another process has the folder, the worker waits and says nothing. */
    int lock = open(dir, O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    CHECK(flock(lock, LOCK_EX | LOCK_NB) == 0);
    child = start(dir, &from);
    usleep(300000);
    fcntl(from, F_SETFL, O_NONBLOCK);
    char byte;
    CHECK(read(from, &byte, 1) < 0);
    CHECK(waitpid(child, NULL, WNOHANG) == 0);
    fcntl(from, F_SETFL, 0);
    close(lock);
    CHECK(finish(child, from, &said) == PROGRESS_EXIT_INPUT);

    OK(file_remove_tree(dir, &err));
    buf_release(&said);
    return check_result();
}
