/* bench_nodes.c -- the real daemon, 2,000 jobs, 64 nodes that report at once: how long its API takes to answer
 * meanwhile, and what the daemon takes of processor and memory. The nodes are threads here with the link of `unbaked
 * node` (server/node/link.h) and a worker that computes nothing: a claim, for JOB_SEC a report every REPORT_SEC with
 * two lines, one part of a checkpoint, one output, the end. So they come and go some hundred times as often as those of
 * rooms. Their scheduler's commands are cp and cat. One client meanwhile adds the jobs and asks for lists and single
 * ones, some twenty times a second.
 *
 * bench_nodes [JOBS [NODES]]. $UNBAKE_BUILD/unbaked is the daemon. */
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

#define SCENE "00112233445566778899aabbccddeeff00112233445566778899aabbccddeeff"
#define JOB_SEC 4.0
#define REPORT_SEC 1.0
#define LEASE_SEC 60
#define PART_BYTES 65536
#define OUTPUT_BYTES 262144
#define ROUND_SEC 0.05 /* between a client's rounds of three requests */
#define IDLE_ROUNDS 100
#define NODES_MAX 256
#define JOBS_MAX 100000
#define PATIENCE_SEC 1800.0

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

static char *in_site(const char *name) {
    char *folder = file_join(dir, "site"), *path = file_join(folder, name);
    mem_free(folder);
    return path;
}

/* Takes a script that the submit command has left. */
static void take_script(const char *name) {
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
static void write_status(void) {
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

static void *keep_cluster(void *unused) {
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

static void beat(void *link) { link_report(link, 0.0, false); }

static void say(struct attempt_link *l, const char *format, ...) __attribute__((format(printf, 2, 3)));
static void say(struct attempt_link *l, const char *format, ...) {
    char line[1024];
    va_list arguments;
    va_start(arguments, format);
    int length = vsnprintf(line, sizeof line, format, arguments);
    va_end(arguments);
    link_add_line(l, line, (size_t)length);
}

/* Sends a file of so many bytes. */
static enum status send_file(struct attempt_link *l, const char *what, const char *name, const char *query,
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

static enum status work(struct attempt_link *l, struct error *why) {
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

static void run_one(const struct cluster_job *c) {
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

static void *be_node(void *unused) {
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

/* --- the client -------------------------------------------------------------------------------- */

enum asked { LIST, SHOW, ADD, ASKED_COUNT };
static const char *const asked_names[] = {"GET /v1/jobs?limit=50", "GET /v1/jobs/ID", "POST /v1/jobs"};

struct latencies {
    double *ms[ASKED_COUNT]; /* [count]; owned */
    size_t count[ASKED_COUNT];
};

static void ask(struct http_request *r, struct latencies *l, enum asked what, const struct request_call *call) {
    struct reply reply;
    reply_init(&reply);
    double begun = clock_sec();
    OK(request_run(r, call, &reply, &err));
    l->ms[what] = mem_realloc_array(l->ms[what], l->count[what] + 1, sizeof(double));
    l->ms[what][l->count[what]++] = 1e3 * (clock_sec() - begun);
    reply_release(&reply);
}

static void add_job(struct http_request *r, struct latencies *l) {
    cJSON *body = cJSON_CreateObject(), *settings = cJSON_CreateObject();
    json_add_string(body, "scene", SCENE);
    json_add_string(body, "name", "a room");
    json_add_string(settings, "executor", "cluster");
    json_add(body, "settings", settings);
    ask(r, l, ADD, &(struct request_call){.method = "POST", .path = "/v1/jobs", .body = body});
    cJSON_Delete(body);
}

static void ask_for_jobs(struct http_request *r, struct latencies *l, long id) {
    char path[64];
    snprintf(path, sizeof path, "/v1/jobs/%ld", id);
    ask(r, l, LIST, &(struct request_call){.path = "/v1/jobs?limit=50"});
    ask(r, l, SHOW, &(struct request_call){.path = path});
}

static int by_value(const void *a, const void *b) {
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

static double quantile(const struct latencies *l, enum asked what, double part) {
    qsort(l->ms[what], l->count[what], sizeof(double), by_value);
    return l->ms[what][(size_t)(part * (double)(l->count[what] - 1))];
}

static void print_latencies(const char *when, const struct latencies *l) {
    for (int i = 0; i < ASKED_COUNT; i++)
        if (l->count[i] > 0)
            printf("%s: %-22s p50 %6.1f ms, p99 %6.1f ms, most %6.1f ms (%zu)\n", when, asked_names[i],
                   quantile(l, (enum asked)i, 0.5), quantile(l, (enum asked)i, 0.99), quantile(l, (enum asked)i, 1.0),
                   l->count[i]);
}

static void release(struct latencies *l) {
    for (int i = 0; i < ASKED_COUNT; i++)
        mem_free(l->ms[i]);
}

/* --- the daemon --------------------------------------------------------------------------------- */

static void prepare(void) {
    struct store *store;
    bool existed;
    static const char conf[] =
        "url = %s\nsubmit = /bin/cp /dev/stdin %s/site/{name}\nstatus = /bin/cat %s/site/status\n"
        "status_line = {id} {name} {state} {reason}\ncancel = /bin/true\nwaiting = waiting\nrunning = running\n"
        "ended = ended\nmax_running = %ld\nstatus_sec = 5\nlease_sec = %d\n[script]\n"
        "token={token} job={job} attempt={attempt} end # {command}\n";
    char *site = file_join(dir, "site"), *executors = file_join(dir, "executors.d"), *data = file_join(dir, "data");
    char *path = file_join(executors, "cluster.conf");
    char *text = mem_printf(conf, url, dir, dir, 2 * node_count, LEASE_SEC); /* as many again wait there */
    OK(file_make_dirs(site, &err));
    OK(file_make_dirs(executors, &err));
    OK(file_make_dirs(data, &err));
    OK(file_replace(path, text, strlen(text), &err));
    OK(store_open(&store, data, &err));
    OK(store_scene_add(store, SCENE, "room", 10, 0, &existed, &err));
    OK(store_scene_ready(store, SCENE, NULL, "{}", &err));
    store_close(store);
    mem_free(text);
    mem_free(path);
    mem_free(data);
    mem_free(executors);
    mem_free(site);
}

static pid_t start_daemon(int port) {
    const char *build = getenv("UNBAKE_BUILD");
    char *binary = file_join(build ? build : "build", "unbaked"), *data = file_join(dir, "data");
    char *executors = mem_printf("executors_dir=%s/executors.d", dir), *log = file_join(dir, "log");
    char *listen = mem_printf("127.0.0.1:%d", port), *queue = mem_printf("queue_limit=%ld", job_count + 100);
    pid_t pid = fork();
    if (pid == 0) {
        prctl(PR_SET_PDEATHSIG, SIGKILL);
        if (!freopen(log, "a", stderr) || !freopen("/dev/null", "w", stdout))
            _exit(126);
        execl(binary, "unbaked", "--data", data, "--listen", listen, "--set", "executors=cluster", "--set", executors,
              "--set", queue, "--set", "min_free_mib=0", "--set", "low_disk_mib=0", (char *)NULL);
        _exit(127);
    }
    char *texts[] = {binary, data, executors, log, listen, queue};
    for (size_t i = 0; i < sizeof texts / sizeof *texts; i++)
        mem_free(texts[i]);
    return pid;
}

/* Seconds of processor of the daemon and of the children it has waited for. */
static void read_cpu(pid_t pid, double *own, double *children) {
    char path[64];
    unsigned long user, kernel, child_user, child_kernel;
    struct buf text;
    snprintf(path, sizeof path, "/proc/%d/stat", (int)pid);
    buf_init(&text, 4096);
    OK(file_read(path, &text, &err));
    const char *at = strrchr(buf_text(&text), ')');
    CHECK(at && sscanf(at, ") %*c %*d %*d %*d %*d %*d %*u %*u %*u %*u %*u %lu %lu %lu %lu", &user, &kernel, &child_user,
                       &child_kernel) == 4);
    double hz = (double)sysconf(_SC_CLK_TCK);
    *own = (double)(user + kernel) / hz;
    *children = (double)(child_user + child_kernel) / hz;
    buf_release(&text);
}

static double resident_mib(pid_t pid) {
    char path[64];
    long kib = 0;
    struct buf text;
    snprintf(path, sizeof path, "/proc/%d/status", (int)pid);
    buf_init(&text, 1 << 16);
    OK(file_read(path, &text, &err));
    const char *at = strstr(buf_text(&text), "VmHWM:");
    CHECK(at && sscanf(at, "VmHWM: %ld", &kib) == 1);
    buf_release(&text);
    return (double)kib / 1024.0;
}

/* A figure of /metrics; 0 where there is none. */
static double metric_of(struct http_request *r, const char *name) {
    struct reply reply;
    reply_init(&reply);
    OK(request_run(r, &(struct request_call){.path = "/metrics"}, &reply, &err));
    char *line = mem_printf("\n%s ", name);
    const char *at = strstr(buf_text(&reply.body), line);
    double value = at ? strtod(at + strlen(line), NULL) : 0.0;
    mem_free(line);
    reply_release(&reply);
    return value;
}

/* --- the whole ----------------------------------------------------------------------------------- */

/* Adds the jobs while the nodes work, then waits for the last. Returns how long it took. */
static double load_daemon(struct http_request *r, struct latencies *l) {
    double begun = clock_sec(), next = begun;
    for (long id = 2; id <= job_count || atomic_load(&ended_count) < job_count; id++) {
        if (id <= job_count)
            add_job(r, l);
        long known = id <= job_count ? id : job_count;
        ask_for_jobs(r, l, 1 + (id * 7919) % known);
        next = next + ROUND_SEC > clock_sec() ? next + ROUND_SEC : clock_sec();
        while (clock_sec() < next)
            poll(NULL, 0, 1 + (int)(1e3 * (next - clock_sec())));
        if (clock_sec() - begun > PATIENCE_SEC) {
            fprintf(stderr, "%ld of %ld jobs have ended\n", atomic_load(&ended_count), job_count);
            exit(1);
        }
    }
    return clock_sec() - begun;
}

int main(int argc, char **argv) {
    static pthread_t node[NODES_MAX], keeper;
    job_count = argc > 1 ? strtol(argv[1], NULL, 10) : job_count;
    node_count = argc > 2 ? strtol(argv[2], NULL, 10) : node_count;
    if (job_count < 1 || job_count > JOBS_MAX || node_count < 1 || node_count > NODES_MAX || !mkdtemp(dir))
        return 2;
    log_set_level(LOG_ERROR);
    int port = 20000 + (int)(getpid() % 12000); /* below those that the system gives out */
    snprintf(url, sizeof url, "http://127.0.0.1:%d", port);
    prepare();
    pid_t daemon = start_daemon(port);
    struct http_request *r = request_new(url, 30.0, -1);
    struct latencies idle = {0}, loaded = {0};
    add_job(r, &loaded); /* waits until the daemon answers */
    loaded.count[ADD] = 0;
    for (int i = 0; i < IDLE_ROUNDS; i++)
        ask_for_jobs(r, &idle, 1);
    double own_before, own, children_before, children;
    read_cpu(daemon, &own_before, &children_before);
    pthread_create(&keeper, NULL, keep_cluster, NULL);
    for (long i = 0; i < node_count; i++)
        pthread_create(&node[i], NULL, be_node, NULL);
    double took = load_daemon(r, &loaded);
    double succeeded = 0.0;
    for (int i = 0; i < 100 && succeeded < (double)job_count; i++, poll(NULL, 0, 100))
        succeeded = metric_of(r, "unbaked_attempts_ended_total{reason=\"succeeded\"}");
    read_cpu(daemon, &own, &children);
    double queries = metric_of(r, "unbaked_executor_queries_total{executor=\"cluster\"}");
    double resident = resident_mib(daemon), busy = 100.0 * (own - own_before) / took;
    printf("%ld jobs on %ld nodes in %.0f s: %.0f succeeded; %.0f claims, reports, files and ends a second\n",
           job_count, node_count, took, succeeded, (double)job_count * (JOB_SEC / REPORT_SEC + 6.0) / took);
    printf("the daemon: %.1f s of CPU, %.0f %% of a core, its commands %.1f s; %.0f MiB resident at most; %.0f status"
           " commands\n",
           own - own_before, busy, children - children_before, resident, queries);
    print_latencies("idle", &idle);
    print_latencies("64 nodes", &loaded);
    figure("daemon under 64 nodes, % of a core", busy, 100, "lower");
    figure("daemon under 64 nodes, MiB resident", resident, 200, "lower");
    for (int i = 0; i < ASKED_COUNT; i++) {
        char *name = mem_printf("%s under 64 nodes, p99 ms", asked_names[i]);
        figure(name, quantile(&loaded, (enum asked)i, 0.99), 100, "lower");
        mem_free(name);
    }
    CHECK(succeeded == (double)job_count && atomic_load(&failed_count) == 0);
    atomic_store(&is_over, true);
    for (long i = 0; i < node_count; i++)
        pthread_join(node[i], NULL);
    pthread_join(keeper, NULL);
    kill(daemon, SIGTERM);
    CHECK(waitpid(daemon, NULL, 0) == daemon);
    release(&idle);
    release(&loaded);
    request_free(r);
    if (check_result() == 0)
        file_remove_tree(dir, NULL);
    return check_result();
}
