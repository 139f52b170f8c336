/* node_kill BUILD ROOM LIVES SEED -- attempts by the real `unbaked node`, which talks to the HTTP side in this process:
 * it is killed at random, taken back, asked to stop, cut off, and started twice; its cache is damaged. Every job that
 * comes of it has the textures, byte for byte, of one that ran at home. This process plays the scheduler: it begins
 * attempts, reads their lines, ends them. */
#include "tests/chaos/node_attempt.h"

#define LIVES_PER_JOB 12
#define LEASE_SEC 10 /* a report a second */
#define ITERATIONS 400L
#define ENDLESS 10000000L /* iterations of a job that is not to come to its end */

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
