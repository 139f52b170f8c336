/* test_http_resumable_faults.c -- uploads in parts where a fault follows another: the clean-up after a failing disk
 * fails, too, or what is being written is removed. What was counted stays, what was not is sent again, and in the end
 * the scene is what was sent. */
#include "common/sha256.h"
#include "server/uploads/upload_session.h"
#include "server/uploads/upload_writer.h"
#include "tests/api/rig.h"
#include "tests/system_faults.h"

#define BYTES 1000
#define HALF (BYTES / 2)
#define MANY 66 /* more than resumables_recover reads at once */

static struct rig rig;
static struct error err;
static char id[UPLOAD_ID_SIZE]; /* of the upload that a check is about */
static char bytes[BYTES], sha256[SHA256_HEX_SIZE];

#define OK(call) CHECK_THAT((call) == STATUS_OK, "%s", err.message)
/* Refused so, by a sentence with `word`. */
#define IS(call, wanted, word)                                                                                         \
    do {                                                                                                               \
        enum status check_status = (call);                                                                             \
        CHECK_THAT(check_status == (wanted) && err.status == check_status && strstr(err.message, word), "%s: %s",      \
                   status_name(check_status), err.message);                                                            \
    } while (0)

/* --- an upload ------------------------------------------------------------------------------------- */

/* Of bytes that none had before; said_sha256: what the client says of it. */
static void create(const char *said_sha256) {
    static unsigned number;
    struct upload_row row = {.name = mem_strdup("room"), .metadata = mem_strdup(""), .length = BYTES};
    memset(bytes, 'x', sizeof bytes);
    memcpy(bytes, &(unsigned){++number}, sizeof number);
    sha256_of(bytes, sizeof bytes, sha256);
    snprintf(row.sha256, sizeof row.sha256, "%s", said_sha256);
    OK(resumable_create(rig.api->resumables, &row, 0, &err));
    snprintf(id, sizeof id, "%s", row.id);
    upload_row_release(&row);
}

static struct upload_writer *take(uint64_t offset) {
    struct upload_writer *writer;
    OK(upload_writer_take(rig.api->resumables, id, offset, false, &writer, &err));
    return writer;
}

/* Writes what is between, and counts nothing. */
static void send_part(uint64_t from, uint64_t to) {
    struct upload_writer *writer = take(from);
    OK(upload_writer_write(writer, bytes + from, to - from, &err));
    upload_writer_release(writer);
}

static enum status look(void) {
    struct upload_row row;
    enum status status = resumable_status(rig.api->resumables, id, &row, &err);
    upload_row_release(&row);
    return status;
}

static uint64_t counted(void) {
    struct upload_row row;
    OK(store_upload_get(rig.store, id, &row, NULL, 0, &err));
    uint64_t received = row.received;
    upload_row_release(&row);
    return received;
}

static off_t file_size(void) {
    struct stat info = {0};
    char *path = upload_session_path(rig.api->resumables, id);
    CHECK(stat(path, &info) == 0);
    mem_free(path);
    return info.st_size;
}

/* It is the scene that was sent, nothing of it is left, and nobody holds it. */
static void check_scene(void) {
    struct upload_row row;
    struct buf archive;
    char *path = mem_printf("%s/scenes/%s/archive", rig.dir, sha256);
    buf_init(&archive, BYTES);
    OK(resumable_status(rig.api->resumables, id, &row, &err));
    CHECK_STRING(row.scene_id, sha256);
    CHECK(row.received == BYTES);
    OK(file_read(path, &archive, &err));
    CHECK(archive.length == BYTES && memcmp(archive.data, bytes, BYTES) == 0);
    CHECK(rig.api->resumables->first == NULL);
    buf_release(&archive);
    upload_row_release(&row);
    mem_free(path);
}

/* The daemon ends, without a database that would take what is not counted yet, and starts again. */
static void restart(void) {
    const struct resumables_config config = rig.api->resumables->config;
    sql_break();
    resumables_free(rig.api->resumables);
    sql_mend();
    rig.api->resumables = resumables_new(&config);
    rig.api->collector_config.uploads = rig.api->resumables;
}

/* --- checks ---------------------------------------------------------------------------------------- */

/* Neither can what was received be put on disk, nor be cut off, nor be called doubtful in the database. */
static void spoil(void) {
    create("");
    send_part(0, HALF);
    struct upload_writer *writer = take(HALF);
    OK(upload_writer_commit(writer, &err));
    OK(upload_writer_write(writer, bytes + HALF, HALF, &err));
    system_break(" fdatasync ftruncate ", EIO);
    sql_break();
    IS(upload_writer_commit(writer, &err), STATUS_IO, "cannot sync");
    sql_mend();
    system_mend();
    CHECK(counted() == HALF && file_size() == BYTES);
    upload_writer_release(writer);
}

static void check_spoiled(void) {
    spoil(); /* the collector comes first */
    system_break(" ftruncate ", EIO);
    sql_break();
    resumables_maintain(rig.api->resumables);
    sql_mend();
    CHECK(counted() == HALF && file_size() == BYTES);
    system_mend();
    resumables_maintain(rig.api->resumables);
    CHECK(counted() == HALF && file_size() == HALF);
    send_part(HALF, BYTES);
    check_scene();

    spoil(); /* the next part does */
    struct upload_writer *writer;
    system_break(" ftruncate ", EIO);
    IS(upload_writer_take(rig.api->resumables, id, HALF, false, &writer, &err), STATUS_IO, "cannot truncate");
    CHECK(writer == NULL);
    system_break(" fallocate ", ENOSPC);
    IS(upload_writer_take(rig.api->resumables, id, HALF, false, &writer, &err), STATUS_NO_SPACE,
       "cannot reserve 1000 bytes");
    system_break(" fallocate ", EOPNOTSUPP); /* some disks cannot reserve */
    send_part(HALF, BYTES);
    system_mend();
    check_scene();
}

/* Nobody asks for what a cut-off request has left: the collector counts it, once it can. */
static void check_tending(void) {
    create("");
    send_part(0, BYTES);
    sql_break();
    resumables_maintain(rig.api->resumables);
    sql_mend();
    CHECK(counted() == 0);
    resumables_maintain(rig.api->resumables);
    CHECK(counted() == BYTES);
    check_scene();
}

/* The file has more than the database knows of, and cannot be read at first. */
static void check_tail(void) {
    create("");
    send_part(0, HALF);
    restart();
    CHECK(counted() == 0);
    system_break(" pread ", EIO);
    IS(look(), STATUS_IO, "cannot read upload");
    system_mend();
    CHECK(counted() == 0);
    OK(look());
    CHECK(counted() == HALF);
    send_part(HALF, BYTES);
    check_scene();
}

static void check_removed(void) {
    struct upload_writer *writer, *late;
    create("");
    writer = take(0);
    OK(upload_writer_write(writer, bytes, HALF, &err));
    OK(resumable_remove(rig.api->resumables, id, &err));
    IS(upload_writer_write(writer, bytes + HALF, HALF, &err), STATUS_NOT_FOUND, "was removed");
    IS(upload_writer_accept(writer, &err), STATUS_NOT_FOUND, "was removed");
    IS(upload_writer_take(rig.api->resumables, id, HALF, false, &late, &err), STATUS_NOT_FOUND, "there is no upload");
    OK(upload_writer_commit(writer, &err)); /* there is nothing to count */
    upload_writer_release(writer);
    CHECK(rig.api->resumables->first == NULL);
}

/* Bytes that are to be checked are announced, and the database cannot take note. The request that has the upload keeps
 * it. */
static void check_disbelief(void) {
    struct upload_writer *writer, *other;
    create("");
    writer = take(0);
    for (uint64_t at = 0; at <= HALF; at += HALF) {
        sql_break();
        IS(upload_writer_take(rig.api->resumables, id, at, true, &other, &err), STATUS_IO, "cannot");
        sql_mend();
        CHECK(other == NULL);
        OK(upload_writer_write(writer, bytes + at, HALF, &err));
    }
    upload_writer_release(writer);
    check_scene();
}

/* Not what was announced: it goes, however often that fails. */
static void check_rejected(void) {
    struct upload_row row;
    create(RIG_SCENE);
    send_part(0, BYTES);
    enum status status = STATUS_IO;
    bool struck = true;
    for (long n = 1; struck && status != STATUS_INPUT && check_failed_count == 0; n++) {
        sql_faults_arm(n);
        status = look();
        struck = sql_faults_lift();
        enum status wanted = struck ? sql_fault->status : STATUS_INPUT;
        /* Where there is no space, the reserve makes some. */
        CHECK_THAT(status == wanted || (wanted == STATUS_NO_SPACE && status == STATUS_INPUT), "call %ld: %s, not %s", n,
                   status_name(status), status_name(wanted));
    }
    CHECK(strstr(err.message, "its metadata says") && *err.hint);
    CHECK(store_upload_get(rig.store, id, &row, NULL, 0, &err) == STATUS_NOT_FOUND);
    upload_row_release(&row);
    char *path = upload_session_path(rig.api->resumables, id);
    CHECK(access(path, F_OK) != 0);
    mem_free(path);
    CHECK(rig.api->resumables->first == NULL);
}

/* Its file is moved, and whether that is on disk is not known: it is no scene before it is. */
static void check_placing(void) {
    create("");
    send_part(0, BYTES);
    char *dir = mem_printf("%s/scenes/%s", rig.dir, sha256);
    OK(file_make_dirs(dir, &err));
    for (int i = 0; i < 3; i++) {
        struct scene_row row;
        system_break(" fsync ", EIO);
        IS(look(), STATUS_IO, "cannot sync folder");
        system_mend();
        CHECK(store_scene_get(rig.store, sha256, &row, &err) == STATUS_NOT_FOUND);
    }
    check_scene();
    mem_free(dir);
}

static void *look_aside(void *user) {
    enum status *status = user;
    *status = look();
    return NULL;
}

/* Two find it whole at once: one of them makes the scene, both are told of it. */
static void check_two(void) {
    enum status statuses[2] = {STATUS_IO, STATUS_IO};
    pthread_t threads[2];
    struct resumables *p = rig.api->resumables;
    unsigned users = 0;
    create("");
    send_part(0, BYTES);
    pthread_mutex_lock(&p->finishing);
    for (int i = 0; i < 2; i++)
        CHECK(pthread_create(&threads[i], NULL, look_aside, &statuses[i]) == 0);
    while (users < 2) {
        usleep(1000);
        pthread_mutex_lock(&p->mutex);
        users = p->first ? p->first->users : 0;
        pthread_mutex_unlock(&p->mutex);
    }
    usleep(50000);
    pthread_mutex_unlock(&p->finishing);
    for (int i = 0; i < 2; i++)
        pthread_join(threads[i], NULL);
    CHECK(statuses[0] == STATUS_OK && statuses[1] == STATUS_OK);
    check_scene();
}

/* Many are whole when the daemon starts, and the disk fails: it starts, and the next start makes scenes of them. */
static void check_recovery(void) {
    char ids[MANY][UPLOAD_ID_SIZE];
    struct upload_row row;
    for (size_t i = 0; i < MANY; i++) {
        create("");
        send_part(0, BYTES);
        strcpy(ids[i], id);
    }
    const struct resumables_config config = rig.api->resumables->config;
    system_break(" rename ", EIO);
    resumables_free(rig.api->resumables); /* counts them */
    rig.api->resumables = resumables_new(&config);
    rig.api->collector_config.uploads = rig.api->resumables;
    CHECK(counted() == BYTES);
    OK(resumables_recover(rig.api->resumables, &err));
    system_mend();
    sql_break();
    IS(resumables_recover(rig.api->resumables, &err), STATUS_IO, "cannot");
    sql_mend();
    for (int is_well = 0; is_well < 2; is_well++) {
        for (size_t i = 0; i < MANY; i++) {
            OK(store_upload_get(rig.store, ids[i], &row, NULL, 0, &err));
            CHECK_THAT(!*row.scene_id == !is_well, "upload %zu", i);
            upload_row_release(&row);
        }
        OK(resumables_recover(rig.api->resumables, &err));
    }
    check_scene();
}

int main(void) {
    rig_start(&rig, &rig_patient, 15);
    log_set_level(LOG_ERROR);
    check_spoiled();
    check_tending();
    check_tail();
    check_removed();
    check_disbelief();
    check_rejected();
    check_placing();
    check_two();
    check_recovery();
    rig_stop(&rig);
    return check_result();
}
