/* supervisor.c -- see supervisor.h.
 *
 * The daemon has threads when it forks, so the child calls only async-signal-safe functions
 * until it executes: everything that needs memory is made before. */
#include "server/job/supervisor.h"

#include <errno.h>
#include <fcntl.h>
#include <signal.h>
#include <stdio.h>
#include <string.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#include "common/file.h"
#include "common/mem.h"
#include "server/data/layout.h"
#include "server/worker/progress.h"

#define LOG_KEEP 65536 /* kept of earlier attempts when the log has passed LOG_LARGE */
#define LOG_LARGE (1 << 20)
#define LINES_AT_ONCE (256 * 1024) /* bytes read from one worker before the others' turn */
#define FIRST_FREE_FD 10           /* lower numbers are for the child's own descriptors */

/* Moves a descriptor above those that the child's dup2 calls overwrite; close-on-exec. */
static int out_of_the_way(int fd) {
    if (fd < 0)
        return fd;
    int moved = fcntl(fd, F_DUPFD_CLOEXEC, FIRST_FREE_FD);
    int kept = errno;
    close(fd);
    errno = kept;
    return moved;
}

/* Cuts the log to its tail once it is large. */
static enum status trim_log(const char *path, int fd, struct error *err) {
    off_t length = lseek(fd, 0, SEEK_END);
    if (length < LOG_LARGE)
        return STATUS_OK;
    char *tail = mem_alloc(LOG_KEEP);
    ssize_t got = pread(fd, tail, LOG_KEEP, length - LOG_KEEP);
    enum status status = STATUS_OK;
    if (got < 0 || ftruncate(fd, 0) != 0)
        status = error_set_errno(err, errno, "cannot truncate %s", path);
    else
        status = file_write_all(fd, tail, (size_t)got, path, err);
    mem_free(tail);
    return status;
}

/* The part of the daemon's environment that a worker gets: where programs and libraries are, settings of the C
 * library and the sanitizers, what tests preload. Anything else may be a secret. The caller's (mem_free); the strings
 * are the environment's. */
static char **worker_environment(void) {
    static const char *const kept[] = {"PATH=",
                                       "LANG=",
                                       "LC_",
                                       "TZ=",
                                       "LD_",
                                       "GLIBC_TUNABLES=",
                                       "MALLOC_",
                                       "RES_OPTIONS=",
                                       "LOCALDOMAIN=",
                                       "ASAN_OPTIONS=",
                                       "LSAN_OPTIONS=",
                                       "TSAN_OPTIONS=",
                                       "UBSAN_OPTIONS=",
                                       "GCOV_",
                                       "UNBAKE_FAULTS",
                                       "UNBAKE_CLOCK=",
                                       "UNBAKE_BOOT_ID="};
    size_t total = 0, count = 0;
    while (environ[total])
        total++;
    char **chosen = mem_calloc(total + 1, sizeof *chosen);
    for (size_t i = 0; i < total; i++)
        for (size_t k = 0; k < sizeof kept / sizeof *kept; k++)
            if (strncmp(environ[i], kept[k], strlen(kept[k])) == 0)
                chosen[count++] = environ[i];
    return chosen;
}

struct spawn {
    const char *binary;
    char *const *argv, *const *environment;
    int null_fd, log_fd, pipe_fd;
    pid_t parent;
};

/* In the child. Only async-signal-safe calls. */
static void become_worker(const struct spawn *spawn) __attribute__((noreturn));
static void become_worker(const struct spawn *spawn) {
    setsid();
    prctl(PR_SET_PDEATHSIG, SIGKILL);
    if (getppid() != spawn->parent) /* the daemon died before PR_SET_PDEATHSIG was set */
        _exit(127);
    for (int signal_number = 1; signal_number < NSIG; signal_number++)
        signal(signal_number, SIG_DFL);
    sigset_t none;
    sigemptyset(&none);
    sigprocmask(SIG_SETMASK, &none, NULL);
    int oom = open("/proc/self/oom_score_adj", O_WRONLY | O_CLOEXEC);
    if (oom >= 0 && write(oom, "500", 3) != 3) {
        /* Only the OOM killer's choice would change: continue. */
    }
    if (dup2(spawn->null_fd, STDIN_FILENO) < 0 || dup2(spawn->log_fd, STDOUT_FILENO) < 0 ||
        dup2(spawn->log_fd, STDERR_FILENO) < 0 || dup2(spawn->pipe_fd, PROGRESS_FD) < 0)
        _exit(127);
    /* Everything else is close-on-exec by convention; this closes what a library forgot. Kernels before 5.9 lack the
     * call. */
    syscall(SYS_close_range, PROGRESS_FD + 1, ~0u, 0);
    execve(spawn->binary, spawn->argv, spawn->environment);
    static const char message[] = "cannot execute the worker's program\n";
    if (write(STDERR_FILENO, message, sizeof message - 1) < 0)
        _exit(126);
    _exit(127);
}

enum status supervisor_start(struct worker *w, const char *binary, const char *dir, struct error *err) {
    *w = (struct worker){.pid_fd = -1, .pipe_fd = -1, .log_path = layout_log(dir)};
    buf_init(&w->line, PROGRESS_LINE_MAX);
    char *argv[] = {mem_strdup("unbaked"), mem_strdup("worker"), mem_strdup(dir), NULL};
    char **environment = worker_environment();
    struct spawn spawn = {.binary = binary,
                          .argv = argv,
                          .environment = environment,
                          .null_fd = -1,
                          .log_fd = -1,
                          .pipe_fd = -1,
                          .parent = getpid()};
    int ends[2] = {-1, -1};
    enum status status = STATUS_OK;
    spawn.null_fd = out_of_the_way(open("/dev/null", O_RDONLY | O_CLOEXEC));
    spawn.log_fd = out_of_the_way(open(w->log_path, O_RDWR | O_CREAT | O_APPEND | O_CLOEXEC | O_NOFOLLOW, 0600));
    if (spawn.null_fd < 0 || spawn.log_fd < 0) {
        status = error_set_errno(err, errno, "cannot open %s", w->log_path);
        goto out;
    }
    status = trim_log(w->log_path, spawn.log_fd, err);
    if (status != STATUS_OK)
        goto out;
    w->log_start = lseek(spawn.log_fd, 0, SEEK_END);
    if (pipe2(ends, O_CLOEXEC) != 0) {
        status = error_set_errno(err, errno, "cannot make a pipe");
        goto out;
    }
    spawn.pipe_fd = out_of_the_way(ends[1]);
    if (spawn.pipe_fd < 0 || fcntl(ends[0], F_SETFL, O_NONBLOCK) != 0) {
        status = error_set_errno(err, errno, "cannot set up a pipe");
        goto out;
    }
    w->pid = fork();
    if (w->pid == 0)
        become_worker(&spawn);
    if (w->pid < 0) {
        w->pid = 0;
        status = error_set_errno(err, errno, "cannot start a process");
        goto out;
    }
    w->pid_fd = (int)syscall(SYS_pidfd_open, w->pid, 0);
    if (w->pid_fd >= 0)
        fcntl(w->pid_fd, F_SETFD, FD_CLOEXEC);
    w->pipe_fd = ends[0];
    ends[0] = -1;
out:
    if (ends[0] >= 0)
        close(ends[0]);
    if (spawn.pipe_fd >= 0)
        close(spawn.pipe_fd);
    if (spawn.log_fd >= 0)
        close(spawn.log_fd);
    if (spawn.null_fd >= 0)
        close(spawn.null_fd);
    for (int i = 0; argv[i]; i++)
        mem_free(argv[i]);
    mem_free(environment);
    if (status != STATUS_OK)
        supervisor_release(w);
    return status;
}

static void take(struct worker *w, const char *data, size_t length,
                 void (*each)(void *user, const char *line, size_t length), void *user) {
    while (length > 0) {
        const char *newline = memchr(data, '\n', length);
        size_t part = newline ? (size_t)(newline - data) : length;
        if (!w->skipping && !buf_append(&w->line, data, part)) {
            w->skipping = true;
            w->long_lines++;
        }
        if (!newline)
            return;
        if (!w->skipping)
            each(user, buf_text(&w->line), w->line.length);
        w->skipping = false;
        buf_clear(&w->line);
        data = newline + 1;
        length -= part + 1;
    }
}

/* Reads up to `limit` bytes. */
static void read_pipe(struct worker *w, size_t limit, void (*each)(void *user, const char *line, size_t length),
                      void *user) {
    char chunk[16384];
    for (size_t total = 0; w->pipe_fd >= 0 && total < limit;) {
        ssize_t got = read(w->pipe_fd, chunk, sizeof chunk);
        if (got < 0 && errno == EINTR)
            continue;
        if (got < 0 && errno == EAGAIN)
            return;
        if (got <= 0) {
            close(w->pipe_fd);
            w->pipe_fd = -1;
            return;
        }
        total += (size_t)got;
        take(w, chunk, (size_t)got, each, user);
    }
}

void supervisor_read(struct worker *w, void (*each)(void *user, const char *line, size_t length), void *user) {
    read_pipe(w, LINES_AT_ONCE, each, user);
}

void supervisor_signal(struct worker *w, int signal_number) {
    if (w->pid > 0)
        kill(w->pid, signal_number);
}

bool supervisor_reap(struct worker *w, int *wait_status, void (*each)(void *user, const char *line, size_t length),
                     void *user) {
    siginfo_t info = {0};
    if (w->pid <= 0 || waitid(P_PID, (id_t)w->pid, &info, WEXITED | WNOHANG | WNOWAIT) != 0 || info.si_pid == 0)
        return false;
    /* The process is not reaped yet, so its number still names its session. */
    kill(-w->pid, SIGKILL);
    read_pipe(w, (size_t)64 << 20, each, user);
    struct rusage used = {0};
    wait4(w->pid, wait_status, 0, &used);
    w->cpu_sec = (double)used.ru_utime.tv_sec + 1e-6 * (double)used.ru_utime.tv_usec + (double)used.ru_stime.tv_sec +
                 1e-6 * (double)used.ru_stime.tv_usec;
    w->pid = 0;
    return true;
}

double supervisor_cpu_sec(const struct worker *w) {
    clockid_t clock;
    struct timespec used;
    if (w->pid <= 0)
        return w->cpu_sec;
    if (clock_getcpuclockid(w->pid, &clock) != 0 || clock_gettime(clock, &used) != 0)
        return 0.0;
    return (double)used.tv_sec + 1e-9 * (double)used.tv_nsec;
}

char *supervisor_last_words(const struct worker *w, size_t limit) {
    char *text = mem_calloc(limit + 1, 1);
    int fd = open(w->log_path, O_RDONLY | O_CLOEXEC | O_NOFOLLOW);
    if (fd < 0)
        return text;
    off_t end = lseek(fd, 0, SEEK_END), start = w->log_start;
    bool whole = end - start <= (off_t)limit;
    if (!whole)
        start = end - (off_t)limit;
    ssize_t got = end > start ? pread(fd, text, (size_t)(end - start), start) : 0;
    close(fd);
    size_t length = got > 0 ? (size_t)got : 0;
    text[length] = '\0';
    if (!whole) { /* start at a whole line if there is one */
        char *newline = memchr(text, '\n', length);
        if (newline && newline[1]) {
            length -= (size_t)(newline + 1 - text);
            memmove(text, newline + 1, length + 1);
        }
    }
    while (length > 0 && (text[length - 1] == '\n' || text[length - 1] == ' '))
        text[--length] = '\0';
    for (size_t i = 0; i < length; i++) {
        unsigned char c = (unsigned char)text[i];
        if (c < 0x20 || c >= 0x7f) /* the text goes into JSON and terminals: ASCII only */
            text[i] = c == '\n' ? ' ' : '?';
    }
    return text;
}

void supervisor_release(struct worker *w) {
    if (w->pipe_fd >= 0)
        close(w->pipe_fd);
    if (w->pid_fd >= 0)
        close(w->pid_fd);
    buf_release(&w->line);
    mem_free(w->log_path);
    *w = (struct worker){.pid_fd = -1, .pipe_fd = -1};
}
