/* test_http_digests.c -- digests of large outputs: no reply waits for one, all replies are about the bytes that they
 * send, and what was computed holds over restarts, for that version of the file alone. The test holds the thread that
 * hashes, whose name it knows, before its first read of a file. */
#include <dlfcn.h>
#include <fcntl.h>
#include <pthread.h>
#include <sys/stat.h>

#include "server/uploads/digests.h"
#include "tests/api/outputs.h"

#define BIG (DIGESTS_AT_ONCE + 1)

static pthread_mutex_t mutex = PTHREAD_MUTEX_INITIALIZER;
static pthread_cond_t changed = PTHREAD_COND_INITIALIZER;
static bool is_held; /* the thread that hashes reads nothing meanwhile */

static void hold(bool now) {
    pthread_mutex_lock(&mutex);
    is_held = now;
    pthread_cond_broadcast(&changed);
    pthread_mutex_unlock(&mutex);
}

ssize_t pread(int fd, void *data, size_t length, off_t at) {
    ssize_t (*call)(int, void *, size_t, off_t);
    char name[16] = "";
    *(void **)&call = dlsym(RTLD_NEXT, "pread");
    pthread_getname_np(pthread_self(), name, sizeof name);
    pthread_mutex_lock(&mutex);
    while (is_held && strcmp(name, "digests") == 0)
        pthread_cond_wait(&changed, &mutex);
    pthread_mutex_unlock(&mutex);
    return call(fd, data, length, at);
}

static int head(struct rig *rig, int64_t job, struct buf *reply) {
    char *text = mem_printf(
        "HEAD /v1/jobs/%lld/outputs/big.exr HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n", (long long)job);
    int status = rig_ask(rig, text, strlen(text), reply);
    mem_free(text);
    return status;
}

/* A strong tag that is not of the content, and no digest. */
static void check_unknown(const struct buf *reply, char etag[256]) {
    field_of(reply, "ETag", etag);
    CHECK_THAT(strncmp(etag, "\"file-", 6) == 0 && strlen(etag) == 39, "ETag: %s", etag);
    check_field(reply, "Repr-Digest", "");
}

static void part_by(struct rig *rig, int64_t job, const char *etag, int status, const char *replied) {
    struct buf reply;
    char fields[400];
    snprintf(fields, sizeof fields, "Range: bytes=3-5\r\nIf-Range: %s\r\n", etag);
    ask(rig, job, "outputs/big.exr", fields, status, &reply);
    check_field(&reply, "ETag", replied);
    if (status == 206)
        CHECK_STRING(rig_body(&reply), "bbb");
    buf_release(&reply);
}

/* While the digest is not there yet. */
static void check_early(struct rig *rig, int64_t job, const char *etag, char version[256]) {
    struct buf reply;
    char fields[300];
    ask(rig, job, "outputs/big.exr", "Range: bytes=0-0\r\n", 206, &reply);
    CHECK_STRING(rig_body(&reply), "b");
    check_unknown(&reply, version);
    buf_release(&reply);
    CHECK(head(rig, job, &reply) == 200);
    check_field(&reply, "ETag", version);
    buf_release(&reply);
    ask(rig, job, "outputs/big.exr", "", 200, &reply);
    CHECK(reply.length - (size_t)(rig_body(&reply) - buf_text(&reply)) == BIG);
    buf_release(&reply);
    snprintf(fields, sizeof fields, "If-None-Match: %s\r\n", version);
    ask(rig, job, "outputs/big.exr", fields, 304, &reply);
    buf_release(&reply);
    part_by(rig, job, version, 206, version);
    part_by(rig, job, "\"other\"", 200, version);
    /* Whether the part that the client has is of this content cannot be told yet: it comes again. */
    part_by(rig, job, etag, 503, "");
    ask(rig, job, "outputs/small.exr", "", 200, &reply); /* small ones need not wait either */
    check_field(&reply, "Repr-Digest", "sha-256=:hNiYd/DUBB77a/kaFvAkjy/Vc+avBcGflr7bn4gveII=:");
    buf_release(&reply);
}

/* And when it is. Who has begun by the version's tag goes on by it. */
static void check_late(struct rig *rig, int64_t job, const char *etag, const char *version) {
    struct buf reply;
    CHECK(head(rig, job, &reply) == 200);
    check_field(&reply, "ETag", etag);
    buf_release(&reply);
    part_by(rig, job, etag, 206, etag);
    part_by(rig, job, version, 206, version);
    part_by(rig, job, "\"other\"", 200, etag);
}

static void restart(struct rig *rig) {
    listener_quiesce(rig->listener);
    listener_stop(rig->listener);
    service_free(rig->api);
    scheduler_free(rig->scheduler);
    store_close(rig->store);
    rig_open(rig, &rig_patient, 60.0, 200, 60);
}

int main(void) {
    struct rig rig;
    char etag[80], other_etag[80], hex[SHA256_HEX_SIZE], version[256], lie[256];
    char *bytes = mem_alloc(BIG);
    memset(bytes, 'b', BIG);
    sha256_of(bytes, BIG, hex);
    snprintf(etag, sizeof etag, "\"sha256-%s\"", hex);
    rig_start(&rig, &rig_patient, 60.0);
    int64_t job = rig_job(&rig);
    int attempt = rig_run_job(&rig, job);
    hold(true);
    write_output(&rig, job, "big.exr", bytes, BIG);
    announce(&rig, job, attempt, "big.exr", "a worker lies", 13); /* about its digest */
    write_output(&rig, job, "small.exr", "0123456789", 10);
    announce(&rig, job, attempt, "small.exr", "0123456789", 10);
    check_early(&rig, job, etag, version);
    hold(false);
    digests_wait(rig.api->digests);
    CHECK(digests_hashed_bytes(rig.api->digests) >= BIG + 10);
    check_late(&rig, job, etag, version);

    hold(true); /* nothing is hashed again */
    restart(&rig);
    check_late(&rig, job, etag, version);
    digests_wait(rig.api->digests);
    CHECK(digests_hashed_bytes(rig.api->digests) == 0);

    /* Another file of the same size takes its place, and is not announced yet. */
    memset(bytes + 1, 'b', BIG - 1);
    bytes[0] = 'c';
    sha256_of(bytes, BIG, hex);
    snprintf(other_etag, sizeof other_etag, "\"sha256-%s\"", hex);
    write_output(&rig, job, "big.exr", bytes, BIG);
    part_by(&rig, job, etag, 503, "");
    struct buf reply;
    CHECK(head(&rig, job, &reply) == 200);
    check_unknown(&reply, lie);
    CHECK(strcmp(lie, version) != 0);
    buf_release(&reply);
    hold(false); /* it was wanted by those who asked */
    digests_wait(rig.api->digests);
    check_late(&rig, job, other_etag, lie);
    part_by(&rig, job, etag, 200, other_etag);

    /* Written to in place, and its time of modification put back: the time of change tells. */
    char *path = mem_printf("%s/jobs/%lld/attempt-1/out/big.exr", rig.dir, (long long)job);
    struct stat info;
    int fd = open(path, O_WRONLY);
    CHECK(fd >= 0 && fstat(fd, &info) == 0 && pwrite(fd, "d", 1, 0) == 1);
    CHECK(futimens(fd, (struct timespec[]){info.st_atim, info.st_mtim}) == 0);
    close(fd);
    mem_free(path);
    part_by(&rig, job, other_etag, 503, "");
    mem_free(bytes);
    rig_stop(&rig);
    return check_result();
}
