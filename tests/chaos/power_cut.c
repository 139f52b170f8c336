/* power_cut BUILD ARCHIVE ROOM POINTS ROUNDS -- the power fails at POINTS moments of a life of the daemon
 * in which scenes are sent, uploads go on in parts, jobs are made, moved about and removed, and workers
 * write checkpoints and outputs; the daemon itself is killed once on the way. The life is recorded once,
 * every operation on a file (preload/files.c). Then for each moment, in each of up to three ways to
 * lose what was not synced (cut.h), the folder that is left is made anew and opened by the daemon's own
 * code: the database is whole, every checkpoint opens and holds what was saved last, and all that was
 * acknowledged before that moment is so (promises.h). */
#include <fts.h>
#include <sys/stat.h>

#include "tests/chaos/daemon.h"
#include "tests/chaos/promises.h"

#define PIECE 30000 /* bytes of an upload's part */
#define HELD_AT 40  /* of the operations that a worker does */

static struct daemon daemon_;
static struct faults *faults;
static char log_path[128], scene[65];
static int log_fd;

/* --- the life --------------------------------------------------------------------------------------- */

static void mark(const char *format, ...) __attribute__((format(printf, 1, 2)));
static void mark(const char *format, ...) {
    char text[300];
    va_list args;
    va_start(args, format);
    int length = vsnprintf(text, sizeof text, format, args);
    va_end(args);
    faults_lock(faults);
    faults_log(log_fd, OP_MARK, 0, 0, text, (size_t)length);
    faults_unlock(faults);
}

static void must(bool holds, const char *what, const struct buf *body) {
    if (!holds) {
        fprintf(stderr, "the recording fails: %s: %s\n", what, buf_text(body));
        exit(1);
    }
}

static void mark_job(const struct buf *body) {
    long long id, revision;
    char state[16];
    const char *at = strstr(buf_text(body), "\"state\":\"");
    must(sscanf(buf_text(body), "{\"id\":%lld,\"revision\":%lld", &id, &revision) == 2 && at &&
             sscanf(at + 9, "%15[a-z]", state) == 1,
         "a job", body);
    mark("job %lld %lld %s", id, revision, state);
}

static long long submit(const char *name, int iterations) {
    struct buf body;
    char *json = mem_printf(
        "{\"scene\":\"%s\",\"name\":\"%s\",\"settings\":{\"texture_size\":64,\"iterations\":%d,"
        "\"texels_per_iteration\":128,\"cameras_per_texel\":1,\"samples_per_camera\":2,"
        "\"gather_samples\":16,\"gloss_passes\":1,\"texels_per_metre\":2,\"report_samples\":1," CLOSED_ROOM "}}",
        scene, name, iterations);
    must(http_json(daemon_.port, "POST", "/v1/jobs", "", json, &body) == 201, "a submission", &body);
    mark_job(&body);
    long long id = strtoll(buf_text(&body) + 6, NULL, 10);
    buf_release(&body);
    mem_free(json);
    return id;
}

/* What is shown of the job; true when it is in that state. */
static bool look(long long id, const char *state) {
    struct buf body;
    char path[64], part[40];
    snprintf(path, sizeof path, "/v1/jobs/%lld", id);
    snprintf(part, sizeof part, "\"state\":\"%s\"", state);
    must(http_get(daemon_.port, path, &body) == 200, "a look", &body);
    mark_job(&body);
    bool is_so = strstr(buf_text(&body), part) != NULL;
    buf_release(&body);
    return is_so;
}

static void await(long long id, const char *state) {
    for (int i = 0; !look(id, state); i++) {
        usleep(20000);
        must(i < 3000, "a job does not become what it must", &(struct buf){0});
    }
}

static void act(long long id, const char *method, const char *what, const char *json) {
    struct buf body;
    char path[64];
    mark("will job %lld", id);
    snprintf(path, sizeof path, "/v1/jobs/%lld%s", id, what);
    int status = http_json(daemon_.port, method, path, "If-Match: *\r\n", json, &body);
    must(status == 202 || status == 200 || status == 204, what, &body);
    if (status == 204)
        mark("gone job %lld", id);
    else
        mark_job(&body);
    buf_release(&body);
}

struct parts {
    char id[40];
    long number;
    size_t length, sent;
};

static void parts_begin(struct parts *u, long number, size_t length) {
    struct buf head, body;
    char fields[100];
    *u = (struct parts){.number = number, .length = length};
    snprintf(fields, sizeof fields, "Tus-Resumable: 1.0.0\r\nUpload-Length: %zu\r\n", length);
    int status = http_exchange(daemon_.port, "POST", "/v1/uploads", fields, "", 0, &head, &body);
    const char *at = strcasestr(buf_text(&head), "\r\nLocation: /v1/uploads/");
    must(status == 201 && at && sscanf(at + 24, "%32[0-9a-f]", u->id) == 1, "an upload", &body);
    buf_release(&head);
    mark("upload %s 0 %ld", u->id, number);
    buf_release(&body);
}

/* Until so many are in the upload's file. */
static void await_bytes(const char *id, size_t count) {
    struct stat info = {0};
    char *path = mem_printf("%s/uploads/%s", daemon_.data, id);
    for (int i = 0; stat(path, &info) != 0 || (size_t)info.st_size < count; i++, usleep(20000))
        must(i < 3000, "half of a part does not come", &(struct buf){0});
    mem_free(path);
}

/* Sends up to `length` bytes more; cut off in the middle, where that is asked for. */
static void parts_send(struct parts *u, size_t length, bool is_checked, bool is_cut_off) {
    struct buf body;
    char path[64], fields[200], checksum[80] = "";
    unsigned char *bytes = mem_alloc(length);
    length = length < u->length - u->sent ? length : u->length - u->sent;
    for (size_t i = 0; i < length; i++)
        bytes[i] = promise_byte(u->number, u->sent + i);
    if (is_checked) { /* of the wrong bytes: nothing of it may count */
        snprintf(checksum, sizeof checksum, "Upload-Checksum: sha1 AAAAAAAAAAAAAAAAAAAAAAAAAAA=\r\n");
        bytes[0] ^= 1;
    }
    snprintf(path, sizeof path, "/v1/uploads/%s", u->id);
    snprintf(fields, sizeof fields,
             "Tus-Resumable: 1.0.0\r\nContent-Type: application/offset+octet-stream\r\n"
             "Upload-Offset: %zu\r\n%s",
             u->sent, checksum);
    mark("will upload %s", u->id);
    if (is_cut_off) {
        char head[400];
        int fd = http_connect(daemon_.port);
        int used = snprintf(head, sizeof head, "PATCH %s HTTP/1.1\r\nHost: localhost\r\nContent-Length: %zu\r\n%s\r\n",
                            path, length, fields);
        http_send(fd, head, (size_t)used);
        http_send(fd, bytes, length / 2);
        await_bytes(u->id, u->sent + length / 2);
        close(fd);
    } else {
        int status = http_ask(daemon_.port, "PATCH", path, fields, bytes, length, &body);
        must(status == (is_checked ? 460 : 204), "a part", &body);
        u->sent += is_checked ? 0 : length;
        mark("upload %s %zu %ld", u->id, u->sent, u->number);
        buf_release(&body);
    }
    mem_free(bytes);
}

static void parts_look(struct parts *u) {
    struct buf body;
    char path[64];
    snprintf(path, sizeof path, "/v1/uploads/%s", u->id);
    must(http_get(daemon_.port, path, &body) == 200, "an upload", &body);
    const char *at = strstr(buf_text(&body), "\"offset\":");
    must(at != NULL, "an upload's offset", &body);
    u->sent = (size_t)strtoull(at + 9, NULL, 10);
    mark("upload %s %zu %ld", u->id, u->sent, u->number);
    buf_release(&body);
}

static void parts_finish(struct parts *u) {
    struct sha256 hash;
    char hex[SHA256_HEX_SIZE];
    sha256_init(&hash);
    for (size_t i = 0; i < u->length; i++) {
        unsigned char byte = promise_byte(u->number, i);
        sha256_update(&hash, &byte, 1);
    }
    sha256_hex(&hash, hex);
    while (u->sent < u->length)
        parts_send(u, PIECE, false, false);
    mark("scene %s 0 checking", hex);
}

static void drop(const char *kind, const char *folder, const char *id) {
    struct buf body;
    char path[100];
    mark("will %s %s", kind, id);
    snprintf(path, sizeof path, "/v1/%s/%s", folder, id);
    must(http_ask(daemon_.port, "DELETE", path, "Tus-Resumable: 1.0.0\r\n", "", 0, &body) == 204, "a removal", &body);
    mark("gone %s %s", kind, id);
    buf_release(&body);
}

static void live_once(const char *archive) {
    struct parts first, second;
    daemon_scene(&daemon_, archive, scene);
    mark("scene %s 0 ready", scene);
    /* Its worker is held up at its first operation until the others are in their places, and then in a
     * checkpoint until it has been told to stop: however fast it is, it is not done before. */
    faults_arm(faults, FAULTS_WORKER, 1, FAULTS_HOLD, true);
    long long long_one = submit("runs", 120), waits = submit("waits", 3), goes = submit("goes", 3);
    parts_begin(&first, 1, 200000);
    parts_send(&first, PIECE, false, false);
    act(waits, "POST", "/pause", "{}");
    parts_begin(&second, 2, 100000);
    act(goes, "PATCH", "", "{\"name\":\"another\",\"priority\":5}");
    act(goes, "POST", "/cancel", "{}");
    parts_send(&first, PIECE, true, false);
    parts_send(&first, PIECE, false, true);
    parts_look(&first);
    act(goes, "DELETE", "", "{}");
    parts_send(&second, PIECE, false, false);
    faults_arm(faults, FAULTS_WORKER, HELD_AT, FAULTS_HOLD, true);
    for (int i = 0; i < 10 || atomic_load(&faults->failed) == 0; i++, usleep(20000)) {
        look(long_one, "succeeded");
        must(i < 3000, "a worker does not come to a checkpoint", &(struct buf){0});
    }
    act(long_one, "POST", "/pause", "{}");
    for (int i = 0; !atomic_load(&faults->is_told); i++, usleep(20000))
        must(i < 3000, "a worker is not told to stop", &(struct buf){0});
    faults_lift(faults);
    await(long_one, "paused");
    act(waits, "POST", "/resume", "{}");
    act(long_one, "POST", "/resume", "{}");
    drop("upload", "uploads", second.id);
    await(long_one, "succeeded");
    await(waits, "succeeded");
    parts_send(&first, PIECE, false, true);
    daemon_signal(&daemon_, SIGKILL); /* nothing runs */
    daemon_start(&daemon_);
    parts_look(&first);
    parts_finish(&first);
    long long last = submit("last", 40);
    parts_begin(&second, 3, 60000);
    parts_finish(&second);
    act(waits, "DELETE", "", "{}");
    await(last, "succeeded");
    look(long_one, "succeeded");
    daemon_signal(&daemon_, SIGTERM);
}

static void record(const char *build, const char *archive) {
    char library[PATH_MAX], page[128], boot[128];
    struct error err;
    daemon_init(&daemon_, build);
    static const char before[] = "00000000-0000-4000-8000-000000000001\n"; /* another boot than the machine's */
    const char *settings[] = {"min_free_mib=0", "low_disk_mib=0",    "max_running=1",
                              "threads=1",      "log_level=warning", "checkpoint_interval_sec=0.1"};
    memcpy(daemon_.settings, settings, sizeof settings);
    preload_find(build, "files", library);
    snprintf(page, sizeof page, "%s/faults", daemon_.dir);
    snprintf(boot, sizeof boot, "%s/boot", daemon_.dir);
    snprintf(log_path, sizeof log_path, "%s/operations", daemon_.dir);
    faults = faults_new(page, daemon_.data, log_path);
    log_fd = open(log_path, O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC, 0600);
    if (!faults || log_fd < 0 || file_replace(boot, before, strlen(before), &err) != STATUS_OK)
        exit(1);
    setenv("UNBAKE_FAULTS", page, 1);
    setenv("UNBAKE_BOOT_ID", boot, 1);
    daemon_.preload = library;
    daemon_start(&daemon_);
    live_once(archive);
    close(log_fd);
}

/* --- what is left of it -------------------------------------------------------------------------------- */

static char *fingerprint(void) {
    sqlite3 *db = NULL;
    sqlite3_stmt *stmt = NULL;
    struct error err;
    char *holder = NULL, *text = NULL;
    if (attempt_folder_with_checkpoint(daemon_.data, 1, &holder, &err) != STATUS_OK || !holder)
        return NULL;
    char *folder = layout_checkpoint(holder), *path = file_join(daemon_.data, folder);
    if (sqlite3_open(path, &db) == SQLITE_OK &&
        sqlite3_prepare_v2(db, "SELECT fingerprint FROM newest", -1, &stmt, NULL) == SQLITE_OK &&
        sqlite3_step(stmt) == SQLITE_ROW)
        text = mem_strdup((const char *)sqlite3_column_text(stmt, 0));
    sqlite3_finalize(stmt);
    sqlite3_close(db);
    mem_free(path);
    mem_free(folder);
    mem_free(holder);
    return text;
}

/* The whole log makes the folder that is there: nothing went past the recorder. What processes write to
 * stderr did. */
static void check_log(struct cut *c, const char *copy) {
    long files = 0;
    cut_make(c, c->step_count, CUT_WHOLE, 0, copy);
    char *roots[] = {daemon_.data, NULL};
    FTS *tree = fts_open(roots, FTS_PHYSICAL | FTS_NOCHDIR, NULL);
    for (FTSENT *entry; tree && (entry = fts_read(tree)) != NULL;) {
        const char *name = entry->fts_path + strlen(daemon_.data);
        if (entry->fts_info != FTS_F || strstr(name, "worker.log") || strcmp(name, "/reserve") == 0)
            continue;
        char *other = mem_printf("%s%s", copy, name);
        CHECK_THAT(promise_same_file(entry->fts_path, other), "%s is not what the log says", name);
        mem_free(other);
        files++;
    }
    if (tree)
        fts_close(tree);
    CHECK(files > 40);
    file_remove_tree(copy, NULL);
}

static long points, cuts, lost, damaged;

static void try_cut(struct cut *c, size_t count, enum cut_kept kept, const char *copy, const char *room,
                    const char *print) {
    static const char *const words[] = {"nothing", "all", "a part"};
    struct promises promises = {0};
    struct broken broken = {0};
    for (size_t i = 0; i < count; i++)
        if (c->step[i].op == OP_MARK)
            promises_take(&promises, c, &c->step[i]);
    cut_make(c, count, kept, (uint32_t)count * 3 + (uint32_t)kept, copy);
    promises_check(&promises, copy, room, print, &broken);
    cuts++;
    lost += broken.lost;
    damaged += broken.damaged;
    CHECK_THAT(!broken.what[0], "cut after operation %zu, %s of what was not synced kept: %s", count, words[kept],
               broken.what);
    file_remove_tree(copy, NULL);
}

int main(int argc, char **argv) {
    points = argc == 6 ? strtol(argv[4], NULL, 10) : 0;
    if (points <= 0)
        return 2;
    struct cut c;
    long ways = strtol(argv[5], NULL, 10);
    record(argv[1], argv[2]);
    cut_read(&c, log_path, daemon_.data);
    /* Where there is memory to do it in: millions of small files, none of which must survive. */
    char folder[64], *copy, *print = fingerprint();
    snprintf(folder, sizeof folder, "%s/unbake-cut-XXXXXX", check_fast_dir());
    if (!print || !mkdtemp(folder))
        return 1;
    copy = file_join(folder, "data");
    log_set_level(LOG_ERROR);
    check_log(&c, copy);
    uint32_t random = 1;
    if ((size_t)points > c.step_count)
        points = (long)c.step_count;
    for (long i = 0; i < points && check_failed_count < 20; i++) {
        /* One moment of each of so many equal parts of the life. */
        size_t from = c.step_count * (size_t)i / (size_t)points, to = c.step_count * (size_t)(i + 1) / (size_t)points;
        size_t count = from + 1 + cut_draw(&random, (unsigned)(to - from));
        for (long way = 0; way < 3; way++)
            if (ways == 3 || way == i % 3)
                try_cut(&c, count, (enum cut_kept)way, copy, argv[3], print);
        if (i % 500 == 499)
            printf("%ld moments\n", i + 1), fflush(stdout);
    }
    printf("%zu operations recorded; the power cut at %ld of them, %ld folders opened\n", c.step_count, points, cuts);
    figure("power cuts: moments", (double)points, 2000, "higher");
    figure("power cuts: acknowledged changes lost", (double)lost, 0, "lower");
    figure("power cuts: databases, checkpoints, files damaged", (double)damaged, 0, "lower");
    file_remove_tree(folder, NULL);
    cut_release(&c);
    mem_free(copy);
    mem_free(print);
    daemon_remove(&daemon_);
    return check_result();
}
