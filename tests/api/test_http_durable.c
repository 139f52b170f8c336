/* test_http_durable.c -- what is acknowledged is on disk: a file that has been written is synced before it gets the
 * name by which it is found, and before the database counts its bytes; the name is synced before the reply. Every
 * write, sync and rename below the data folder is seen, in whatever thread. And room is looked for and taken under one
 * lock. */
#include <dlfcn.h>
#include <fcntl.h>
#include <libgen.h>
#include <pthread.h>
#include <sqlite3.h>
#include <sys/stat.h>

#include "tests/api/outputs.h"

#define UPLOADED ((size_t)300 << 10)
#define INODES 512
#define TUS "Tus-Resumable: 1.0.0\r\n"

static struct rig rig;
static pthread_mutex_t mutex = PTHREAD_MUTEX_INITIALIZER;
static ino_t dirty[INODES]; /* files that were written, folders in which names have changed, and that were not synced */
static int renamed_dirty, counted_dirty, renames, counts; /* under the mutex */
static atomic_int reservations, reserved_without_lock;
static atomic_bool is_creating; /* an upload in parts */

static void mark(ino_t inode, bool is_dirty) {
    pthread_mutex_lock(&mutex);
    size_t at = INODES, none = INODES;
    for (size_t i = 0; i < INODES; i++) {
        at = dirty[i] == inode ? i : at;
        none = dirty[i] == 0 && none == INODES ? i : none;
    }
    if (!is_dirty && at < INODES)
        dirty[at] = 0;
    else if (is_dirty && at == INODES && none < INODES)
        dirty[none] = inode;
    pthread_mutex_unlock(&mutex);
}

static bool is_dirty(ino_t inode) {
    bool found = false;
    pthread_mutex_lock(&mutex);
    for (size_t i = 0; i < INODES; i++)
        found = found || dirty[i] == inode;
    pthread_mutex_unlock(&mutex);
    return found;
}

static void mark_fd(int fd, bool now) {
    struct stat info;
    if (fstat(fd, &info) == 0 && (S_ISREG(info.st_mode) || S_ISDIR(info.st_mode)))
        mark(info.st_ino, now);
}

#define REAL(name)                                                                                                     \
    __typeof__(name) *call;                                                                                            \
    *(void **)&call = dlsym(RTLD_NEXT, #name)

ssize_t write(int fd, const void *data, size_t length) {
    REAL(write);
    if (fd > STDERR_FILENO)
        mark_fd(fd, true);
    return call(fd, data, length);
}

ssize_t pwrite(int fd, const void *data, size_t length, off_t at) {
    REAL(pwrite);
    mark_fd(fd, true);
    return call(fd, data, length, at);
}

int fsync(int fd) {
    REAL(fsync);
    mark_fd(fd, false);
    return call(fd);
}

int fdatasync(int fd) {
    REAL(fdatasync);
    mark_fd(fd, false);
    return call(fd);
}

int rename(const char *from, const char *to) {
    REAL(rename);
    struct stat info;
    bool is_file = lstat(from, &info) == 0 && S_ISREG(info.st_mode) && !strstr(to, "/trash/");
    bool was_dirty = is_file && is_dirty(info.st_ino);
    int result = call(from, to);
    char folder[300];
    snprintf(folder, sizeof folder, "%s", to);
    if (is_file && result == 0 && stat(dirname(folder), &info) == 0)
        mark(info.st_ino, true);
    pthread_mutex_lock(&mutex);
    renames += is_file;
    renamed_dirty += was_dirty;
    pthread_mutex_unlock(&mutex);
    return result;
}

int fallocate(int fd, int mode, off_t at, off_t length) {
    REAL(fallocate);
    if (is_creating) {
        atomic_fetch_add(&reservations, 1);
        bool is_free = pthread_mutex_trylock(&rig.api->folder.scene_mutex) == 0;
        atomic_fetch_add(&reserved_without_lock, is_free);
        if (is_free)
            pthread_mutex_unlock(&rig.api->folder.scene_mutex);
    }
    return call(fd, mode, at, length);
}

static char upload_path[400];

int sqlite3_step(sqlite3_stmt *stmt) {
    REAL(sqlite3_step);
    struct stat info;
    const char *text = sqlite3_sql(stmt);
    if (text && strstr(text, "UPDATE uploads SET updated_ms") && stat(upload_path, &info) == 0) {
        bool was_dirty = is_dirty(info.st_ino);
        pthread_mutex_lock(&mutex);
        counts++;
        counted_dirty += was_dirty;
        pthread_mutex_unlock(&mutex);
    }
    return call(stmt);
}

/* --- requests ------------------------------------------------------------------------------------ */

static void send_bytes(const char *method, const char *path, const char *fields, const void *body, size_t length,
                       int wanted, struct buf *reply) {
    struct buf request;
    buf_init(&request, 1 << 20);
    buf_printf(&request, "%s %s HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n%sContent-Length: %zu\r\n\r\n",
               method, path, fields, length);
    buf_append(&request, body, length);
    int status = rig_ask(&rig, request.data, request.length, reply);
    CHECK_THAT(status == wanted, "%s %s: %d, not %d: %s", method, path, status, wanted, buf_text(reply));
    buf_release(&request);
}

/* The archive of the scene, its folder and the folders' folder are as they are on disk. */
static void check_scene(const void *data, size_t length) {
    struct stat info;
    char hex[SHA256_HEX_SIZE];
    sha256_of(data, length, hex);
    const char *const part[] = {"/archive", "", "/.."};
    for (size_t i = 0; i < sizeof part / sizeof *part; i++) {
        char *path = mem_printf("%s/scenes/%s%s", rig.dir, hex, part[i]);
        CHECK(stat(path, &info) == 0);
        CHECK_THAT(!is_dirty(info.st_ino), "%s is not synced when the scene is acknowledged", path);
        mem_free(path);
    }
}

static void in_one(char *bytes) {
    struct buf reply;
    bytes[0] = '1';
    int before = renames;
    send_bytes("POST", "/v1/scenes", "", bytes, UPLOADED, 201, &reply);
    buf_release(&reply);
    check_scene(bytes, UPLOADED);
    CHECK(renames == before + 1 && renamed_dirty == 0);
}

static void in_parts(char *bytes) {
    struct buf reply;
    char location[256], fields[200];
    bytes[0] = '2';
    snprintf(fields, sizeof fields, TUS "Upload-Length: %zu\r\n", UPLOADED);
    is_creating = true;
    send_bytes("POST", "/v1/uploads", fields, "", 0, 201, &reply);
    is_creating = false;
    CHECK(reservations == 1 && reserved_without_lock == 0);
    field_of(&reply, "Location", location);
    buf_release(&reply);
    snprintf(upload_path, sizeof upload_path, "%s/uploads/%s", rig.dir, location + strlen("/v1/uploads/"));
    for (size_t at = 0; at < UPLOADED; at += UPLOADED / 2) {
        snprintf(fields, sizeof fields, TUS "Content-Type: application/offset+octet-stream\r\nUpload-Offset: %zu\r\n",
                 at);
        send_bytes("PATCH", location, fields, bytes + at, UPLOADED / 2, 204, &reply);
        buf_release(&reply);
    }
    check_scene(bytes, UPLOADED);
    CHECK(counts == 2 && counted_dirty == 0 && renamed_dirty == 0);
}

int main(void) {
    char *bytes = mem_alloc(UPLOADED);
    memset(bytes, 'x', UPLOADED);
    rig_start(&rig, &rig_patient, 60.0);
    in_one(bytes);
    in_parts(bytes);
    mem_free(bytes);
    rig_stop(&rig);
    return check_result();
}
