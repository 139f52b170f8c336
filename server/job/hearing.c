/* hearing.c -- see hearing.h. */
#include "server/job/hearing.h"

#include <errno.h>
#include <string.h>
#include <sys/stat.h>

#include "common/log.h"
#include "common/mem.h"
#include "common/protocol.h"

#define EVENTS_MAX 500000 /* of one attempt: an honest one stays far below */
#define PROBLEMS_MAX 1000 /* of one scene */

struct listener {
    struct attempt *attempt;
    struct store *store;
    struct figures *figures;
};

/* `data` is as the worker has it. What only the daemon says of an event is not for a worker to say:
 * it may be that of another job, or run by whoever sent the scene. */
static void enter_event(const struct listener *l, const char *type, cJSON *data) {
    static const char *const daemons[] = {"job", "attempt", "at", "snapshot"};
    struct attempt *a = l->attempt;
    struct error err;
    if (a->job_id == 0 || a->event_count++ >= EVENTS_MAX)
        return;
    for (size_t i = 0; i < sizeof daemons / sizeof *daemons; i++)
        cJSON_DeleteItemFromObjectCaseSensitive(data, daemons[i]);
    char *text = json_text(data);
    enum status status = store_event_add(l->store, a->job_id, a->number, type, text, &err);
    mem_free(text);
    if (status != STATUS_OK && !a->complained) {
        a->complained = true; /* once: the next thousand reports would say the same */
        log_warning("job %lld: cannot record a %s event: %s", (long long)a->job_id, type,
                    err.message);
    }
}

/* The file must be there, whole, and a plain file: what is announced is served to users. A disk that cannot tell is
 * asked once more, for the last time when the worker has ended. */
static enum status put_file(const struct attempt *a, struct store *store, const char *type, const cJSON *line,
                            bool is_last, struct error *err) {
    const char *name, *sha256, *content_type;
    double bytes;
    enum status status = json_string(line, "name", type, "", &name, err);
    if (status == STATUS_OK)
        status = json_string(line, "sha256", type, "", &sha256, err);
    if (status == STATUS_OK)
        status = json_string(line, "content_type", type, "application/octet-stream", &content_type, err);
    if (status == STATUS_OK)
        status = json_number(line, "bytes", type, -1.0, &bytes, err);
    if (status == STATUS_OK) {
        struct stat info;
        char *path = mem_printf("%s/out/%s", a->dir, name);
        bool is_there = lstat(path, &info) == 0;
        if (!is_there && errno != ENOENT && !is_last)
            status = error_set_errno(err, errno, "cannot look at %s", path);
        else if (!is_there || !S_ISREG(info.st_mode) || (double)info.st_size != bytes)
            status = error_set(err, STATUS_INPUT, "%s is not a file of %.0f bytes", name, bytes);
        mem_free(path);
    }
    if (status == STATUS_OK)
        status = store_output_put(store, a->job_id, a->number, type, name, (uint64_t)bytes, sha256, content_type, err);
    return status;
}

/* Another try would end like this one. */
static bool is_final(enum status status) {
    return status == STATUS_OK || status == STATUS_INPUT || status == STATUS_CONFLICT || status == STATUS_NOT_FOUND;
}

/* A newer file has taken its place. */
static void drop_untaken(struct attempt *a, const cJSON *line) {
    const cJSON *name = cJSON_GetObjectItemCaseSensitive(line, "name");
    for (int i = cJSON_GetArraySize(a->untaken); i-- > 0;)
        if (cJSON_Compare(name, cJSON_GetObjectItemCaseSensitive(cJSON_GetArrayItem(a->untaken, i), "name"), true))
            cJSON_DeleteItemFromArray(a->untaken, i);
}

static void log_file(const struct attempt *a, enum status status, const struct error *err) {
    if (status != STATUS_OK)
        log_warning("job %lld: its worker announced a file that is not taken%s: %s", (long long)a->job_id,
                    is_final(status) ? "" : " yet", err->message);
}

static void enter_file(const struct listener *l, const char *type, const cJSON *line) {
    struct attempt *a = l->attempt;
    struct error err;
    if (a->job_id == 0 || a->event_count++ >= EVENTS_MAX)
        return;
    drop_untaken(a, line);
    enum status status = put_file(a, l->store, type, line, false, &err);
    log_file(a, status, &err);
    if (is_final(status))
        return;
    cJSON *kept = cJSON_Duplicate(line, true);
    json_add_string(kept, "type", type);
    a->untaken = a->untaken ? a->untaken : cJSON_CreateArray();
    cJSON_AddItemToArray(a->untaken, kept);
}

enum status hearing_make_up(struct attempt *a, struct store *store, struct error *err) {
    const cJSON *line;
    while ((line = cJSON_GetArrayItem(a->untaken, 0)) != NULL) {
        const char *type = cJSON_GetStringValue(cJSON_GetObjectItemCaseSensitive(line, "type"));
        enum status status = put_file(a, store, type, line, true, err);
        if (!is_final(status))
            return status;
        log_file(a, status, err);
        cJSON_DeleteItemFromArray(a->untaken, 0);
    }
    return STATUS_OK;
}

static void note_end(struct attempt *a, const cJSON *line) {
    const char *word, *message, *hint;
    if (json_string(line, "status", "end", "", &word, NULL) != STATUS_OK ||
        json_string(line, "message", "end", "", &message, NULL) != STATUS_OK ||
        json_string(line, "hint", "end", "", &hint, NULL) != STATUS_OK)
        return;
    for (int i = 0; i < STATUS_COUNT; i++) {
        if (strcmp(status_name((enum status)i), word) == 0) {
            a->has_end = true;
            a->end_status = (enum status)i;
        }
    }
    mem_free(a->end_message);
    mem_free(a->end_hint);
    a->end_message = mem_strdup(message);
    a->end_hint = mem_strdup(hint);
}

static void note_checkpoint(const struct listener *l, const cJSON *line) {
    double iteration, bytes, seconds;
    if (json_number(line, "iteration", "checkpoint", 0, &iteration, NULL) != STATUS_OK ||
        json_number(line, "bytes", "checkpoint", 0, &bytes, NULL) != STATUS_OK ||
        json_number(line, "seconds", "checkpoint", 0, &seconds, NULL) != STATUS_OK)
        return;
    if (bytes >= 0.0 && seconds >= 0.0 && bytes < 1e15 && seconds < 1e6) {
        atomic_fetch_add(&l->figures->checkpoint_count, 1);
        atomic_fetch_add(&l->figures->checkpoint_bytes, (unsigned long long)bytes);
        atomic_fetch_add(&l->figures->checkpoint_us, (unsigned long long)(seconds * 1e6));
    }
    cJSON *data = cJSON_CreateObject();
    char *message = mem_printf("checkpoint at iteration %.0f: %.1f MB in %.2f s", iteration,
                               bytes * 1e-6, seconds);
    json_add_string(data, "level", "info");
    json_add_string(data, "message", message);
    enter_event(l, EVENT_LOG, data);
    mem_free(message);
    cJSON_Delete(data);
}

/* How far the optimiser is: the loss comes with its iteration, `rays` is only for the figures.
 * True when the metric is none of the job's curves. */
static bool note_figures(const struct listener *l, const cJSON *line) {
    struct attempt *a = l->attempt;
    const char *series;
    double step, value;
    if (json_string(line, "series", "metric", "", &series, NULL) != STATUS_OK ||
        json_number(line, "step", "metric", 0, &step, NULL) != STATUS_OK ||
        json_number(line, "value", "metric", 0, &value, NULL) != STATUS_OK)
        return false;
    bool is_rays = strcmp(series, "rays") == 0;
    /* The first iteration that is heard of may be a resumed one: only what follows is new. */
    if (strcmp(series, "loss") == 0 && step < 1e15) {
        if (a->iteration >= 0.0 && step > a->iteration)
            atomic_fetch_add(&l->figures->iteration_count, (unsigned long long)(step - a->iteration));
        a->iteration = step;
    }
    if (is_rays && value > a->rays && value < 1e18) {
        atomic_fetch_add(&l->figures->ray_count, (unsigned long long)(value - a->rays));
        a->rays = value;
    }
    return is_rays;
}

static void hear(void *user, const char *text, size_t length) {
    const struct listener *l = user;
    struct attempt *a = l->attempt;
    cJSON *line;
    if (json_parse(text, length, "a worker's line", &line, NULL) != STATUS_OK)
        return; /* and so is a line of an unknown type */
    /* Events have their type beside their data, not in it. */
    cJSON *kept = cJSON_DetachItemFromObjectCaseSensitive(line, "type");
    const char *type = kept && kept->valuestring ? kept->valuestring : "";
    if (strcmp(type, "stage") == 0) { /* a stage begins: its progress is none */
        json_add_number(line, "done", 0.0);
        json_add_number(line, "total", 0.0);
        json_add_number(line, "eta_sec", -1.0);
    }
    if (strcmp(type, "progress") == 0 || strcmp(type, "stage") == 0)
        enter_event(l, EVENT_PROGRESS, line);
    else if (strcmp(type, "metric") == 0) {
        if (!note_figures(l, line))
            enter_event(l, EVENT_METRIC, line);
    }
    else if (strcmp(type, "log") == 0)
        enter_event(l, EVENT_LOG, line);
    else if (strcmp(type, "preview") == 0)
        enter_file(l, EVENT_PREVIEW, line);
    else if (strcmp(type, "output") == 0)
        enter_file(l, EVENT_OUTPUT, line);
    else if (strcmp(type, "checkpoint") == 0)
        note_checkpoint(l, line);
    else if (strcmp(type, "end") == 0)
        note_end(a, line);
    else if (strcmp(type, "problem") == 0 && a->problems) {
        if (cJSON_GetArraySize(a->problems) < PROBLEMS_MAX) {
            cJSON_AddItemToArray(a->problems, line);
            line = NULL;
        }
    } else if (strcmp(type, "scene") == 0) {
        cJSON_Delete(a->facts);
        a->facts = cJSON_DetachItemFromObjectCaseSensitive(line, "facts");
    }
    cJSON_Delete(kept);
    cJSON_Delete(line);
}

void hearing_listen(struct attempt *a, struct store *store, struct figures *figures) {
    struct listener listener = {.attempt = a, .store = store, .figures = figures};
    if (a->phase != ATTEMPT_ALIVE)
        return;
    supervisor_read(&a->worker, hear, &listener);
    if (supervisor_bury(&a->worker, &a->wait_status, hear, &listener))
        a->phase = ATTEMPT_ENDED;
}
