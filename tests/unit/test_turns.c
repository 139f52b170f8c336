/* test_turns.c -- whose turn it is between users, and their limits. */
#include <limits.h>

#include "server/store/internal.h"
#include "tests/sql_faults.h"
#include "tests/unit/store_rig.h"

static struct store *store;

static int64_t job_of(int64_t user, int priority) {
    struct job_new new = {.scene_id = SCENE_A,
                          .name = "n",
                          .labels = "{}",
                          .settings = "{}",
                          .priority = priority,
                          .max_attempts = 2,
                          .owner_id = user,
                          .user_queue_limit = 3};
    int64_t id = 0;
    bool replayed;
    enum status status = store_job_add(store, &new, 1000, &id, &replayed, &err);
    return status == STATUS_OK ? id : -(int64_t)status;
}

static int64_t owner_next(int limit) {
    struct job job = {0};
    int64_t id, owner = -1;
    if (store_job_next(store, limit, NULL, &id, &err) == STATUS_OK && store_job_get(store, id, &job, &err) == STATUS_OK)
        owner = job.owner_id;
    job_release(&job);
    return owner;
}

/* Whoever used least is first, whatever the others' priorities. */
static void test_least_used(void) {
    CHECK(job_of(1, 100) > 0 && job_of(2, 0) > 0 && job_of(3, 50) > 0);
    OK(store_usage_add(store, 1, 100.0, &err));
    OK(store_usage_add(store, 2, 10.0, &err));
    CHECK(owner_next(0) == 3);
    OK(store_usage_add(store, 3, 1.0, &err));
    CHECK(owner_next(0) == 3);
    for (int i = 0; i < 20; i++)
        OK(store_usage_add(store, 3, 1.0, &err)); /* charges add up: 21 s */
    CHECK(owner_next(0) == 2);
    OK(store_usage_add(store, 2, 12.0, &err)); /* 22 s */
    CHECK(owner_next(0) == 3);
    OK(store_usage_add(store, 3, 0.0, &err));
    OK(store_usage_add(store, 3, -5.0, &err));
    CHECK(owner_next(0) == 3);
}

/* CPU time that could not be entered, again and again, is entered with the next charge of anybody, or by itself. */
static void test_unpaid(void) {
    char *dir = fresh_dir();
    struct store *other = store;
    OK(store_open(&store, dir, &err));
    add_ready_scene(store, SCENE_A);
    CHECK(job_of(1, 0) > 0 && job_of(2, 0) > 0);
    OK(store_usage_pay(store, &err)); /* nothing is owed */
    for (long n = 1; n <= 3; n++) {
        static const char *const statements[] = {"BEGIN", "SELECT weight FROM usage", "COMMIT"};
        sql_faults_arm_only(statements[n - 1], 1, false);
        CHECK(store_usage_add(store, 1, 100.0, &err) != STATUS_OK && sql_faults_lift());
    }
    CHECK(owner_next(0) == 1);
    OK(store_usage_add(store, 2, 250.0, &err)); /* less than 3 times 100 */
    CHECK(owner_next(0) == 2);
    sql_faults_arm_only("INSERT OR REPLACE INTO usage", 1, false);
    CHECK(store_usage_add(store, 2, 100.0, &err) != STATUS_OK && sql_faults_lift());
    CHECK(owner_next(0) == 2);
    OK(store_usage_pay(store, &err));
    CHECK(owner_next(0) == 1);
    OK(store_usage_pay(store, &err)); /* it is entered once */
    OK(store_usage_add(store, 1, 100.0, &err));
    CHECK(owner_next(0) == 2);
    store_close(store);
    drop_dir(dir);
    store = other;
}

/* What was charged, by month and user; a charge that failed is in it once it is entered, and counts once. */
static void test_months(void) {
    char *dir = fresh_dir();
    struct store *other;
    struct usage_row *rows;
    size_t count;
    int64_t token;
    char secret[TOKEN_SIZE];
    double nobody = 0.0, ada = 0.0;
    OK(store_open(&other, dir, &err));
    OK(store_usage_list(other, &rows, &count, &err));
    CHECK(count == 0);
    store_usage_release(rows, count);
    OK(store_token_add(other, "ada", ROLE_USER, 0, secret, &token, &err));
    OK(store_usage_add(other, 1, 3600.0, &err));
    OK(store_usage_add(other, 0, 7.0, &err));
    sql_faults_arm_only("INSERT INTO usage_months", 1, false);
    CHECK(store_usage_add(other, 1, 1800.0, &err) != STATUS_OK && sql_faults_lift());
    OK(store_usage_pay(other, &err));
    OK(store_usage_pay(other, &err));
    store_close(other);
    OK(store_open(&other, dir, &err));
    OK(sql_run(&other->sql, &err, "INSERT INTO usage_months VALUES (1, '1999-12', 5.0)", ""));
    OK(store_usage_list(other, &rows, &count, &err));
    CHECK(count >= 3 && strcmp(rows[0].month, "1999-12") == 0 && strcmp(rows[0].user, "ada") == 0);
    for (size_t i = 1; i < count; i++) { /* more than one month where a month ends just now */
        CHECK(strlen(rows[i].month) == 7 && strcmp(rows[i].month, "2020-01") > 0);
        *(strcmp(rows[i].user, "ada") == 0 ? &ada : &nobody) += rows[i].cpu_sec;
    }
    CHECK_NEAR(ada, 5400.0, 1e-9);
    CHECK_NEAR(nobody, 7.0, 1e-9);
    store_usage_release(rows, count);
    sql_faults_arm_only("FROM usage_months", 1, false);
    CHECK(store_usage_list(other, &rows, &count, &err) != STATUS_OK && sql_faults_lift() && count == 0 && !rows);
    store_close(other);
    drop_dir(dir);
}

/* What runs already counts against the limit of running jobs, the user's own only. Returns a job of user 3
 * that runs. */
static int64_t test_running(void) {
    int64_t id;
    int attempt;
    OK(store_job_next(store, 1, NULL, &id, &err));
    OK(store_job_start(store, id, "process", &attempt, &err));
    int64_t second = job_of(3, 0);
    CHECK(owner_next(1) == 2 && owner_next(2) == 3);
    OK(store_job_succeed(store, id, attempt, "", &err));
    CHECK(owner_next(1) == 3);
    OK(store_job_start(store, second, "process", &attempt, &err));
    return second;
}

/* One user's queue is full, others' is not; nobody has no limit. */
static void test_full_queue(void) {
    CHECK(job_of(2, 0) > 0 && job_of(2, 0) > 0);
    CHECK(job_of(2, 0) == -(int64_t)STATUS_LIMIT);
    CHECK(job_of(3, 0) > 0);
    for (int i = 0; i < 5; i++)
        CHECK(job_of(0, 0) > 0);
    CHECK(owner_next(1) == 0); /* nobody has used nothing */
}

/* Jobs that have ended count, others' do not; what is known by its key is there already; nobody has no limit. */
static void test_kept(void) {
    struct job_new new = {.scene_id = SCENE_A,
                          .name = "n",
                          .labels = "{}",
                          .settings = "{}",
                          .max_attempts = 2,
                          .owner_id = 31,
                          .user_max_jobs = 3,
                          .idempotency_key = "first",
                          .request_sha256 = "x"};
    char hint[64];
    int64_t ids[3], id, others;
    bool replayed;
    for (int i = 0; i < 3; i++) {
        OK(store_job_add(store, &new, 1000, &ids[i], &replayed, &err));
        new.idempotency_key = NULL;
    }
    IS(store_job_add(store, &new, 1000, &id, &replayed, &err), STATUS_NO_SPACE);
    CHECK_STRING(err.message, "you keep 3 jobs, and a user may keep 3");
    CHECK_STRING(err.hint, "delete jobs that you do not need; an administrator can raise the option user_max_jobs");
    for (int i = 0; i < 3; i++)
        OK(store_job_cancel(store, ids[i], &err));
    OK(store_job_patch(store, ids[0], -1,
                       &(struct job_patch){.priority = INT_MIN, .shared = -1, .retention.pin = KEEP_PIN_ON}, &err));
    IS(store_job_add(store, &new, 1000, &id, &replayed, &err), STATUS_NO_SPACE);
    snprintf(hint, sizeof hint, "the oldest that has ended is %lld", (long long)ids[1]);
    CHECK_THAT(strstr(err.hint, hint), "%s", err.hint);
    new.idempotency_key = "first";
    OK(store_job_add(store, &new, 1000, &id, &replayed, &err));
    CHECK(replayed && id == ids[0]);
    OK(store_job_retry(store, ids[2], 3, NULL, NULL, &err)); /* one that is kept anyway */
    new.idempotency_key = NULL;
    new.owner_id = 32;
    OK(store_job_add(store, &new, 1000, &others, &replayed, &err));
    new.owner_id = 0;
    for (int i = 0; i < 4; i++) {
        OK(store_job_add(store, &new, 1000, &id, &replayed, &err));
        OK(store_job_delete(store, id, &err));
    }
    new.owner_id = 31;
    OK(store_job_delete(store, ids[1], &err));
    OK(store_job_add(store, &new, 1000, &ids[1], &replayed, &err));
    for (int i = 0; i < 3; i++)
        OK(store_job_delete(store, ids[i], &err));
    OK(store_job_delete(store, others, &err));
}

static enum status upload_of(int64_t user, int number) {
    struct upload_row row = {.owner_id = user, .name = (char *)"room", .metadata = (char *)"", .length = 10};
    const struct count_limits limits = {.all = 4, .one_user = 2};
    snprintf(row.id, sizeof row.id, "%032d", number);
    return store_upload_add(store, &row, "hash", 4, &limits, &err);
}

/* One user cannot take all the room for unfinished uploads. */
static void test_uploads(void) {
    OK(upload_of(1, 1));
    OK(upload_of(1, 2));
    IS(upload_of(1, 3), STATUS_LIMIT);
    OK(upload_of(2, 4));
    OK(upload_of(0, 5));
    IS(upload_of(3, 6), STATUS_LIMIT);
    for (int number = 1; number <= 5; number++) {
        char id[UPLOAD_ID_SIZE];
        snprintf(id, sizeof id, "%032d", number);
        IS(store_upload_delete(store, id, &err), number == 3 ? STATUS_NOT_FOUND : STATUS_OK);
    }
}

/* Ten users with a job after another: turns differ by one at most. */
static void test_ten_users(void) {
    int started[10] = {0};
    for (int user = 11; user <= 20; user++)
        for (int i = 0; i < 3; i++)
            CHECK(job_of(user, 0) > 0);
    for (;;) {
        struct job job;
        int64_t id;
        int attempt;
        if (store_job_next(store, 1, NULL, &id, &err) != STATUS_OK)
            break;
        OK(store_job_get(store, id, &job, &err));
        OK(store_job_start(store, id, "process", &attempt, &err));
        OK(store_usage_add(store, job.owner_id, 3600.0, &err));
        OK(store_job_succeed(store, id, attempt, "", &err));
        if (job.owner_id > 10) {
            int *mine = &started[job.owner_id - 11], least = 99;
            for (int i = 0; i < 10; i++)
                least = started[i] < least ? started[i] : least;
            CHECK_THAT(++*mine <= least + 1, "user %lld has its turn %d, somebody none after %d",
                       (long long)job.owner_id, *mine, least);
        }
        job_release(&job);
    }
}

/* Scenes and outputs; `job` is the third user's. */
static void test_bytes(int64_t job) {
    uint64_t bytes;
    OK(store_user_bytes(store, 0, NULL, 0, &bytes, &err));
    CHECK(bytes == 10);
    OK(store_output_put(store, job, 1, EVENT_OUTPUT, "a.exr", 1000, SCENE_A, "x/y", &err));
    OK(store_user_bytes(store, 3, NULL, 0, &bytes, &err));
    CHECK_THAT(bytes == 1000, "%llu bytes", (unsigned long long)bytes);
}

int main(void) {
    char *dir = fresh_dir();
    OK(store_open(&store, dir, &err));
    add_ready_scene(store, SCENE_A);
    test_least_used();
    int64_t running = test_running();
    test_full_queue();
    test_ten_users();
    test_uploads();
    test_kept();
    test_bytes(running);
    test_unpaid();
    test_months();
    store_close(store);
    drop_dir(dir);
    return check_result();
}
