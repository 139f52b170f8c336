/* A job's files: by name only, by range, under the digest of the very bytes that are sent. */
#include <pthread.h>
#include <sys/stat.h>

#include "tests/api/outputs.h"

static void check_ranges(struct rig *rig, int64_t job, const char *etag) {
    struct buf reply;
    char fields[256];
    ask(rig, job, "outputs/a.exr", "Range: bytes=2-4\r\n", 206, &reply);
    CHECK_STRING(rig_body(&reply), "234");
    check_field(&reply, "Content-Range", "bytes 2-4/10");
    check_field(&reply, "Content-Length", "3");
    check_field(&reply, "ETag", etag);
    buf_release(&reply);
    ask(rig, job, "outputs/a.exr", "Range: bytes=-1\r\n", 206, &reply);
    CHECK_STRING(rig_body(&reply), "9");
    buf_release(&reply);
    ask(rig, job, "outputs/a.exr", "Range: bytes=10-\r\n", 416, &reply);
    check_field(&reply, "Content-Range", "bytes */10");
    buf_release(&reply);
    ask(rig, job, "outputs/a.exr", "Range: bytes=0-1,4-5\r\n", 200, &reply);
    CHECK_STRING(rig_body(&reply), "0123456789");
    buf_release(&reply);
    snprintf(fields, sizeof fields, "Range: bytes=5-\r\nIf-Range: %s\r\n", etag);
    ask(rig, job, "outputs/a.exr", fields, 206, &reply);
    CHECK_STRING(rig_body(&reply), "56789");
    buf_release(&reply);
    ask(rig, job, "outputs/a.exr", "Range: bytes=5-\r\nIf-Range: \"other\"\r\n", 200, &reply);
    CHECK_STRING(rig_body(&reply), "0123456789");
    buf_release(&reply);
    snprintf(fields, sizeof fields, "If-None-Match: \"x\", %s\r\n", etag);
    ask(rig, job, "outputs/a.exr", fields, 304, &reply);
    CHECK_STRING(rig_body(&reply), "");
    check_field(&reply, "ETag", etag);
    buf_release(&reply);
}

/* A range means nothing to HEAD (RFC 9110, 14.2): the fields are those of GET without it. */
static void check_head(struct rig *rig, int64_t job, const char *etag) {
    static const char *const ranges[] = {"", "Range: bytes=2-4\r\n", "Range: bytes=99-\r\n"};
    for (size_t i = 0; i < sizeof ranges / sizeof *ranges; i++) {
        struct buf reply;
        char *text =
            mem_printf("HEAD /v1/jobs/%lld/outputs/a.exr HTTP/1.1\r\nHost: localhost\r\n%sConnection: close\r\n\r\n",
                       (long long)job, ranges[i]);
        CHECK(rig_ask(rig, text, strlen(text), &reply) == 200);
        check_field(&reply, "Content-Length", "10");
        check_field(&reply, "Content-Range", "");
        check_field(&reply, "ETag", etag);
        CHECK_STRING(rig_body(&reply), "");
        buf_release(&reply);
        mem_free(text);
    }
}

static void check_serving(struct rig *rig) {
    struct buf reply;
    char hex[SHA256_HEX_SIZE], etag[80];
    int64_t job = rig_job(rig);
    int attempt = rig_run_job(rig, job);
    write_output(rig, job, "a.exr", "0123456789", 10);
    announce(rig, job, attempt, "a.exr", "0123456789", 10);
    write_output(rig, job, "preview/b_c.png", "png", 3);
    announce(rig, job, attempt, "preview/b_c.png", "png", 3);
    write_output(rig, job, "secret.exr", "not announced", 13);
    write_output(rig, job, "empty.exr", "", 0);
    announce(rig, job, attempt, "empty.exr", "", 0);
    sha256_of("0123456789", 10, hex);
    snprintf(etag, sizeof etag, "\"sha256-%s\"", hex);

    ask(rig, job, "outputs", "", 200, &reply);
    CHECK(strstr(rig_body(&reply), "\"href\":\"/v1/jobs/1/outputs/preview/b_c.png\""));
    CHECK(strstr(rig_body(&reply), hex));
    buf_release(&reply);
    ask(rig, job, "outputs/a.exr", "", 200, &reply);
    CHECK_STRING(rig_body(&reply), "0123456789");
    check_field(&reply, "ETag", etag);
    check_field(&reply, "Content-Type", "image/x-exr");
    check_field(&reply, "Accept-Ranges", "bytes");
    check_field(&reply, "Content-Security-Policy", "sandbox allow-same-origin; script-src 'none'");
    check_field(&reply, "Repr-Digest", "sha-256=:hNiYd/DUBB77a/kaFvAkjy/Vc+avBcGflr7bn4gveII=:");
    buf_release(&reply);
    static const char *const same[] = {"outputs/preview/b_c.png", "outputs/preview%2Fb_c.png",
                                       "outputs/preview%2fb_c%2epng"};
    for (size_t i = 0; i < sizeof same / sizeof *same; i++) {
        ask(rig, job, same[i], "", 200, &reply);
        CHECK_STRING(rig_body(&reply), "png");
        buf_release(&reply);
    }
    ask(rig, job, "outputs/empty.exr", "", 200, &reply);
    check_field(&reply, "Content-Length", "0");
    buf_release(&reply);
    static const char *const absent[] = {"outputs/secret.exr", "outputs/preview", "outputs/A.exr", "outputs/a.exr%20"};
    for (size_t i = 0; i < sizeof absent / sizeof *absent; i++) {
        ask(rig, job, absent[i], "", 404, &reply);
        buf_release(&reply);
    }
    check_ranges(rig, job, etag);
    check_head(rig, job, etag);
}

/* A file that is a link, or lies behind one, is not followed wherever it points. */
static void check_links(struct rig *rig) {
    struct buf reply;
    int64_t job = rig_job(rig);
    int attempt = rig_run_job(rig, job);
    write_output(rig, job, "kept", "x", 1);
    char *path = mem_printf("%s/jobs/%lld/attempt-1/out/link.exr", rig->dir, (long long)job);
    CHECK(symlink("/etc/hostname", path) == 0);
    mem_free(path);
    path = mem_printf("%s/jobs/%lld/attempt-1/out/folder", rig->dir, (long long)job);
    CHECK(symlink("/etc", path) == 0);
    mem_free(path);
    path = mem_printf("%s/jobs/%lld/attempt-1/out/pipe", rig->dir, (long long)job);
    CHECK(mkfifo(path, 0600) == 0);
    mem_free(path);
    static const char *const names[] = {"link.exr", "folder/hostname", "pipe", "folder"};
    for (size_t i = 0; i < sizeof names / sizeof *names; i++) {
        announce(rig, job, attempt, names[i], "x", 1);
        char *name = mem_printf("outputs/%s", names[i]);
        ask(rig, job, name, "", 500, &reply);
        buf_release(&reply);
        mem_free(name);
    }
}

struct writer {
    struct rig *rig;
    int64_t job;
    int attempt;
    _Atomic bool stop;
};

#define BIG 100000

/* Replaces the file over and over, always with the same size, announcing it afterwards. */
static void *replace(void *user) {
    struct writer *w = user;
    char *data = mem_alloc(BIG);
    for (int i = 0; !w->stop; i++) {
        memset(data, 'a' + i % 26, BIG);
        write_output(w->rig, w->job, "big.exr", data, BIG);
        announce(w->rig, w->job, w->attempt, "big.exr", data, BIG);
    }
    mem_free(data);
    return NULL;
}

static void check_replaced(struct rig *rig) {
    struct writer w = {.rig = rig, .job = rig_job(rig)};
    w.attempt = rig_run_job(rig, w.job);
    char *zeros = mem_calloc(1, BIG);
    write_output(rig, w.job, "big.exr", zeros, BIG);
    announce(rig, w.job, w.attempt, "big.exr", zeros, BIG);
    mem_free(zeros);
    pthread_t thread;
    pthread_create(&thread, NULL, replace, &w);
    for (int i = 0; i < 150; i++) {
        struct buf reply;
        char etag[256], hex[SHA256_HEX_SIZE], wanted[80];
        ask(rig, w.job, "outputs/big.exr", "", 200, &reply);
        size_t length = reply.length - (size_t)(rig_body(&reply) - buf_text(&reply));
        sha256_of(rig_body(&reply), length, hex);
        snprintf(wanted, sizeof wanted, "\"sha256-%s\"", hex);
        field_of(&reply, "ETag", etag);
        CHECK_STRING(etag, wanted);
        CHECK(length == BIG);
        buf_release(&reply);
    }
    w.stop = true;
    pthread_join(thread, NULL);
}

static void check_log(struct rig *rig) {
    struct buf reply;
    struct error err;
    int64_t job = rig_job(rig);
    ask(rig, job, "log", "", 200, &reply);
    CHECK_STRING(rig_body(&reply), "");
    buf_release(&reply);
    char *dir = mem_printf("%s/jobs/%lld", rig->dir, (long long)job), *path = file_join(dir, "worker.log");
    rig_must(file_make_dirs(dir, &err), &err, "file_make_dirs");
    rig_must(file_replace(path, "first line\nsecond\nthird\n", 24, &err), &err, "file_replace");
    ask(rig, job, "log", "", 200, &reply);
    CHECK_STRING(rig_body(&reply), "first line\nsecond\nthird\n");
    buf_release(&reply);
    ask(rig, job, "log?bytes=16", "", 200, &reply);
    CHECK_STRING(rig_body(&reply), "second\nthird\n");
    buf_release(&reply);
    ask(rig, job, "log?bytes=0", "", 400, &reply);
    buf_release(&reply);
    mem_free(dir);
    mem_free(path);
}

int main(void) {
    struct rig rig;
    rig_start(&rig, &rig_patient, 15);
    log_set_level(LOG_ERROR);
    check_serving(&rig);
    check_replaced(&rig);
    check_log(&rig);
    fprintf(stderr, "four errors about links and a pipe are expected here:\n");
    check_links(&rig);
    rig_stop(&rig);
    return check_result();
}
