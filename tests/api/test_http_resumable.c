/* test_http_resumable.c -- two that count what one upload has received, at once, while the disk fails one
 * of them: what the kernel may have dropped is counted by neither, and is sent again. And one that takes over. */
#include <errno.h>
#include <pthread.h>
#include <stdatomic.h>
#include <time.h>

#include "common/sha256.h"
#include "server/uploads/upload_writer.h"
#include "tests/api/rig.h"

#define BYTES 1000

/* --- a disk ---------------------------------------------------------------------------------- */

static atomic_bool is_armed;
static atomic_int begun, ended; /* syncs of uploads since */
static atomic_bool is_asked;    /* the second is about to come */

static bool is_upload(int fd) {
    char name[64], path[256];
    snprintf(name, sizeof name, "/proc/self/fd/%d", fd);
    ssize_t length = readlink(name, path, sizeof path - 1);
    path[length > 0 ? length : 0] = '\0';
    return strstr(path, "/uploads/") != NULL;
}

static void nap(void) { nanosleep(&(struct timespec){.tv_nsec = 1000000}, NULL); }

/* The first of an upload fails, after a second one, if it comes meanwhile, has ended well: the kernel
 * tells a lost page once, and the file has lost its last byte. */
int fdatasync(int fd) {
    if (!atomic_load(&is_armed) || !is_upload(fd))
        return 0;
    int number = atomic_fetch_add(&begun, 1) + 1;
    if (number == 1) {
        while (!atomic_load(&is_asked))
            nap();
        for (int i = 0; i < 100 && atomic_load(&ended) == 0; i++)
            nap();
        CHECK(pwrite(fd, "", 1, BYTES - 1) == 1);
        errno = EIO;
        return -1;
    }
    atomic_fetch_add(&ended, 1);
    return 0;
}

/* --- two at once ------------------------------------------------------------------------------ */

struct look {
    struct resumables *resumables;
    const char *id;
    enum status status;
};

static void *look(void *user) {
    struct look *l = user;
    struct upload_row row = {0};
    struct error err;
    l->status = resumable_status(l->resumables, l->id, &row, &err);
    upload_row_release(&row);
    return NULL;
}

static struct upload_writer *send_all(struct resumables *p, const char *id, const char *bytes) {
    struct upload_writer *writer;
    struct error err;
    rig_must(upload_writer_take(p, id, 0, false, &writer, &err), &err, "upload_writer_take");
    rig_must(upload_writer_write(writer, bytes, BYTES, &err), &err, "upload_writer_write");
    return writer;
}

static void check_received(struct rig *rig, const char *id, uint64_t wanted) {
    struct upload_row row = {0};
    struct error err;
    rig_must(store_upload_get(rig->store, id, &row, NULL, 0, &err), &err, "store_upload_get");
    CHECK_THAT(row.received == wanted && !*row.scene_id, "%llu bytes, scene \"%s\"", (unsigned long long)row.received,
               row.scene_id);
    upload_row_release(&row);
}

/* What comes while the first sync, that will fail, is under way. */
enum rival { RIVAL_LOOK, RIVAL_FINISH, RIVAL_CLAIM };

static void test_two(struct rig *rig, enum rival rival) {
    struct resumables *p = rig->api->resumables;
    struct upload_row row = {.name = mem_strdup("room"), .metadata = mem_strdup(""), .length = BYTES}, found = {0};
    struct error err;
    struct upload_writer *late = NULL;
    char bytes[BYTES], wanted[SHA256_HEX_SIZE];
    struct sha256 hash;
    pthread_t thread;
    memset(bytes, 'x' + (int)rival, sizeof bytes);
    sha256_init(&hash);
    sha256_update(&hash, bytes, sizeof bytes);
    sha256_hex(&hash, wanted);
    rig_must(resumable_create(p, &row, 0, &err), &err, "resumable_create");

    struct upload_writer *writer = send_all(p, row.id, bytes);
    struct look first = {.resumables = p, .id = row.id};
    atomic_store(&begun, 0);
    atomic_store(&ended, 0);
    atomic_store(&is_asked, false);
    atomic_store(&is_armed, true);
    CHECK(pthread_create(&thread, NULL, look, &first) == 0);
    while (atomic_load(&begun) == 0)
        nap();
    atomic_store(&is_asked, true);
    enum status status = rival == RIVAL_LOOK     ? resumable_status(p, row.id, &found, &err)
                         : rival == RIVAL_FINISH ? upload_writer_finish(writer, &found, &err)
                                                 : upload_writer_take(p, row.id, 0, true, &late, &err);
    pthread_join(thread, NULL);
    atomic_store(&is_armed, false);
    CHECK(first.status == STATUS_IO);
    check_received(rig, row.id, 0);
    if (rival == RIVAL_LOOK) /* it may look again, and finds nothing */
        CHECK(status == STATUS_OK && found.received == 0);
    else
        CHECK_THAT(status == STATUS_CONFLICT, "%s", status_name(status));
    upload_row_release(&found);
    upload_writer_release(late);
    upload_writer_release(writer);

    writer = send_all(p, row.id, bytes);
    rig_must(upload_writer_finish(writer, &found, &err), &err, "upload_writer_finish");
    CHECK_STRING(found.scene_id, wanted);
    upload_writer_release(writer);
    upload_row_release(&found);
    upload_row_release(&row);
}

/* A part that is to be checked has come, but for the end of its request, and another request takes the upload over:
 * what the first has brought does not count. */
static void test_overtaken(struct rig *rig) {
    struct resumables *p = rig->api->resumables;
    struct upload_row row = {.name = mem_strdup("room"), .metadata = mem_strdup(""), .length = BYTES};
    unsigned long long before = atomic_load(&rig->api->uploaded_bytes);
    struct error err;
    struct buf reply;
    rig_must(resumable_create(p, &row, 0, &err), &err, "resumable_create");
    char *head =
        mem_printf("PATCH /v1/uploads/%s HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\nTus-Resumable: 1.0.0\r\n"
                   "Content-Type: application/offset+octet-stream\r\nUpload-Offset: 0\r\n"
                   "Upload-Checksum: sha256 ungWv48Bz+pBQUDeXa4iI7ADYaOWF3qctBD/YfIAFa0=\r\n"
                   "Transfer-Encoding: chunked\r\n\r\n3\r\nabc\r\n",
                   row.id);
    int fd = rig_connect(rig);
    rig_send(fd, head, strlen(head));
    while (atomic_load(&rig->api->uploaded_bytes) < before + 3)
        nap();
    struct upload_writer *late;
    rig_must(upload_writer_take(p, row.id, 0, false, &late, &err), &err, "upload_writer_take");
    rig_must(upload_writer_write(late, "other", 5, &err), &err, "upload_writer_write");
    rig_must(upload_writer_commit(late, &err), &err, "upload_writer_commit");
    upload_writer_release(late);
    buf_init(&reply, 1 << 16);
    rig_send(fd, "0\r\n\r\n", 5);
    rig_receive(fd, &reply, NULL);
    CHECK_THAT(rig_status(&reply) == 409 && strstr(buf_text(&reply), "another request continues"), "%s",
               buf_text(&reply));
    check_received(rig, row.id, 5);
    buf_release(&reply);
    close(fd);
    mem_free(head);
    upload_row_release(&row);
}

int main(void) {
    struct rig rig;
    rig_start(&rig, &rig_patient, 15);
    log_set_level(LOG_ERROR);
    test_two(&rig, RIVAL_LOOK);
    test_two(&rig, RIVAL_FINISH);
    test_two(&rig, RIVAL_CLAIM);
    test_overtaken(&rig);
    rig_stop(&rig);
    return check_result();
}
