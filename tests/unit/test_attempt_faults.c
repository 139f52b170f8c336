/* test_attempt_faults.c -- an attempt of a job and the check of a scene, from their start to the entry of their
 * outcome, while a call of SQLite or of the system fails, or all from one on. What is not done is done the next time:
 * no job loses an attempt, no output is lost, no process and no descriptor is left. As worker stands in this program
 * itself: `test_attempt_faults worker DIR`. */
#include "server/job/attempt.h"

#include "server/job/outcome.h"
#include "server/job/worker_messages.h"
#include "server/store/internal.h"
#include "server/worker/progress.h"
#include "tests/unit/fault_rig.h"

#define SHA "0123456789abcdef0123456789abcdef0123456789abcdef0123456789abcdef"

/* --- the worker's side ------------------------------------------------------------------------------ */

static int worker(const char *folder) {
    struct progress p = {.fd = PROGRESS_FD};
    const char *kind;
    cJSON *order;
    char *path = file_join(folder, "job.json"), *out = file_join(folder, "out/a.txt");
    if (json_read(path, 1 << 20, &order, &err) != STATUS_OK ||
        json_string(order, "kind", "job.json", "", &kind, &err) != STATUS_OK)
        return PROGRESS_EXIT_FAILED;
    if (strcmp(kind, "check") == 0) {
        if (strstr(folder, "/ffff"))
            return PROGRESS_EXIT_INPUT;
        progress_scene(&p, cJSON_CreateObject());
    } else {
        if (file_replace(out, "data", 4, &err) != STATUS_OK)
            return PROGRESS_EXIT_FAILED;
        progress_stage(&p, "refine");
        progress_file(&p, "preview", "a.txt", 3, SCENE_A, "text/plain"); /* replaced by now */
        progress_file(&p, "preview", "a.txt", 4, SCENE_A, "text/plain");
        progress_metric(&p, "loss", 3, 0.25);
        progress_file(&p, "output", "a.txt", 4, SHA, "text/plain");
    }
    progress_end(&p, STATUS_OK, "", "");
    return PROGRESS_EXIT_OK;
}

/* --- the daemon's side ------------------------------------------------------------------------------ */

static struct counters figures;
static long strikes;

static void hear_to_the_end(struct attempt *a) {
    for (; a->phase == ATTEMPT_ALIVE; usleep(1000))
        worker_messages_read(a, store, &figures);
}

static void settle(struct attempt *a) {
    hear_to_the_end(a);
    OK(outcome_settle(a, store, NULL, &figures, &err));
    CHECK(a->phase == ATTEMPT_EMPTY);
}

static void check_output(int64_t id, size_t wanted) {
    struct output_row *rows;
    size_t count;
    OK(store_output_list(store, id, &rows, &count, &err));
    CHECK_THAT(count == wanted, "job %lld: %zu outputs", (long long)id, count);
    for (size_t i = 0; i < count; i++) {
        CHECK_STRING(rows[i].sha256, SHA); /* that which was announced last */
        output_row_release(&rows[i]);
    }
    mem_free(rows);
}

/* Of earlier attempts: more than is kept. */
static void fill_log(int64_t id) {
    char *folder = mem_printf("%s/jobs/%lld", dir, (long long)id), *log = file_join(folder, "worker.log");
    OK(file_make_dirs(folder, &err));
    int fd = open(log, O_WRONLY | O_CREAT | O_CLOEXEC, 0600);
    CHECK(fd >= 0 && ftruncate(fd, 3 << 19) == 0);
    close(fd);
    mem_free(log);
    mem_free(folder);
}

/* A job that could not be started waits, or (its entry failed, too) claims to run until the scheduler finds it, or
 * waits for room on the disk; it has all its attempts, and says why. */
static void put_right(int64_t id, const struct error *why, bool is_entered) {
    struct job job;
    size_t requeued;
    OK(store_job_get(store, id, &job, &err));
    CHECK_THAT(job.attempts_left == 3, "%d attempts are left: %s", job.attempts_left, why->message);
    CHECK_THAT(job.state == JOB_QUEUED || job.state == JOB_PAUSED || (job.state == JOB_RUNNING && !is_entered),
               "%s: %s", job_state_name(job.state), why->message);
    CHECK(job.state != JOB_PAUSED || job.reason[0]);
    if (job.state == JOB_PAUSED)
        OK(store_job_resume(store, id, NULL, &err));
    job_release(&job);
    OK(store_reconcile(store, NULL, 0, &requeued, &err));
}

/* False where there is no n-th call. */
static bool start_once(bool is_sql, long n, bool stays) {
    struct attempt a = {0};
    struct error why = {0};
    int64_t id = add_job("{}", NULL);
    int before = count_descriptors();
    fill_log(id);
    strike(is_sql, n, stays);
    enum status status = attempt_start_job(&a, &config, store, &figures, id, 1, n % 3 ? &why : NULL);
    bool struck = lift();
    if (a.phase != ATTEMPT_ALIVE) {
        CHECK_THAT(struck && !has_child() && count_descriptors() == before && !a.dir, "call %ld: something is left", n);
        CHECK(status == STATUS_OK || n % 3 == 0 || (why.status == status && *why.message));
        put_right(id, &why, status == STATUS_OK);
        OK(attempt_start_job(&a, &config, store, &figures, id, 1, &err));
    }
    settle(&a);
    CHECK_THAT(state_of(id) == JOB_SUCCEEDED, "call %ld: %s", n, job_state_name(state_of(id)));
    check_output(id, 1);
    CHECK(count_descriptors() == before);
    return struck;
}

/* What a worker says while the store fails is not lost where it counts, nor is how it ended; and the log is not filled
 * with the same. */
static bool end_once(bool is_sql, long n, bool stays) {
    struct attempt a = {0};
    int64_t id = add_job("{}", NULL);
    log_forget();
    OK(attempt_start_job(&a, &config, store, &figures, id, 1, &err));
    strike(is_sql, n, stays);
    hear_to_the_end(&a);
    enum status status = outcome_settle(&a, store, NULL, &figures, &err);
    bool struck = lift();
    CHECK_THAT(status == STATUS_OK || (a.phase == ATTEMPT_ENDED && *err.message && state_of(id) == JOB_RUNNING),
               "call %ld: lost", n);
    if (status != STATUS_OK)
        settle(&a);
    CHECK_THAT(state_of(id) == JOB_SUCCEEDED, "call %ld: %s", n, job_state_name(state_of(id)));
    if (log_count("that is not entered: ") == 0) /* as of a disk that cannot find it again and again */
        check_output(id, 1);
    else
        CHECK_THAT(!is_sql && stays, "call %ld: an output is lost", n);
    CHECK_THAT(log_count("cannot record a") <= 1, "call %ld: the log is filled", n);
    return struck;
}

static void add_scene(const char *id) {
    bool existed;
    char *files = mem_printf("%s/scenes/%s/files/images", dir, id);
    OK(file_make_dirs(files, &err));
    OK(store_scene_add(store, id, "scene", 1, 0, &existed, &err));
    mem_free(files);
}

static enum scene_state scene_state(const char *id) {
    struct scene_row row;
    OK(store_scene_get(store, id, &row, &err));
    enum scene_state state = row.state;
    scene_row_release(&row);
    return state;
}

static const struct unchecked *unchecked(const char *id) {
    static struct unchecked scene;
    snprintf(scene.id, sizeof scene.id, "%s", id);
    return &scene;
}

static bool check_once(bool is_sql, long n, bool stays) {
    static long number;
    char id[SCENE_ID_SIZE];
    struct attempt a = {0};
    struct error why = {0};
    int before = count_descriptors();
    snprintf(id, sizeof id, "%08lx%.56s", ++number, SCENE_A);
    add_scene(id);
    strike(is_sql, n, stays);
    enum status status = attempt_start_check(&a, &config, store, unchecked(id), 1, n % 3 ? &why : NULL);
    bool struck = lift();
    if (status != STATUS_OK) {
        CHECK_THAT(struck && !has_child() && count_descriptors() == before, "call %ld: something is left", n);
        CHECK((n % 3 == 0 || *why.message) && scene_state(id) == SCENE_CHECKING);
        OK(attempt_start_check(&a, &config, store, unchecked(id), 1, &err));
    }
    hear_to_the_end(&a);
    strike(is_sql, n, stays);
    status = outcome_settle(&a, store, NULL, &figures, &why);
    struck = lift() || struck;
    if (status != STATUS_OK) {
        CHECK(*why.message && scene_state(id) == SCENE_CHECKING);
        settle(&a);
    }
    CHECK_THAT(scene_state(id) == SCENE_READY, "call %ld: %s", n, scene_state_name(scene_state(id)));
    return struck;
}

/* A job whose scene was rejected is told why, if that is known. */
static void check_rejected(void) {
    static const char *const problems[] = {"[]", "[{\"file\":\"mesh.ply\",\"reason\":\"it is empty\"}]"};
    for (int i = 0; i < 2; i++) {
        char id[SCENE_ID_SIZE];
        struct attempt a = {0};
        struct job job;
        snprintf(id, sizeof id, "bbbb%04x%.56s", (unsigned)i, SCENE_A);
        add_scene(id);
        struct job_new new = {.scene_id = id, .name = "job", .labels = "{}", .settings = "{}", .max_attempts = 3};
        int64_t number;
        bool replayed;
        OK(store_job_add(store, &new, 1000, &number, &replayed, &err));
        OK(store_scene_reject(store, id, NULL, problems[i], "{}", &err));
        OK(attempt_start_job(&a, &config, store, &figures, number, 1, &err));
        OK(store_job_get(store, number, &job, &err));
        CHECK(a.phase == ATTEMPT_EMPTY && job.state == JOB_FAILED && strstr(job.hint, "problems"));
        CHECK_THAT(strstr(job.reason, i ? "was rejected: it is empty" : "was rejected"), "%s", job.reason);
        job_release(&job);
    }
}

static void check_order(const struct attempt *a, const char *part) {
    struct buf text;
    char *path = file_join(a->dir, "job.json");
    buf_init(&text, 1 << 20);
    OK(file_read(path, &text, &err));
    CHECK_THAT(strstr(buf_text(&text), part), "%s is not in %s", part, buf_text(&text));
    buf_release(&text);
    mem_free(path);
}

static int64_t add_job_on(const char *scene, const char *settings) {
    struct job_new new = {.scene_id = scene, .name = "job", .labels = "{}", .settings = settings, .max_attempts = 3};
    int64_t id = 0;
    bool replayed;
    OK(store_job_add(store, &new, 1000, &id, &replayed, &err));
    return id;
}

/* The check is told how the scene was said to be read, jobs what the check has made of that. One whose mesh and
 * photographs do not fit is for no job, but for one that was told to take it. */
static void check_fit(void) {
    static const char facts[] = "{\"fit\":{\"verdict\":\"no\",\"evidence\":[\"it hangs upside down\"],"
                                "\"remedy\":{\"mesh_axes\":\"x -z y\"},\"remedy_text\":\"the mesh is y-up\"},"
                                "\"reading\":{\"axes\":\"opencv\",\"scale\":2}}";
    char id[SCENE_ID_SIZE];
    struct attempt a = {0};
    struct job job;
    snprintf(id, sizeof id, "cccc%.60s", SCENE_A);
    add_scene(id);
    OK(store_scene_patch(store, NULL, id, &(struct scene_patch){.reading = "{\"axes\":\"opencv\"}"}, &err));
    OK(attempt_start_check(&a, &config, store, unchecked(id), 1, &err));
    check_order(&a, "\"reading\":{\"axes\":\"opencv\"}");
    settle(&a);
    int64_t number = add_job_on(id, "{}");
    OK(attempt_start_job(&a, &config, store, &figures, number, 1, &err));
    check_order(&a, "\"reading\":{\"axes\":\"opencv\"}");
    settle(&a);

    OK(store_scene_patch(store, NULL, id, &(struct scene_patch){.reading = "{\"axes\":\"opencv\"}"}, &err));
    OK(store_scene_ready(store, id, NULL, facts, &err));
    number = add_job_on(id, "{}");
    OK(attempt_start_job(&a, &config, store, &figures, number, 1, &err));
    OK(store_job_get(store, number, &job, &err));
    CHECK(a.phase == ATTEMPT_EMPTY && job.state == JOB_FAILED);
    CHECK_THAT(strstr(job.reason, "do not fit: it hangs upside down"), "%s", job.reason);
    CHECK_THAT(strstr(job.hint, "the mesh is y-up: `unbake scenes set ccccaaaaaaaa mesh_axes='x -z y'`"), "%s",
               job.hint);
    job_release(&job);
    number = add_job_on(id, "{\"fit\":\"ignore\"}");
    OK(attempt_start_job(&a, &config, store, &figures, number, 1, &err));
    check_order(&a, "\"reading\":{\"axes\":\"opencv\",\"scale\":2}");
    settle(&a);
}

/* A retry from a stage that needs a new checkpoint does not begin with the old one: where that cannot be removed, the
 * job waits. */
static void check_restart(void) {
    struct attempt a = {0};
    struct job job;
    int64_t id = add_job("{}", NULL);
    char *checkpoint = mem_printf("%s/jobs/%lld/attempt-1/checkpoint/checkpoint.db", dir, (long long)id);
    OK(attempt_start_job(&a, &config, store, &figures, id, 1, &err));
    settle(&a);
    OK(file_replace(checkpoint, "old", 3, &err));
    OK(store_job_retry(store, id, 3, "prepare", NULL, &err));
    strike_system("unlinkat", 1, false);
    CHECK(attempt_start_job(&a, &config, store, &figures, id, 1, &err) == STATUS_IO && strstr(err.message, checkpoint));
    CHECK(lift() && state_of(id) == JOB_QUEUED && access(checkpoint, F_OK) == 0);
    OK(attempt_start_job(&a, &config, store, &figures, id, 1, &err));
    CHECK(access(checkpoint, F_OK) != 0);
    settle(&a);
    OK(store_job_get(store, id, &job, &err));
    CHECK(job.state == JOB_SUCCEEDED && !job.restart_from[0]);
    job_release(&job);
    mem_free(checkpoint);
}

/* A job that has gone on without its attempt, or is gone: there is nothing to enter. */
static void check_left_behind(void) {
    struct attempt a = {0};
    struct job job;
    int64_t id = add_job("{}", NULL);
    OK(attempt_start_job(&a, &config, store, &figures, id, 1, &err));
    OK(store_job_stop(store, id, a.number, "", &err));
    settle(&a);
    CHECK(state_of(id) == JOB_QUEUED);
    OK(attempt_start_job(&a, &config, store, &figures, id, 1, &err));
    OK(store_job_stop(store, id, a.number, "", &err));
    OK(store_job_cancel(store, id, &err));
    OK(store_job_delete(store, id, &err));
    settle(&a);
    CHECK(store_job_get(store, id, &job, &err) == STATUS_NOT_FOUND);
}

/* What an attempt took of the processors is its owner's also where that could not be entered when it ended, which is no
 * reason to put off its outcome. */
static bool has_usage(int64_t owner) {
    int64_t found = 0;
    OK(sql_int(&store->sql, 0, &found, &err, "SELECT 1 FROM usage WHERE owner_id = ?", "i", owner));
    return found;
}

static void check_charge(void) {
    struct attempt a = {0};
    struct job_new new = {
        .scene_id = SCENE_A, .name = "job", .labels = "{}", .settings = "{}", .max_attempts = 3, .owner_id = 5};
    int64_t id;
    bool replayed;
    OK(store_job_add(store, &new, 100000, &id, &replayed, &err));
    OK(attempt_start_job(&a, &config, store, &figures, id, 1, &err));
    hear_to_the_end(&a);
    strike_sql("usage", 1, true);
    OK(outcome_settle(&a, store, NULL, &figures, &err));
    CHECK(lift() && state_of(id) == JOB_SUCCEEDED && !has_usage(5));
    OK(store_usage_pay(store, &err));
    CHECK(has_usage(5));
}

/* What was unpacked of a rejected scene stays where it cannot be removed, and the log says so. */
static void check_unpacked(void) {
    struct attempt a = {0};
    char id[SCENE_ID_SIZE];
    log_forget();
    for (int i = 0; i < 2; i++) {
        snprintf(id, sizeof id, "ffff%04x%.56s", (unsigned)i, SCENE_A);
        add_scene(id);
        char *files = mem_printf("%s/scenes/%s/files", dir, id);
        OK(attempt_start_check(&a, &config, store, unchecked(id), 1, &err));
        hear_to_the_end(&a);
        if (i == 0)
            strike_system("unlinkat", 1, true);
        OK(outcome_settle(&a, store, NULL, &figures, &err));
        CHECK(lift() == (i == 0) && scene_state(id) == SCENE_REJECTED && (access(files, F_OK) == 0) == (i == 0));
        CHECK(log_count("cannot remove") == 2 && log_count(files) == (i == 0)); /* and the pictures */
        mem_free(files);
    }
}

static void strike_all(bool (*once)(bool is_sql, long n, bool stays)) {
    for (int way = 0; way < 4; way++)
        for (long n = 1; once(way % 2, n, way / 2) && check_failed_count == 0; n++)
            strikes++;
}

int main(int argc, char **argv) {
    if (argc == 3 && strcmp(argv[1], "worker") == 0)
        _exit(worker(argv[2]));
    rig_start();
    strike_all(start_once);
    strike_all(end_once);
    strike_all(check_once);
    check_rejected();
    check_fit();
    check_restart();
    check_left_behind();
    check_unpacked();
    check_charge();
    rig_stop();
    printf("%ld calls failed\n", strikes);
    return check_result();
}
