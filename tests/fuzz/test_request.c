/* test_request.c -- whole requests, from the head that libmicrohttpd has taken apart to the last byte
 * of the reply: every route with its query, fields and body, over a real store.
 *
 *   input:  O|T                       is the daemon open, or does it ask for tokens?
 *           METHOD TARGET\n
 *           Name: value\n ...         $TOKEN stands for a valid token
 *           \n
 *           body
 *
 * The store is made anew after what has changed it, so each input meets the same jobs and scenes. */
#include "server/http/routes.h"

#include <sys/stat.h>
#include <unistd.h>

#include "common/file.h"
#include "common/log.h"
#include "common/mem.h"
#include "common/protocol.h"
#include "common/sha256.h"
#include "server/http/auth.h"
#include "server/http/service.h"
#include "server/transport/head.h"
#include "server/transport/listener.h"
#include "tests/fuzz/fuzz.h"

#define SCENE "00112233445566778899aabbccddeeff00112233445566778899aabbccddeeff"
#define UPLOAD "0123456789abcdef0123456789abcdef"
#define READS_MAX 50

static struct {
    char dir[128];
    struct store *store;
    struct scheduler *scheduler;
    struct api *api;
    char token[TOKEN_SIZE];
} lab;

/* --- the daemon ------------------------------------------------------------------------------ */

static void put_file(const char *name, const char *text) {
    char *path = file_join(lab.dir, name), *slash = strrchr(path, '/');
    struct error err;
    *slash = '\0';
    MUST_OK(file_make_dirs(path, &err), &err);
    *slash = '/';
    fuzz_write(path, (const uint8_t *)text, strlen(text));
    mem_free(path);
}

/* Job 1 has succeeded with an output, job 2 runs, job 3 is queued, job 4 is paused. */
static void add_jobs(struct error *err) {
    static const char text[] = "0123456789";
    char digest[SHA256_HEX_SIZE];
    int64_t id;
    bool replayed;
    int attempt;
    struct job_new job = {
        .scene_id = SCENE, .name = "job", .labels = "{\"a\":\"b\"}", .settings = "{}", .max_attempts = 2};
    for (int i = 0; i < 4; i++)
        MUST_OK(store_job_add(lab.store, &job, 100, &id, &replayed, err), err);
    MUST_OK(store_job_start(lab.store, 1, "process", &attempt, err), err);
    sha256_of(text, strlen(text), digest);
    put_file("jobs/1/attempt-1/out/preview/a.png", text);
    put_file("jobs/1/worker.log", "a line\nanother\n");
    put_file("jobs/1/checkpoint.db", "");
    MUST_OK(
        store_output_put(lab.store, 1, attempt, EVENT_OUTPUT, "preview/a.png", strlen(text), digest, "image/png", err),
        err);
    MUST_OK(store_job_succeed(lab.store, 1, attempt, "", err), err);
    MUST_OK(store_job_start(lab.store, 2, "process", &attempt, err), err);
    MUST_OK(store_job_pause(lab.store, 4, err), err);
}

static void add_upload(struct error *err) {
    struct upload_row row = {.length = 100, .name = (char *)"room", .metadata = (char *)""};
    struct sha256 hash;
    sha256_init(&hash);
    memcpy(row.id, UPLOAD, sizeof UPLOAD);
    MUST_OK(store_upload_add(lab.store, &row, &hash, sizeof hash, &(struct count_limits){.all = 100}, err), err);
    put_file("uploads/" UPLOAD, "");
}

static void start_daemon(void) {
    static const struct api_library libraries[] = {{"SQLite", "3"}};
    struct error err;
    bool existed;
    int64_t token_id;
    log_set_level(LOG_ERROR);
    snprintf(lab.dir, sizeof lab.dir, "%s/data", fuzz_folder());
    MUST_OK(file_make_dirs(lab.dir, &err), &err);
    put_file("reserve", ""); /* or 16 MiB would be put there each time */
    MUST_OK(store_open(&lab.store, lab.dir, &err), &err);
    MUST_OK(store_scene_add(lab.store, SCENE, "room", 10, 0, &existed, &err), &err);
    MUST_OK(store_scene_ready(lab.store, SCENE, NULL, "{\"triangle_count\":12}", &err), &err);
    put_file("scenes/" SCENE "/archive", "0123456789");
    add_jobs(&err);
    add_upload(&err);
    MUST_OK(store_token_add(lab.store, "ada", ROLE_USER, 0, lab.token, &token_id, &err), &err);
    struct scheduler_config work = {
        .data_dir = lab.dir, .max_running = 1, .checkpoint_interval_sec = 60, .stop_grace_sec = 1};
    MUST_OK(scheduler_new(&lab.scheduler, &work, lab.store, &err), &err);
    struct api_config config = {.data_dir = lab.dir,
                                .max_attempts = 2,
                                .queue_limit = 50,
                                .max_upload_bytes = 1 << 20,
                                .user_max_bytes = 1 << 21,
                                .max_streams = 5,
                                .keepalive_sec = 15,
                                .upload_keep_ms = 3600000,
                                .server_names = "lab.example.org",
                                .libraries = libraries,
                                .library_count = 1};
    MUST_OK(service_new(&lab.api, &config, lab.store, lab.scheduler, &err), &err);
}

static void stop_daemon(void) {
    service_free(lab.api);
    scheduler_free(lab.scheduler);
    store_close(lab.store);
    file_remove_tree(lab.dir, NULL);
    lab.api = NULL;
}

/* --- the request ----------------------------------------------------------------------------- */

/* As callbacks.c's take_method does it. */
static void take_method(struct request *r, const char *word) {
    static const char *const names[METHOD_COUNT] = {"GET", "POST", "PATCH", "DELETE", "OPTIONS", "PUT"};
    r->is_head = strcmp(word, "HEAD") == 0;
    r->method = METHOD_GET;
    while (!r->is_head && r->method < METHOD_COUNT && strcmp(word, names[r->method]) != 0)
        r->method++;
}

static void add_field(struct request *r, const char *name, const char *value) {
    r->fields = mem_realloc_array(r->fields, r->field_count + 1, sizeof *r->fields);
    struct field *field = &r->fields[r->field_count++];
    const char *token = strstr(value, "$TOKEN");
    field->name = mem_strdup(name);
    field->value =
        token ? mem_printf("%.*s%s%s", (int)(token - value), value, lab.token, token + 6) : mem_strdup(value);
}

/* Takes the head off *text, line by line; the body is what is left. */
static enum status read_head(struct request *r, char **text, struct error *err) {
    char *line = strsep(text, "\n"), *target = strchr(line, ' ');
    if (target)
        *target++ = '\0';
    take_method(r, line);
    enum status status = target_parse(&r->target, target ? target : "", err);
    while (*text && (line = strsep(text, "\n")) != NULL && *line) {
        char *colon = strchr(line, ':');
        if (colon)
            *colon++ = '\0';
        add_field(r, line, colon ? colon + (*colon == ' ') : "");
    }
    head_request_id(r);
    return status;
}

/* The body comes in two pieces. */
static struct response *send_body(struct request *r, const char *body, size_t length) {
    struct response *reply = NULL;
    size_t half = length / 2;
    const char *piece[2] = {body, body + half};
    const size_t size[2] = {half, length - half};
    for (int i = 0; i < 2 && !reply; i++)
        if (size[i] > 0)
            reply = routes_data(lab.api, r, piece[i], size[i]);
    return reply;
}

/* What exchange.c does with a request. */
static struct response *serve(struct request *r, char *text, const char *end) {
    struct error err;
    char number[24];
    enum status status = read_head(r, &text, &err);
    size_t length = text ? (size_t)(end - text) : 0;
    bool is_chunked = request_field(r, "Transfer-Encoding") != NULL;
    if (length > 0 && !is_chunked && !request_field(r, "Content-Length")) {
        snprintf(number, sizeof number, "%zu", length);
        add_field(r, "Content-Length", number);
    }
    r->has_body = is_chunked || length > 0;
    r->content_length = is_chunked ? -1 : (int64_t)length; /* the library sees to it */
    struct response *reply = head_check(r, "HTTP/1.1", auth_is_open(lab.api) ? lab.api->config.server_names : NULL);
    if (!reply && status != STATUS_OK) {
        MUST(status == STATUS_INPUT);
        return NULL;
    }
    if (!reply)
        reply = routes_find(r);
    if (!reply)
        reply = routes_begin(lab.api, r);
    if (!reply && r->has_body)
        reply = send_body(r, text ? text : "", length);
    return reply ? reply : routes_finish(lab.api, r);
}

/* --- the reply ------------------------------------------------------------------------------- */

static void no_wake(void *waker) { (void)waker; }

static void check_fields(const struct response *reply) {
    for (size_t i = 0; i < reply->field_count; i++)
        for (const char *at = reply->fields[i].value; *at; at++)
            MUST((unsigned char)*at >= 0x20 && *at != 0x7f);
}

static void check_body(const struct response *reply) {
    struct stat info;
    cJSON *value = NULL;
    const char *type = reply->field_count > 0 ? reply->fields[0].value : "";
    if (reply->fd >= 0)
        MUST(fstat(reply->fd, &info) == 0 && reply->offset + reply->length <= (uint64_t)info.st_size);
    if (reply->text && (strcmp(type, MIME_JSON) == 0 || strcmp(type, MIME_PROBLEM) == 0))
        MUST(json_parse(reply->text, reply->length, "the reply", &value, NULL) == STATUS_OK);
    cJSON_Delete(value);
}

static void read_stream(struct stream *stream) {
    char chunk[1000];
    ssize_t got = 1;
    stream->wake = no_wake;
    for (int i = 0; i < READS_MAX && got > 0; i++) {
        got = stream->read(stream, chunk, sizeof chunk);
        MUST(got >= -1 && got <= (ssize_t)sizeof chunk);
        if (got == 0 && stream->fill(stream))
            got = 1;
    }
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    struct request r = {0};
    if (size < 2)
        return 0;
    if (!lab.api)
        start_daemon();
    lab.api->config.access = data[0] == 'T' ? API_ACCESS_TOKENS : API_ACCESS_OPEN;
    char *text = fuzz_text(data + 1, size - 1);
    struct response *reply = serve(&r, text, text + size - 1);
    bool is_changed = r.method != METHOD_GET && reply && reply->status < 300;
    if (reply) {
        MUST(reply->status >= 200 && reply->status <= 599 && reply->status != 500);
        check_fields(reply);
        check_body(reply);
        if (reply->stream)
            read_stream(reply->stream);
    }
    response_free(reply);
    routes_drop_body(&r);
    request_release(&r);
    free(text);
    if (is_changed)
        stop_daemon();
    return 0;
}

/* --- seeds ----------------------------------------------------------------------------------- */

#define HOST "Host: localhost\n"
#define TUS "Tus-Resumable: 1.0.0\n"
#define JSON "Content-Type: application/json\n"

void fuzz_seeds(struct seeds *s) {
    static const char *const requests[] = {
        "OGET /v1/jobs?state=queued&limit=2&cursor=4\n" HOST,
        "OGET /v1/jobs/1\n" HOST "If-None-Match: \"rev-3\"\n",
        "OGET /v1/jobs/3?wait=5\n" HOST "If-None-Match: \"rev-1\"\n",
        "OHEAD /v1/jobs/1/outputs/preview/a.png\n" HOST "Range: bytes=2-5\nIf-Range: \"sha256-x\"\n",
        "OGET /v1/jobs/1/outputs/preview%2Fa.png\n" HOST "Range: bytes=-3\n",
        "OGET /v1/jobs/1/outputs\n" HOST,
        "OGET /v1/jobs/1/log?bytes=8\n" HOST,
        "OGET /v1/jobs/1/events?follow=0\n" HOST "Last-Event-ID: 2\nAccept: application/x-ndjson\n",
        "OGET /v1/events?after=0&wait=3\n" HOST "Accept: text/event-stream\n",
        "OPOST /v1/jobs\n" HOST JSON
        "Idempotency-Key: k-1\n\n{\"scene\": \"00112233\", \"name\": \"x\", \"priority\": 5,"
        " \"labels\": {\"a\": \"b\"}, \"shared\": true, \"settings\": {\"texture_size\": 2048, \"method\": \"listing1\"},"
        " \"webhook\": {\"url\": \"https://lab.example.org/h\", \"secret\": \"0123456789abcdef\"}}",
        "OPOST /v1/jobs?dry_run=1\n" HOST JSON "\n{\"scene\": \"" SCENE "\", \"settings\": {\"seed\": 7}}",
        "OPATCH /v1/jobs/3\n" HOST "Content-Type: application/merge-patch+json\nIf-Match: \"rev-1\"\n\n"
        "{\"order\": \"first\", \"pinned\": true, \"expires_at\": \"2030-01-01T00:00:00Z\", \"priority\": -3}",
        "OPATCH /v1/jobs/3\n" HOST JSON "If-Match: *\n\n{\"order\": 4, \"expires_at\": null, \"name\": \"y\"}",
        "OPOST /v1/jobs/2/cancel\n" HOST,
        "OPOST /v1/jobs/3/pause\n" HOST,
        "OPOST /v1/jobs/4/resume\n" HOST,
        "OPOST /v1/jobs/1/retry?from=report\n" HOST,
        "ODELETE /v1/jobs/1?dry_run=1\n" HOST,
        "ODELETE /v1/jobs/1\n" HOST,
        "OPOST /v1/jobs/1/extend\n" HOST JSON "\n{\"iterations\": 500}",
        "OPOST /v1/jobs/1/extend\n" HOST JSON "\n{\"time_limit_sec\": 60.5}",
        "OGET /v1/scenes?limit=1&cursor=1800000000000-00ff\n" HOST,
        "OGET /v1/scenes/00112233\n" HOST,
        "OPATCH /v1/scenes/" SCENE "\n" HOST JSON "If-Match: *\n\n{\"name\": \"z\", \"pinned\": false}",
        "ODELETE /v1/scenes/" SCENE "\n" HOST,
        "OPOST /v1/scenes?name=kitchen\n" HOST "Content-Type: application/octet-stream\n"
        "Repr-Digest: sha-256=:ungWv48Bz+pBQUDeXa4iI7ADYaOWF3qctBD/YfIAFa0=:\n\nabc",
        "OPOST /v1/scenes\n" HOST "Transfer-Encoding: chunked\n"
        "X-Content-SHA256: ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad\n\nabc",
        "OPOST /v1/uploads\n" HOST TUS "Upload-Length: 100\nUpload-Metadata: name cm9vbQ==,filename YS56aXA=,is\n",
        "OGET /v1/uploads?sha256=" SCENE "&limit=3&cursor=1800000000000-00ff\n" HOST,
        "OHEAD /v1/uploads/" UPLOAD "\n" HOST TUS,
        "ODELETE /v1/uploads/" UPLOAD "?dry_run=1\n" HOST TUS,
        "OPATCH /v1/uploads/" UPLOAD "\n" HOST TUS "Upload-Offset: 0\nContent-Type: application/offset+octet-stream\n"
        "Upload-Checksum: sha1 qZk+NkcGgWq6PiVxeFDCbJzQ2J0=\n\nabc",
        "OPATCH /v1/uploads/" UPLOAD "\n" HOST TUS "Upload-Offset: 0\nContent-Type: application/offset+octet-stream\n"
        "Upload-Checksum: sha256 ungWv48Bz+pBQUDeXa4iI7ADYaOWF3qctBD/YfIAFa0=\n\nabc",
        "OPOST /v1/uploads/" UPLOAD "\n" HOST TUS "X-HTTP-Method-Override: DELETE\n",
        "OOPTIONS /v1/uploads\n" HOST,
        "OPOST /v1/collect?dry_run=1\n" HOST,
        "TGET /v1/session\n" HOST "Authorization: Bearer $TOKEN\n",
        "TGET /v1/jobs\n" HOST "Cookie: a=b; unbake_token=$TOKEN\n",
        "TPOST /v1/session\n" HOST JSON "X-Forwarded-Proto: https\n\n{\"token\": \"unbake_1_x\"}",
        "TDELETE /v1/session\n" HOST,
        "TPOST /v1/jobs/3/cancel\n" HOST
        "Authorization: Bearer $TOKEN\nOrigin: http://localhost\nX-Request-Id: abc-1\n",
        "OGET /metrics\n" HOST,
        "OGET /readyz\n" HOST,
        "OGET /v1/version\n" HOST,
        "OGET /v1/settings\n" HOST,
        "OGET /openapi.json\n" HOST,
        "OGET /\n" HOST "Expect: 100-continue\n",
        "OBREW /v1/jobs\nHost: [::1]:80\n",
    };
    s->mutants = 1500;
    for (size_t i = 0; i < sizeof requests / sizeof *requests; i++)
        seeds_text(s, requests[i]);
}
