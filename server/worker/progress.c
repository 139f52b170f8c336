/* progress.c -- the worker's side of its pipe; see progress.h. */
#include "server/worker/progress.h"

#include <errno.h>
#include <string.h>
#include <unistd.h>

#include "common/mem.h"

/* Writes one line, in as many writes as the pipe needs: only one thread writes. Takes object. */
static void send_line(struct progress *p, cJSON *object) {
    char *text = json_text(object);
    cJSON_Delete(object);
    size_t length = strlen(text);
    if (p->fd >= 0 && length < PROGRESS_LINE_MAX) {
        text[length] = '\n'; /* replaces the NUL */
        size_t done = 0;
        while (done < length + 1) {
            ssize_t wrote = write(p->fd, text + done, length + 1 - done);
            if (wrote < 0 && errno == EINTR)
                continue;
            if (wrote < 0) {
                p->fd = -1; /* the reader is gone */
                break;
            }
            done += (size_t)wrote;
        }
    }
    mem_free(text);
}

static cJSON *line(const char *type) {
    cJSON *object = cJSON_CreateObject();
    json_add_string(object, "type", type);
    return object;
}

/* A copy of `text` of at most `limit` bytes, not cut inside a UTF-8 sequence: JSON may need six bytes for one, and
 * lines are limited. The caller's. */
static char *cut(const char *text, size_t limit) {
    size_t length = strlen(text);
    if (length > limit) {
        length = limit;
        while (length > 0 && ((unsigned char)text[length] & 0xc0) == 0x80)
            length--;
    }
    return mem_strndup(text, length);
}

static void add_cut(cJSON *object, const char *key, const char *text) {
    char *copy = cut(text, 8000);
    if (strlen(copy) < strlen(text)) { /* mark the omission */
        char *marked = mem_printf("%s [cut]", copy);
        mem_free(copy);
        copy = marked;
    }
    json_add_string(object, key, copy);
    mem_free(copy);
}

void progress_stage(struct progress *p, const char *stage) {
    cJSON *object = line("stage");
    json_add_string(object, "stage", stage);
    send_line(p, object);
}

void progress_step(struct progress *p, const char *stage, double done, double total, double eta_sec) {
    cJSON *object = line("progress");
    json_add_string(object, "stage", stage);
    json_add_number(object, "done", done);
    json_add_number(object, "total", total);
    json_add_number(object, "eta_sec", eta_sec);
    send_line(p, object);
}

void progress_metric(struct progress *p, const char *series, long step, double value) {
    cJSON *object = line("metric");
    json_add_string(object, "series", series);
    json_add_int(object, "step", step);
    json_add_number(object, "value", value);
    send_line(p, object);
}

void progress_file(struct progress *p, const char *type, const char *name, uint64_t bytes, const char *sha256,
                   const char *content_type) {
    cJSON *object = line(type);
    json_add_string(object, "name", name);
    json_add_int(object, "bytes", (int64_t)bytes);
    json_add_string(object, "sha256", sha256);
    json_add_string(object, "content_type", content_type);
    send_line(p, object);
}

void progress_log(struct progress *p, const char *level, const char *message) {
    cJSON *object = line("log");
    json_add_string(object, "level", level);
    add_cut(object, "message", message);
    send_line(p, object);
}

void progress_checkpoint(struct progress *p, long iteration, uint64_t bytes, double seconds) {
    cJSON *object = line("checkpoint");
    json_add_int(object, "iteration", iteration);
    json_add_int(object, "bytes", (int64_t)bytes);
    json_add_number(object, "seconds", seconds);
    send_line(p, object);
}

void progress_part(struct progress *p, int number, int first, uint64_t bytes) {
    cJSON *object = line("part");
    json_add_int(object, "number", number);
    json_add_int(object, "first", first);
    json_add_int(object, "bytes", (int64_t)bytes);
    send_line(p, object);
}

void progress_record(struct progress *p, const char *name, const char *sha256) {
    cJSON *object = line("record");
    json_add_string(object, "name", name);
    json_add_string(object, "sha256", sha256);
    send_line(p, object);
}

void progress_plan(struct progress *p, uint64_t pictures, int parts, const char *digest) {
    cJSON *object = line("plan");
    json_add_int(object, "pictures", (int64_t)pictures);
    json_add_int(object, "parts", parts);
    json_add_string(object, "digest", digest);
    send_line(p, object);
}

void progress_space(struct progress *p, uint64_t bytes) {
    cJSON *object = line("space");
    json_add_int(object, "bytes", (int64_t)bytes);
    send_line(p, object);
}

void progress_problem(struct progress *p, const char *file, const char *reason, const char *hint) {
    cJSON *object = line("problem");
    char *name = cut(file, 1000);
    json_add_string(object, "file", name);
    mem_free(name);
    add_cut(object, "reason", reason);
    if (hint && hint[0])
        add_cut(object, "hint", hint);
    send_line(p, object);
}

void progress_scene(struct progress *p, cJSON *facts) {
    cJSON *object = line("scene");
    json_add(object, "facts", facts);
    send_line(p, object);
}

void progress_end(struct progress *p, enum status status, const char *message, const char *hint) {
    cJSON *object = line("end");
    json_add_string(object, "status", status_name(status));
    add_cut(object, "message", status == STATUS_OK ? p->remark : message);
    add_cut(object, "hint", hint);
    send_line(p, object);
}
