/* bench_nodes.c -- the real daemon, 2,000 jobs, 64 nodes that report at once: how long its API takes to answer
 * meanwhile, and what the daemon takes of processor and memory. The nodes are threads here with the link of `unbaked
 * node` (server/node/link.h) and a worker that computes nothing: a claim, for JOB_SEC a report every REPORT_SEC with
 * two lines, one part of a checkpoint, one output, the end. So they come and go some hundred times as often as those of
 * rooms. Their scheduler's commands are cp and cat. One client meanwhile adds the jobs and asks for lists and single
 * ones, some twenty times a second.
 *
 * bench_nodes [JOBS [NODES]]. $UNBAKE_BUILD/unbaked is the daemon. */
#include "tests/bench/node_cluster.h"

#define SCENE "00112233445566778899aabbccddeeff00112233445566778899aabbccddeeff"
#define LEASE_SEC 60
#define ROUND_SEC 0.05 /* between a client's rounds of three requests */
#define IDLE_ROUNDS 100
#define NODES_MAX 256
#define PATIENCE_SEC 1800.0

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
