/* resumable.c -- see resumable.h. Sessions and their locks are described in upload_session.h. */
#include "server/uploads/resumable.h"

#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "common/boot.h"
#include "common/clock.h"
#include "common/file.h"
#include "common/log.h"
#include "common/mem.h"
#include "common/random_hex.h"
#include "server/data/layout.h"
#include "server/data/trash.h"
#include "server/uploads/upload.h"
#include "server/uploads/upload_session.h"

#define UNFINISHED_MAX 10000  /* of all users */
#define SPARE_BYTES (1 << 20) /* difference that need not be freed: file systems round up */

/* --- from an upload to a scene ----------------------------------------------------------- */

/* The reading that the upload said. Where jobs keep the scene from it, it stays as it was, which its owner can see of
 * it: the content has come all the same. */
static enum status give_reading(struct resumables *r, const struct upload_row *row, const char *scene_id,
                                struct error *err) {
    const struct caller owner = {.user_id = row->owner_id, .role = ROLE_USER};
    enum status status = store_scene_give_reading(r->config.store, &owner, scene_id, row->reading, err);
    if (status != STATUS_CONFLICT)
        return status;
    log_info("upload %s: scene %.12s stays read as it is: %s", row->id, scene_id, err->message);
    return STATUS_OK;
}

/* The file is, or was about to be, at its place among the scenes. */
static enum status place(struct resumables *r, const struct upload_row *row, const char *scene_id, struct error *err) {
    struct folder *folder = r->config.folder;
    char *path = upload_session_path(r, row->id);
    bool existed;
    pthread_mutex_lock(&folder->scene_mutex);
    enum status status = STATUS_OK;
    if (access(path, F_OK) == 0 || errno != ENOENT)
        status = upload_place(folder->dir, path, scene_id, err);
    else /* it is there, but possibly not on disk */
        status = upload_sync_place(folder->dir, scene_id, err);
    if (status == STATUS_OK)
        status = store_scene_add(r->config.store, scene_id, row->name, row->length, row->owner_id, &existed, err);
    pthread_mutex_unlock(&folder->scene_mutex);
    if (status == STATUS_OK && row->reading && *row->reading)
        status = give_reading(r, row, scene_id, err);
    mem_free(path);
    return status == STATUS_OK ? store_upload_finish(r->config.store, row->id, scene_id, err) : status;
}

/* The content does not have the announced digest. */
static enum status reject(struct resumables *r, const struct upload_row *row, const char *scene_id, struct error *err) {
    enum status status = resumable_remove(r, row->id, err);
    if (status != STATUS_OK)
        return status;
    error_set(err, STATUS_INPUT, "the upload's SHA-256 is %s, and its metadata says %s", scene_id, row->sha256);
    return error_hint(err, "it was removed: send the content again");
}

/* Makes a complete upload into its scene, once. */
static enum status finish(struct resumables *r, const char *id, struct error *err) {
    struct upload_row row;
    struct sha256 hash;
    char scene_id[SHA256_HEX_SIZE];
    pthread_mutex_lock(&r->finishing);
    enum status status = store_upload_get(r->config.store, id, &row, &hash, sizeof hash, err);
    if (status == STATUS_OK && !*row.scene_id) {
        sha256_hex(&hash, scene_id);
        bool is_as_said = !*row.sha256 || strcmp(row.sha256, scene_id) == 0;
        status = is_as_said ? place(r, &row, scene_id, err) : reject(r, &row, scene_id, err);
        if (status == STATUS_OK)
            r->config.scene_added(r->config.user);
    }
    pthread_mutex_unlock(&r->finishing);
    upload_row_release(&row);
    return status;
}

/* Commits; finishes the upload if it is complete. */
static enum status settle(struct upload_session *s, struct error *err) {
    enum status status = upload_session_commit(s, err);
    if (status != STATUS_OK || !upload_session_is_whole(s))
        return status;
    status = finish(s->resumables, s->id, err);
    if (status == STATUS_OK)
        upload_session_close(s);
    return status;
}

/* --- all of them ------------------------------------------------------------------------- */

struct resumables *resumables_new(const struct resumables_config *config) {
    struct resumables *r = mem_calloc(1, sizeof *r);
    r->config = *config;
    pthread_mutex_init(&r->mutex, NULL);
    pthread_mutex_init(&r->finishing, NULL);
    boot_id(r->boot);
    if (!*r->boot)
        log_warning(
            "the kernel's boot id cannot be read: what a daemon that is killed has received of an upload and not "
            "yet counted is sent again");
    return r;
}

/* Whether blocks are allocated beyond the file's end. */
static bool holds_space(const struct resumables *r, const char *id) {
    char *path = upload_session_path(r, id);
    struct stat info;
    bool holds = stat(path, &info) == 0 && (uint64_t)info.st_blocks * 512 > (uint64_t)info.st_size + SPARE_BYTES;
    mem_free(path);
    return holds;
}

static void give_space_back(struct resumables *r, const char *id) {
    struct upload_session *s;
    struct error err;
    if (upload_session_get(r, id, &s, &err) != STATUS_OK)
        return; /* finished or removed meanwhile */
    if (upload_session_shrink(s, &err) != STATUS_OK)
        log_warning("upload %s: %s", id, err.message);
    upload_session_put(s);
}

/* Visits all uploads that are not a scene. */
static enum status each_upload(struct resumables *r, void (*visit)(struct resumables *r, const struct upload_row *row),
                               struct error *err) {
    char cursor[128] = "";
    enum status status;
    do {
        struct upload_row rows[64];
        size_t count;
        char next[128];
        status = store_upload_list(r->config.store, NULL, "", cursor, 64, rows, &count, next, err);
        for (size_t i = 0; i < count; i++) {
            if (!*rows[i].scene_id)
                visit(r, &rows[i]);
            upload_row_release(&rows[i]);
        }
        memcpy(cursor, next, sizeof cursor);
    } while (status == STATUS_OK && *cursor);
    return status;
}

/* Frees the reserved space of an upload that has not grown for idle_ms. */
static void give_idle_space_back(struct resumables *r, const struct upload_row *row) {
    if (row->updated_ms < clock_unix_ms() - r->config.idle_ms && holds_space(r, row->id))
        give_space_back(r, row->id);
}

void resumables_maintain(struct resumables *r) {
    struct upload_session *s;
    pthread_mutex_lock(&r->mutex);
    unsigned long round = ++r->round;
    pthread_mutex_unlock(&r->mutex);
    while ((s = upload_session_next(r, round)) != NULL) { /* a session without users exists only because it is dirty */
        struct error err;
        if (settle(s, &err) != STATUS_OK)
            log_warning("upload %s: %s", s->id, err.message);
        upload_session_put(s);
    }
    struct error why;
    if (each_upload(r, give_idle_space_back, &why) != STATUS_OK)
        log_warning("cannot look for idle uploads: %s", why.message);
}

void resumables_free(struct resumables *r) {
    if (!r)
        return;
    resumables_maintain(r);
    while (r->first)
        upload_session_drop(r->first);
    pthread_mutex_destroy(&r->finishing);
    pthread_mutex_destroy(&r->mutex);
    mem_free(r);
}

static void finish_whole(struct resumables *r, const struct upload_row *row) {
    struct error why;
    if (row->received == row->length && finish(r, row->id, &why) != STATUS_OK)
        log_warning("upload %s: %s", row->id, why.message);
}

enum status resumables_recover(struct resumables *r, struct error *err) { return each_upload(r, finish_whole, err); }

/* --- one of them ------------------------------------------------------------------------- */

enum status resumable_create(struct resumables *r, struct upload_row *row, size_t user_max, struct error *err) {
    struct sha256 hash;
    memset(&hash, 0, sizeof hash); /* everything is stored */
    sha256_init(&hash);
    enum status status = random_hex(row->id, UPLOAD_ID_SIZE - 1, err);
    if (status != STATUS_OK)
        return status;
    snprintf(row->boot, sizeof row->boot, "%s", r->boot);
    char *path = upload_session_path(r, row->id);
    int fd = open(path, O_RDWR | O_CREAT | O_EXCL | O_CLOEXEC, 0600);
    if (fd < 0)
        status = error_set_errno(err, errno, "cannot create %s", path);
    else if (fallocate(fd, FALLOC_FL_KEEP_SIZE, 0, (off_t)row->length) != 0 && errno != EOPNOTSUPP)
        status =
            error_set_errno(err, errno, "cannot reserve %llu bytes for the upload", (unsigned long long)row->length);
    if (status == STATUS_OK && fsync(fd) != 0)
        status = error_set_errno(err, errno, "cannot sync %s", path);
    if (status == STATUS_OK)
        status = file_sync_parent(path, err);
    const struct count_limits limits = {.all = UNFINISHED_MAX, .one_user = user_max};
    if (status == STATUS_OK)
        status = store_upload_add(r->config.store, row, &hash, sizeof hash, &limits, err);
    if (fd >= 0)
        close(fd);
    if (fd >= 0 && status != STATUS_OK)
        unlink(path);
    mem_free(path);
    return status;
}

enum status resumable_status(struct resumables *r, const char *id, struct upload_row *row, struct error *err) {
    struct upload_session *s;
    enum status status = store_upload_get(r->config.store, id, row, NULL, 0, err);
    if (status != STATUS_OK || *row->scene_id)
        return status;
    upload_row_release(row);
    status = upload_session_get(r, id, &s, err);
    if (status == STATUS_OK) {
        status = settle(s, err);
        upload_session_put(s);
    } else if (status == STATUS_CONFLICT) {
        status = STATUS_OK; /* finished meanwhile */
    }
    return status == STATUS_OK ? store_upload_get(r->config.store, id, row, NULL, 0, err) : status;
}

enum status resumable_remove_files(struct resumables *r, const char *id, struct error *err) {
    char *path = layout_upload(NULL, id);
    upload_session_mark_gone(r, id);
    enum status status = trash_take(r->config.folder->trash, path, err);
    mem_free(path);
    return status;
}

enum status resumable_remove(struct resumables *r, const char *id, struct error *err) {
    enum status status = store_upload_delete(r->config.store, id, err);
    return status == STATUS_OK ? resumable_remove_files(r, id, err) : status;
}
