/* reserve.c -- keeps disk space for transactions that free space or stop work: they must succeed on a full disk.
 *
 *      ample     (space for WAL and database is preallocated)     every transaction
 *       │  ▲
 *       ▼  └─ (the disk has space again)
 *      tight     (they cannot be extended)                        only those that free space or stop work
 *
 * 1. After each commit the write-ahead log is extended by a cushion beyond its content, and the database file by spare
 *    pages. As soon as that fails, ordinary transactions are refused with STATUS_NO_SPACE; the others use the
 *    preallocated blocks.
 * 2. While space is tight, each commit is followed by a checkpoint, so that the same part of the log is reused.
 * 3. Some file systems cannot preallocate, or allocate again on writing (copy on write). There DATA/reserve, a file of
 *    zeros, is removed when such a transaction has failed, and the transaction is repeated.
 *
 * Called under the store's mutex, except store_reserve_spend and store_reserve_renew. */
#include <errno.h>
#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include "common/file.h"
#include "common/log.h"
#include "common/mem.h"
#include "server/data/layout.h"
#include "server/store/internal.h"
#include "server/store/store.h"

/* Cancelling a job writes about 12 pages. Removing one frees most of its pages, and freed pages are not written. */
#define CUSHION_BYTES ((int64_t)4 << 20) /* with 64 MiB free at the start; otherwise a 16th of the free space */
#define CUSHION_BYTES_MIN ((int64_t)128 << 10)
#define STEP_SHARE 4  /* the log grows by a quarter of the cushion, so that not every commit extends it */
#define SPARE_SHARE 4 /* a quarter of the cushion, for new pages of the database: stopping a job adds an event */
#define CHUNK_BYTES (64 << 10) /* the database file grows by this much */
#define WAL_HEADER 32          /* bytes: sqlite.org/fileformat2.html, 4.1 */
#define FRAME_HEADER 24
#define CHECKPOINT_FRAMES 1000 /* SQLite's own default */
#define CHECKPOINT_TIGHT 16

#define FILE_BYTES ((uint64_t)16 << 20)      /* size of DATA/reserve */
#define FILE_BYTES_MIN ((uint64_t)256 << 10) /* at least; on a smaller disk there is none */

/* Called by SQLite after each commit, with the frames in the log. It replaces SQLite's own hook, which makes the
 * checkpoints; the next commit makes up for a failed one. */
static int committed(void *user, sqlite3 *db, const char *name, int frames) {
    struct reserve *r = user;
    bool is_reset = frames < r->wal_frames;
    struct stat info;
    r->wal_frames = frames;
    if (is_reset && r->wal_fd >= 0 && fstat(r->wal_fd, &info) == 0 && info.st_size < r->wal_bytes)
        r->wal_bytes = info.st_size; /* journal_size_limit has truncated it */
    if (frames >= (r->is_tight ? CHECKPOINT_TIGHT : CHECKPOINT_FRAMES))
        sqlite3_wal_checkpoint_v2(db, name, SQLITE_CHECKPOINT_PASSIVE, NULL, NULL);
    return SQLITE_OK;
}

static bool is_full(int number) { return number == ENOSPC || number == EDQUOT || number == EFBIG; }

/* Extends the log; false where the disk is full. */
static bool extend_wal(struct store *store) {
    struct reserve *r = &store->reserve;
    int64_t wanted = WAL_HEADER + r->wal_frames * (r->page_bytes + FRAME_HEADER) + r->cushion_bytes;
    if (r->wal_fd < 0) {
        char *path = mem_printf("%s-wal", store->sql.path);
        r->wal_fd = open(path, O_RDWR | O_CLOEXEC); /* SQLite takes no locks on this file, so closing it is safe */
        mem_free(path);
    }
    if (wanted <= r->wal_bytes || r->is_unsupported || r->wal_fd < 0)
        return true;
    wanted += r->cushion_bytes / STEP_SHARE;
    if (fallocate(r->wal_fd, 0, 0, wanted) == 0) {
        r->wal_bytes = wanted;
        return true;
    }
    r->is_unsupported = errno == EOPNOTSUPP || errno == ENOSYS;
    return !is_full(errno);
}

/* The same for the database file, to which checkpoints write. */
static bool extend_database(struct store *store) {
    struct reserve *r = &store->reserve;
    int64_t pages = r->pages_used + r->cushion_bytes / SPARE_SHARE / r->page_bytes;
    if (pages <= r->page_count)
        return true;
    int64_t bytes = pages * r->page_bytes;
    errno = 0;
    int code = sqlite3_file_control(store->sql.db, "main", SQLITE_FCNTL_SIZE_HINT, &bytes);
    if (code == SQLITE_OK) {
        r->page_count = pages;
        return true;
    }
    /* SQLite does not pass the reason on. */
    uint64_t room = 0;
    return !(is_full(errno) ||
             (file_free_bytes(r->dir, &room, NULL) == STATUS_OK && room < (uint64_t)r->cushion_bytes));
}

enum status reserve_before_commit(struct store *store, struct error *err) {
    return sql_int(&store->sql, 0, &store->reserve.pages_used, err, "PRAGMA page_count", "");
}

void reserve_after_commit(struct store *store) {
    struct reserve *r = &store->reserve;
    bool was_tight = r->is_tight;
    r->is_tight = !(extend_wal(store) && extend_database(store));
    if (r->is_tight && !was_tight)
        log_warning("%s: the disk is full: only what frees space or stops work is entered", store->sql.path);
    else if (was_tight && !r->is_tight)
        log_info("%s: the disk has room again", store->sql.path);
}

enum status reserve_check(struct store *store, struct error *err) {
    if (store->reserve.is_tight)
        reserve_after_commit(store);
    if (!store->reserve.is_tight)
        return STATUS_OK;
    error_set(err, STATUS_NO_SPACE, "%s: the disk is full", store->sql.path);
    return error_hint(err, "Free some space on the disk that holds the file: cancel or delete jobs, delete scenes.");
}

enum status reserve_open(struct store *store, const char *dir, struct error *err) {
    struct reserve *r = &store->reserve;
    int64_t page_bytes;
    int chunk = CHUNK_BYTES;
    r->dir = mem_strdup(dir);
    enum status status = sql_int(&store->sql, 0, &page_bytes, err, "PRAGMA page_size", "");
    if (status != STATUS_OK)
        return status;
    r->page_bytes = (int)page_bytes;
    r->cushion_bytes = CUSHION_BYTES;
    uint64_t room;
    if (file_free_bytes(dir, &room, NULL) == STATUS_OK && room / 16 < (uint64_t)CUSHION_BYTES)
        r->cushion_bytes = (int64_t)(room / 16) > CUSHION_BYTES_MIN ? (int64_t)(room / 16) : CUSHION_BYTES_MIN;
    sqlite3_file_control(store->sql.db, "main", SQLITE_FCNTL_CHUNK_SIZE, &chunk);
    sqlite3_wal_hook(store->sql.db, committed, r);
    return STATUS_OK;
}

void reserve_close(struct store *store) {
    if (store->reserve.wal_fd >= 0)
        close(store->reserve.wal_fd);
    mem_free(store->reserve.dir);
    store->reserve = (struct reserve){.wal_fd = -1};
}

/* --- the file ------------------------------------------------------------------------------ */

bool store_reserve_spend(struct store *store) {
    char *path = layout_reserve(store->reserve.dir);
    bool spent = unlink(path) == 0;
    if (spent)
        log_warning("the disk is full: %s was given up so that something can be stopped or removed", path);
    mem_free(path);
    return spent;
}

void store_reserve_renew(struct store *store) {
    char *path = layout_reserve(store->reserve.dir);
    uint64_t room = 0;
    /* Only where more than that is free: others need the space too. */
    if (access(path, F_OK) != 0 && file_free_bytes(store->reserve.dir, &room, NULL) == STATUS_OK &&
        room / 8 >= FILE_BYTES_MIN) {
        uint64_t bytes = room / 8 < FILE_BYTES ? room / 8 : FILE_BYTES;
        int fd = open(path, O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0600);
        bool done = fd >= 0 && posix_fallocate(fd, 0, (off_t)bytes) == 0;
        if (fd >= 0)
            close(fd);
        if (fd >= 0 && !done)
            unlink(path);
    }
    mem_free(path);
}
