/* worker.c -- the child's entry: reads the order, locks the folder, enters the sandbox, works, reports its end; see
 * worker.h. */
#include "server/worker/worker.h"

#include <errno.h>
#include <fcntl.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <unistd.h>

#include "common/log.h"
#include "common/mem.h"
#include "common/render_settings.h"
#include "common/url.h"
#include "server/relight/denoise.h"
#include "server/worker/order.h"
#include "server/worker/progress.h"
#include "server/worker/sandbox.h"
#include "server/worker/tasks.h"

#define LOCK_TRIES 100 /* 0.1 s each: a killed worker may not have exited yet */

/* Locks the folder until the process ends: the descriptor is never closed. */
static enum status take_folder(const char *dir, struct error *err) {
    int fd = open(dir, O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    if (fd < 0)
        return error_set_errno(err, errno, "cannot open folder %s", dir);
    for (int i = 0; flock(fd, LOCK_EX | LOCK_NB) != 0; i++) {
        if (errno != EWOULDBLOCK) {
            enum status status = error_set_errno(err, errno, "cannot lock folder %s", dir);
            close(fd);
            return status;
        }
        if (i == LOCK_TRIES) {
            close(fd);
            return error_set(err, STATUS_UNAVAILABLE, "another worker is in folder %s", dir);
        }
        usleep(100000);
    }
    return STATUS_OK;
}

/* Its library loads others, which the sandbox forbids later. One that is missing is the render's to complain of. */
static void open_denoiser(struct order *order, struct progress *progress) {
    struct error err;
    bool is_wanted = strcmp(order->kind, "render") == 0 && render_settings_bool(order->settings, "denoise");
    if (is_wanted && denoiser_open(order->thread_count, &order->denoiser, &err) != STATUS_OK)
        progress_log(progress, "warning", err.message);
}

static void confine(const struct order *order, struct progress *progress) {
    struct sandbox_result result;
    struct url url;
    struct sandbox sandbox = {.write_dir = order->dir, .memory_bytes = order->memory_bytes};
    const char *read[] = {order->scene, order->outputs, order->files}; /* no kind has more than two of them */
    for (size_t i = 0, used = 0; i < sizeof read / sizeof *read && used < SANDBOX_READ_DIRS; i++)
        if (read[i] && *read[i])
            sandbox.read_dir[used++] = read[i];
    if (strcmp(order->kind, "deliver") == 0) { /* a malformed URL is reported when it is called */
        sandbox.write_dir = NULL;
        if (url_parse(order->url, &url, NULL) == STATUS_OK)
            sandbox.connect_port = (uint16_t)strtoul(url.port, NULL, 10);
    }
    if (!order->sandbox) {
        progress_log(progress, "warning", "sandbox: switched off by the daemon's configuration");
        return;
    }
    sandbox_enter(&sandbox, &result);
    progress_log(progress, result.files && result.system_calls && result.memory ? "info" : "warning", result.text);
}

static enum status work(const struct order *order, struct progress *progress, struct error *err) {
    static const struct {
        const char *kind;
        enum status (*run)(const struct order *, struct progress *, struct error *);
    } tasks[] = {
        {"reconstruct", task_reconstruct}, {"render", task_render}, {"evaluate", task_evaluate}, {"check", task_check},
        {"deliver", task_deliver},
    };
    for (size_t i = 0; i < sizeof tasks / sizeof tasks[0]; i++)
        if (strcmp(order->kind, tasks[i].kind) == 0)
            return tasks[i].run(order, progress, err);
    return error_set(err, STATUS_INTERNAL, "job.json: unknown kind \"%.40s\"", order->kind);
}

static int exit_status(enum status status) {
    switch (status) {
    case STATUS_OK: return PROGRESS_EXIT_OK;
    case STATUS_INPUT:
    case STATUS_LIMIT: return PROGRESS_EXIT_INPUT;
    case STATUS_NO_SPACE: return PROGRESS_EXIT_NO_SPACE;
    case STATUS_CANCELLED: return PROGRESS_EXIT_STOPPED;
    default: return PROGRESS_EXIT_FAILED;
    }
}

/* A library that calls exit, as libarchive does, has run out of memory: exit as mem.h does. */
static void on_exit_of_library(int status, void *is_over) {
    (void)status;
    if (!*(const bool *)is_over)
        _exit(PROGRESS_EXIT_MEMORY);
}

int worker_main(int argc, char **argv) {
    if (argc != 2) {
        fprintf(stderr, "usage: unbaked worker DIR\nThe daemon runs this; see job.json in DIR.\n");
        return PROGRESS_EXIT_FAILED;
    }
    struct progress progress = {.fd = fcntl(PROGRESS_FD, F_GETFD) >= 0 ? PROGRESS_FD : -1};
    struct order order;
    struct error err = {0};
    bool *is_over = mem_calloc(1, sizeof *is_over); /* outlives this function */
    on_exit(on_exit_of_library, is_over);
    signal(SIGPIPE, SIG_IGN); /* a daemon that is gone is noticed elsewhere */
    enum status status = order_read(&order, argv[1], &err);
    if (status == STATUS_OK)
        status = take_folder(argv[1], &err);
    if (status == STATUS_OK) {
        open_denoiser(&order, &progress);
        confine(&order, &progress);
        status = work(&order, &progress, &err);
    }
    if (status != STATUS_OK)
        log_error("%s", err.message);
    progress_end(&progress, status, err.message, err.hint);
    denoiser_free(order.denoiser);
    order_release(&order);
    *is_over = true;
    return exit_status(status);
}
