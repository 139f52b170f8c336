/* worker.h -- for long tests: one attempt of a job by a worker of its own, without a daemon. */
#ifndef UNBAKE_TESTS_CHAOS_WORKER_H
#define UNBAKE_TESTS_CHAOS_WORKER_H

#include <poll.h>

#include "common/sha256.h"
#include "server/worker/progress.h"
#include "tests/chaos/daemon.h"

/* What must be the same, byte for byte, whatever befell the job. */
static const char *const worker_outputs[] = {"base_color.exr", "roughness.exr",  "specular.exr",
                                             "emission.exr",   "confidence.exr", "scene.ply"};
#define WORKER_OUTPUTS (sizeof worker_outputs / sizeof *worker_outputs)

static inline void worker_write_order(const char *dir, char *text) {
    char *path = file_join(dir, "job.json");
    struct error err;
    if (file_replace(path, text, strlen(text), &err) != STATUS_OK)
        exit(1);
    mem_free(text);
    mem_free(path);
}

/* The check of the scene that is in the folder as `archive`. */
static inline void worker_order_check(const char *dir, bool sandbox) {
    worker_write_order(dir, mem_printf("{\"kind\":\"check\",\"scene_id\":\"x\",\"thread_count\":1,\"memory_bytes\":0,"
                                       "\"sandbox\":%s}",
                                       sandbox ? "true" : "false"));
}

/* Writes the order; `settings` are JSON members. */
static inline void worker_order(const char *dir, const char *room, int attempt, int threads, double checkpoint_sec,
                                bool sandbox, const char *settings) {
    char *text = mem_printf(
        "{\"kind\":\"reconstruct\",\"scene\":\"%s\",\"scene_id\":\"x\",\"name\":\"x\",\"job_id\":1,\"attempt\":%d,"
        "\"thread_count\":%d,\"memory_bytes\":0,\"sandbox\":%s,\"checkpoint_interval_sec\":%g,\"settings\":{%s}}",
        room, attempt, threads, sandbox ? "true" : "false", checkpoint_sec, settings);
    worker_write_order(dir, text);
}

/* `preload`: a library, or NULL. What the worker has to complain about goes to the file `log`. */
static inline pid_t worker_start(const char *binary, const char *dir, const char *preload, const char *log,
                                 int *pipe_fd) {
    int ends[2];
    pid_t parent = getpid();
    if (pipe(ends) != 0)
        exit(1);
    pid_t pid = fork();
    if (pid == 0) {
        prctl(PR_SET_PDEATHSIG, SIGKILL);
        if (getppid() != parent || dup2(ends[1], PROGRESS_FD) < 0 || !freopen(log, "a", stderr))
            _exit(126);
        for (int fd = PROGRESS_FD + 1; fd < 64; fd++)
            close(fd);
        preload_set(preload);
        execl(binary, "unbaked", "worker", dir, (char *)NULL);
        _exit(127);
    }
    close(ends[1]);
    *pipe_fd = ends[0];
    return pid;
}

/* Reads the pipe until a line has `part`, the pipe ends, or so much time has passed. */
static inline bool worker_hear(int fd, const char *part, double seconds) {
    static char text[1 << 16];
    size_t length = 0;
    double end = clock_sec() + seconds;
    for (;;) {
        struct pollfd wait = {.fd = fd, .events = POLLIN};
        double left = end - clock_sec();
        if (left <= 0.0 || poll(&wait, 1, (int)(left * 1e3) + 1) <= 0)
            return false;
        ssize_t got = read(fd, text + length, sizeof text - 1 - length);
        if (got <= 0)
            return false;
        length += (size_t)got;
        text[length] = '\0';
        if (strstr(text, part))
            return true;
        if (length > sizeof text / 2) { /* a part may have begun */
            size_t kept = strlen(part);
            memmove(text, text + length - kept, kept + 1);
            length = kept;
        }
    }
}

static inline void worker_hash(const char *dir, char sums[WORKER_OUTPUTS][SHA256_HEX_SIZE]) {
    struct error err;
    for (size_t i = 0; i < WORKER_OUTPUTS; i++) {
        char *path = mem_printf("%s/out/%s", dir, worker_outputs[i]);
        CHECK_THAT(sha256_of_file(path, sums[i], &err) == STATUS_OK, "%s", err.message);
        mem_free(path);
    }
}

#endif
