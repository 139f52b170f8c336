/* process.c -- see process.h.
 *
 * The daemon has threads when it forks, so the child calls only async-signal-safe functions
 * until it executes: everything that needs memory is made before. */
#include "server/job/process.h"

#include <errno.h>
#include <fcntl.h>
#include <math.h>
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
#include "server/job/line_reader.h"
#include "server/job/oom.h"
#include "server/job/worker_log.h"
#include "server/worker/progress.h"

#define LINES_AT_ONCE (256 * 1024)      /* bytes read from one process before the others' turn */
#define LINES_AT_END ((size_t)64 << 20) /* what a pipe may hold at the most is far less */
#define FIRST_FREE_FD 10                /* lower numbers are for the child's own descriptors */
#define NO_PIDFD_LOOK_SEC 0.2           /* where the kernel has no pidfd to report that a process has ended */

struct process {
    struct run run;
    pid_t pid;                /* 0: reaped */
    int pid_fd;               /* readable when the process has ended; -1 on old kernels */
    struct line_reader lines; /* of its pipe */
    char *log;
    off_t log_start;    /* where this process's part of the log begins */
    double cpu_sec;     /* in all, once it is reaped */
    uint64_t oom_kills; /* the machine's count before it started */
};

static const struct process *of_const(const struct run *run) { return (const struct process *)(const void *)run; }
static struct process *of(struct run *run) { return (struct process *)(void *)run; }

/* --- its start ------------------------------------------------------------------------------ */

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

/* Forks; the process's end of the pipe is spawn->pipe_fd. */
static enum status start_process(struct process *p, struct spawn *spawn, struct error *err) {
    int ends[2];
    if (pipe2(ends, O_CLOEXEC) != 0)
        return error_set_errno(err, errno, "cannot make a pipe");
    p->lines.fd = ends[0];
    spawn->pipe_fd = out_of_the_way(ends[1]);
    if (spawn->pipe_fd < 0 || fcntl(p->lines.fd, F_SETFL, O_NONBLOCK) != 0)
        return error_set_errno(err, errno, "cannot set up a pipe");
    p->pid = fork();
    if (p->pid == 0)
        become_worker(spawn);
    if (p->pid < 0) {
        p->pid = 0;
        return error_set_errno(err, errno, "cannot start a process");
    }
    p->pid_fd = (int)syscall(SYS_pidfd_open, p->pid, 0);
    if (p->pid_fd >= 0)
        fcntl(p->pid_fd, F_SETFD, FD_CLOEXEC);
    snprintf(p->run.place, sizeof p->run.place, "process %d", (int)p->pid);
    return STATUS_OK;
}

static enum status spawn_in(struct process *p, const char *binary, const char *dir, struct error *err) {
    char *argv[] = {mem_strdup("unbaked"), mem_strdup("worker"), mem_strdup(dir), NULL};
    char **environment = worker_environment();
    struct spawn spawn = {.binary = binary,
                          .argv = argv,
                          .environment = environment,
                          .null_fd = -1,
                          .log_fd = -1,
                          .pipe_fd = -1,
                          .parent = getpid()};
    int log_fd;
    enum status status = worker_log_open(p->log, &log_fd, &p->log_start, err);
    if (status == STATUS_OK) {
        spawn.log_fd = out_of_the_way(log_fd);
        spawn.null_fd = out_of_the_way(open("/dev/null", O_RDONLY | O_CLOEXEC));
        if (spawn.null_fd < 0 || spawn.log_fd < 0)
            status = error_set_errno(err, errno, "cannot open %s", spawn.null_fd < 0 ? "/dev/null" : p->log);
    }
    if (status == STATUS_OK)
        status = start_process(p, &spawn, err);
    if (spawn.pipe_fd >= 0)
        close(spawn.pipe_fd);
    if (spawn.log_fd >= 0)
        close(spawn.log_fd);
    if (spawn.null_fd >= 0)
        close(spawn.null_fd);
    for (int i = 0; argv[i]; i++)
        mem_free(argv[i]);
    mem_free(environment);
    return status;
}

/* Says where on this machine a folder lies that the worker reads. */
static void add_folder(cJSON *order, const char *key, const char *data_dir, const char *folder) {
    if (!folder)
        return;
    char *path = file_join(data_dir, folder);
    cJSON_DeleteItemFromObjectCaseSensitive(order, key);
    json_add_string(order, key, path);
    mem_free(path);
}

/* The order, with where that lies on this machine which the worker reads. */
static enum status write_order(const char *data_dir, const char *dir, const struct run_work *work, struct error *err) {
    if (work->scene_id) {
        char *scene = layout_scene(NULL, work->scene_id), *files = layout_files(scene);
        add_folder(work->order, "scene", data_dir, files);
        mem_free(files);
        mem_free(scene);
    }
    add_folder(work->order, "outputs", data_dir, work->outputs);
    add_folder(work->order, "files", data_dir, work->files);
    char *text = json_text(work->order), *path = layout_order(dir);
    enum status status = file_replace(path, text, strlen(text), err);
    mem_free(path);
    mem_free(text);
    return status;
}

static const struct run_kind kind;

static enum status start(const struct executor *executor, const struct run_work *work, struct run **run,
                         struct error *err) {
    const struct process_executor *e = (const struct process_executor *)(const void *)executor;
    struct process *p = mem_calloc(1, sizeof *p);
    char *dir = file_join(e->data_dir, work->folder);
    *p = (struct process){.run = {.kind = &kind}, .pid_fd = -1, .oom_kills = oom_kills("")};
    p->log = file_join(e->data_dir, work->log);
    line_reader_init(&p->lines, -1);
    enum status status = write_order(e->data_dir, dir, work, err);
    if (status == STATUS_OK)
        status = spawn_in(p, e->binary, dir, err);
    mem_free(dir);
    *run = status == STATUS_OK ? &p->run : NULL;
    if (status != STATUS_OK)
        run_free(&p->run);
    return status;
}

const struct executor *process_executor_init(struct process_executor *p, const char *binary, const char *data_dir) {
    *p = (struct process_executor){
        .executor = {.name = "process", .start = start}, .binary = binary, .data_dir = data_dir};
    return &p->executor;
}

/* --- its lines, and its end ------------------------------------------------------------------ */

static void read_lines(struct process *p, size_t limit, run_line_fn *each, void *user) {
    line_reader_read(&p->lines, limit, each, user);
    p->run.long_lines = p->lines.dropped;
}

static void process_read(struct run *run, run_line_fn *each, void *user) {
    read_lines(of(run), LINES_AT_ONCE, each, user);
}

static void process_ask(struct run *run, enum run_request request) {
    static const int signals[] = {[RUN_STOP] = SIGTERM, [RUN_KILL] = SIGKILL, [RUN_PREVIEW] = SIGUSR1};
    const struct process *p = of(run);
    if (p->pid > 0)
        kill(p->pid, signals[request]);
}

static void say_end(const struct process *p, int wait_status, struct run_end *end) {
    if (WIFEXITED(wait_status)) {
        *end = (struct run_end){.way = RUN_EXIT, .code = WEXITSTATUS(wait_status)};
        return;
    }
    bool by_kernel = WTERMSIG(wait_status) == SIGKILL && oom_kills("") > p->oom_kills;
    *end = (struct run_end){.way = by_kernel ? RUN_MEMORY : RUN_SIGNAL, .code = WTERMSIG(wait_status)};
}

static bool process_ended(struct run *run, struct run_end *end, run_line_fn *each, void *user) {
    struct process *p = of(run);
    siginfo_t info = {0};
    if (p->pid <= 0)
        return false;
    int failed = waitid(P_PID, (id_t)p->pid, &info, WEXITED | WNOHANG | WNOWAIT), number = errno;
    bool is_lost = failed && number == ECHILD; /* somebody else has reaped it: how it ended nobody can tell */
    if (!is_lost && (failed || info.si_pid == 0))
        return false;
    if (!is_lost)
        kill(-p->pid, SIGKILL); /* it is not reaped yet, so its number still names its session */
    read_lines(p, LINES_AT_END, each, user);
    struct rusage used = {0};
    int wait_status = 0;
    if (is_lost) {
        *end = (struct run_end){.way = RUN_LOST, .reason = "its process is gone, and how it ended is not known"};
    } else {
        wait4(p->pid, &wait_status, 0, &used);
        say_end(p, wait_status, end);
    }
    p->cpu_sec = (double)used.ru_utime.tv_sec + 1e-6 * (double)used.ru_utime.tv_usec + (double)used.ru_stime.tv_sec +
                 1e-6 * (double)used.ru_stime.tv_usec;
    p->pid = 0;
    return true;
}

static double process_cpu_sec(const struct run *run) {
    const struct process *p = of_const(run);
    clockid_t clock;
    struct timespec used;
    if (p->pid <= 0)
        return p->cpu_sec;
    if (clock_getcpuclockid(p->pid, &clock) != 0 || clock_gettime(clock, &used) != 0)
        return 0.0;
    return (double)used.tv_sec + 1e-9 * (double)used.tv_nsec;
}

static char *process_log_tail(const struct run *run, size_t limit) {
    const struct process *p = of_const(run);
    return worker_log_tail(p->log, p->log_start, limit);
}

static size_t process_poll(const struct run *run, struct pollfd fds[RUN_FDS], double *look_sec) {
    const struct process *p = of_const(run);
    fds[0] = (struct pollfd){.fd = p->pid_fd, .events = POLLIN};
    fds[1] = (struct pollfd){.fd = p->lines.fd, .events = POLLIN};
    *look_sec = p->pid_fd < 0 ? NO_PIDFD_LOOK_SEC : (double)INFINITY;
    return 2;
}

static void process_free(struct run *run) {
    struct process *p = of(run);
    line_reader_release(&p->lines);
    if (p->pid_fd >= 0)
        close(p->pid_fd);
    mem_free(p->log);
    mem_free(p);
}

static const struct run_kind kind = {.read = process_read,
                                     .ask = process_ask,
                                     .ended = process_ended,
                                     .cpu_sec = process_cpu_sec,
                                     .log_tail = process_log_tail,
                                     .poll = process_poll,
                                     .free = process_free};
