/* test_http_faults.c -- each call of SQLite, and each of the system, that a request leads to fails once: the reply has
 * the status of that fault and a sentence, nothing leaks, and the same request succeeds when it is made again. */
#include "server/transport/problem.h"
#include "tests/api/rig.h"
#include "tests/system_faults.h"

#define UPLOADED 600 /* bytes */

static struct rig rig;
static struct error err;
static int64_t job;
static char upload[80], scene[SCENE_ID_SIZE] = RIG_SCENE;
static char bytes[UPLOADED];
static char token_field[TOKEN_SIZE + 40]; /* "" while the daemon is open */

/* --- requests ------------------------------------------------------------------------------------ */

/* The path with {j}, {u} and {s} replaced; the caller's. */
static char *fill_in(const char *path) {
    char number[24];
    const char *mark = strchr(path, '{');
    snprintf(number, sizeof number, "%lld", (long long)job);
    if (!mark)
        return mem_strdup(path);
    return mem_printf("%.*s%s%s", (int)(mark - path), path,
                      mark[1] == 'j'   ? number
                      : mark[1] == 'u' ? upload
                                       : scene,
                      mark + 3);
}

static int ask(const char *method, const char *path, const char *fields, const void *body, size_t length,
               struct buf *reply) {
    struct buf request;
    char *full = fill_in(path);
    buf_init(&request, 1 << 20);
    buf_printf(&request, "%s %s HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n%s%s", method, full, token_field,
               fields);
    if (strcmp(method, "GET") != 0)
        buf_printf(&request, "Content-Length: %zu\r\n", length);
    buf_puts(&request, "\r\n");
    buf_append(&request, body, length);
    int status = rig_ask(&rig, request.data, request.length, reply);
    buf_release(&request);
    mem_free(full);
    return status;
}

/* --- what there must be before ------------------------------------------------------------------- */

static void queued_job(void) { job = rig_job(&rig); }

static void ended_job(void) {
    job = rig_job(&rig);
    rig_must(store_job_cancel(rig.store, job, &err), &err, "cancel");
}

static void resumable_job(void) {
    ended_job();
    char *dir = mem_printf("%s/jobs/%lld/attempt-1/checkpoint", rig.dir, (long long)job);
    char *path = file_join(dir, "checkpoint.db");
    rig_must(file_make_dirs(dir, &err), &err, "a folder");
    rig_must(file_replace(path, "x", 1, &err), &err, "a checkpoint");
    mem_free(path);
    mem_free(dir);
}

static void job_with_output(void) {
    queued_job();
    int attempt = rig_run_job(&rig, job);
    char *dir = mem_printf("%s/jobs/%lld/attempt-1/out", rig.dir, (long long)job), *path = file_join(dir, "a.png");
    rig_must(file_make_dirs(dir, &err), &err, "a folder");
    rig_must(file_replace(path, "abc", 3, &err), &err, "an output");
    for (int i = 0; i < 2; i++)
        rig_must(store_output_put(rig.store, job, attempt, EVENT_OUTPUT, i ? "b.png" : "a.png", 3, RIG_SCENE,
                                  "image/png", &err),
                 &err, "store_output_put");
    mem_free(path);
    mem_free(dir);
}

static void new_bytes(void) {
    static long number;
    number++;
    memset(bytes, 'x', sizeof bytes);
    memcpy(bytes + 100, &number, sizeof number);
}

static void unused_scene(void) {
    static int number;
    bool existed;
    snprintf(scene, sizeof scene, "%08x%s", ++number, RIG_SCENE + 8);
    rig_must(store_scene_add(rig.store, scene, "room", 10, 0, &existed, &err), &err, "store_scene_add");
    rig_must(store_scene_ready(rig.store, scene, NULL, "{}", &err), &err, "store_scene_ready");
}

static void rig_scene_again(void) { strcpy(scene, RIG_SCENE); }

#define TUS "Tus-Resumable: 1.0.0\r\n"

static void new_upload(void) {
    struct buf reply;
    new_bytes();
    CHECK(ask("POST", "/v1/uploads", TUS "Upload-Length: 600\r\n", "", 0, &reply) == 201);
    const char *location = strstr(buf_text(&reply), "\r\nLocation: /v1/uploads/");
    CHECK(location && sscanf(location + 24, "%32[0-9a-f]", upload) == 1);
    buf_release(&reply);
}

/* Jobs, a scene and an upload that are to go, and are in doubt: what has expired is removed as far as it can be. */
static void expired_things(void) {
    new_upload();
    unused_scene();
    ended_job();
    rig_must(store_retention_set_periods(rig.store, 1, 1, 1, &err), &err, "store_retention_set_periods");
    usleep(3000);
}

/* --- requests, in this order --------------------------------------------------------------------------- */

#define JSON "Content-Type: application/json\r\nIf-Match: *\r\n"
#define PART TUS "Content-Type: application/offset+octet-stream\r\nUpload-Offset: 0\r\n"
#define PART_CHECKED PART "Upload-Checksum: sha256 "

static const struct step {
    const char *method, *path, *fields, *body; /* NULL: UPLOADED bytes */
    void (*before)(void);                      /* each time; NULL: nothing */
    bool is_tolerant;                          /* it may do without: an empty stream, say */
} steps[] = {
    {"GET", "/readyz", "", "", NULL, false},
    {"GET", "/metrics", "", "", NULL, false},
    {"GET", "/v1/session", "", "", NULL, false},
    {"POST", "/v1/scenes?name=x", "", NULL, new_bytes, false},
    {"GET", "/v1/scenes", "", "", unused_scene, false},
    {"GET", "/v1/scenes/{s}", "", "", NULL, false},
    {"GET", "/v1/scenes/00112233", "", "", queued_job, false},
    {"PATCH", "/v1/scenes/{s}", JSON, "{\"name\":\"y\",\"pinned\":false}", NULL, false},
    {"DELETE", "/v1/scenes/{s}?dry_run=1", "", "", NULL, false},
    {"DELETE", "/v1/scenes/{s}", "", "", unused_scene, false},
    {"GET", "/v1/version", "", "", rig_scene_again, false},
    {"POST", "/v1/uploads", TUS "Upload-Length: 600\r\n", "", NULL, false},
    {"GET", "/v1/uploads", "", "", new_upload, false},
    {"GET", "/v1/uploads/{u}", "", "", NULL, false},
    {"PATCH", "/v1/uploads/{u}", JSON, "{\"pinned\":true}", NULL, false},
    {"PATCH", "/v1/uploads/{u}", PART, NULL, new_upload, false},
    {"PATCH", "/v1/uploads/{u}", PART_CHECKED "ungWv48Bz+pBQUDeXa4iI7ADYaOWF3qctBD/YfIAFa0=\r\n", "abc", new_upload,
     false},
    {"DELETE", "/v1/uploads/{u}?dry_run=1", TUS, "", new_upload, false},
    {"DELETE", "/v1/uploads/{u}", TUS, "", new_upload, false},
    {"POST", "/v1/jobs", JSON, "{\"scene\":\"" RIG_SCENE "\"}", queued_job, false},
    {"POST", "/v1/jobs", JSON "Idempotency-Key: k\r\n",
     "{\"scene\":\"00112233\",\"webhook\":"
     "{\"url\":\"http://x/\",\"secret\":\"0123456789abcdef\"}}",
     NULL, false},
    {"POST", "/v1/jobs?dry_run=1", JSON, "{\"scene\":\"" RIG_SCENE "\"}", NULL, false},
    {"GET", "/v1/jobs", "", "", NULL, false},
    {"GET", "/v1/jobs?state=queued&limit=1", "", "", NULL, false},
    {"GET", "/v1/jobs/{j}", "", "", NULL, false},
    {"GET", "/v1/jobs/{j}?wait=1", "If-None-Match: \"rev-1\"\r\n", "", ended_job, false},
    {"PATCH", "/v1/jobs/{j}", JSON, "{\"name\":\"n\",\"order\":\"first\"}", queued_job, false},
    {"POST", "/v1/jobs/{j}/pause", "", "", queued_job, false},
    {"POST", "/v1/jobs/{j}/resume", "", "", queued_job, false},
    {"POST", "/v1/jobs/{j}/cancel", "", "", queued_job, false},
    {"POST", "/v1/jobs/{j}/retry?from=refine", "", "", ended_job, false},
    {"POST", "/v1/jobs/{j}/extend", JSON, "{\"looks\":60}", resumable_job, false},
    {"GET", "/v1/jobs/{j}/log", "", "", queued_job, false},
    {"GET", "/v1/jobs/{j}/outputs", "", "", job_with_output, false},
    {"GET", "/v1/jobs/{j}/outputs/a.png", "", "", job_with_output, false},
    {"GET", "/v1/jobs/{j}/events?after=0&follow=0", "", "", queued_job, true},
    {"GET", "/v1/jobs/{j}/events?after=0&follow=0", "", "", ended_job, true},
    {"GET", "/v1/jobs/{j}/events?follow=0", "", "", queued_job, true},
    {"GET", "/v1/events?after=0&follow=0", "", "", NULL, true},
    {"GET", "/v1/events?follow=0", "", "", NULL, true},
    {"DELETE", "/v1/jobs/{j}?dry_run=1", "", "", resumable_job, false},
    {"DELETE", "/v1/jobs/{j}", "", "", resumable_job, false},
    {"POST", "/v1/collect?dry_run=1", "", "", expired_things, false},
    {"POST", "/v1/collect?dry_run=0", "", "", expired_things, true},
};

/* With a token that there is. */
static char login[TOKEN_SIZE + 20];
static const struct step login_step = {"POST", "/v1/session", JSON, login, NULL, false};

/* Its n-th call of SQLite, or of the system, fails; false where it has fewer. */
static bool strike(const struct step *step, bool is_sql, long n) {
    struct buf reply;
    if (step->before)
        step->before();
    if (is_sql)
        sql_faults_arm(n);
    else
        system_faults_arm(n);
    int status = ask(step->method, step->path, step->fields, step->body ? step->body : bytes,
                     step->body ? strlen(step->body) : UPLOADED, &reply);
    bool struck = is_sql ? sql_faults_lift() : system_faults_lift(), is_done = status / 100 == 2;
    enum status fault = is_sql ? sql_fault->status : system_fault == ENOSPC ? STATUS_NO_SPACE : STATUS_IO;
    /* For what frees space or stops work, room is made on a full disk; not all that is done to files must be. */
    bool frees = strcmp(step->method, "DELETE") == 0 || strstr(step->path, "/pause") || strstr(step->path, "/cancel");
    bool may_be_done = step->is_tolerant || !is_sql || (fault == STATUS_NO_SPACE && frees);
    int wanted = strcmp(step->path, "/readyz") == 0 ? 503 : problem_status(fault);
    const char *what = is_sql ? "SQLite" : "the system";
    if (struck)
        CHECK_THAT(status == wanted || (may_be_done && is_done), "%s %s, call %ld of %s: %d, not %d: %s", step->method,
                   step->path, n, what, status, wanted, buf_text(&reply));
    else
        CHECK_THAT(is_done, "%s %s: %d: %s", step->method, step->path, status, buf_text(&reply));
    CHECK_THAT(is_done || strstr(buf_text(&reply), "\"detail\":\""), "%s %s, call %ld of %s: no sentence", step->method,
               step->path, n, what);
    buf_release(&reply);
    return struck;
}

static long strike_each(const struct step *step, bool is_sql) {
    long calls = 0;
    for (long n = 1; strike(step, is_sql, n) && check_failed_count == 0; n++)
        calls++;
    return calls;
}

static long strike_all(bool is_sql) {
    long calls = 0;
    for (size_t i = 0; i < sizeof steps / sizeof *steps && check_failed_count == 0; i++)
        calls += strike_each(&steps[i], is_sql);
    return calls;
}

static void check_refusals(void) {
    static const struct {
        const char *method, *path, *fields, *body;
        int status;
    } bad[] = {
        {"POST", "/v1/session", JSON, "{", 400},
        {"POST", "/v1/session", JSON, "{\"token\":7}", 400},
        {"POST", "/v1/session", JSON, "{}", 400},
        {"GET", "/v1/jobs/{j}/log?bytes=0", "", "", 400},
        {"GET", "/v1/jobs/{j}/outputs/a.png", "Range: bytes=10-\r\n", "", 416},
        {"DELETE", "/v1/jobs/{j}?dry_run=1", "", "", 409},
        {"POST", "/v1/jobs/{j}/extend", JSON, "{", 400},
        {"POST", "/v1/jobs/{j}/extend", JSON, "[]", 400},
        {"POST", "/v1/jobs/{j}/extend", JSON, "{\"time_limit_sec\":1,\"seed\":2}", 400},
        {"POST", "/v1/jobs", JSON, "{\"scene\":\"" RIG_SCENE "\",\"shared\":7}", 422},
        {"POST", "/v1/collect?dry_run=2", "", "", 400},
        {"GET", "/v1/uploads?sha256=x", "", "", 400},
        {"GET", "/v1/uploads?cursor=x", "", "", 400},
        {"POST", "/v1/scenes", "Repr-Digest: x\r\n", "archive", 400},
    };
    job_with_output();
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) {
        struct buf reply;
        int status = ask(bad[i].method, bad[i].path, bad[i].fields, bad[i].body, strlen(bad[i].body), &reply);
        CHECK_THAT(status == bad[i].status && strstr(buf_text(&reply), "\"detail\":\""), "%s %s (%s): %d, not %d",
                   bad[i].method, bad[i].path, bad[i].body, status, bad[i].status);
        buf_release(&reply);
    }
}

static void check_answer(const char *method, const char *path, const char *fields, const char *body, int wanted,
                         const char *word) {
    struct buf reply;
    int status = ask(method, path, fields, body, strlen(body), &reply);
    CHECK_THAT(status == wanted && strstr(buf_text(&reply), word), "%d, not %d with \"%s\": %s", status, wanted, word,
               buf_text(&reply));
    buf_release(&reply);
}

static void check_metadata(void) {
    char *fields = mem_printf(TUS "Upload-Length: 1\r\nUpload-Metadata: name %0996d\r\n", 0);
    check_answer("POST", "/v1/uploads", fields, "", 400, "longer than 1000 bytes");
    mem_free(fields);
}

/* What the database has as a job's settings makes no sense: that is no fault of the client's. */
static void check_garbled(void) {
    static const char *const settings[] = {"{", "[]", "{\"no_such\":1}"};
    bool replayed;
    for (size_t i = 0; i < sizeof settings / sizeof *settings; i++) {
        struct job_new new = {
            .scene_id = RIG_SCENE, .name = "job", .labels = "{}", .settings = settings[i], .max_attempts = 2};
        rig_must(store_job_add(rig.store, &new, 1000, &job, &replayed, &err), &err, "store_job_add");
        check_answer("POST", "/v1/jobs/{j}/extend", JSON, "{\"looks\":60}", 500, "log has details");
    }
}

/* The HTTP side starts, or says why not. */
static bool start_once(bool is_sql, long n) {
    struct api_config config = {.data_dir = rig.dir,
                                .max_attempts = 2,
                                .queue_limit = 50,
                                .max_upload_bytes = 8 << 20,
                                .max_streams = 9,
                                .keepalive_sec = 60,
                                .upload_keep_ms = 3600000};
    struct listener_config network = {.address = "127.0.0.1", .connection_max = 9, .limits = rig_patient};
    struct api *api;
    struct listener *listener;
    err = (struct error){0};
    faults_are_off = false;
    if (is_sql)
        sql_faults_arm(n);
    else
        system_faults_arm(n);
    enum status status = service_new(&api, &config, rig.store, rig.scheduler, &err);
    if (status == STATUS_OK)
        status = service_listen(&listener, &network, api, &err);
    bool struck = is_sql ? sql_faults_lift() : system_faults_lift(), has_begun = status == STATUS_OK;
    faults_are_off = true;
    CHECK_THAT(has_begun ? true : struck && err.status == status && *err.message, "a start, call %ld: %s", n,
               err.message);
    if (has_begun) {
        listener_quiesce(listener);
        listener_stop(listener);
    }
    service_free(api);
    return struck;
}

static long strike_start(void) {
    struct scheduler_config work = {.data_dir = rig.dir, .max_running = 1};
    long calls = 0;
    snprintf(rig.dir, sizeof rig.dir, "%s/unbake-rig-XXXXXX", check_fast_dir());
    CHECK(mkdtemp(rig.dir) != NULL);
    rig_must(store_open(&rig.store, rig.dir, &err), &err, "store_open");
    rig_must(scheduler_new(&rig.scheduler, &work, rig.store, &err), &err, "scheduler_new");
    for (int is_sql = 0; is_sql < 2; is_sql++)
        for (long n = 1; start_once(is_sql, n) && check_failed_count == 0; n++)
            calls++;
    scheduler_free(rig.scheduler);
    store_close(rig.store);
    rig_must(file_remove_tree(rig.dir, &err), &err, "file_remove_tree");
    return calls;
}

int main(void) {
    char token[TOKEN_SIZE];
    int64_t id;
    log_set_level(LOG_ERROR);
    faults_are_off = true; /* in this thread */
    long calls = strike_start();
    rig_start(&rig, &rig_patient, 60.0);
    log_set_level(LOG_ERROR);
    rig.api->config.queue_limit = 100000;
    check_refusals();
    check_metadata();
    check_garbled();
    calls += strike_all(true) + strike_all(false);
    rig_must(store_retention_set_periods(rig.store, 0, 0, 3600000, &err), &err, "store_retention_set_periods");
    rig_must(store_token_add(rig.store, "root", ROLE_ADMIN, 0, token, &id, &err), &err, "token");
    snprintf(token_field, sizeof token_field, "Authorization: Bearer %s\r\n", token);
    snprintf(login, sizeof login, "{\"token\":\"%s\"}", token);
    rig.api->config.user_max_bytes = (uint64_t)1 << 30;
    calls += strike_all(true) + strike_each(&login_step, true);
    printf("%ld calls failed\n", calls);
    rig_stop(&rig);
    return check_result();
}
