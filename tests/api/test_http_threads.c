/* test_http_threads.c -- who waits for the disk. Every call that may wait for one, and every mutex, is seen with the
 * name of the thread: libmicrohttpd's own, "MHD-...", make none of the calls, and never meet a mutex whose holder is in
 * one. And while the disk hangs, /healthz is answered, and /readyz says so in time. */
#include <pthread.h>

#include "server/data/collector.h"
#include "server/data/trash.h"
#include "server/http/readiness.h"
#include "server/uploads/digests.h"
#include "tests/api/outputs.h"
#include "tests/system_faults.h"

#define UPLOADED ((size_t)600 << 10) /* bytes: some pieces */
#define CLIENTS 4
#define SLOW_US 2000 /* that a call takes, so that others meet its mutexes */

static const char *const disk_calls =
    "SQLite chmod close fallocate fchmod fdatasync flock fstat fstatat fsync ftruncate lstat mkdir mkdtemp mkostemp open "
    "openat opendir pread pwrite read readdir rename statvfs unlink unlinkat write";

static struct rig rig;
static struct error err;
static char *bytes; /* [UPLOADED] */
static char token_field[TOKEN_SIZE + 40];

/* --- what the threads do ------------------------------------------------------------------------- */

#define LIBRARY_CALLS_MAX 20
static pthread_mutex_t watch_mutex = PTHREAD_MUTEX_INITIALIZER;
static pthread_cond_t watch_changed = PTHREAD_COND_INITIALIZER;
static const char *library_calls[LIBRARY_CALLS_MAX]; /* made by the library's threads */
static int library_call_count;
static atomic_long disk_call_count;
static bool is_watching, is_hung; /* under watch_mutex */
static int hung_count;            /* threads that hang in a call */
static _Atomic pid_t at_disk[64]; /* threads in a call */

static bool is_library(void) {
    static _Thread_local int is_so = -1;
    if (is_so < 0) {
        char name[16] = "";
        pthread_getname_np(pthread_self(), name, sizeof name);
        is_so = strncmp(name, "MHD-", 4) == 0;
    }
    return is_so;
}

static _Thread_local bool is_mine; /* a mutex of the test's, or one that has been seen */

static void blame(const char *call) {
    is_mine = true;
    pthread_mutex_lock(&watch_mutex);
    if (is_watching && library_call_count < LIBRARY_CALLS_MAX)
        library_calls[library_call_count++] = call;
    pthread_mutex_unlock(&watch_mutex);
    is_mine = false;
}

static void watch(const char *call) {
    if (!is_among(call, disk_calls))
        return;
    if (is_library()) {
        blame(call);
        return;
    }
    atomic_fetch_add(&disk_call_count, 1);
    bool is_slow = strcmp(call, "SQLite") != 0 && strcmp(call, "close") != 0;
    size_t slot = 0;
    for (pid_t none = 0; is_slow && slot < 64; slot++, none = 0)
        if (atomic_compare_exchange_strong(&at_disk[slot], &none, (pid_t)syscall(SYS_gettid)))
            break;
    is_mine = true;
    pthread_mutex_lock(&watch_mutex);
    bool waits = is_slow && is_watching && !faults_are_off;
    bool in_sqlite = is_slow && is_watching && faults_are_off && strstr(call, "sync");
    hung_count += is_slow && is_hung;
    pthread_cond_broadcast(&watch_changed);
    while (is_slow && is_hung)
        pthread_cond_wait(&watch_changed, &watch_mutex);
    pthread_mutex_unlock(&watch_mutex);
    is_mine = false;
    if (waits || in_sqlite)
        usleep(SLOW_US);
    if (is_slow && slot < 64)
        atomic_store(&at_disk[slot], 0);
}

#ifndef __SANITIZE_THREAD__
static int (*real_lock)(pthread_mutex_t *), (*real_trylock)(pthread_mutex_t *);

__attribute__((constructor)) static void find_locks(void) {
    *(void **)&real_lock = dlsym(RTLD_NEXT, "pthread_mutex_lock");
    *(void **)&real_trylock = dlsym(RTLD_NEXT, "pthread_mutex_trylock");
}

int pthread_mutex_lock(pthread_mutex_t *mutex) {
    if (!real_lock)
        find_locks();
    if (is_mine || !is_library() || real_trylock(mutex) != 0) {
        pid_t owner = is_mine || !is_library() ? 0 : mutex->__data.__owner;
        for (size_t i = 0; owner && i < 64; i++)
            if (atomic_load(&at_disk[i]) == owner)
                blame("a mutex of somebody who is at the disk");
        return real_lock(mutex);
    }
    return 0;
}
#endif

/* --- clients ------------------------------------------------------------------------------------- */

static int ask_as(const char *method, const char *path, const char *fields, const void *body, size_t length,
                  struct buf *reply) {
    struct buf request;
    buf_init(&request, 4 << 20);
    buf_printf(&request, "%s %s HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n%s%s", method, path, token_field,
               fields);
    if (!strstr(fields, "chunked"))
        buf_printf(&request, "Content-Length: %zu\r\n", length);
    buf_puts(&request, "\r\n");
    buf_append(&request, body, length);
    int status = rig_ask(&rig, request.data, request.length, reply);
    buf_release(&request);
    return status;
}

static void must(int wanted, const char *method, const char *path, const char *fields, const void *body,
                 size_t length) {
    struct buf reply;
    int status = ask_as(method, path, fields, body, length, &reply);
    CHECK_THAT(status == wanted, "%s %s: %d, not %d: %s", method, path, status, wanted, buf_text(&reply));
    buf_release(&reply);
}

#define TUS "Tus-Resumable: 1.0.0\r\n"
#define JSON "Content-Type: application/json\r\nIf-Match: *\r\n"

/* A new upload; `path` gets where it is. */
static void create(char path[80]) {
    struct buf reply;
    char fields[80];
    snprintf(fields, sizeof fields, TUS "Upload-Length: %zu\r\n", UPLOADED);
    CHECK(ask_as("POST", "/v1/uploads", fields, "", 0, &reply) == 201);
    field_of(&reply, "Location", (char[256]){0});
    const char *at = strstr(buf_text(&reply), "\r\nLocation: ");
    CHECK(at && sscanf(at + 12, "%79s", path) == 1);
    buf_release(&reply);
}

/* In parts, the second in chunks; one that is cut off, one that is refused half-way. */
static void upload(int number) {
    char path[80], half[40];
    struct buf chunks;
    size_t part = UPLOADED / 2;
    create(path);
    must(204, "PATCH", path, TUS "Content-Type: application/offset+octet-stream\r\nUpload-Offset: 0\r\n", bytes, part);
    buf_init(&chunks, 4 << 20);
    for (size_t at = part, size = 1; at < UPLOADED; at += size, size = 2 * size + 1) {
        size = size < UPLOADED - at ? size : UPLOADED - at;
        buf_printf(&chunks, "%zx\r\n", size);
        buf_append(&chunks, bytes + at, size);
        buf_puts(&chunks, "\r\n");
    }
    buf_puts(&chunks, "0\r\n\r\n");
    snprintf(half, sizeof half, "Upload-Offset: %zu\r\n", part);
    char *fields =
        mem_printf(TUS "Content-Type: application/offset+octet-stream\r\nTransfer-Encoding: chunked\r\n%s", half);
    must(204, "PATCH", path, fields, buf_text(&chunks), chunks.length);
    must(200, "HEAD", path, TUS, "", 0);
    mem_free(fields);
    buf_release(&chunks);
    create(path);
    char *cut =
        mem_printf("PATCH %s HTTP/1.1\r\nHost: localhost\r\n%s" TUS "Content-Type: application/offset+octet-stream\r\n"
                   "Upload-Offset: 0\r\nContent-Length: %zu\r\n\r\nabc",
                   path, token_field, UPLOADED);
    int fd = rig_connect(&rig);
    rig_send(fd, cut, strlen(cut));
    close(fd);
    mem_free(cut);
    must(204, "DELETE", path, TUS, "", 0);
    cut = mem_printf("POST /v1/scenes HTTP/1.1\r\nHost: localhost\r\n%sContent-Length: %zu\r\n\r\nabc%d", token_field,
                     UPLOADED, number);
    fd = rig_connect(&rig);
    rig_send(fd, cut, strlen(cut));
    close(fd);
    mem_free(cut);
}

static void jobs(const char *scene, int number) {
    struct buf reply;
    char body[200], path[80], more[120];
    int64_t job = 0;
    snprintf(body, sizeof body, "{\"scene\":\"%s\",\"name\":\"j%d\"}", scene, number);
    CHECK(ask_as("POST", "/v1/jobs", JSON, body, strlen(body), &reply) == 201);
    CHECK(sscanf(strstr(buf_text(&reply), "{\"id\":") ? strstr(buf_text(&reply), "{\"id\":") + 6 : "", "%ld", &job) ==
          1);
    buf_release(&reply);
    snprintf(path, sizeof path, "/v1/jobs/%lld", (long long)job);
    must(200, "GET", path, "", "", 0);
    must(200, "PATCH", path, JSON, "{\"priority\":1}", 14);
    static const char *const actions[] = {"pause", "resume", "cancel"};
    for (size_t i = 0; i < 3; i++) {
        snprintf(more, sizeof more, "%s/%s", path, actions[i]);
        must(202, "POST", more, "", "", 0);
    }
    snprintf(more, sizeof more, "%s/log", path);
    must(200, "GET", more, "", "", 0);
    snprintf(more, sizeof more, "%s/events?after=0&follow=0", path);
    must(200, "GET", more, "", "", 0);
    must(204, "DELETE", path, "", "", 0);
}

static char big_path[80];
static char big_scene[SCENE_ID_SIZE];

/* What a client asks, all of it. */
static void *client(void *user) {
    int number = *(int *)user;
    char scene[SHA256_HEX_SIZE], path[100];
    char *mine = mem_alloc(UPLOADED);
    memset(mine, 'a' + number, UPLOADED);
    sha256_of(mine, UPLOADED, scene);
    must(201, "POST", "/v1/scenes?name=x", "", mine, UPLOADED);
    snprintf(path, sizeof path, "/v1/scenes/%s", scene);
    must(200, "GET", path, "", "", 0);
    must(200, "PATCH", path, JSON, "{\"pinned\":true}", 15);
    rig_must(store_scene_ready(rig.store, scene, NULL, "{}", &err), &err, "store_scene_ready");
    must(204, "DELETE", path, "", "", 0);
    upload(number);
    jobs(big_scene, number);
    must(200, "GET", big_path, "", "", 0);
    must(206, "GET", big_path, "Range: bytes=5-900000\r\n", "", 0);
    must(200, "HEAD", big_path, "", "", 0);
    static const char *const others[] = {
        "/",           "/healthz",     "/readyz",    "/metrics",    "/openapi.json", "/v1/version",
        "/v1/session", "/v1/settings", "/v1/scenes", "/v1/uploads", "/v1/jobs",      "/v1/events?follow=0"};
    for (size_t i = 0; i < sizeof others / sizeof *others; i++)
        must(200, "GET", others[i], "", "", 0);
    must(404, "GET", "/v1/jobs/999", "", "", 0);
    must(200, "POST", "/v1/collect?dry_run=1", "", "", 0);
    must(400, "POST", "/v1/session", JSON, "{}", 2);
    mem_free(mine);
    return NULL;
}

static void make_output(void) {
    char *big = mem_calloc(1, 2 * DIGESTS_AT_ONCE);
    int64_t job = rig_job(&rig);
    int attempt = rig_run_job(&rig, job);
    write_output(&rig, job, "big.exr", big, 2 * DIGESTS_AT_ONCE);
    announce(&rig, job, attempt, "big.exr", big, 2 * DIGESTS_AT_ONCE);
    snprintf(big_path, sizeof big_path, "/v1/jobs/%lld/outputs/big.exr", (long long)job);
    snprintf(big_scene, sizeof big_scene, "%s", RIG_SCENE);
    mem_free(big);
}

static void check_library(void) {
    pthread_mutex_lock(&watch_mutex);
    is_watching = false;
    for (int i = 0; i < library_call_count; i++)
        CHECK_THAT(false, "one of the library's threads met %s", library_calls[i]);
    pthread_mutex_unlock(&watch_mutex);
    CHECK(atomic_load(&disk_call_count) > 1000); /* and they were seen */
}

/* --- a disk that hangs --------------------------------------------------------------------------- */

static void hang(bool now) {
    is_mine = true;
    pthread_mutex_lock(&watch_mutex);
    is_hung = now;
    pthread_cond_broadcast(&watch_changed);
    pthread_mutex_unlock(&watch_mutex);
    is_mine = false;
}

static void check_hung(void) {
    enum { WAITING = 20 }; /* more than there are threads */
    int fd[WAITING];
    struct buf reply;
    char *request = mem_printf("POST /v1/uploads HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n%s" TUS
                               "Upload-Length: 600\r\n\r\n",
                               token_field);
    alarm(120); /* who waits for the disk waits for ever */
    hang(true);
    for (int i = 0; i < WAITING; i++) {
        fd[i] = rig_connect(&rig);
        rig_send(fd[i], request, strlen(request));
    }
    is_mine = true;
    pthread_mutex_lock(&watch_mutex);
    while (hung_count == 0)
        pthread_cond_wait(&watch_changed, &watch_mutex);
    pthread_mutex_unlock(&watch_mutex);
    is_mine = false;
    faults_are_off = true;
    must(200, "GET", "/healthz", "", "", 0);
    must(200, "GET", "/openapi.json", "", "", 0);
    must(405, "GET", "/v1/collect", "", "", 0);
    hang(false);
    for (int i = 0; i < WAITING; i++) {
        buf_init(&reply, 1 << 16);
        rig_receive(fd[i], &reply, NULL);
        CHECK(rig_status(&reply) == 201);
        buf_release(&reply);
        close(fd[i]);
    }
    hang(true); /* whoever asks now is told in time, and so are those who come later, at once */
    CHECK(ask_as("GET", "/readyz", "", "", 0, &reply) == 503);
    CHECK(strstr(buf_text(&reply), "has not answered within"));
    buf_release(&reply);
    must(503, "GET", "/readyz", "", "", 0);
    hang(false);
    alarm(0);
    while (ask_as("GET", "/readyz", "", "", 0, &reply) != 200)
        buf_release(&reply);
    buf_release(&reply);
    mem_free(request);
}

int main(void) {
    pthread_t threads[CLIENTS];
    int numbers[CLIENTS];
    char token[TOKEN_SIZE];
    int64_t id;
#ifdef __SANITIZE_THREAD__
    CHECK_SKIP("%s", "the thread sanitizer opens files itself, under its own lock");
#endif
    bytes = mem_alloc(UPLOADED);
    memset(bytes, 'z', UPLOADED);
    rig_start(&rig, &rig_patient, 60.0);
    log_set_level(LOG_ERROR);
    rig_must(store_token_add(rig.store, "root", ROLE_ADMIN, 0, token, &id, &err), &err, "token");
    snprintf(token_field, sizeof token_field, "Authorization: Bearer %s\r\n", token);
    make_output();
    faults_watch = watch;
    is_watching = true;
    for (int i = 0; i < CLIENTS; i++) {
        numbers[i] = i;
        CHECK(pthread_create(&threads[i], NULL, client, &numbers[i]) == 0);
    }
    for (int i = 0; i < CLIENTS; i++)
        pthread_join(threads[i], NULL);
    trash_wait(rig.api->folder.trash);
    check_library();
    check_hung();
    faults_watch = NULL;
    mem_free(bytes);
    rig_stop(&rig);
    return check_result();
}
