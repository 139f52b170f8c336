/* test_reserve.c -- a disk that is really full, to its last block: what frees space or stops work is entered all the
 * same, all else is refused, and all of it works again once there is room. On a small file system of its own. */
#include <fcntl.h>
#include <sched.h>
#include <sys/mount.h>

#include "server/store/attempts.h"
#include "server/store/remote.h"
#include "tests/unit/store_rig.h"

#define DISK "size=64m"
#define JOBS 600
#define EVENTS 3000 /* of each of two jobs, in turn: pages of events have both jobs' */

static struct store *store;
static char *disk, *dir, *reserve;

/* Takes every byte that the disk still has. */
static void fill_disk(void) {
    static int number;
    static char block[65536];
    char *path = mem_printf("%s/fill-%d", disk, number++);
    int fd = open(path, O_WRONLY | O_CREAT | O_CLOEXEC, 0600);
    CHECK(fd >= 0);
    for (size_t size = sizeof block; size > 0; size /= 2)
        while (write(fd, block, size) > 0)
            ;
    close(fd);
    uint64_t room = 1;
    OK(file_free_bytes(disk, &room, &err));
    CHECK_THAT(room == 0, "%llu bytes are free", (unsigned long long)room);
    mem_free(path);
}

static void empty_disk(void) {
    char **names;
    size_t count;
    OK(file_list(disk, &names, &count, &err));
    for (size_t i = 0; i < count; i++) {
        char *path = file_join(disk, names[i]);
        if (strncmp(names[i], "fill-", 5) == 0)
            CHECK(unlink(path) == 0);
        mem_free(path);
    }
    file_free_names(names, count);
}

static enum job_state state_of(int64_t id) {
    struct job job = {0};
    OK(store_job_get(store, id, &job, &err));
    enum job_state state = job.state;
    job_release(&job);
    return state;
}

static enum status add_refused(void) {
    struct job_new new = {.scene_id = SCENE_A, .name = "n", .labels = "{}", .settings = "{}", .max_attempts = 2};
    int64_t id;
    bool replayed;
    return store_job_add(store, &new, 100000, &id, &replayed, &err);
}

static enum status add_upload(const char *id) {
    struct upload_row row = {.owner_id = 0, .name = "u", .metadata = "", .length = 100};
    snprintf(row.id, sizeof row.id, "%s", id);
    return store_upload_add(store, &row, "hash", 4, &(struct count_limits){10, 10}, &err);
}

#define UPLOAD "0123456789abcdef0123456789abcdef"

/* Ordinary work until the disk refuses it: the log and the database have grown to where they cannot any more. */
static void work_until_full(int64_t job, int attempt) {
    enum status status = STATUS_OK;
    for (int i = 0; i < 100000 && status == STATUS_OK; i++)
        status = store_event_add(store, job, attempt, EVENT_LOG, "{\"level\":\"info\",\"message\":\"more\"}", &err);
    IS(status, STATUS_NO_SPACE);
}

/* All that stops or frees, once; each with no byte free. *ids: waiting jobs; the first two run. */
static void stop_all(const int64_t *ids, const int *attempt, const char *token_user) {
    bool is_gone, more;
    size_t count;
    IS(add_refused(), STATUS_NO_SPACE);
    CHECK_THAT(strstr(err.message, "the disk is full"), "%s", err.message);
    IS(store_probe(store, &err), STATUS_NO_SPACE);
    OK(store_job_cancel(store, ids[0], &err));                      /* a wish, as it runs, */
    OK(store_job_stop(store, ids[0], attempt[0], "stopped", &err)); /* fulfilled */
    CHECK(state_of(ids[0]) == JOB_CANCELLED);
    OK(store_job_pause(store, ids[1], &err));
    OK(store_job_crash(store, ids[1], attempt[1], "no space", "", 0, &err));
    CHECK(state_of(ids[1]) == JOB_PAUSED);
    for (size_t i = 2; i < JOBS; i++) {
        fill_disk(); /* what a checkpoint may have given back */
        OK(i % 2 ? store_job_cancel(store, ids[i], &err) : store_job_pause(store, ids[i], &err));
        CHECK(state_of(ids[i]) == (i % 2 ? JOB_CANCELLED : JOB_PAUSED));
    }
    fill_disk();
    IS(store_job_resume(store, ids[2], NULL, &err), STATUS_NO_SPACE);
    OK(store_upload_delete(store, UPLOAD, &err));
    OK(store_scene_delete(store, SCENE_B, -1, false, &is_gone, &err));
    CHECK(is_gone);
    OK(store_token_revoke(store, token_user, &count, &err));
    CHECK(count == 1);
    OK(store_event_prune(store, INT64_MAX, &more, &err));
    for (size_t i = 0; i < JOBS; i++) {
        fill_disk();
        OK(store_job_delete(store, ids[i], &err));
    }
    IS(add_refused(), STATUS_NO_SPACE);
}

/* What is the first to be entered by a daemon that has begun on a full disk, about job `id`, which runs elsewhere. */
static void requeue(int64_t id, int attempt) {
    size_t requeued;
    (void)attempt;
    OK(store_reconcile(store, NULL, 0, &requeued, &err));
    CHECK(requeued == 1 && state_of(id) == JOB_QUEUED);
}

/* Of the job's two parts the other is taken up. */
static void end_stray(int64_t id, int attempt) {
    const struct attempt_key kept = {id, attempt + 1};
    struct attempt_row row;
    size_t requeued;
    OK(store_reconcile(store, &kept, 1, &requeued, &err));
    OK(store_attempt_get(store, &(struct attempt_key){id, attempt}, &row, &err));
    CHECK(requeued == 0 && row.phase == ATTEMPT_ROW_ENDED && state_of(id) == JOB_RUNNING);
}

static void request(int64_t id, int attempt) {
    struct remote_row row;
    OK(store_remote_request(store, id, attempt, REMOTE_CANCEL, &err));
    OK(store_remote_get(store, id, attempt, &row, &err));
    CHECK(row.wanted == REMOTE_CANCEL);
}

static void close_attempt(int64_t id, int attempt) {
    struct remote_row row;
    size_t writers;
    OK(store_remote_close(store, id, attempt, &writers, &err));
    OK(store_remote_get(store, id, attempt, &row, &err));
    CHECK(row.phase == REMOTE_ENDED);
}

/* A daemon that ended, killed or not, on a disk that is full now: it has nothing left but its reserve. */
static void begin_on_full_disk(void (*first)(int64_t id, int attempt)) {
    int64_t id;
    int attempt;
    empty_disk();
    OK(store_probe(store, &err));
    OK(add_refused());
    store_reserve_renew(store);
    id = add_job(store, SCENE_A, 0);
    OK(store_job_start(store, id, "site", &attempt, &err));
    struct remote_row row = {.job_id = id, .number = attempt, .executor = "site", .lease_sec = 60};
    snprintf(row.name, sizeof row.name, "unbake-%lld-1", (long long)id);
    OK(store_remote_begin(store, &row, "hash", &err));
    store_close(store);
    fill_disk();
    OK(store_open(&store, dir, &err));
    CHECK(access(reserve, F_OK) == 0);
    first(id, attempt);
    CHECK(access(reserve, F_OK) != 0);
    OK(store_job_cancel(store, id, &err));
}

int main(void) {
    if (unshare(CLONE_NEWNS) != 0 || mount(NULL, "/", NULL, MS_REC | MS_PRIVATE, NULL) != 0)
        CHECK_SKIP("this user may not mount a small disk");
    char token[TOKEN_SIZE];
    int64_t ids[JOBS], token_id;
    int attempt[2];
    disk = fresh_dir();
    if (mount("none", disk, "tmpfs", 0, DISK) != 0)
        CHECK_SKIP("cannot mount a small disk");
    dir = file_join(disk, "data");
    reserve = file_join(dir, "reserve");
    OK(file_make_dirs(dir, &err));
    OK(store_open(&store, dir, &err));
    store_keep_events(store, 100000);
    store_reserve_renew(store);
    add_ready_scene(store, SCENE_A);
    add_ready_scene(store, SCENE_B);
    OK(store_token_add(store, "anna", ROLE_USER, 0, token, &token_id, &err));
    OK(add_upload(UPLOAD));
    for (size_t i = 0; i < JOBS; i++)
        ids[i] = add_job(store, SCENE_A, 0);
    for (int k = 0; k < 2; k++)
        OK(store_job_start(store, ids[k], "process", &attempt[k], &err));
    for (int i = 0; i < EVENTS; i++)
        for (int k = 0; k < 2; k++)
            OK(store_event_add(store, ids[k], attempt[k], EVENT_METRIC, "{\"series\":\"loss\",\"step\":1,\"value\":2}",
                               &err));
    fill_disk();
    work_until_full(ids[0], attempt[0]);
    stop_all(ids, attempt, "anna");
    CHECK(access(reserve, F_OK) == 0); /* none of this has needed it */

    begin_on_full_disk(requeue);
    begin_on_full_disk(end_stray);
    begin_on_full_disk(request);
    begin_on_full_disk(close_attempt);
    store_close(store);
    CHECK(umount2(disk, MNT_DETACH) == 0);
    mem_free(reserve);
    mem_free(dir);
    drop_dir(disk);
    return check_result();
}
