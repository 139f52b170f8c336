/* fetch.c -- see fetch.h. */
#include "client/fetch.h"

#include <errno.h>
#include <fcntl.h>
#include <string.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include "client/view.h"
#include "common/clock.h"
#include "common/file.h"
#include "common/mem.h"
#include "common/url.h"

#define PATIENCE_SEC 60.0 /* without a byte, after which a download is given up; --retry sets it */
#define VERSIONS_MAX 5    /* give up on a file that changes more often during the download */

enum status fetch_list(struct fetch *f) {
    char path[64];
    snprintf(path, sizeof path, "/v1/jobs/%lld/outputs", (long long)f->job);
    enum status status = request_get(f->client->request, path, &f->reply, f->err);
    if (status != STATUS_OK)
        return status;
    cJSON_Delete(f->outputs);
    f->outputs = cJSON_DetachItemFromObjectCaseSensitive(f->reply.json, "items");
    return STATUS_OK;
}

static const cJSON *find_output(const struct fetch *f, const char *name) {
    const cJSON *item;
    cJSON_ArrayForEach(item, f->outputs) {
        if (strcmp(member_text(item, "name"), name) == 0)
            return item;
    }
    return NULL;
}

/* Notes what the list says about f->name. */
static enum status look_up(struct fetch *f) {
    const cJSON *item = find_output(f, f->name);
    if (!item)
        return error_set(f->err, STATUS_NOT_FOUND, "job %lld has no output %s any more", (long long)f->job, f->name);
    int64_t bytes = member_whole(item, "bytes", 0);
    f->bytes = bytes > 0 ? (uint64_t)bytes : 0;
    snprintf(f->sha256, sizeof f->sha256, "%s", member_text(item, "sha256"));
    return STATUS_OK;
}

/* --- NAME.part ----------------------------------------------------------------------------- */

static enum status empty_part(struct fetch *f) {
    sha256_init(&f->hash);
    f->have = 0;
    if (ftruncate(f->fd, 0) != 0 || lseek(f->fd, 0, SEEK_SET) != 0)
        return error_set_errno(f->err, errno, "cannot empty %s", f->part);
    return STATUS_OK;
}

/* Opens NAME.part and hashes what an earlier fetch left in it. */
static enum status open_part(struct fetch *f) {
    char chunk[65536];
    f->fd = open(f->part, O_RDWR | O_CREAT | O_NOFOLLOW | O_CLOEXEC, 0644);
    if (f->fd < 0)
        return error_set_errno(f->err, errno, "cannot open %s", f->part);
    if (flock(f->fd, LOCK_EX | LOCK_NB) != 0) {
        error_set(f->err, STATUS_IO, "%s is in use", f->part);
        return error_hint(f->err, "another `unbake get` seems to fetch the same file");
    }
    sha256_init(&f->hash);
    f->have = 0;
    for (;;) {
        ssize_t got = read(f->fd, chunk, sizeof chunk);
        if (got < 0 && errno == EINTR)
            continue;
        if (got < 0)
            return error_set_errno(f->err, errno, "cannot read %s", f->part);
        if (got == 0)
            break;
        sha256_update(&f->hash, chunk, (size_t)got);
        f->have += (uint64_t)got;
    }
    f->resumed = f->have > 0;
    return STATUS_OK;
}

static bool on_bytes(void *user, const struct reply *reply, const char *bytes, size_t length) {
    struct fetch *f = user;
    /* The first piece of a reply tells whether the server resumes or starts over. */
    if (f->moved_at < 0.0 && !(reply->code == 206 && reply->range_first == (int64_t)f->have)) {
        f->resumed = false;
        f->write_status = empty_part(f);
    }
    f->moved_at = clock_sec();
    if (f->write_status == STATUS_OK && f->have + length > f->bytes) {
        f->have = f->bytes + 1; /* longer than listed: another version; the hash will differ */
        return false;
    }
    if (f->write_status == STATUS_OK)
        f->write_status = file_write_all(f->fd, bytes, length, f->part, f->err);
    if (f->write_status != STATUS_OK)
        return false;
    sha256_update(&f->hash, bytes, length);
    f->have += length;
    meter_update(&f->meter, (double)f->have);
    return true;
}

/* --- one file ------------------------------------------------------------------------------ */

static enum status request_rest(struct fetch *f) {
    struct buf path;
    char range[64], version[128];
    buf_init(&path, 8192);
    buf_printf(&path, "/v1/jobs/%lld/outputs/", (long long)f->job);
    url_encode(&path, f->name, true);
    snprintf(range, sizeof range, "Range: bytes=%llu-", (unsigned long long)f->have);
    snprintf(version, sizeof version, "If-Range: \"sha256-%s\"", f->sha256);
    struct request_call call = {.path = buf_text(&path), .sink = on_bytes, .user = f, .once = true};
    if (f->have > 0) {
        call.header[0] = range;
        call.header[1] = version;
    }
    f->moved_at = -1.0;
    f->write_status = STATUS_OK;
    enum status status = request_run(f->client->request, &call, &f->reply, f->err);
    buf_release(&path);
    if (f->write_status != STATUS_OK) {
        f->reply.code = 0; /* a local failure, not the server's */
        return f->write_status;
    }
    return status;
}

/* Fetches until NAME.part has the file's length, over broken connections. */
static enum status fetch_rest(struct fetch *f) {
    double patience = f->client->retry_sec >= 0.0 ? f->client->retry_sec : PATIENCE_SEC;
    double last = clock_sec();
    for (int tries = 0; f->have < f->bytes; tries++) {
        enum status status = request_rest(f);
        if (f->moved_at > last) {
            last = f->moved_at;
            tries = 0;
        }
        if (status == STATUS_OK && f->have < f->bytes)
            return STATUS_OK; /* a shorter version: the hash will differ */
        if (status != STATUS_OK && (status != STATUS_UNAVAILABLE || clock_sec() - last > patience))
            return status;
        if (status != STATUS_OK && !request_pause(f->client->request, tries, f->reply.retry_after_sec))
            return error_set(f->err, STATUS_CANCELLED, "interrupted");
    }
    return STATUS_OK;
}

static enum status put_in_place(struct fetch *f) {
    if (fsync(f->fd) != 0)
        return error_set_errno(f->err, errno, "cannot sync %s", f->part);
    if (rename(f->part, f->path) != 0)
        return error_set_errno(f->err, errno, "cannot rename %s", f->part);
    return file_sync_parent(f->path, f->err);
}

/* Brings NAME.part to the listed SHA-256 and gives it its name. */
static enum status fetch_verified(struct fetch *f) {
    for (int version = 0; version < VERSIONS_MAX; version++) {
        char found[SHA256_HEX_SIZE], listed[SHA256_HEX_SIZE];
        enum status status = f->have > f->bytes ? empty_part(f) : STATUS_OK;
        if (status == STATUS_OK)
            status = fetch_rest(f);
        if (status != STATUS_OK)
            return status;
        bool resumed = f->resumed;
        sha256_hex(&f->hash, found);
        if (f->have == f->bytes && strcmp(found, f->sha256) == 0)
            return put_in_place(f);
        memcpy(listed, f->sha256, sizeof listed);
        f->resumed = false;
        status = empty_part(f);
        if (status == STATUS_OK)
            status = fetch_list(f);
        if (status == STATUS_OK)
            status = look_up(f);
        if (status != STATUS_OK)
            return status;
        if (strcmp(listed, f->sha256) == 0 && !resumed) {
            f->reply.code = 0;
            return error_set(f->err, STATUS_CORRUPT, "%s arrived with SHA-256 %.12s..., listed is %.12s...", f->name,
                             found, listed);
        }
    }
    f->reply.code = 0;
    return error_set(f->err, STATUS_CONFLICT, "%s changes faster than it can be fetched", f->name);
}

/* One object for --json: the outcome for a file. */
static cJSON *result_of(const struct fetch *f, const char *action) {
    cJSON *result = cJSON_CreateObject();
    json_add_string(result, "name", f->name);
    json_add_string(result, "path", f->path);
    json_add_int(result, "bytes", (int64_t)f->bytes);
    json_add_string(result, "sha256", f->sha256);
    json_add_string(result, "action", action);
    return result;
}

static bool is_there(const struct fetch *f) {
    char found[SHA256_HEX_SIZE];
    struct stat info;
    return stat(f->path, &info) == 0 && S_ISREG(info.st_mode) && (uint64_t)info.st_size == f->bytes &&
           sha256_of_file(f->path, found, NULL) == STATUS_OK && strcmp(found, f->sha256) == 0;
}

static enum status make_parent(struct fetch *f) {
    char *parent = mem_strdup(f->path);
    char *slash = strrchr(parent, '/');
    enum status status = STATUS_OK;
    if (slash && slash != parent) {
        *slash = '\0';
        status = file_make_dirs(parent, f->err);
    }
    mem_free(parent);
    return status;
}

enum status fetch_one(struct fetch *f, cJSON *results) {
    struct client *c = f->client;
    enum status status = look_up(f);
    if (status != STATUS_OK)
        return status;
    f->reply.code = 0;
    if (is_there(f)) {
        cJSON_AddItemToArray(results, result_of(f, "present"));
        return STATUS_OK;
    }
    status = make_parent(f);
    if (status == STATUS_OK)
        status = open_part(f);
    if (status == STATUS_OK) {
        meter_begin(&f->meter, c->quiet || c->json ? NULL : &c->err, f->name, (double)f->have, (double)f->bytes);
        status = fetch_verified(f);
        meter_end(&f->meter);
    }
    if (f->fd >= 0)
        close(f->fd);
    f->fd = -1;
    if (status == STATUS_OK)
        cJSON_AddItemToArray(results, result_of(f, f->resumed ? "resumed" : "fetched"));
    return status;
}
