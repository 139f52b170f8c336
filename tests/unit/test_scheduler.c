/* test_scheduler.c -- how attempts of jobs and checks of scenes end, and what the scheduler makes of it; a worker plays
 * all that may happen (scheduler_plays.h). */
#include <stdatomic.h>
#include <sys/stat.h>

#include "server/data/layout.h"
#include "server/data/trash.h"
#include "tests/unit/scheduler_plays.h"

#define TRASH_SCENE "7777777777777777777777777777777777777777777777777777777777777777"

struct request_counts {
    int progress, metric, log, output, state;
};

static void tally_one(void *user, int64_t id, int64_t at_ms, int attempt, const char *type, const char *data) {
    struct request_counts *t = user;
    (void)id, (void)at_ms, (void)attempt;
    t->progress += strcmp(type, EVENT_PROGRESS) == 0 && strstr(data, "\"done\":3") != NULL;
    t->metric += strcmp(type, EVENT_METRIC) == 0 && strstr(data, "0.25") != NULL;
    t->log += strcmp(type, EVENT_LOG) == 0;
    t->output += strcmp(type, EVENT_OUTPUT) == 0;
    t->state += strcmp(type, EVENT_STATE) == 0;
    static const char *const daemons[] = {"\"type\"", "\"job\"", "\"attempt\"", "\"at\"", "\"snapshot\""};
    for (size_t i = 0; i < sizeof daemons / sizeof *daemons; i++)
        CHECK_THAT(strstr(data, daemons[i]) == NULL, "%s", data);
}

static void tally_talk(void *user, int64_t id, int64_t at_ms, int attempt, const char *type, const char *data) {
    struct request_counts *t = user;
    (void)id, (void)at_ms, (void)attempt;
    t->metric += strcmp(type, EVENT_METRIC) == 0;
    t->log += strcmp(type, EVENT_LOG) == 0 && strstr(data, "has reported 100 events: from here on") != NULL;
    t->output += strcmp(type, EVENT_OUTPUT) == 0;
}

/* What is too much is left out, and one event says so; outputs and the newest progress are not. */
static void check_talker(struct daemon *d) {
    struct request_counts t = {0};
    struct output_row *rows;
    struct job job;
    size_t count;
    int64_t id = submit(d, SCENE_A, "talker");
    expect(d, id, JOB_SUCCEEDED, 1, "", "");
    OK(store_event_list(d->store, id, 0, 100000, tally_talk, &t, &err));
    CHECK_THAT(t.log == 1 && t.metric > 10 && t.metric < RIG_EVENTS_MAX && t.output == 2, "%d, %d, %d", t.log, t.metric,
               t.output);
    OK(store_output_list(d->store, id, &rows, &count, &err));
    CHECK_THAT(count == 2, "%zu outputs", count);
    for (size_t i = 0; i < count; i++)
        output_row_release(&rows[i]);
    mem_free(rows);
    OK(store_job_get(d->store, id, &job, &err));
    CHECK_STRING(job.stage, "export");
    CHECK_NEAR(job.progress, 1.0, 1e-9);
    job_release(&job);
}

/* So with the problems of a scene. */
static void check_ruin(struct daemon *d) {
    static const char id[] = "1111111111111111111111111111111111111111111111111111111111111111";
    struct scene_row row;
    add_scene(d, id, "ruin");
    CHECK(wait_for_scene(d, id, SCENE_REJECTED));
    OK(store_scene_get(d->store, id, &row, &err));
    CHECK(strstr(row.problems, "\"5 more problems are not listed\"") != NULL);
    scene_row_release(&row);
}

static void check_whole_life(struct daemon *d, int64_t id, int states) {
    struct request_counts t = {0};
    OK(store_event_list(d->store, id, 0, 1000, tally_one, &t, &err));
    CHECK_THAT(t.progress == 1 && t.metric == 1 && t.log == 2 && t.output == 1 && t.state == states, "%d %d %d %d %d",
               t.progress, t.metric, t.log, t.output, t.state);
    struct output_row *rows;
    size_t count;
    OK(store_output_list(d->store, id, &rows, &count, &err));
    CHECK(count == 1 && strcmp(rows[0].name, "good.txt") == 0 && rows[0].bytes == 4);
    for (size_t i = 0; i < count; i++)
        output_row_release(&rows[i]);
    mem_free(rows);
}

/* A scene's problems, as soon as it has some. */
static void expect_problems(struct daemon *d, const char *id, enum scene_state state, const char *part) {
    struct scene_row row = {0};
    for (int i = 0; i < WAIT_TRIES; i++) {
        scene_row_release(&row);
        OK(store_scene_get(d->store, id, &row, &err));
        if (strcmp(row.problems, "[]") != 0)
            break;
        usleep(WAIT_US);
    }
    CHECK_THAT(row.state == state && strstr(row.problems, part), "scene %.3s is %s: %s", id,
               scene_state_name(row.state), row.problems);
    scene_row_release(&row);
    char *files = mem_printf("%s/scenes/%s/files", d->dir, id);
    CHECK_THAT(access(files, F_OK) != 0, "%s is left", files);
    mem_free(files);
}

/* A scene for which the disk has no room is not at fault: it waits, and so do its jobs, while others go
 * on; it can be removed; and it is checked again when it is sent again, when the daemon starts, and
 * when there is more room (tests/api/test_retention.sh). */
static void test_no_room(struct daemon *d) {
    bool is_gone;
    char *room = file_join(d->dir, "room");
    daemon_start(d, 1, "/proc/self/exe");
    add_scene(d, SCENE_D, "large");
    expect_problems(d, SCENE_D, SCENE_CHECKING, "disk full: cannot write mesh.ply");
    add_scene(d, SCENE_D, "large");
    expect_problems(d, SCENE_D, SCENE_CHECKING, "disk full");
    add_scene(d, SCENE_E, "crash");
    expect_problems(d, SCENE_E, SCENE_REJECTED, "crashed");
    OK(store_scene_delete(d->store, SCENE_D, -1, false, &is_gone, &err));
    add_scene(d, SCENE_D, "large");
    expect_problems(d, SCENE_D, SCENE_CHECKING, "disk full");
    int64_t job = submit(d, SCENE_D, "good");
    daemon_stop(d);
    OK(file_replace(room, "", 0, &err));
    daemon_start(d, 1, "/proc/self/exe");
    expect(d, job, JOB_SUCCEEDED, 1, "", "");
    daemon_stop(d);
    mem_free(room);
}

static void test_outcomes(struct daemon *d) {
    daemon_start(d, 2, "/proc/self/exe");
    add_scene(d, SCENE_A, "good");
    add_scene(d, SCENE_B, "bad");
    add_scene(d, SCENE_C, "crash");
    int64_t early = submit(d, SCENE_B, "good"); /* before the check is over, perhaps */
    CHECK(wait_for_scene(d, SCENE_A, SCENE_READY));
    CHECK(wait_for_scene(d, SCENE_B, SCENE_REJECTED));
    CHECK(wait_for_scene(d, SCENE_C, SCENE_REJECTED));
    struct scene_row row;
    OK(store_scene_get(d->store, SCENE_A, &row, &err));
    CHECK_STRING(row.facts, "{\"frame_count\":12}");
    scene_row_release(&row);
    OK(store_scene_get(d->store, SCENE_B, &row, &err));
    CHECK_STRING(row.problems, "[{\"file\":\"mesh.ply\",\"reason\":\"face 3 has no area\"},"
                               "{\"file\":\"images/1.png\",\"reason\":\"is truncated\",\"hint\":\"copy it again\"}]");
    scene_row_release(&row);
    OK(store_scene_get(d->store, SCENE_C, &row, &err));
    CHECK_THAT(strstr(row.problems, "crashed (Aborted") != NULL, "%s", row.problems);
    scene_row_release(&row);
    if (early)
        expect(d, early, JOB_FAILED, 1, "was rejected", "problems");

    check_talker(d);
    check_ruin(d);
    int64_t good = submit(d, SCENE_A, "good"), once = submit(d, SCENE_A, "once");
    int64_t segv = submit(d, SCENE_A, "segv"), liar = submit(d, SCENE_A, "liar");
    int64_t input = submit(d, SCENE_A, "input"), full = submit(d, SCENE_A, "full");
    int64_t memory = submit(d, SCENE_A, "memory"), killed = submit(d, SCENE_A, "killed");
    int64_t silent = submit(d, SCENE_A, "silent"), deserter = submit(d, SCENE_A, "deserter");
    int64_t around = submit(d, SCENE_A, "surroundings"), damaged = submit(d, SCENE_A, "\"");
    int64_t two_faced = submit(d, SCENE_A, "two-faced"), broken = submit(d, SCENE_A, "broken"),
            late = submit(d, SCENE_A, "late");
    expect(d, good, JOB_SUCCEEDED, 1, "", "");
    check_whole_life(d, good, 3);
    expect(d, once, JOB_SUCCEEDED, 2, "", "");
    check_whole_life(d, once, 5);
    expect(d, segv, JOB_FAILED, 2, "crashed (Segmentation fault); the end of its log: fatal: boom", "");
    expect(d, liar, JOB_SUCCEEDED, 1, "", "");
    check_whole_life(d, liar, 3);
    expect(d, input, JOB_FAILED, 1, "the mesh is empty", "export it again");
    expect(d, full, JOB_PAUSED, 1, "disk full: checkpoint.db", "resume");
    expect(d, memory, JOB_FAILED, 2, "could not allocate 12345", "smaller texture_size");
    expect(d, killed, JOB_FAILED, 2, "killed from outside", "smaller texture_size");
    char *killed_dir = mem_printf("%s/jobs/%lld/attempt-2", d->dir, (long long)killed);
    CHECK(is_tidy(killed_dir));
    mem_free(killed_dir);
    expect(d, silent, JOB_FAILED, 2, "without a result", "");
    expect(d, deserter, JOB_FAILED, 2, "stopped from outside", "");
    expect(d, around, JOB_SUCCEEDED, 1, "", "");
    expect(d, damaged, JOB_FAILED, 1, "the job's settings", "");
    expect(d, two_faced, JOB_FAILED, 2, "without a result", "");
    expect(d, broken, JOB_FAILED, 2, "the disk is broken", "");
    expect(d, late, JOB_FAILED, 2, "ended with status", "");
    daemon_stop(d);
}

/* What a check that crashed has unpacked is removed by the trash, which the scheduler does not wait for. */
static void count_emptied(void *user) { atomic_fetch_add((atomic_int *)user, 1); }

static void test_trash(struct daemon *d) {
    atomic_int emptied = 0;
    char *folder = layout_trash(d->dir);
    OK(file_make_dirs(folder, &err));
    OK(trash_new(&d->trash, d->dir, count_emptied, &emptied, &err));
    trash_wait(d->trash);
    int before = atomic_load(&emptied);
    daemon_start(d, 1, "/proc/self/exe");
    add_scene(d, TRASH_SCENE, "crash");
    expect_problems(d, TRASH_SCENE, SCENE_REJECTED, "");
    trash_wait(d->trash);
    CHECK_THAT(atomic_load(&emptied) > before, "the trash had nothing to do");
    daemon_stop(d);
    trash_free(d->trash);
    d->trash = NULL;
    mem_free(folder);
}

int main(int argc, char **argv) {
    struct daemon d;
    daemon_begin(&d, argc, argv);
    test_outcomes(&d);
    test_no_room(&d);
    test_trash(&d);
    daemon_end(&d);
    return check_result();
}
