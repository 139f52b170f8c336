/* The side of the daemon that nodes talk to: one claim, the attempt's own token and no other, reports that may be
 * repeated and have no gaps, files that are whole or not there, and nothing after the end. */
#include <sys/stat.h>

#include "common/sha256.h"
#include "common/source_digest.h"
#include "server/data/layout.h"
#include "server/net/field.h"
#include "server/store/remote.h"
#include "tests/api/rig.h"

#define TOKEN "secret-of-this-attempt"
#define ANN "Authorization: Bearer " TOKEN "\r\nUnbake-Claimant: 00112233445566778899\r\n"
#define BOB "Authorization: Bearer " TOKEN "\r\nUnbake-Claimant: ffffffffffffffffffff\r\n"

static char version[128]; /* a claim by a node of this version */
static int64_t job;
static int number;
static struct buf reply;

/* A request to the attempt; its reply stays in `reply`. */
static int ask(const struct rig *rig, const char *method, const char *path, const char *fields, const void *body,
               size_t length) {
    char *head = mem_printf("%s /v1/attempts/%lld/%d/%s HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n"
                            "Content-Length: %zu\r\n%s\r\n",
                            method, (long long)job, number, path, length, fields);
    struct buf text;
    buf_init(&text, (size_t)16 << 20);
    buf_puts(&text, head);
    buf_append(&text, body, length);
    buf_release(&reply);
    int status = rig_ask(rig, text.data, text.length, &reply);
    buf_release(&text);
    mem_free(head);
    return status;
}

static int post(const struct rig *rig, const char *path, const char *who, const char *json) {
    char *fields = mem_printf("%sContent-Type: application/json\r\n", who);
    int status = ask(rig, "POST", path, fields, json, strlen(json));
    mem_free(fields);
    return status;
}

/* Sends a file with the digest of `claimed`. */
static int put(const struct rig *rig, const char *path, const char *who, const char *body, const char *claimed) {
    char hex[SHA256_HEX_SIZE], digest[64];
    sha256_of(claimed, strlen(claimed), hex);
    field_digest_format(hex, digest);
    char *fields = mem_printf("%sRepr-Digest: %s\r\nContent-Type: application/octet-stream\r\n", who, digest);
    int status = ask(rig, "PUT", path, fields, body, strlen(body));
    mem_free(fields);
    return status;
}

#define IS(call, wanted)                                                                                               \
    do {                                                                                                               \
        int status_of_call = (call);                                                                                   \
        CHECK_THAT(status_of_call == (wanted), "%d, not %d: %s", status_of_call, wanted, buf_text(&reply));            \
    } while (0)
#define SAYS(text) CHECK_THAT(strstr(rig_body(&reply), text) != NULL, "no %s in %s", text, buf_text(&reply))

/* A job whose attempt waits to be claimed, with its folder and its order. */
static void begin(struct rig *rig) {
    struct error err;
    char hex[SHA256_HEX_SIZE];
    job = rig_job(rig);
    number = rig_run_job(rig, job);
    struct remote_row row = {.job_id = job, .number = number, .executor = "slurm", .lease_sec = 60};
    snprintf(row.name, sizeof row.name, "unbake-%lld-%d", (long long)job, number);
    sha256_of(TOKEN, strlen(TOKEN), hex);
    rig_must(store_remote_begin(rig->store, &row, hex, &err), &err, "store_remote_begin");
    char *dir = layout_attempt(rig->dir, job, number), *order = layout_order(dir), *out = layout_out(dir);
    char *checkpoint = layout_checkpoint_folder(dir);
    static const char text[] = "{\"kind\":\"reconstruct\",\"scene\":\"/secret/path\",\"settings\":{}}";
    rig_must(file_make_dirs(out, &err), &err, "out");
    rig_must(file_make_dirs(checkpoint, &err), &err, "checkpoint");
    rig_must(file_replace(order, text, strlen(text), &err), &err, "order");
    mem_free(checkpoint);
    mem_free(out);
    mem_free(order);
    mem_free(dir);
}

/* The content of a file of the attempt's folder; NULL: there is none. The caller's. */
static char *content(const struct rig *rig, const char *name) {
    char *dir = layout_attempt(rig->dir, job, number), *path = file_join(dir, name);
    struct buf text;
    struct error err;
    buf_init(&text, 1 << 20);
    enum status status = file_read(path, &text, &err);
    char *found = status == STATUS_OK ? mem_strdup(buf_text(&text)) : NULL;
    buf_release(&text);
    mem_free(path);
    mem_free(dir);
    return found;
}

#define HOLDS(name, wanted)                                                                                            \
    do {                                                                                                               \
        char *found_text = content(rig, name);                                                                         \
        CHECK_STRING(found_text ? found_text : "(absent)", wanted);                                                    \
        mem_free(found_text);                                                                                          \
    } while (0)

static void check_claims(struct rig *rig) {
    begin(rig);
    IS(post(rig, "report", ANN, "{\"seq\":1}"), 409); /* not before the claim */
    IS(ask(rig, "GET", "scene", ANN, "", 0), 409);
    IS(post(rig, "claim", "Unbake-Claimant: 00112233445566778899\r\n", version), 401);
    IS(post(rig, "claim", "Authorization: Bearer wrong\r\nUnbake-Claimant: 00112233445566778899\r\n", version), 401);
    IS(post(rig, "claim", "Authorization: Bearer " TOKEN "\r\n", version), 400);
    IS(post(rig, "claim", ANN, version), 200);
    SAYS("\"kind\":\"reconstruct\"");
    SAYS("\"lease_sec\":60");
    CHECK(!strstr(rig_body(&reply), "/secret/path"));
    IS(post(rig, "claim", ANN, version), 200); /* its reply was lost */
    IS(post(rig, "claim", BOB, version), 409);
    SAYS("claimed by another");
    IS(post(rig, "report", BOB, "{\"seq\":1}"), 409);
    IS(put(rig, "outputs/a.exr", BOB, "x", "x"), 409);
    IS(post(rig, "claim", BOB, "{\"version\":\"0.0.1\",\"host\":\"old\"}"), 409); /* does not end what is claimed */
    IS(post(rig, "report", ANN, "{\"seq\":1}"), 200);

    begin(rig);
    IS(post(rig, "claim", ANN, "{\"version\":\"0.0.1\",\"host\":\"old\"}"), 409);
    SAYS("unbaked on old has version 0.0.1, the daemon has " UNBAKE_VERSION " (sources ");
    IS(post(rig, "claim", ANN, version), 409);
    struct remote_row row;
    struct error err;
    CHECK(store_remote_get(rig->store, job, number, &row, &err) == STATUS_OK);
    CHECK_STRING(row.end.way, "refused");

    begin(rig);
    IS(post(rig, "claim", ANN, "{\"version\":\"" UNBAKE_VERSION " (sources 0123456789abcdef)\",\"host\":\"old\"}"),
       409);
    SAYS("has version " UNBAKE_VERSION " (sources 0123456789abcdef), the daemon has " UNBAKE_VERSION " (sources ");
}

static void check_lines(void *wanted, const char *lines) { CHECK_STRING(lines, (const char *)wanted); }

static void check_reports(struct rig *rig) {
    struct error err;
    begin(rig);
    IS(post(rig, "claim", ANN, version), 200);
    IS(post(rig, "report", ANN, "{\"seq\":2}"), 409); /* a gap */
    SAYS("does not follow");
    for (int i = 0; i < 2; i++) { /* the second: its reply was lost */
        IS(post(rig, "report", ANN, "{\"seq\":1,\"lines\":[\"{\\\"a\\\":1}\",\"two\"],\"cpu_sec\":3.5}"), 200);
        SAYS("\"do\":\"go_on\"");
        SAYS("\"last_seq\":1");
    }
    CHECK(store_remote_read(rig->store, job, number, check_lines, "{\"a\":1}\ntwo\n", &err) == STATUS_OK);
    CHECK(store_remote_read(rig->store, job, number, check_lines, "", &err) == STATUS_NOT_FOUND);
    CHECK(store_remote_request(rig->store, job, number, REMOTE_STOP, &err) == STATUS_OK);
    IS(post(rig, "report", ANN, "{\"seq\":2,\"lines\":[]}"), 200);
    SAYS("\"do\":\"stop\"");
    static const char *const bad[] = {"{}",
                                      "{\"seq\":0}",
                                      "{\"seq\":3,\"lines\":\"x\"}",
                                      "{\"seq\":3,\"lines\":[1]}",
                                      "{\"seq\":3,\"lines\":[\"a\\nb\"]}",
                                      "{\"seq\":3,\"cpu_sec\":-1}"};
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++)
        IS(post(rig, "report", ANN, bad[i]), 422);
    IS(post(rig, "end", ANN, "{\"seq\":3,\"way\":\"flew\"}"), 422);
    IS(post(rig, "end", ANN, "{\"seq\":3,\"way\":\"exit\",\"code\":700}"), 422);
    IS(post(rig, "end", ANN, "{\"seq\":5,\"way\":\"exit\"}"), 409);
    for (int i = 0; i < 2; i++)
        IS(post(rig, "end", ANN, "{\"seq\":3,\"way\":\"exit\",\"code\":85,\"last_words\":\"bye\"}"), 200);
    struct remote_row row;
    CHECK(store_remote_get(rig->store, job, number, &row, &err) == STATUS_OK);
    CHECK(row.end.code == 85 && row.cpu_sec == 3.5 && row.last_seq == 3);
    CHECK_STRING(row.end.log_tail, "bye");
    /* Nothing after the end. */
    IS(post(rig, "report", ANN, "{\"seq\":4}"), 409);
    IS(post(rig, "end", ANN, "{\"seq\":4,\"way\":\"exit\"}"), 409);
    IS(ask(rig, "GET", "checkpoint", ANN, "", 0), 409);
    IS(put(rig, "outputs/a.exr", ANN, "late", "late"), 409);
    IS(put(rig, "checkpoint/part-1?first=1", ANN, "late", "late"), 409);
    HOLDS("out/a.exr", "(absent)");
    HOLDS("checkpoint/part-1", "(absent)");
}

static void check_outputs(struct rig *rig) {
    begin(rig);
    IS(post(rig, "claim", ANN, version), 200);
    for (int i = 0; i < 2; i++)
        IS(put(rig, "outputs/preview/b_c.png", ANN, "picture", "picture"), 204);
    HOLDS("out/preview/b_c.png", "picture");
    IS(put(rig, "outputs/preview/b_c.png", ANN, "pictore", "picture"), 422);
    SAYS("Repr-Digest says");
    HOLDS("out/preview/b_c.png", "picture");
    IS(put(rig, "outputs/empty.exr", ANN, "", ""), 204);
    IS(put(rig, "log", BOB, "said\n", "said\n"), 409);
    IS(put(rig, "log", ANN, "said\n", "said\n"), 204);
    char *long_log = mem_calloc(65538, 1);
    memset(long_log, 'a', 65537);
    IS(put(rig, "log", ANN, long_log, long_log), 413);
    mem_free(long_log);
    HOLDS("out/empty.exr", "");
    IS(ask(rig, "PUT", "outputs/a.exr", ANN "Content-Type: application/octet-stream\r\n", "x", 1), 400);
    static const char *const bad[] = {"outputs/../job.json", "outputs/%2e%2e/job.json", "outputs/..%2fjob.json",
                                      "outputs/.hidden",     "outputs/a%2f..%2f..%2fb", "outputs/a//b",
                                      "outputs/%2fetc%2fx",  "outputs/a%00b",           "outputs/with%20blank.exr",
                                      "outputs/a%0ab"};
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) {
        int status = put(rig, bad[i], ANN, "evil", "evil");
        CHECK_THAT(status == 400 || status == 422, "%s: %d", bad[i], status);
    }
    HOLDS("job.json", "{\"kind\":\"reconstruct\",\"scene\":\"/secret/path\",\"settings\":{}}");
    /* Two lengths. */
    IS(ask(rig, "PUT", "outputs/a.exr",
           ANN "Repr-Digest: sha-256=:47DEQpj8HBSa+/TImW+5JCeuQeRkm5NMpJWZG3hSuFU=:\r\n"
               "Content-Type: application/octet-stream\r\nExpect: 100-continue\r\nContent-Length: 9000000\r\n",
           "", 0),
       400);
    /* More than an upload may have, and than uploads leave free: neither binds what a job makes. */
    uint64_t before = rig->api->config.min_free_bytes;
    char *large = mem_alloc((9 << 20) + 1);
    memset(large, 'x', 9 << 20);
    large[9 << 20] = '\0';
    rig->api->config.min_free_bytes = (uint64_t)1 << 60;
    IS(put(rig, "outputs/large.exr", ANN, large, large), 204);
    rig->api->config.min_free_bytes = before;
    mem_free(large);
}

static void check_checkpoints(struct rig *rig) {
    struct error err;
    begin(rig);
    char *dir = layout_attempt(rig->dir, job, number), *db = layout_checkpoint(dir);
    rig_must(file_replace(db, "database", 8, &err), &err, "checkpoint.db");
    IS(post(rig, "claim", ANN, version), 200);
    IS(ask(rig, "GET", "checkpoint", ANN, "", 0), 200);
    SAYS("\"name\":\"checkpoint.db\",\"bytes\":8,\"sha256\":\"");
    IS(ask(rig, "GET", "checkpoint/checkpoint.db", ANN "Range: bytes=4-\r\n", "", 0), 206);
    CHECK_STRING(rig_body(&reply), "base");
    IS(ask(rig, "GET", "checkpoint/..%2fjob.json", ANN, "", 0), 400);
    IS(ask(rig, "GET", "checkpoint/job.json", ANN, "", 0), 404);
    IS(put(rig, "checkpoint/checkpoint.db?first=1", ANN, "x", "x"), 422);
    IS(put(rig, "checkpoint/part-1", ANN, "x", "x"), 400);
    IS(put(rig, "checkpoint/part-1?first=2", ANN, "x", "x"), 400);
    IS(put(rig, "checkpoint/part-1?first=1", ANN, "x", "y"), 422);
    HOLDS("checkpoint/checkpoint.db", "database");
    IS(put(rig, "checkpoint/part-1?first=1", ANN, "one", "one"), 204);
    HOLDS("checkpoint/checkpoint.db", "(absent)");
    IS(put(rig, "checkpoint/part-2?first=1", ANN, "two", "two"), 204);
    IS(put(rig, "checkpoint/part-3?first=2", ANN, "three", "three"), 204);
    HOLDS("checkpoint/part-1", "(absent)");
    HOLDS("checkpoint/part-2", "two");
    HOLDS("checkpoint/part-3", "three");
    mem_free(db);
    mem_free(dir);
}

static void check_scene(struct rig *rig) {
    struct error err;
    char *scene = layout_scene(rig->dir, RIG_SCENE), *files = layout_files(scene), *images = file_join(files, "images");
    char *a = file_join(files, "transforms.json"), *b = file_join(images, "0 1.png"), *list = layout_file_list(scene);
    char *link = file_join(files, "link"), hex[SHA256_HEX_SIZE];
    rig_must(file_make_dirs(images, &err), &err, "images");
    rig_must(file_replace(a, "{}", 2, &err), &err, "a");
    rig_must(file_replace(b, "0123456789", 10, &err), &err, "b");
    CHECK(symlink("/etc/passwd", link) == 0);
    begin(rig);
    IS(post(rig, "claim", ANN, version), 200);
    IS(ask(rig, "GET", "scene", ANN, "", 0), 200);
    sha256_of("0123456789", 10, hex);
    SAYS("\"scene_id\":\"" RIG_SCENE "\"");
    SAYS("\"name\":\"images/0 1.png\",\"bytes\":10");
    SAYS(hex);
    CHECK(!strstr(rig_body(&reply), "link") && access(list, F_OK) == 0);
    IS(ask(rig, "GET", "scene/images/0%201.png", ANN "Range: bytes=3-\r\n", "", 0), 206);
    CHECK_STRING(rig_body(&reply), "3456789");
    IS(ask(rig, "GET", "scene/images%2f0%201.png", ANN, "", 0), 200);
    IS(ask(rig, "GET", "scene/images%2f0%201.png", BOB, "", 0), 409);
    CHECK(ask(rig, "GET", "scene/link", ANN, "", 0) >= 400);
    CHECK(ask(rig, "GET", "scene/..%2farchive", ANN, "", 0) == 400);
    /* What is kept of digests does not outlive a change of the file. */
    rig_must(file_replace(b, "9876543210", 10, &err), &err, "b");
    IS(ask(rig, "GET", "scene", ANN, "", 0), 200);
    CHECK(!strstr(rig_body(&reply), hex));
    mem_free(link);
    mem_free(list);
    mem_free(b);
    mem_free(a);
    mem_free(images);
    mem_free(files);
    mem_free(scene);
}

/* A user's token, an admin's even, is not an attempt's; and the other way round. */
static void check_tokens(struct rig *rig) {
    char token[TOKEN_SIZE], fields[256];
    struct error err;
    int64_t id;
    begin(rig);
    rig_must(store_token_add(rig->store, "root", ROLE_ADMIN, 0, token, &id, &err), &err, "store_token_add");
    snprintf(fields, sizeof fields, "Authorization: Bearer %s\r\nUnbake-Claimant: 00112233445566778899\r\n", token);
    IS(post(rig, "claim", fields, version), 401);
    IS(post(rig, "claim", ANN, version), 200);
    buf_release(&reply);
    IS(rig_get(rig, "/v1/jobs", "Authorization: Bearer " TOKEN "\r\n", &reply), 401);
    number++;
    IS(post(rig, "claim", ANN, version), 401); /* of no other attempt */
}

int main(void) {
    struct rig rig;
    rig_start(&rig, &rig_patient, 15.0);
    snprintf(version, sizeof version, "{\"version\":\"%s\",\"host\":\"node7\"}", source_version);
    buf_init(&reply, (size_t)64 << 20);
    check_claims(&rig);
    check_reports(&rig);
    check_outputs(&rig);
    check_checkpoints(&rig);
    check_scene(&rig);
    check_tokens(&rig);
    buf_release(&reply);
    rig_stop(&rig);
    return check_result();
}
