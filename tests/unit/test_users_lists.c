/* test_users_lists.c -- what is readable for whom in lists. */
#include <limits.h>

#include "tests/unit/users_rig.h"

/* --- lists --------------------------------------------------------------------------------- */

static size_t jobs_seen(struct store *store, const struct caller *who, int state) {
    struct job jobs[10];
    size_t count;
    OK(store_job_list(store, who, &(struct job_filter){.state = state, .kind = -1}, 0, 10, jobs, &count, &err));
    for (size_t i = 0; i < count; i++)
        job_release(&jobs[i]);
    return count;
}

static size_t scenes_seen(struct store *store, const struct caller *who) {
    struct scene_row rows[10];
    size_t count;
    char next[128];
    OK(store_scene_list(store, who, "", 10, rows, &count, next, &err));
    for (size_t i = 0; i < count; i++)
        scene_row_release(&rows[i]);
    return count;
}

/* What three callers see of scenes, and of jobs that one of them shares. */
struct callers {
    struct caller alice, bob, admin;
};

static void check_scenes_seen(struct store *store, const struct callers *c) {
    struct scene_row row;
    CHECK(scenes_seen(store, &c->alice) == 1 && scenes_seen(store, &c->bob) == 1 && scenes_seen(store, &c->admin) == 2);
    OK(store_scene_find(store, &c->alice, "aaaa", &row, &err)); /* ambiguous only among one's own */
    CHECK_STRING(row.id, SCENE_A);
    CHECK_STRING(row.owner, "alice");
    scene_row_release(&row);
    IS(store_scene_find(store, &c->admin, "aaaa", &row, &err), STATUS_CONFLICT);
    IS(store_scene_find(store, &c->alice, "aaaac", &row, &err), STATUS_NOT_FOUND);
}

/* Alice's job becomes bob's to read, and its scene with it, and is taken back. */
static void check_sharing(struct store *store, const struct callers *c, int64_t job_id) {
    struct job job;
    enum access access;
    OK(store_scene_access(store, &c->bob, SCENE_A, &access, &err));
    CHECK(access == ACCESS_NONE);
    OK(store_job_patch(store, job_id, -1, &(struct job_patch){.priority = INT_MIN, .shared = 1}, &err));
    OK(store_job_get(store, job_id, &job, &err));
    CHECK(job.is_shared && caller_access_job(&c->bob, &job) == ACCESS_READ &&
          caller_access_job(&c->alice, &job) == ACCESS_CHANGE);
    CHECK_STRING(job.owner, "alice");
    job_release(&job);
    OK(store_scene_access(store, &c->bob, SCENE_A, &access, &err));
    CHECK(access == ACCESS_READ && jobs_seen(store, &c->bob, -1) == 2 && scenes_seen(store, &c->bob) == 2);
    OK(store_job_patch(store, job_id, -1, &(struct job_patch){.name = "x", .priority = INT_MIN, .shared = -1},
                       &err)); /* stays shared */
    CHECK(jobs_seen(store, &c->bob, -1) == 2);
    OK(store_job_patch(store, job_id, -1, &(struct job_patch){.priority = INT_MIN, .shared = 0}, &err));
    CHECK(jobs_seen(store, &c->bob, -1) == 1);
}

/* Both have sent the same bytes, and have a job each: the scene stays until the last of them removes it. */
static void check_common_scene(struct store *store, const struct callers *c, int64_t first, int64_t second) {
    bool existed, is_gone;
    OK(store_scene_add(store, SCENE_A, "a", 1, c->bob.user_id, &existed, &err));
    CHECK(!existed && scenes_seen(store, &c->bob) == 2);
    const struct retention past = {.sets_expiry = true, .expires_ms = 1}, pin = {.pin = KEEP_PIN_ON},
                           loose = {.pin = KEEP_PIN_OFF};
    OK(store_scene_patch(store, &c->alice, SCENE_A, &(struct scene_patch){"mine", pin, NULL}, &err));
    IS(store_scene_patch(store, &c->bob, SCENE_A, &(struct scene_patch){NULL, loose, NULL}, &err), STATUS_CONFLICT);
    IS(store_scene_patch(store, &c->bob, SCENE_A, &(struct scene_patch){NULL, past, NULL}, &err), STATUS_CONFLICT);
    OK(store_scene_patch(store, &c->admin, SCENE_A, &(struct scene_patch){NULL, loose, NULL}, &err));
    IS(store_scene_delete(store, SCENE_A, c->alice.user_id, false, &is_gone, &err), STATUS_CONFLICT);
    OK(store_job_cancel(store, first, &err));
    OK(store_scene_delete(store, SCENE_A, c->alice.user_id, false, &is_gone, &err));
    CHECK(!is_gone && scenes_seen(store, &c->alice) == 0 && scenes_seen(store, &c->bob) == 2);
    OK(store_scene_patch(store, &c->bob, SCENE_A, &(struct scene_patch){NULL, past, NULL},
                         &err)); /* it is his alone now */
    IS(store_scene_delete(store, SCENE_A, c->bob.user_id, false, &is_gone, &err), STATUS_CONFLICT);
    OK(store_job_cancel(store, second, &err));
    OK(store_scene_delete(store, SCENE_A, c->bob.user_id, false, &is_gone, &err));
    CHECK(is_gone && scenes_seen(store, &c->admin) == 1);
}

static void test_lists(void) {
    char *dir = fresh_dir();
    struct store *store;
    bool existed;
    OK(store_open(&store, dir, &err));
    struct callers c = {.admin = {.role = ROLE_ADMIN}};
    c.alice = add_user(store, "alice");
    c.bob = add_user(store, "bob");
    OK(store_scene_add(store, SCENE_A, "a", 1, c.alice.user_id, &existed, &err));
    OK(store_scene_ready(store, SCENE_A, NULL, "{}", &err));
    OK(store_scene_add(store, SCENE_C, "c", 1, c.bob.user_id, &existed, &err));
    OK(store_scene_ready(store, SCENE_C, NULL, "{}", &err));
    check_scenes_seen(store, &c);

    /* One key each: bob's does not find alice's job. */
    int64_t first = add_own_job(store, SCENE_A, c.alice.user_id, "key");
    int64_t second = add_own_job(store, SCENE_A, c.bob.user_id, "key");
    CHECK(first != second && add_own_job(store, SCENE_A, c.alice.user_id, "key") == first);
    CHECK(jobs_seen(store, &c.alice, -1) == 1 && jobs_seen(store, &c.bob, JOB_QUEUED) == 1 &&
          jobs_seen(store, &c.admin, -1) == 2 && jobs_seen(store, NULL, JOB_QUEUED) == 2);
    check_sharing(store, &c, first);
    check_common_scene(store, &c, first, second);
    store_close(store);
    drop_dir(dir);
}

int main(void) {
    test_lists();
    return check_result();
}
