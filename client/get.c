/* get.c -- `get`: a job's outputs become files.
 *
 * 1. A file has its name only when its content has the SHA-256 that the server lists; before, it is
 *    NAME.part.
 * 2. What NAME.part holds is hashed, not trusted: if the whole is wrong in the end, it is fetched
 *    from its beginning once more.
 * 3. A running job may replace an output at any time: If-Range names the version, and after a
 *    mismatch the list is asked for again.
 * 4. No name from the server leads out of the folder asked for. */
#include <errno.h>
#include <fcntl.h>
#include <fnmatch.h>
#include <string.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include "client/commands.h"
#include "client/meter.h"
#include "client/view.h"
#include "common/clock.h"
#include "common/file.h"
#include "common/mem.h"
#include "common/nearest.h"
#include "common/sha256.h"

#define PATIENCE_SEC 60.0
#define VERSIONS_MAX 5 /* give up on a file that changes more often during the download */

const struct command_option get_options[] = {
    {"output", 'o', OPTION_TEXT, "DIR", "where the files go; it is made if need be (job-JOB)"},
    {0},
};

struct fetch {
    struct client *client;
    int64_t job;
    const char *dir;
    cJSON *outputs; /* the server's list; owned */
    struct reply reply;
    struct error *err;

    /* The current file: */
    char *name, *path, *part; /* owned */
    char sha256[SHA256_HEX_SIZE];
    uint64_t bytes;
    int fd;
    uint64_t have; /* bytes of NAME.part, all of them in `hash` */
    struct sha256 hash;
    bool resumed;
    double moved_at;          /* when bytes last arrived */
    enum status write_status; /* a local write error during the transfer */
    struct meter meter;
};

bool get_name_is_safe(const char *name) {
    if (strlen(name) > 1000 || !*name)
        return false;
    for (const char *at = name;;) {
        size_t length = strcspn(at, "/");
        if (length == 0 || length > 200 || at[0] == '.')
            return false;
        for (size_t i = 0; i < length; i++)
            if ((unsigned char)at[i] < 0x20 || at[i] == 0x7F || at[i] == '\\')
                return false;
        if (at[length] == '\0')
            return true;
        at += length + 1;
    }
}

/* --- the list ------------------------------------------------------------------------------ */

static enum status ask_for_outputs(struct fetch *f) {
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

/* Every word must match an output, before anything is fetched. */
static enum status check_words(struct fetch *f, const struct options *o) {
    for (size_t i = 1; o && i < o->word_count; i++) {
        struct nearest nearest;
        bool matched = false;
        const cJSON *item;
        nearest_init(&nearest, o->word[i]);
        cJSON_ArrayForEach(item, f->outputs) {
            const char *name = member_text(item, "name");
            matched = matched || fnmatch(o->word[i], name, 0) == 0;
            nearest_offer(&nearest, name);
        }
        if (matched)
            continue;
        long long job = (long long)f->job;
        error_set(f->err, STATUS_NOT_FOUND, "job %lld has no output %.200s", job, o->word[i]);
        return nearest.best ? error_hint(f->err, "did you mean %s?", nearest.best)
                            : error_hint(f->err, "`unbake show %lld` lists what there is", job);
    }
    return STATUS_OK;
}

static bool wanted(const struct options *o, const char *name) {
    for (size_t i = 1; o && i < o->word_count; i++)
        if (fnmatch(o->word[i], name, 0) == 0)
            return true;
    return !o || o->word_count == 1;
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
    request_escape(&path, f->name, true);
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
            status = ask_for_outputs(f);
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

static enum status fetch_one(struct fetch *f, cJSON *results) {
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

/* --- all of them --------------------------------------------------------------------------- */

static enum status fetch_all(struct fetch *f, const struct options *o, cJSON *results) {
    enum status status = ask_for_outputs(f);
    if (status != STATUS_OK)
        return status;
    if (cJSON_GetArraySize(f->outputs) == 0) {
        error_set(f->err, STATUS_NOT_FOUND, "job %lld has no outputs yet", (long long)f->job);
        return error_hint(f->err, "`unbake watch %lld` shows how far it is", (long long)f->job);
    }
    status = check_words(f, o);
    cJSON *first = cJSON_Duplicate(f->outputs, true); /* the list may be fetched again meanwhile */
    const cJSON *item;
    cJSON_ArrayForEach(item, first) {
        const char *name = member_text(item, "name");
        if (status != STATUS_OK)
            break;
        if (!wanted(o, name))
            continue;
        if (!get_name_is_safe(name)) {
            f->reply.code = 0;
            status = error_set(f->err, STATUS_CORRUPT, "the server lists an output with an unsafe name: %.200s", name);
            break;
        }
        f->name = mem_strdup(name);
        f->path = file_join(f->dir, name);
        f->part = mem_printf("%s.part", f->path);
        status = fetch_one(f, results);
        mem_free(f->name);
        mem_free(f->path);
        mem_free(f->part);
    }
    cJSON_Delete(first);
    return status;
}

static void print_results(struct client *c, const char *dir, const cJSON *results) {
    int count = cJSON_GetArraySize(results), present = 0;
    double bytes = 0.0;
    char size[16];
    const cJSON *result;
    if (c->json) {
        client_print_json(c, results);
        return;
    }
    cJSON_ArrayForEach(result, results) {
        bool there = strcmp(member_text(result, "action"), "present") == 0;
        present += there;
        bytes += there ? 0.0 : member_number(result, "bytes", 0.0);
    }
    format_bytes(size, bytes);
    if (c->quiet)
        return;
    printf("%d file%s in %s", count, count == 1 ? "" : "s", dir);
    if (present == count)
        printf(", all there already\n");
    else
        printf(" (%s%s)\n", size, present ? "; the others were there" : "");
}

/* Fetches what the words after the first name (o NULL: all). `status`: of what led here; f->job is known where it is
 * STATUS_OK. */
static int get(struct fetch *f, const struct options *o, enum status status) {
    struct client *c = f->client;
    struct error *err = f->err;
    int code = CLIENT_OK;
    cJSON *results = cJSON_CreateArray();
    if (status == STATUS_OK)
        status = fetch_all(f, o, results);
    if (status == STATUS_CANCELLED)
        error_hint(err, "`unbake get %lld -o DIR` continues where this stopped", (long long)f->job);
    if (status != STATUS_OK)
        code = client_fail(c, &f->reply, err);
    else
        print_results(c, f->dir, results);
    cJSON_Delete(results);
    cJSON_Delete(f->outputs);
    reply_release(&f->reply);
    return code;
}

int get_run(struct client *c, const struct options *o) {
    struct error err;
    struct fetch f = {.client = c, .err = &err, .fd = -1};
    reply_init(&f.reply);
    enum status status = client_job_id(c, o->word[0], &f.job, &f.reply, &err);
    char *fallback = mem_printf("job-%lld", (long long)f.job);
    f.dir = options_text(o, "output", fallback);
    int code = get(&f, o, status);
    mem_free(fallback);
    return code;
}

int get_job(struct client *c, int64_t job, const char *dir) {
    struct error err;
    struct fetch f = {.client = c, .err = &err, .fd = -1, .job = job, .dir = dir};
    reply_init(&f.reply);
    return get(&f, NULL, STATUS_OK);
}
