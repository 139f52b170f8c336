/* node_kill BUILD ROOM LIVES SEED -- attempts by the real `unbaked node`, which talks to the HTTP side in this process:
 * it is killed at random, taken back, asked to stop, cut off, and started twice; its cache is damaged. Every job that
 * comes of it has the textures, byte for byte, of one that ran at home. This process plays the scheduler: it begins
 * attempts, reads their lines, ends them. */
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
#define LIVES_PER_JOB 12
#define LEASE_SEC 10 /* a report a second */
#define PATIENCE_SEC 240.0
#define ITERATIONS 400L
#define ENDLESS 10000000L /* iterations of a job that is not to come to its end */
#define SETTINGS                                                                                                       \
    "\"texture_size\":64,\"iterations\":%ld,\"texels_per_iteration\":128,\"cameras_per_texel\":1,"                     \
    "\"samples_per_camera\":2,\"report_samples\":1,\"gather_samples\":16,\"gloss_passes\":1,"                          \
    "\"texels_per_metre\":2,\"preview_interval_sec\":1"

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

static unsigned draw(unsigned limit) {
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

static char *settings(long iterations) { return mem_printf(SETTINGS, iterations); }

static void begin(struct remote_attempt *a, int64_t job, int threads, long iterations) {
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
static pid_t start_node(const struct remote_attempt *a) {
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

static void check_line(struct remote_attempt *a, const char *text, size_t length) {
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

static void check_lines(void *user, const char *lines) {
    for (const char *at = lines, *end; (end = strchr(at, '\n')) != NULL; at = end + 1)
        check_line(user, at, (size_t)(end - at));
}

/* Reads what has been reported; returns the attempt's phase. */
static enum remote_phase listen_to(struct remote_attempt *a) {
    OK(store_remote_get(rig.store, a->job, a->number, &a->row, &err));
    while (store_remote_read(rig.store, a->job, a->number, check_lines, a, &err) == STATUS_OK)
        ;
    return a->row.phase;
}

/* The number of the newest part of a checkpoint that has come. */
static int newest_part(const struct remote_attempt *a) {
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

static void wait_for_part(struct remote_attempt *a) {
    while (newest_part(a) == 0 && listen_to(a) < REMOTE_ENDED)
        usleep(10000);
}

/* Until the node has ended: its exit status, or minus the signal's number. It gets the signal `number` after so many
 * parts of checkpoints and `wait_sec` more; -1: never. */
static int follow(struct remote_attempt *a, int parts, double wait_sec, int number) {
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
static void lose(struct remote_attempt *a) {
    size_t writers = 1;
    while (writers > 0)
        OK(store_remote_close(rig.store, a->job, a->number, &writers, &err));
    OK(store_job_stop(rig.store, a->job, a->number, "", &err));
}

static void check_equal(const struct remote_attempt *a) {
    char sums[WORKER_OUTPUTS][SHA256_HEX_SIZE], *dir = layout_attempt(rig.dir, a->job, a->number);
    CHECK_THAT(strcmp(a->row.end.way, "exit") == 0 && a->row.end.code == 0, "%s %d: %s", a->row.end.way,
               a->row.end.code, a->row.end.reason);
    worker_hash(dir, sums);
    for (size_t i = 0; i < WORKER_OUTPUTS; i++)
        CHECK_THAT(strcmp(sums[i], home_sums[i]) == 0, "job %lld: %s differs", (long long)a->job, worker_outputs[i]);
    mem_free(dir);
    OK(store_job_succeed(rig.store, a->job, a->number, "", &err));
}

static void show_log(void) {
    struct buf text;
    char *log = file_join(rig.dir, "node.log");
    buf_init(&text, 1 << 22);
    if ((check_failed_count > 0 || getenv("UNBAKE_SHOW")) && file_read(log, &text, NULL) == STATUS_OK)
        fprintf(stderr, "%s\n", buf_text(&text));
    buf_release(&text);
    mem_free(log);
}

/* --- what may befall one --------------------------------------------------------------------------- */

/* The site starts the attempt a second time: that one is turned away, the first one does not notice. */
static void test_undisturbed(void) {
    struct remote_attempt a = {.lease_sec = LEASE_SEC}, second;
    begin(&a, rig_job(&rig), 1, ITERATIONS);
    a.pid = start_node(&a);
    while (listen_to(&a) < REMOTE_CLAIMED)
        usleep(10000);
    second = a;
    second.pid = start_node(&a);
    CHECK(follow(&second, -1, 0.0, 0) == 1);
    CHECK_THAT(follow(&a, -1, 0.0, 0) == 0, "the node has failed");
    checkpoint_count = a.checkpoints;
    CHECK(a.outputs >= (long)WORKER_OUTPUTS && a.row.cpu_sec > 0.0 && a.row.refused_count >= 1);
    check_equal(&a);
}

/* The site has taken the attempt's machine: its worker has stopped by itself, not been killed after the time that it
 * has for a checkpoint, and the attempt is over for whoever is started for it again. */
static void check_taken_back(const struct remote_attempt *a, int code) {
    struct remote_attempt again = *a;
    CHECK_THAT(code == 85 && strcmp(a->row.end.way, "preempted") == 0, "the node ended with %d, %s", code,
               a->row.end.way);
    /* 0: it had not begun; SIGTERM: it did not listen yet. Neither has anything to save. */
    CHECK_THAT(a->row.end.code == 85 || a->row.end.code == 0 || a->row.end.code == SIGTERM, "the worker ended with %d",
               a->row.end.code);
    again.pid = start_node(a);
    CHECK(follow(&again, -1, 0.0, 0) == 1);
    taken_count++;
}

/* Killed or taken back again and again, until a life is long enough. */
static void test_kills(int lives) {
    static const int signals[] = {SIGKILL, SIGKILL, SIGUSR1, SIGTERM};
    struct remote_attempt a = {.lease_sec = LEASE_SEC};
    int64_t job = 0;
    bool is_done = true;
    int of_job = 0;
    for (int i = 0; (i < lives || !is_done) && check_failed_count == 0; i++, of_job++) {
        if (is_done)
            job = rig_job(&rig), of_job = 0;
        begin(&a, job, 1 + i % 2, ITERATIONS);
        a.pid = start_node(&a);
        bool is_last = of_job + 1 >= LIVES_PER_JOB || i >= lives;
        int number = signals[draw(4)];
        int code = follow(&a, is_last ? -1 : (int)draw(5), 1e-3 * draw(150), number);
        is_done = code == 0;
        if (is_done) {
            check_equal(&a);
            continue;
        }
        if (number == SIGKILL) {
            CHECK_THAT(code == -SIGKILL, "the node ended with %d", code);
            kill_count++;
        } else {
            check_taken_back(&a, code);
        }
        lose(&a);
    }
}

/* A file of the scene is damaged in the cache, another only half there. */
static void damage_cache(void) {
    char *mesh = file_join(rig.dir, "cache/" RIG_SCENE "/mesh.ply");
    char *image = file_join(rig.dir, "cache/" RIG_SCENE "/images/1.png"), *part = mem_printf("%s.part", image);
    OK(file_replace(mesh, "ply", 3, &err));
    CHECK_THAT(rename(image, part) == 0 && truncate(part, 50) == 0, "no %s", image);
    mem_free(part);
    mem_free(image);
    mem_free(mesh);
}

/* The machine's scheduler takes it back: a checkpoint, then the next attempt goes on. */
static void test_taken_back(int number) {
    struct remote_attempt a = {.lease_sec = LEASE_SEC};
    int64_t job = 0;
    int code = 0;
    for (int tries = 0; code == 0 && tries < 50; tries++) { /* until one is not at its end when the signal comes */
        job = rig_job(&rig);
        begin(&a, job, 2, ITERATIONS);
        a.pid = start_node(&a);
        code = follow(&a, 2, 0.0, number);
    }
    CHECK_THAT(code == 85, "the node ended with %d", code);
    CHECK_STRING(a.row.end.way, "preempted");
    lose(&a);
    damage_cache();
    begin(&a, job, 2, ITERATIONS);
    a.pid = start_node(&a);
    CHECK(follow(&a, -1, 0.0, 0) == 0);
    CHECK_THAT(a.checkpoints < ITERATIONS, "%ld checkpoints: it began anew", a.checkpoints);
    check_equal(&a);
}

static void test_wishes(void) {
    static const struct {
        enum remote_request request;
        const char *way;
        int code, exit_status;
    } t[] = {{REMOTE_STOP, "exit", 85, 85}, {REMOTE_CANCEL, "signal", SIGKILL, 1}};
    for (size_t i = 0; i < sizeof t / sizeof *t; i++) {
        struct remote_attempt a = {.lease_sec = LEASE_SEC};
        begin(&a, rig_job(&rig), 2, ENDLESS);
        OK(store_remote_request(rig.store, a.job, a.number, REMOTE_PREVIEW, &err));
        a.pid = start_node(&a);
        wait_for_part(&a);
        OK(store_remote_request(rig.store, a.job, a.number, t[i].request, &err));
        int code = follow(&a, -1, 0.0, 0);
        CHECK_THAT(code == t[i].exit_status && strcmp(a.row.end.way, t[i].way) == 0 && a.row.end.code == t[i].code,
                   "%d, %s %d", code, a.row.end.way, a.row.end.code);
        lose(&a);
    }
}

/* The daemon's disk is full for a moment: the attempt goes on. It stays full, and the daemon asks to stop, as a
 * scheduler does that stops those at home: it ends as stopped. Where nobody asks, the job is blocked, and says
 * where. */
static void test_full_disk(bool all) {
    struct remote_attempt a = {.lease_sec = LEASE_SEC};
    begin(&a, rig_job(&rig), 2, ITERATIONS);
    atomic_store(&disk_is_full, true);
    a.pid = start_node(&a);
    while (listen_to(&a) < REMOTE_CLAIMED)
        usleep(10000);
    for (double until = clock_sec() + 4.0; clock_sec() < until; usleep(10000))
        listen_to(&a);
    CHECK(newest_part(&a) == 0 && a.row.phase == REMOTE_CLAIMED);
    atomic_store(&disk_is_full, false);
    CHECK_THAT(follow(&a, -1, 0.0, 0) == 0, "the node has failed");
    check_equal(&a);

    begin(&a, rig_job(&rig), 2, ENDLESS);
    a.pid = start_node(&a);
    wait_for_part(&a);
    atomic_store(&disk_is_full, true);
    usleep(1000000);
    OK(store_remote_request(rig.store, a.job, a.number, REMOTE_STOP, &err));
    int code = follow(&a, -1, 0.0, 0);
    CHECK_THAT(code == 85 && strcmp(a.row.end.way, "exit") == 0 && a.row.end.code == 85 && a.no_space_count == 0,
               "%d, %s %d: %s", code, a.row.end.way, a.row.end.code, a.row.end.reason);
    lose(&a);

    if (all) {
        begin(&a, rig_job(&rig), 2, ENDLESS);
        a.pid = start_node(&a);
        CHECK(follow(&a, -1, 0.0, 0) == 74);
        CHECK(strcmp(a.row.end.way, "exit") == 0 && a.row.end.code == 74 && a.no_space_count == 1);
        CHECK_THAT(strncmp(a.row.end.reason, "at the daemon: ", 15) == 0, "%s", a.row.end.reason);
        lose(&a);
    }
    atomic_store(&disk_is_full, false);
}

/* Answers are lost on the way: every request may have been carried out, and nothing is done twice or missed. Some
 * connections are turned away, since there are too many. */
static void test_lost_answers(unsigned seed) {
    struct remote_attempt a = {.lease_sec = 60};
    struct proxy proxy;
    proxy_start(&proxy, listener_port(rig.listener), 1, 3, seed);
    port = proxy.port;
    begin(&a, rig_job(&rig), 2, ITERATIONS);
    a.pid = start_node(&a);
    CHECK_THAT(follow(&a, -1, 0.0, 0) == 0, "the node has failed");
    CHECK_THAT(a.checkpoints == checkpoint_count && a.outputs >= (long)WORKER_OUTPUTS, "%ld checkpoints, %ld outputs",
               a.checkpoints, a.outputs);
    check_equal(&a);
    port = listener_port(rig.listener);
    printf("%ld connections cut, %ld turned away\n", atomic_load(&proxy.cut_count), atomic_load(&proxy.turned_count));
    proxy_stop(&proxy);
}

/* The daemon is gone for longer than the lease: the node gives up, and its worker with it. */
static void test_cut_off(void) {
    struct remote_attempt a = {.lease_sec = 3};
    begin(&a, rig_job(&rig), 2, ENDLESS);
    a.pid = start_node(&a);
    wait_for_part(&a);
    listener_quiesce(rig.listener);
    listener_stop(rig.listener);
    int status = 0;
    CHECK(waitpid(a.pid, &status, 0) == a.pid && WIFEXITED(status) && WEXITSTATUS(status) == 1);
    char *work = file_join(rig.dir, "work"), **names = NULL;
    size_t count = 0;
    OK(file_list(work, &names, &count, &err));
    CHECK_THAT(count <= (size_t)kill_count, "%zu folders are left", count); /* those that were killed left theirs */
    file_free_names(names, count);
    mem_free(work);
    listen_to(&a);
    CHECK(a.row.phase == REMOTE_CLAIMED); /* nothing was said any more */
    lose(&a);
}

int main(int argc, char **argv) {
    if (argc != 5)
        return 2;
    snprintf(binary, sizeof binary, "%s/unbaked", argv[1]);
    random_ = (unsigned)strtoul(argv[4], NULL, 10);
    rig_start(&rig, &rig_patient, 15.0);
    port = listener_port(rig.listener);
    char *home = file_join(rig.dir, "home"), *scene = layout_scene(rig.dir, RIG_SCENE), *files = layout_files(scene);
    char *copy = mem_printf("mkdir -p %s && cp -r %s/. %s/", files, argv[2], files);
    int fd, status;
    OK(file_make_dirs(home, &err));
    CHECK(system(copy) == 0);
    char *text = settings(ITERATIONS);
    worker_order(home, argv[2], 1, 2, 0.0, true, text);
    mem_free(text);
    pid_t pid = worker_start(binary, home, NULL, "/dev/null", &fd);
    worker_hear(fd, "\"end\"", PATIENCE_SEC);
    waitpid(pid, &status, 0);
    CHECK_THAT(WIFEXITED(status) && WEXITSTATUS(status) == 0, "the worker at home has failed");
    worker_hash(home, home_sums);

    test_undisturbed();
    test_kills(atoi(argv[3]));
    test_taken_back(SIGUSR1);
    if (atoi(argv[3]) > 10)
        test_taken_back(SIGTERM);
    test_wishes();
    test_full_disk(atoi(argv[3]) > 10);
    test_lost_answers(random_);
    test_cut_off();
    show_log();
    mem_free(copy);
    mem_free(files);
    mem_free(scene);
    mem_free(home);
    printf("%ld nodes killed, %ld taken back\n", kill_count, taken_count);
    service_free(rig.api);
    scheduler_free(rig.scheduler);
    store_close(rig.store);
    file_remove_tree(rig.dir, NULL);
    return check_result();
}
