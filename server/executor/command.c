/* command.c -- see command.h. */
#include "server/executor/command.h"

#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <spawn.h>
#include <stdbool.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/wait.h>
#include <unistd.h>

#include "common/clock.h"

#define LOOK_MS 20         /* how soon the end is seen of a command that keeps its output open elsewhere */
#define COMPLAINT_MAX 4096 /* bytes of a command's standard error that are kept: the last line of it is told */

extern char **environ;

struct child {
    pid_t pid; /* also of its group */
    int in, out, complaints;
};

static void close_all(const int *fds, size_t count) {
    for (size_t i = 0; i < count; i++)
        if (fds[i] >= 0)
            close(fds[i]);
}

/* A file without a name that holds the input, at its beginning. */
static int input_file(const char *input) {
    size_t length = strlen(input), done = 0;
    int fd = memfd_create("command-input", MFD_CLOEXEC);
    while (fd >= 0 && done < length) {
        ssize_t n = write(fd, input + done, length - done);
        if (n <= 0)
            break;
        done += (size_t)n;
    }
    if (fd >= 0 && (done < length || lseek(fd, 0, SEEK_SET) != 0)) {
        close(fd);
        fd = -1;
    }
    return fd;
}

/* Its own group, no signal blocked or ignored, and no descriptor but the three: all others are close-on-exec. */
static int spawn(struct child *c, char *const argv[], int in, int out, int complaints) {
    posix_spawnattr_t how;
    posix_spawn_file_actions_t files;
    sigset_t none, all;
    sigemptyset(&none);
    sigfillset(&all);
    posix_spawnattr_init(&how);
    posix_spawn_file_actions_init(&files);
    posix_spawnattr_setflags(&how, POSIX_SPAWN_SETPGROUP | POSIX_SPAWN_SETSIGDEF | POSIX_SPAWN_SETSIGMASK);
    posix_spawnattr_setpgroup(&how, 0);
    posix_spawnattr_setsigmask(&how, &none);
    posix_spawnattr_setsigdefault(&how, &all);
    posix_spawn_file_actions_adddup2(&files, in, STDIN_FILENO);
    posix_spawn_file_actions_adddup2(&files, out, STDOUT_FILENO);
    posix_spawn_file_actions_adddup2(&files, complaints, STDERR_FILENO);
    int number = posix_spawnp(&c->pid, argv[0], &files, &how, argv, environ);
    posix_spawn_file_actions_destroy(&files);
    posix_spawnattr_destroy(&how);
    return number;
}

static enum status start(struct child *c, char *const argv[], const char *input, struct error *err) {
    int out[2] = {-1, -1}, complaints[2] = {-1, -1}, in = input_file(input);
    if (in < 0 || pipe2(out, O_CLOEXEC) != 0 || pipe2(complaints, O_CLOEXEC) != 0) {
        error_set_errno(err, errno, "cannot set up the command %s", argv[0]);
        close_all((int[]){in, out[0], out[1], complaints[0], complaints[1]}, 5);
        return err ? err->status : STATUS_IO;
    }
    int number = spawn(c, argv, in, out[1], complaints[1]);
    close_all((int[]){in, out[1], complaints[1]}, 3);
    c->out = out[0];
    c->complaints = complaints[0];
    if (number == 0 && fcntl(c->out, F_SETFL, O_NONBLOCK) == 0 && fcntl(c->complaints, F_SETFL, O_NONBLOCK) == 0)
        return STATUS_OK;
    close_all((int[]){c->out, c->complaints}, 2);
    return error_set_errno(err, number ? number : errno, "cannot start the command %s", argv[0]);
}

/* Takes what there is. Closes and forgets the descriptor at its end. Beyond its limit `to` takes no more. */
static void drain(int *fd, struct buf *to) {
    char part[4096];
    ssize_t n = 1;
    while (*fd >= 0 && n > 0) {
        n = read(*fd, part, sizeof part);
        if (n > 0)
            buf_append(to, part, (size_t)n);
    }
    if (*fd >= 0 && (n == 0 || errno != EAGAIN)) {
        close(*fd);
        *fd = -1;
    }
}

/* Waits for its end, or kills it at the deadline. *is_late: that was so. */
static int follow(struct child *c, double deadline_sec, const atomic_bool *stop, struct buf *output,
                  struct buf *complaints, bool *is_late) {
    double until = clock_sec() + deadline_sec;
    int wait_status = 0;
    *is_late = false;
    for (;;) {
        pid_t ended = waitpid(c->pid, &wait_status, WNOHANG);
        drain(&c->out, output);
        drain(&c->complaints, complaints);
        if (ended != 0)
            break;
        if (!*is_late && (clock_sec() >= until || (stop && atomic_load(stop)))) {
            *is_late = true;
            kill(-c->pid, SIGKILL);
        }
        struct pollfd fds[] = {{.fd = c->out, .events = POLLIN}, {.fd = c->complaints, .events = POLLIN}};
        poll(fds, 2, LOOK_MS);
    }
    close_all((int[]){c->out, c->complaints}, 2);
    return wait_status;
}

/* The last line that is not empty; cuts the text off after it. */
static const char *last_line(struct buf *complaints) {
    size_t length = complaints->length;
    while (length > 0 && strchr(" \t\r\n", complaints->data[length - 1]))
        length--;
    if (length == 0)
        return "";
    complaints->data[length] = '\0';
    const char *newline = strrchr(complaints->data, '\n');
    return newline ? newline + 1 : complaints->data;
}

enum status command_run(char *const argv[], const char *input, double deadline_sec, const atomic_bool *stop,
                        struct buf *output, struct error *err) {
    struct child child = {.out = -1, .complaints = -1};
    struct buf complaints;
    bool is_late;
    enum status status = start(&child, argv, input ? input : "", err);
    if (status != STATUS_OK)
        return status;
    buf_init(&complaints, COMPLAINT_MAX);
    int end = follow(&child, deadline_sec, stop, output, &complaints, &is_late);
    const char *words = last_line(&complaints);
    if (is_late)
        status = error_set(err, STATUS_UNAVAILABLE, "%s did not end within %.0f s", argv[0], deadline_sec);
    else if (WIFSIGNALED(end))
        status = error_set(err, STATUS_IO, "%s was killed (%s)", argv[0], strsignal(WTERMSIG(end)));
    else if (WEXITSTATUS(end) != 0)
        status = error_set(err, STATUS_IO, "%s ended with status %d%s%.200s", argv[0], WEXITSTATUS(end),
                           *words ? ": " : "", words);
    else if (output->overflowed)
        status = error_set(err, STATUS_LIMIT, "%s writes more than %zu bytes", argv[0], COMMAND_OUTPUT_MAX);
    buf_release(&complaints);
    return status;
}
