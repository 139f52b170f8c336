/* test_share.c -- what a user is held to have taken of the disk: folders of scenes and jobs as they are, whatever of
 * them an archive or a list of outputs tells; the limit of it where a scene is checked and a job begins; the figure
 * after the daemon was killed, and what a job takes beside its folder. As worker stands in this program itself:
 * `test_share worker DIR`. */
#include "server/job/attempt.h"

#include "server/job/disk_usage.h"
#include "server/job/housekeeping.h"
#include "server/job/outcome.h"
#include "server/job/worker_messages.h"
#include "server/worker/progress.h"
#include "tests/unit/fault_rig.h"

#define KIB 1024
#define NAMELESS (3 * 1024 * KIB) /* bytes that a job takes of the disk in no file of its folder */
#define SCENE_B "bbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbb"
#define SCENE_C "cccccccccccccccccccccccccccccccccccccccccccccccccccccccccccccccc"
#define ALICE 7
#define BOB 8

static struct counters figures;

/* A file of so many KiB, none of which compresses to nothing. */
static void write_file(const char *folder, const char *name, size_t kib) {
    char *path = file_join(folder, name), *bytes = mem_calloc(kib, KIB);
    uint64_t x = 1;
    for (size_t i = 0; i < kib * KIB; i++) {
        x = x * 6364136223846793005u + 1442695040888963407u;
        bytes[i] = (char)(x >> 56);
    }
    CHECK(file_replace(path, bytes, kib * KIB, &err) == STATUS_OK);
    mem_free(bytes);
    mem_free(path);
}

/* --- the worker's side: a scene is unpacked to 256 KiB, a job leaves an output of 4 bytes and a checkpoint of 128 KiB
 * -- */

static int worker(const char *folder) {
    struct progress p = {.fd = PROGRESS_FD};
    const char *kind;
    cJSON *order;
    char *path = file_join(folder, "job.json");
    if (json_read(path, 1 << 20, &order, &err) != STATUS_OK ||
        json_string(order, "kind", "job.json", "", &kind, &err) != STATUS_OK)
        return PROGRESS_EXIT_FAILED;
    if (strcmp(kind, "check") == 0) {
        char *files = file_join(folder, "files");
        if (file_make_dirs(files, &err) != STATUS_OK)
            return PROGRESS_EXIT_FAILED;
        write_file(files, "mesh.ply", 256);
        progress_scene(&p, cJSON_CreateObject());
    } else {
        progress_space(&p, NAMELESS);
        write_file(folder, "checkpoint/checkpoint.db", 128);
        write_file(folder, "out/a.exr", 64);
        progress_file(&p, "output", "a.exr", 64 * KIB, SCENE_A, "image/x-exr");
    }
    progress_end(&p, STATUS_OK, "", "");
    return PROGRESS_EXIT_OK;
}

/* --- the daemon's side --------------------------------------------------------------------------------- */

static int64_t kept_by(int64_t user) {
    uint64_t bytes;
    OK(store_user_bytes(store, user, NULL, 0, &bytes, &err));
    return (int64_t)bytes;
}

static int64_t job_of(int64_t user) {
    struct job_new new = {
        .scene_id = SCENE_A, .name = "job", .labels = "{}", .settings = "{}", .max_attempts = 3, .owner_id = user};
    int64_t id = 0;
    bool replayed;
    OK(store_job_add(store, &new, 1000, &id, &replayed, &err));
    return id;
}

static char *job_dir(int64_t id) { return mem_printf("%s/jobs/%lld", dir, (long long)id); }

static int64_t disk_of(int64_t id) {
    struct job job;
    OK(store_job_get(store, id, &job, &err));
    int64_t bytes = job.disk_bytes;
    job_release(&job);
    return bytes;
}

static int64_t size_of(const char *path) {
    uint64_t files, bytes;
    OK(file_tree_size(path, &files, &bytes, &err));
    return (int64_t)bytes;
}

static struct scheduler_config limited(uint64_t bytes) {
    struct scheduler_config changed = config;
    changed.user_max_bytes = bytes;
    return changed;
}

static void settle(struct attempt *a) {
    for (; a->phase == ATTEMPT_ALIVE; usleep(1000))
        worker_messages_read(a, store, &figures);
    OK(outcome_settle(a, store, NULL, &figures, &err));
}

/* Runs one attempt of the job to its end; false where it did not begin. */
static bool run_job(int64_t id, uint64_t limit) {
    const struct scheduler_config with = limited(limit);
    struct attempt a = {0};
    OK(attempt_start_job(&a, &with, store, &figures, id, 1, &err));
    if (a.phase == ATTEMPT_EMPTY)
        return false;
    settle(&a);
    return true;
}

static const struct unchecked *unchecked(const char *id) {
    static struct unchecked scene;
    snprintf(scene.id, sizeof scene.id, "%s", id);
    return &scene;
}

/* Sends an archive of 16 KiB and checks it; then it belongs to `second`, too, before it is checked (-1: to nobody
 * else). */
static void check_scene(const char *id, int64_t owner, int64_t second, uint64_t limit, struct scene_row *row) {
    const struct scheduler_config with = limited(limit);
    struct attempt a = {0};
    bool existed;
    char *folder = mem_printf("%s/scenes/%s", dir, id);
    OK(file_make_dirs(folder, &err));
    write_file(folder, "archive", 16);
    OK(store_scene_add(store, id, "scene", 16 * KIB, owner, &existed, &err));
    if (second >= 0)
        OK(store_scene_add(store, id, "scene", 16 * KIB, second, &existed, &err));
    OK(attempt_start_check(&a, &with, store, unchecked(id), 1, &err));
    settle(&a);
    OK(store_scene_get(store, id, row, &err));
    mem_free(folder);
}

/* A scene counts with what it was unpacked to, for each of its owners. */
static void test_scene(void) {
    struct scene_row row;
    char *folder = mem_printf("%s/scenes/" SCENE_B, dir);
    check_scene(SCENE_B, ALICE, BOB, 0, &row);
    CHECK(row.state == SCENE_READY && row.disk_bytes == size_of(folder));
    CHECK_THAT(row.disk_bytes >= (256 + 16) * KIB, "%lld bytes", (long long)row.disk_bytes);
    CHECK(kept_by(ALICE) == row.disk_bytes && kept_by(BOB) == row.disk_bytes && kept_by(9) == 0);
    scene_row_release(&row);
    mem_free(folder);
}

/* A scene that is unpacked to more than its owner may keep is no scene, unless another owner may, or nobody. */
static void test_large_scene(void) {
    struct scene_row row;
    bool is_gone;
    char *files = mem_printf("%s/scenes/" SCENE_C "/files", dir);
    uint64_t limit = (uint64_t)kept_by(ALICE) + 100 * KIB;
    check_scene(SCENE_C, ALICE, BOB, limit, &row);
    CHECK(row.state == SCENE_REJECTED && access(files, F_OK) != 0 && row.disk_bytes == -1);
    CHECK_THAT(strstr(row.problems, "unpacked, it is too large: your scenes and jobs take 0.3 of the 0.4 MiB") &&
                   strstr(row.problems, "then send it again"),
               "%s", row.problems);
    scene_row_release(&row);
    check_scene(SCENE_C, ALICE, 9, limit, &row);
    CHECK(row.state == SCENE_READY && access(files, F_OK) == 0);
    scene_row_release(&row);
    OK(store_scene_delete(store, SCENE_C, -1, false, &is_gone, &err));
    check_scene(SCENE_C, ALICE, 0, limit, &row);
    CHECK(row.state == SCENE_READY);
    scene_row_release(&row);
    OK(store_scene_delete(store, SCENE_C, -1, false, &is_gone, &err));
    mem_free(files);
}

/* A job counts with all of its folder once an attempt has ended, and no longer with a checkpoint that is removed. */
static void test_job(void) {
    int64_t before = kept_by(ALICE), id = job_of(ALICE);
    char *folder = job_dir(id), *checkpoint = file_join(folder, "attempt-1/checkpoint/checkpoint.db");
    CHECK(kept_by(ALICE) == before && disk_of(id) == 0);
    CHECK(run_job(id, 0));
    int64_t size = size_of(folder);
    CHECK_THAT(disk_of(id) == size && size >= (128 + 64) * KIB, "%lld of %lld bytes", (long long)disk_of(id),
               (long long)size);
    CHECK(kept_by(ALICE) == before + size);

    struct scheduler_config with = config;
    with.checkpoint_keep_sec = -3600;
    housekeeping_run(&with, store);
    CHECK(access(checkpoint, F_OK) != 0 && disk_of(id) == size_of(folder) && disk_of(id) <= size - 128 * KIB);
    CHECK(kept_by(ALICE) == before + disk_of(id));

    /* What cannot be removed is still there at the next start. */
    char *inner = file_join(folder, "attempt-1/checkpoint");
    OK(file_make_dirs(inner, &err));
    mem_free(inner);
    write_file(folder, "attempt-1/checkpoint/checkpoint.db", 128);
    strike_system("unlinkat", 1, true);
    housekeeping_run(&with, store);
    CHECK(lift() && disk_of(id) == -1);
    CHECK(kept_by(ALICE) == before + 64 * KIB); /* its outputs, as they were announced */
    disk_usage_enter_unknown(&config, store);
    CHECK(disk_of(id) == size_of(folder));

    /* A disk that is too full to enter anything gets its room. */
    log_forget();
    strike_sql("UPDATE jobs SET disk_bytes", 1, false);
    housekeeping_run(&with, store);
    CHECK(lift() && log_count("job ") == 1 && access(checkpoint, F_OK) != 0 && disk_of(id) == size_of(folder));
    OK(store_job_delete(store, id, &err));
    CHECK(kept_by(ALICE) == before);
    mem_free(checkpoint);
    mem_free(folder);
}

/* While a job runs, its outputs count, or what it took before. */
static void test_running(void) {
    int64_t before = kept_by(ALICE), id = job_of(ALICE);
    int number;
    OK(store_job_start(store, id, "process", &number, &err));
    OK(store_output_put(store, id, number, EVENT_OUTPUT, "a.exr", 1000, SCENE_A, "x/y", &err));
    CHECK(kept_by(ALICE) == before + 1000);
    OK(store_disk_enter(store, &(struct disk_use){.job_id = id, .bytes = 5000}, 1, &err));
    CHECK(kept_by(ALICE) == before + 5000);
    OK(store_output_put(store, id, number, EVENT_OUTPUT, "b.exr", 7000, SCENE_A, "x/y", &err));
    CHECK(kept_by(ALICE) == before + 8000);
    OK(store_job_succeed(store, id, number, "", &err));
    CHECK(kept_by(ALICE) == before + 5000);
    OK(store_job_delete(store, id, &err));
}

/* What a job says that it takes beside its folder counts until it ends, and it is told how much that may be. */
static void test_nameless(void) {
    int64_t before = kept_by(ALICE), id = job_of(ALICE), most = 0;
    const struct scheduler_config with = limited((uint64_t)before + 5000 * KIB);
    struct attempt a = {0};
    double left = 0.0;
    char *folder = job_dir(id), *path = file_join(folder, "attempt-1/job.json");
    cJSON *order = NULL;
    OK(attempt_start_job(&a, &with, store, &figures, id, 1, &err));
    OK(json_read(path, 1 << 20, &order, &err));
    OK(json_number(order, "disk_bytes", "job.json", 0.0, &left, &err));
    CHECK_NEAR(left, 5000 * KIB, 0.5);
    for (; a.phase == ATTEMPT_ALIVE; usleep(1000)) {
        worker_messages_read(&a, store, &figures);
        most = kept_by(ALICE) > most ? kept_by(ALICE) : most;
    }
    CHECK_THAT(most >= before + NAMELESS, "%lld bytes beside", (long long)(most - before));
    OK(outcome_settle(&a, store, NULL, &figures, &err));
    CHECK(disk_of(id) == size_of(folder) && disk_of(id) < NAMELESS);
    OK(store_job_delete(store, id, &err));
    cJSON_Delete(order);
    mem_free(path);
    mem_free(folder);
}

/* A job of somebody who keeps too much waits for him; one that has begun does not wait for itself. */
static void test_full(void) {
    struct job job;
    uint64_t limit = (uint64_t)kept_by(ALICE) + 64 * KIB;
    int64_t first = job_of(ALICE), second = job_of(ALICE);
    CHECK(run_job(first, limit) && kept_by(ALICE) > (int64_t)limit);
    OK(store_job_retry(store, first, 3, "solve", NULL, &err));
    CHECK(run_job(first, limit) && state_of(first) == JOB_SUCCEEDED);
    CHECK(!run_job(second, limit));
    OK(store_job_get(store, second, &job, &err));
    CHECK(job.state == JOB_PAUSED && job.attempts_left == 3);
    CHECK_THAT(strstr(job.reason, "that a user may keep") && strstr(job.hint, "then resume") &&
                   strstr(job.hint, "user_max_mib"),
               "%s; %s", job.reason, job.hint);
    job_release(&job);
    int64_t others = job_of(BOB);
    CHECK(run_job(others, limit));
    OK(store_job_delete(store, first, &err));
    OK(store_job_resume(store, second, NULL, &err));
    CHECK(run_job(second, limit) && state_of(second) == JOB_SUCCEEDED);
    OK(store_job_delete(store, second, &err));
    OK(store_job_delete(store, others, &err));
}

/* A daemon is killed while a job runs, which has written what was never entered: the next start finds it. */
static void test_killed(void) {
    int64_t before = kept_by(BOB), id = job_of(BOB);
    char *folder = job_dir(id), *out = file_join(folder, "attempt-2/out");
    int number;
    size_t requeued;
    CHECK(run_job(id, 0));
    OK(store_job_retry(store, id, 3, "solve", NULL, &err));
    OK(store_job_start(store, id, "process", &number, &err));
    OK(file_make_dirs(out, &err));
    write_file(out, "b.exr", 512);
    store_close(store);
    OK(store_open(&store, dir, &err));
    OK(store_reconcile(store, NULL, 0, &requeued, &err));
    store_close(store); /* and killed again */
    OK(store_open(&store, dir, &err));
    OK(store_reconcile(store, NULL, 0, &requeued, &err));
    disk_usage_enter_unknown(&config, store);
    CHECK(requeued == 0 && disk_of(id) == size_of(folder) && disk_of(id) >= (512 + 128 + 64) * KIB);
    CHECK(kept_by(BOB) == before + disk_of(id));
    OK(store_job_delete(store, id, &err));
    mem_free(out);
    mem_free(folder);
}

/* More than are entered at once, some of which the disk cannot tell. */
static void test_many(void) {
    int64_t ids[150];
    int unknown = 0;
    for (int i = 0; i < 150; i++) {
        ids[i] = job_of(BOB);
        OK(store_disk_enter(store, &(struct disk_use){.job_id = ids[i], .bytes = -1}, 1, &err));
        char *folder = job_dir(ids[i]);
        OK(file_make_dirs(folder, &err));
        write_file(folder, "worker.log", 4);
        mem_free(folder);
    }
    log_forget();
    strike_system("fstatat", 50, false);
    disk_usage_enter_unknown(&config, store);
    CHECK(lift());
    for (int i = 0; i < 150; i++) {
        unknown += disk_of(ids[i]) == -1;
        CHECK(disk_of(ids[i]) == -1 || disk_of(ids[i]) >= 4 * KIB);
    }
    CHECK(unknown == 1 && log_count("of the disk is not known: ") == 1);
    strike_sql("OFFSET", 1, false);
    disk_usage_enter_unknown(&config, store);
    CHECK(lift() && log_count("is not known of all: ") == 1);
    strike_sql("UPDATE jobs SET disk_bytes", 1, false);
    disk_usage_enter_unknown(&config, store);
    CHECK(lift() && log_count("is not known of all: ") == 2);
    disk_usage_enter_unknown(&config, store);
    for (int i = 0; i < 150; i++) {
        CHECK(disk_of(ids[i]) >= 4 * KIB);
        OK(store_job_delete(store, ids[i], &err));
    }
}

int main(int argc, char **argv) {
    if (argc == 3 && strcmp(argv[1], "worker") == 0)
        _exit(worker(argv[2]));
    rig_start();
    test_scene();
    test_large_scene();
    test_job();
    test_running();
    test_nameless();
    test_full();
    test_killed();
    test_many();
    rig_stop();
    return check_result();
}
