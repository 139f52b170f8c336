/* node_cluster.h -- a cluster in one process: a scheduler of cp and cat, and nodes that compute nothing. */
#ifndef UNBAKE_TESTS_BENCH_NODE_CLUSTER_H
#define UNBAKE_TESTS_BENCH_NODE_CLUSTER_H

#include <dirent.h>
#include <fcntl.h>
#include <poll.h>
#include <pthread.h>
#include <signal.h>
#include <stdatomic.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include "common/clock.h"
#include "common/file.h"
#include "common/log.h"
#include "common/mem.h"
#include "common/request.h"
#include "common/sha256.h"
#include "server/node/link.h"
#include "server/store/store.h"
#include "tests/check.h"
#include "tests/figures.h"

#define JOB_SEC 4.0
#define REPORT_SEC 1.0
#define PART_BYTES 65536
#define OUTPUT_BYTES 262144
#define JOBS_MAX 100000

static struct error err;
static char dir[] = "/tmp/unbake-bench-nodes-XXXXXX", url[64];
static long job_count = 2000, node_count = 64;
static atomic_long ended_count, failed_count;
static atomic_bool is_over;

#define OK(call)                                                                                                       \
    do {                                                                                                               \
        if ((call) != STATUS_OK) {                                                                                     \
            fprintf(stderr, "%s: %s\n", #call, err.message);                                                           \
            exit(1);                                                                                                   \
        }                                                                                                              \
    } while (0)

/* --- the cluster ------------------------------------------------------------------------------ */

enum place { QUEUED, RUNNING, GONE };

static struct cluster {
    pthread_mutex_t mutex;
    struct cluster_job {
        char name[64], token[65];
        int64_t job;
        int attempt;
        enum place place;
        double gone_at;
    } job[JOBS_MAX];
    size_t count, next; /* the first that no node has taken */
} cluster = {.mutex = PTHREAD_MUTEX_INITIALIZER};

static inline char *in_site(const char *name) {
    char *folder = file_join(dir, "site"), *path = file_join(folder, name);
    mem_free(folder);
    return path;
}

/* Takes a script that the submit command has left. */
static inline void take_script(const char *name) {
    struct cluster_job *c = &cluster.job[cluster.count];
    struct buf text;
    long long job;
    char *path = in_site(name);
    buf_init(&text, 4096);
    if (file_read(path, &text, NULL) == STATUS_OK &&
        sscanf(buf_text(&text), "token=%64s job=%lld attempt=%d end", c->token, &job, &c->attempt) == 3 &&
        strstr(buf_text(&text), "end") && unlink(path) == 0) {
        snprintf(c->name, sizeof c->name, "%.63s", name);
        c->job = job;
        cluster.count++;
    }
    buf_release(&text);
    mem_free(path);
}

/* What the status command prints: all that are alive, or have ended of late. */
static inline void write_status(void) {
    static const char *const words[] = {"waiting", "running", "ended"};
    struct buf text;
    char *path = in_site("status");
    buf_init(&text, 1 << 24);
    buf_puts(&text, "id name state reason\n");
    for (size_t i = 0; i < cluster.count; i++)
        if (cluster.job[i].place != GONE || clock_sec() - cluster.job[i].gone_at < 60.0)
            buf_printf(&text, "%zu %s %s Priority\n", i + 1, cluster.job[i].name, words[cluster.job[i].place]);
    OK(file_replace(path, buf_text(&text), text.length, &err));
    buf_release(&text);
    mem_free(path);
}

static inline void *keep_cluster(void *unused) {
    (void)unused;
    for (int round = 0; !atomic_load(&is_over); round++) {
        char *folder = file_join(dir, "site");
        DIR *list = opendir(folder);
        struct dirent *entry;
        pthread_mutex_lock(&cluster.mutex);
        while (list && (entry = readdir(list)) != NULL)
            if (strncmp(entry->d_name, "unbake-", 7) == 0)
                take_script(entry->d_name);
        if (round % 10 == 0)
            write_status();
        pthread_mutex_unlock(&cluster.mutex);
        if (list)
            closedir(list);
        mem_free(folder);
        poll(NULL, 0, 20);
    }
    return NULL;
}

/* --- a node ------------------------------------------------------------------------------------ */

static inline void beat(void *link) { link_report(link, 0.0, false); }

static void say(struct attempt_link *l, const char *format, ...) __attribute__((format(printf, 2, 3)));
static inline void say(struct attempt_link *l, const char *format, ...) {
    char line[1024];
    va_list arguments;
    va_start(arguments, format);
    int length = vsnprintf(line, sizeof line, format, arguments);
    va_end(arguments);
    link_add_line(l, line, (size_t)length);
}

/* Sends a file of so many bytes. */
static inline enum status send_file(struct attempt_link *l, const char *what, const char *name, const char *query,
                                    size_t length, char hex[SHA256_HEX_SIZE], struct error *why) {
    FILE *file = tmpfile();
    char *bytes = mem_calloc(length, 1);
    snprintf(bytes, length, "%s %s", l->path, name);
    sha256_of(bytes, length, hex);
    CHECK(file && write(fileno(file), bytes, length) == (ssize_t)length);
    enum status status = link_send(l, what, name, query, fileno(file), hex, why);
    fclose(file);
    mem_free(bytes);
    return status;
}

static inline enum status work(struct attempt_link *l, struct error *why) {
    char hex[SHA256_HEX_SIZE];
    double begun = clock_sec(), next = begun;
    say(l, "{\"type\":\"stage\",\"stage\":\"refine\"}");
    while (clock_sec() - begun < JOB_SEC) {
        double done = (clock_sec() - begun) / JOB_SEC;
        say(l, "{\"type\":\"progress\",\"stage\":\"refine\",\"done\":%.3f,\"total\":1,\"eta_sec\":%.1f}", done,
            JOB_SEC * (1.0 - done));
        say(l, "{\"type\":\"checkpoint\",\"iteration\":10,\"bytes\":%d,\"seconds\":0.1}", PART_BYTES);
        link_report(l, JOB_SEC * done, true);
        next += REPORT_SEC;
        while (clock_sec() < next)
            poll(NULL, 0, 50);
    }
    enum status status = send_file(l, "checkpoint", "part-1", "?first=1", PART_BYTES, hex, why);
    if (status == STATUS_OK)
        status = send_file(l, "outputs", "base_color.exr", "", OUTPUT_BYTES, hex, why);
    say(l, "{\"type\":\"output\",\"name\":\"base_color.exr\",\"sha256\":\"%s\",\"bytes\":%d}", hex, OUTPUT_BYTES);
    say(l, "{\"type\":\"end\",\"status\":\"ok\",\"message\":\"\"}");
    while (status == STATUS_OK && !link_all_lines_sent(l) && link_state(l) == LINK_OPEN)
        link_report(l, JOB_SEC, true);
    return status;
}

static inline void run_one(const struct cluster_job *c) {
    struct attempt_link link;
    struct error why = {0};
    cJSON *order = NULL;
    const struct link_config config = {
        .url = url, .token = c->token, .job_id = c->job, .number = c->attempt, .beat = beat, .user = &link};
    const struct link_end end = {.way = "exit", .reason = "", .log_tail = ""};
    link_init(&link, &config);
    enum status status = link_claim(&link, "node", 1, &order, &why);
    if (status == STATUS_OK)
        status = work(&link, &why);
    if (status == STATUS_OK)
        status = link_end(&link, &end, JOB_SEC, &why);
    if (status != STATUS_OK) {
        fprintf(stderr, "job %lld: %s\n", (long long)c->job, why.message);
        atomic_fetch_add(&failed_count, 1);
    }
    atomic_fetch_add(&ended_count, 1);
    cJSON_Delete(order);
    link_release(&link);
}

static inline void *be_node(void *unused) {
    (void)unused;
    while (!atomic_load(&is_over)) {
        struct cluster_job *c = NULL;
        pthread_mutex_lock(&cluster.mutex);
        if (cluster.next < cluster.count) {
            c = &cluster.job[cluster.next++];
            c->place = RUNNING;
        }
        pthread_mutex_unlock(&cluster.mutex);
        if (!c) {
            poll(NULL, 0, 50);
            continue;
        }
        run_one(c);
        pthread_mutex_lock(&cluster.mutex);
        c->place = GONE;
        c->gone_at = clock_sec();
        pthread_mutex_unlock(&cluster.mutex);
    }
    return NULL;
}

#endif
