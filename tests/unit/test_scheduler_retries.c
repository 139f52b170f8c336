/* test_scheduler_retries.c -- what the scheduler cannot do while calls of SQLite or of the system fail it does later:
 * it checks scenes that had no room, queues jobs whose start was not entered, starts at all; and work waits while the
 * disk is nearly full (scheduler_rig.h). */
#include "tests/unit/scheduler_rig.h"

#include "common/log.h"
#include "tests/system_faults.h"

/* --- the worker's side ----------------------------------------------------------------------- */

static int play(const char *role, const char *dir, int attempt) {
    struct progress p = {.fd = PROGRESS_FD};
    char *go = file_join(dir, "go");
    (void)attempt;
    while (strcmp(role, "waits") == 0 && access(go, F_OK) != 0)
        usleep(2000);
    progress_end(&p, STATUS_OK, "", "");
    return 0;
}

/* Fits the disk once there is a file "room" in the data folder; each try is a line in "tries". */
static int play_check(const char *role, const char *dir) {
    struct progress p = {.fd = PROGRESS_FD};
    char *room = file_join(dir, "../../room"), *tries = file_join(dir, "../../tries");
    int fd = open(tries, O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC, 0600);
    if (fd < 0 || write(fd, "\n", 1) != 1)
        return 90;
    if (strcmp(role, "large") == 0 && access(room, F_OK) != 0) {
        progress_end(&p, STATUS_NO_SPACE, "cannot write mesh.ply", "");
        return PROGRESS_EXIT_NO_SPACE;
    }
    check_out(&p);
    return 0;
}

/* --- the daemon's side ------------------------------------------------------------------------ */

static off_t count_tries(const struct daemon *d) {
    char *path = file_join(d->dir, "tries");
    int fd = (int)syscall(SYS_openat, AT_FDCWD, path, O_RDONLY | O_CLOEXEC, 0);
    off_t count = fd >= 0 ? lseek(fd, 0, SEEK_END) : 0;
    if (fd >= 0)
        close(fd);
    mem_free(path);
    return count;
}

static bool waits_for_room(struct daemon *d, const char *id) {
    struct scene_row row;
    OK(store_scene_get(d->store, id, &row, &err));
    bool waits = row.state == SCENE_CHECKING && strstr(row.problems, "disk full");
    scene_row_release(&row);
    return waits;
}

/* The scheduler has gone on `rounds` times from now. */
static void let_go_on(struct daemon *d, unsigned long rounds) {
    unsigned long end = scheduler_rounds(d->scheduler) + rounds;
    for (int i = 0; i < WAIT_TRIES && scheduler_rounds(d->scheduler) < end; i++) {
        scheduler_wake(d->scheduler);
        usleep(WAIT_US);
    }
    CHECK(scheduler_rounds(d->scheduler) >= end);
}

/* A scene that had no room while nobody can say how much there is, or the store fails: it is checked again when that is
 * over, and not over and over until then. */
static void test_postponed(struct daemon *d) {
    char *room = file_join(d->dir, "room");
    daemon_start(d, 1, "/proc/self/exe");
    let_go_on(d, 3);
    system_faults_arm_only("statvfs", 1, true);
    add_scene(d, SCENE_A, "large");
    for (int i = 0; i < WAIT_TRIES && !waits_for_room(d, SCENE_A); i++)
        usleep(WAIT_US);
    let_go_on(d, 20);
    CHECK(waits_for_room(d, SCENE_A) && count_tries(d) == 1);
    OK(file_replace(room, "", 0, &err));
    let_go_on(d, 20);
    CHECK(waits_for_room(d, SCENE_A) && count_tries(d) == 1);
    sql_faults_arm_only("UPDATE scenes SET problems = '[]'", 1,
                        true); /* before the other is lifted: it goes on at any time */
    CHECK(system_faults_lift());
    let_go_on(d, 20);
    CHECK(waits_for_room(d, SCENE_A) && count_tries(d) == 1);
    CHECK(sql_faults_lift());
    scheduler_wake(d->scheduler);
    CHECK(wait_for_scene(d, SCENE_A, SCENE_READY) && count_tries(d) == 2);
    daemon_stop(d);
    mem_free(room);
}

/* Jobs that run by the store alone go on, without the loss of an attempt, whichever call of SQLite fails meanwhile. One
 * that has been queued again and finds the disk full when it starts is paused, and goes on when its user says so. */
static void test_orphans(struct daemon *d) {
    daemon_start(d, 1, "/proc/self/exe");
    let_go_on(d, 3);
    for (long n = 1; n <= 60 && check_failed_count == 0; n++) {
        struct job_new new = {
            .scene_id = SCENE_A, .name = "job", .labels = "{}", .settings = "{\"role\":\"good\"}", .max_attempts = 2};
        struct job job = {0};
        int64_t id;
        int number;
        bool replayed;
        sql_faults_arm_only("FROM jobs", 1, true); /* the scheduler finds neither the one nor the other */
        OK(store_job_add(d->store, &new, 1000, &id, &replayed, &err));
        OK(store_job_start(d->store, id, "process", &number, &err));
        sql_faults_arm_only(NULL, n, n % 2);
        for (int i = 0; i < WAIT_TRIES && atomic_load(&sql_faults_left) > 0; i++)
            let_go_on(d, 1);
        CHECK(sql_faults_lift());
        for (int i = 0; i < WAIT_TRIES && !job_is_terminal(job.state); i++) {
            scheduler_wake(d->scheduler);
            usleep(WAIT_US);
            job_release(&job);
            OK(store_job_get(d->store, id, &job, &err));
            if (job.state == JOB_PAUSED && atomic_load(&sql_fault)->status == STATUS_NO_SPACE)
                OK(store_job_resume(d->store, id, NULL, &err));
        }
        CHECK_THAT(job.state == JOB_SUCCEEDED && job.attempts_left == 2, "call %ld: %s, %d attempts are left", n,
                   job_state_name(job.state), job.attempts_left);
        job_release(&job);
    }
    daemon_stop(d);
}

/* How an attempt ended is entered once the store can be written again: nothing is done twice. */
static void test_unsettled(struct daemon *d) {
    daemon_start(d, 1, "/proc/self/exe");
    int64_t id = submit(d, SCENE_A, "waits");
    char *go = mem_printf("%s/jobs/%lld/attempt-1/go", d->dir, (long long)id);
    CHECK(wait_for(d, id, JOB_RUNNING, NULL));
    let_go_on(d, 3);
    sql_faults_arm_only("BEGIN IMMEDIATE", 1, true);
    OK(file_replace(go, "", 0, &err));
    for (int i = 0; i < WAIT_TRIES && atomic_load(&sql_faults_left) >= 0; i++)
        let_go_on(d, 1);
    let_go_on(d, 20);
    CHECK(wait_for(d, id, JOB_RUNNING, NULL));
    CHECK(sql_faults_lift());
    scheduler_wake(d->scheduler);
    expect(d, id, JOB_SUCCEEDED, 1, "", "");
    daemon_stop(d);
    mem_free(go);
}

/* A start that fails says why, whichever of its statements it is. */
static void test_start(struct daemon *d) {
    static const char *const statements[] = {"SELECT min(id) FROM jobs WHERE state = ? AND id > ?",
                                             "SELECT id, ifnull(attempts.number", "UPDATE scenes SET problems = '[]'"};
    struct scheduler_config config = {
        .data_dir = d->dir, .executor = process_executor_init(&at_home, "/proc/self/exe", d->dir), .max_running = 1};
    OK(store_open(&d->store, d->dir, &err));
    OK(scheduler_new(&d->scheduler, &config, d->store, &err));
    scheduler_stop(d->scheduler);
    for (size_t i = 0; i < sizeof statements / sizeof *statements; i++) {
        err = (struct error){0};
        faults_are_off = false;
        sql_faults_arm_only(statements[i], 1, true); /* some are asked for more than once */
        enum status status = scheduler_run(d->scheduler, &err);
        faults_are_off = true;
        CHECK_THAT(sql_faults_lift() && status != STATUS_OK && status == err.status && *err.message, "%s",
                   statements[i]);
    }
    OK(scheduler_run(d->scheduler, &err));
    scheduler_free(d->scheduler);
    store_close(d->store);
}

/* No disk has so much room. */
static void test_low_disk(struct daemon *d) {
    struct scheduler_config config = {.data_dir = d->dir,
                                      .executor = process_executor_init(&at_home, "/proc/self/exe", d->dir),
                                      .max_running = 1,
                                      .low_disk_bytes = UINT64_MAX / 2,
                                      .stop_grace_sec = 1};
    struct job job = {0};
    OK(store_open(&d->store, d->dir, &err));
    OK(scheduler_new(&d->scheduler, &config, d->store, &err));
    CHECK(pthread_create(&d->thread, NULL, run_scheduler, d) == 0);
    int64_t id = submit(d, SCENE_A, "good");
    for (int i = 0; i < WAIT_TRIES && !(job.reason && *job.reason); i++) {
        usleep(WAIT_US);
        job_release(&job);
        OK(store_job_get(d->store, id, &job, &err));
    }
    CHECK(job.state == JOB_QUEUED && strstr(job.reason, "the disk is nearly full: less than") && *job.hint);
    CHECK(scheduler_waits_for_disk(d->scheduler));
    job_release(&job);
    daemon_stop(d);
    daemon_start(d, 1, "/proc/self/exe");
    expect(d, id, JOB_SUCCEEDED, 1, "", "");
    CHECK(!scheduler_waits_for_disk(d->scheduler));
    daemon_stop(d);
}

int main(int argc, char **argv) {
    struct daemon d;
    daemon_begin(&d, argc, argv);
    log_set_level(LOG_ERROR);
    faults_are_off = true; /* in this thread */
    test_postponed(&d);
    test_orphans(&d);
    test_unsettled(&d);
    test_start(&d);
    test_low_disk(&d);
    daemon_end(&d);
    return check_result();
}
