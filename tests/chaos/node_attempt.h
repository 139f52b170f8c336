/* node_attempt.h -- a scheduler's side of attempts by the real `unbaked node`: begins them, reads their lines, ends
 * them. */
#ifndef UNBAKE_TESTS_CHAOS_NODE_ATTEMPT_H
#define UNBAKE_TESTS_CHAOS_NODE_ATTEMPT_H

#include <dlfcn.h>
#include <sys/stat.h>
#include <sys/statvfs.h>

#include "server/data/attempt_folder.h"
#include "server/data/layout.h"
#include "server/store/remote.h"
#include "tests/api/rig.h"
#include "tests/chaos/proxy.h"
#include "tests/chaos/worker.h"

#define TOKEN "token-of-this-attempt"
#define PATIENCE_SEC 240.0
#define SETTINGS                                                                                                       \
    "\"texture_size\":64,\"iterations\":%ld,\"texels_per_iteration\":128,\"cameras_per_texel\":1,"                     \
    "\"samples_per_camera\":2,\"report_samples\":1,\"gather_samples\":16,\"gloss_passes\":1,"                          \
    "\"texels_per_metre\":2,\"preview_interval_sec\":1," CLOSED_ROOM

static struct rig rig;
static int port; /* that nodes are told */
static struct error err;
static char binary[512], home_sums[WORKER_OUTPUTS][SHA256_HEX_SIZE];
static unsigned random_;
static long kill_count, taken_count, checkpoint_count; /* the last: of a job that nobody disturbed */

/* The rig's disk, as the HTTP side sees it. */
static atomic_bool disk_is_full;
int statvfs(const char *path, struct statvfs *info) {
    int (*real)(const char *, struct statvfs *) = NULL;
    *(void **)&real = dlsym(RTLD_NEXT, "statvfs");
    int failed = real(path, info);
    if (failed == 0 && atomic_load(&disk_is_full))
        info->f_bavail = 0;
    return failed;
}

#define OK(call) CHECK_THAT((call) == STATUS_OK, "%s", err.message)

static inline unsigned draw(unsigned limit) {
    random_ = random_ * 1664525u + 1013904223u;
    return (random_ >> 8) % limit;
}

/* --- an attempt ---------------------------------------------------------------------------------- */

struct remote_attempt {
    int64_t job;
    int number, lease_sec;
    pid_t pid;
    long checkpoints, outputs, no_space_count; /* lines that were read */
    struct remote_row row;
};

static inline char *settings(long iterations) { return mem_printf(SETTINGS, iterations); }

static inline void begin(struct remote_attempt *a, int64_t job, int threads, long iterations) {
    char hex[SHA256_HEX_SIZE];
    *a = (struct remote_attempt){.job = job, .lease_sec = a->lease_sec};
    OK(store_job_start(rig.store, job, "site", &a->number, &err));
    OK(attempt_folder_begin(rig.dir, job, a->number, &err));
    struct remote_row row = {.job_id = job, .number = a->number, .executor = "site", .lease_sec = a->lease_sec};
    snprintf(row.name, sizeof row.name, "unbake-%lld-%d", (long long)job, a->number);
    sha256_of(TOKEN, strlen(TOKEN), hex);
    OK(store_remote_begin(rig.store, &row, hex, &err));
    char *dir = layout_attempt(rig.dir, job, a->number), *text = settings(iterations);
    worker_order(dir, "/nowhere", a->number, threads, 0.0, true, text);
    mem_free(text);
    mem_free(dir);
}

/* Starts a node for the attempt; what it prints goes to rig.dir/node.log. */
static inline pid_t start_node(const struct remote_attempt *a) {
    char *url = mem_printf("http://127.0.0.1:%d", port), *log = file_join(rig.dir, "node.log");
    char *job = mem_printf("%lld", (long long)a->job), *number = mem_printf("%d", a->number);
    char *cache = file_join(rig.dir, "cache"), *work = file_join(rig.dir, "work");
    pid_t parent = getpid(), pid = fork();
    if (pid == 0) {
        prctl(PR_SET_PDEATHSIG, SIGKILL);
        if (getppid() != parent || !freopen(log, "a", stderr))
            _exit(126);
        for (int fd = 3; fd < 256; fd++)
            close(fd);
        setenv("UNBAKE_NODE_TOKEN", TOKEN, 1);
        execl(binary, "unbaked", "node", url, "--job", job, "--attempt", number, "--cache", cache, "--work", work,
              (char *)NULL);
        _exit(127);
    }
    char *texts[] = {url, log, job, number, cache, work};
    for (size_t i = 0; i < sizeof texts / sizeof *texts; i++)
        mem_free(texts[i]);
    return pid;
}

static inline void check_line(struct remote_attempt *a, const char *text, size_t length) {
    cJSON *line = NULL;
    const char *type, *name;
    double bytes;
    struct stat info;
    CHECK_THAT(json_parse(text, length, "line", &line, &err) == STATUS_OK, "%s", err.message);
    OK(json_string(line, "type", "line", "", &type, &err));
    CHECK(strcmp(type, "part") != 0);
    a->checkpoints += strcmp(type, "checkpoint") == 0;
    a->no_space_count += strcmp(type, "end") == 0 && strstr(text, "no-space") != NULL;
    if (strcmp(type, "output") == 0 || strcmp(type, "preview") == 0) {
        char *dir = layout_attempt(rig.dir, a->job, a->number);
        OK(json_string(line, "name", "line", "", &name, &err));
        OK(json_number(line, "bytes", "line", 0.0, &bytes, &err));
        char *path = layout_output(dir, name);
        bool is_there = stat(path, &info) == 0; /* a preview may have been replaced by now, an output not */
        CHECK_THAT(is_there && (type[0] == 'p' || (double)info.st_size == bytes), "%s is announced, and not there",
                   name);
        a->outputs += type[0] == 'o';
        mem_free(path);
        mem_free(dir);
    }
    cJSON_Delete(line);
}

static inline void check_lines(void *user, const char *lines) {
    for (const char *at = lines, *end; (end = strchr(at, '\n')) != NULL; at = end + 1)
        check_line(user, at, (size_t)(end - at));
}

/* Reads what has been reported; returns the attempt's phase. */
static inline enum remote_phase listen_to(struct remote_attempt *a) {
    OK(store_remote_get(rig.store, a->job, a->number, &a->row, &err));
    while (store_remote_read(rig.store, a->job, a->number, check_lines, a, &err) == STATUS_OK)
        ;
    return a->row.phase;
}

/* The number of the newest part of a checkpoint that has come. */
static inline int newest_part(const struct remote_attempt *a) {
    char *dir = layout_attempt(rig.dir, a->job, a->number), *folder = layout_checkpoint_folder(dir), **names = NULL;
    size_t count = 0;
    int newest = 0;
    OK(file_list(folder, &names, &count, &err));
    for (size_t i = 0; i < count; i++)
        newest = layout_part_number(names[i]) > newest ? layout_part_number(names[i]) : newest;
    file_free_names(names, count);
    mem_free(folder);
    mem_free(dir);
    return newest;
}

static inline void wait_for_part(struct remote_attempt *a) {
    while (newest_part(a) == 0 && listen_to(a) < REMOTE_ENDED)
        usleep(10000);
}

/* Until the node has ended: its exit status, or minus the signal's number. It gets the signal `number` after so many
 * parts of checkpoints and `wait_sec` more; -1: never. */
static inline int follow(struct remote_attempt *a, int parts, double wait_sec, int number) {
    double give_up = clock_sec() + PATIENCE_SEC, at = 0.0;
    int before = newest_part(a);
    int status = 0;
    bool has_sent = false;
    while (waitpid(a->pid, &status, WNOHANG) == 0) {
        listen_to(a);
        /* Who takes a process's machine before it has claimed anything takes nothing of a job. */
        bool may_signal = number == SIGKILL || a->row.phase >= REMOTE_CLAIMED;
        if (at == 0.0 && parts >= 0 && may_signal && newest_part(a) >= before + parts)
            at = clock_sec() + wait_sec;
        if (!has_sent && at > 0.0 && clock_sec() >= at) {
            kill(a->pid, number);
            has_sent = true;
        }
        if (clock_sec() > give_up) {
            fprintf(stderr, "a node does not come to its end\n");
            kill(a->pid, SIGKILL);
            exit(1);
        }
        usleep(10000);
    }
    listen_to(a);
    return WIFEXITED(status) ? WEXITSTATUS(status) : -WTERMSIG(status);
}

/* Nothing more is accepted, and the job waits for its next attempt. */
static inline void lose(struct remote_attempt *a) {
    size_t writers = 1;
    while (writers > 0)
        OK(store_remote_close(rig.store, a->job, a->number, &writers, &err));
    OK(store_job_stop(rig.store, a->job, a->number, "", &err));
}

static inline void check_equal(const struct remote_attempt *a) {
    char sums[WORKER_OUTPUTS][SHA256_HEX_SIZE], *dir = layout_attempt(rig.dir, a->job, a->number);
    CHECK_THAT(strcmp(a->row.end.way, "exit") == 0 && a->row.end.code == 0, "%s %d: %s", a->row.end.way,
               a->row.end.code, a->row.end.reason);
    worker_hash(dir, sums);
    for (size_t i = 0; i < WORKER_OUTPUTS; i++)
        CHECK_THAT(strcmp(sums[i], home_sums[i]) == 0, "job %lld: %s differs", (long long)a->job, worker_outputs[i]);
    mem_free(dir);
    OK(store_job_succeed(rig.store, a->job, a->number, "", &err));
}

static inline void show_log(void) {
    struct buf text;
    char *log = file_join(rig.dir, "node.log");
    buf_init(&text, 1 << 22);
    if ((check_failed_count > 0 || getenv("UNBAKE_SHOW")) && file_read(log, &text, NULL) == STATUS_OK)
        fprintf(stderr, "%s\n", buf_text(&text));
    buf_release(&text);
    mem_free(log);
}

#endif
