/* worker_messages.c -- see worker_messages.h.
 *
 * A worker that reports too much must not keep the daemon from other work. Above event_max reports, an attempt's
 * reports are entered once a second; of those in between
 *
 *      files       are all entered, the newest of each name
 *      progress    only the newest is entered
 *      the rest    is dropped, and one event says so
 */
#include "server/job/worker_messages.h"

#include <errno.h>
#include <string.h>
#include <sys/stat.h>

#include "common/clock.h"
#include "common/log.h"
#include "common/mem.h"
#include "common/protocol.h"
#include "server/data/layout.h"
#include "server/job/disk_usage.h"

#define THINNED_SEC 1.0   /* between two reports that are entered, once they are thinned */
#define UNTAKEN_MAX 2000  /* files; a normal job has a few hundred */
#define PROBLEMS_MAX 1000 /* of one scene */

struct message_listener {
    struct attempt *attempt;
    struct store *store;
    struct counters *counters;
};

static void complain(struct attempt *a, const char *type, const struct error *err) {
    if (!a->complained) /* logged once: the next thousand would say the same */
        log_warning("job %lld: cannot record a %s event: %s", (long long)a->job_id, type, err->message);
    a->complained = true;
}

/* `data` is as the worker sent it. Members that only the daemon sets are removed: the worker has parsed untrusted
 * files and may name another job. */
static void put_event(struct attempt *a, struct store *store, const char *type, cJSON *data) {
    static const char *const daemons[] = {"job", "attempt", "at", "snapshot"};
    struct error err;
    for (size_t i = 0; i < sizeof daemons / sizeof *daemons; i++)
        cJSON_DeleteItemFromObjectCaseSensitive(data, daemons[i]);
    char *text = json_text(data);
    if (store_event_add(store, a->job_id, a->number, type, text, &err) != STATUS_OK)
        complain(a, type, &err);
    mem_free(text);
}

static void say_thinned(struct attempt *a, struct store *store) {
    if (a->said_thinned)
        return;
    a->said_thinned = true;
    char *message =
        mem_printf("this attempt has reported %ld events: from here on its metrics and log lines are dropped, "
                   "and progress is entered once a second; outputs are all there",
                   a->event_max);
    cJSON *data = cJSON_CreateObject();
    json_add_string(data, "level", "warning");
    json_add_string(data, "message", message);
    log_warning("job %lld: %s", (long long)a->job_id, message);
    put_event(a, store, EVENT_LOG, data);
    cJSON_Delete(data);
    mem_free(message);
}

/* Whether this report is above the attempt's limit. */
static bool is_thinned(struct attempt *a, struct store *store) {
    if (a->event_count < a->event_max) {
        a->event_count++;
        return false;
    }
    say_thinned(a, store);
    return true;
}

/* Progress of a part becomes that of the job; false: it says nothing. */
static bool add_up(const struct message_listener *l, cJSON *data) {
    struct attempt *a = l->attempt;
    struct parts_progress all;
    struct error err;
    double done, total, eta_sec;
    if (json_number(data, "done", "progress", 0.0, &done, NULL) != STATUS_OK ||
        json_number(data, "total", "progress", 0.0, &total, NULL) != STATUS_OK ||
        json_number(data, "eta_sec", "progress", -1.0, &eta_sec, NULL) != STATUS_OK || !(total > 0.0))
        return false;
    if (store_part_progress(l->store, a->job_id, a->number, done, eta_sec, &all, &err) != STATUS_OK) {
        complain(a, EVENT_PROGRESS, &err);
        return false;
    }
    cJSON_SetNumberHelper(cJSON_GetObjectItemCaseSensitive(data, "done"), all.done);
    cJSON_SetNumberHelper(cJSON_GetObjectItemCaseSensitive(data, "total"), all.total);
    cJSON_DeleteItemFromObjectCaseSensitive(data, "eta_sec");
    json_add_number(data, "eta_sec", all.eta_sec);
    return true;
}

static void enter_event(const struct message_listener *l, const char *type, cJSON *data) {
    struct attempt *a = l->attempt;
    if (a->job_id == 0 || (a->part.part > 0 && strcmp(type, EVENT_PROGRESS) == 0 && !add_up(l, data)))
        return;
    if (!is_thinned(a, l->store)) {
        put_event(a, l->store, type, data);
    } else if (strcmp(type, EVENT_PROGRESS) == 0) {
        cJSON_Delete(a->late_progress);
        a->late_progress = cJSON_Duplicate(data, true);
    }
}

/* The file must exist, complete and regular, since it will be served to users. Where the disk gives no answer, it is
 * asked again, for the last time after the worker has ended. A preview of another size is a newer one, which the worker
 * announces next: it is not entered, and not wrong. */
static enum status put_file(const struct attempt *a, struct store *store, const char *type, const cJSON *line,
                            bool is_last, struct error *err) {
    const char *name, *sha256, *content_type;
    double bytes;
    bool is_replaced = false;
    enum status status = json_string(line, "name", type, "", &name, err);
    if (status == STATUS_OK)
        status = json_string(line, "sha256", type, "", &sha256, err);
    if (status == STATUS_OK)
        status = json_string(line, "content_type", type, "application/octet-stream", &content_type, err);
    if (status == STATUS_OK)
        status = json_number(line, "bytes", type, -1.0, &bytes, err);
    if (status == STATUS_OK) {
        struct stat info;
        char *path = layout_output(a->dir, name);
        bool is_there = lstat(path, &info) == 0;
        if (!is_there && errno != ENOENT && !is_last)
            status = error_set_errno(err, errno, "cannot access %s", path);
        else if (is_there && S_ISREG(info.st_mode) && (double)info.st_size != bytes && strcmp(type, EVENT_PREVIEW) == 0)
            is_replaced = true;
        else if (!is_there || !S_ISREG(info.st_mode) || (double)info.st_size != bytes)
            status = error_set(err, STATUS_INPUT, "%s is not a file of %.0f bytes", name, bytes);
        mem_free(path);
    }
    if (status == STATUS_OK && !is_replaced)
        status = store_output_put(store, a->job_id, a->number, type, name, (uint64_t)bytes, sha256, content_type, err);
    return status;
}

/* Whether another try would fail the same way. */
static bool is_final(enum status status) {
    return status == STATUS_OK || status == STATUS_INPUT || status == STATUS_CONFLICT || status == STATUS_NOT_FOUND;
}

/* Drops a file that a newer one has replaced. */
static void drop_untaken(struct attempt *a, const cJSON *line) {
    const cJSON *name = cJSON_GetObjectItemCaseSensitive(line, "name");
    for (int i = cJSON_GetArraySize(a->untaken); i-- > 0;)
        if (cJSON_Compare(name, cJSON_GetObjectItemCaseSensitive(cJSON_GetArrayItem(a->untaken, i), "name"), true))
            cJSON_DeleteItemFromArray(a->untaken, i);
}

static void log_file(const struct attempt *a, enum status status, const struct error *err) {
    if (status != STATUS_OK)
        log_warning("job %lld: its worker announced a file that is not entered%s: %s", (long long)a->job_id,
                    is_final(status) ? "" : " yet", err->message);
}

/* Keeps a file for later; it replaces an older one of that name. */
static void keep_file(struct attempt *a, const char *type, const cJSON *line) {
    cJSON *kept = cJSON_Duplicate(line, true);
    json_add_string(kept, "type", type);
    a->untaken = a->untaken ? a->untaken : cJSON_CreateArray();
    cJSON_AddItemToArray(a->untaken, kept);
}

static void enter_file(const struct message_listener *l, const char *type, const cJSON *line) {
    struct attempt *a = l->attempt;
    struct error err;
    if (a->job_id == 0)
        return;
    drop_untaken(a, line);
    if (is_thinned(a, l->store) && cJSON_GetArraySize(a->untaken) < UNTAKEN_MAX) {
        keep_file(a, type, line);
        return;
    }
    enum status status = put_file(a, l->store, type, line, false, &err);
    log_file(a, status, &err);
    if (!is_final(status))
        keep_file(a, type, line);
}

/* Enters the files of a->untaken; removes those that are entered or can never be. */
static enum status take_files(struct attempt *a, struct store *store, bool is_last, struct error *err) {
    const cJSON *line;
    while ((line = cJSON_GetArrayItem(a->untaken, 0)) != NULL) {
        const char *type = cJSON_GetStringValue(cJSON_GetObjectItemCaseSensitive(line, "type"));
        enum status status = put_file(a, store, type, line, is_last, err);
        if (!is_final(status))
            return status;
        log_file(a, status, err);
        cJSON_DeleteItemFromArray(a->untaken, 0);
    }
    return STATUS_OK;
}

enum status worker_messages_retry(struct attempt *a, struct store *store, struct error *err) {
    if (a->late_progress)
        put_event(a, store, EVENT_PROGRESS, a->late_progress);
    cJSON_Delete(a->late_progress);
    a->late_progress = NULL;
    return take_files(a, store, true, err);
}

/* Enters what a thinned attempt has reported since the last time. */
static void enter_late(struct attempt *a, struct store *store) {
    struct error err;
    double now = clock_sec();
    if (!a->said_thinned || now - a->thinned_at < THINNED_SEC)
        return;
    a->thinned_at = now;
    if (a->late_progress)
        put_event(a, store, EVENT_PROGRESS, a->late_progress);
    cJSON_Delete(a->late_progress);
    a->late_progress = NULL;
    (void)take_files(a, store, false, &err); /* what fails is kept for the next time */
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

static void note_checkpoint(const struct message_listener *l, const cJSON *line) {
    double iteration, bytes, seconds;
    if (json_number(line, "iteration", "checkpoint", 0, &iteration, NULL) != STATUS_OK ||
        json_number(line, "bytes", "checkpoint", 0, &bytes, NULL) != STATUS_OK ||
        json_number(line, "seconds", "checkpoint", 0, &seconds, NULL) != STATUS_OK)
        return;
    if (bytes >= 0.0 && seconds >= 0.0 && bytes < 1e15 && seconds < 1e6) {
        atomic_fetch_add(&l->counters->checkpoint_count, 1);
        atomic_fetch_add(&l->counters->checkpoint_bytes, (unsigned long long)bytes);
        atomic_fetch_add(&l->counters->checkpoint_us, (unsigned long long)(seconds * 1e6));
    }
    cJSON *data = cJSON_CreateObject();
    char *message = mem_printf("checkpoint at iteration %.0f: %.1f MB in %.2f s", iteration, bytes * 1e-6, seconds);
    json_add_string(data, "level", "info");
    json_add_string(data, "message", message);
    enter_event(l, EVENT_LOG, data);
    mem_free(message);
    cJSON_Delete(data);
}

/* What the worker takes of the disk without a name in its folder: it counts as its owner's until the attempt ends. */
static void note_space(const struct message_listener *l, const cJSON *line) {
    struct attempt *a = l->attempt;
    struct error err;
    double bytes;
    struct disk_use use = {.job_id = a->job_id, .bytes = a->job_id ? disk_usage_of_folder(a->whole_dir) : -1};
    if (json_number(line, "bytes", "space", -1.0, &bytes, NULL) != STATUS_OK || !(bytes >= 0.0 && bytes < 1e15) ||
        use.bytes < 0)
        return;
    use.bytes += (int64_t)bytes;
    if (store_disk_enter(l->store, &use, 1, &err) != STATUS_OK)
        complain(a, "space", &err);
}

/* Counts iterations and rays. A loss comes with its iteration; `rays` is only counted. True when the metric is not
 * one of the job's curves. */
static bool note_counters(const struct message_listener *l, const cJSON *line) {
    struct attempt *a = l->attempt;
    const char *series;
    double step, value;
    if (json_string(line, "series", "metric", "", &series, NULL) != STATUS_OK ||
        json_number(line, "step", "metric", 0, &step, NULL) != STATUS_OK ||
        json_number(line, "value", "metric", 0, &value, NULL) != STATUS_OK)
        return false;
    bool is_rays = strcmp(series, "rays") == 0;
    /* The first iteration reported may be that of a resumed job: only later ones count as new. */
    if (strcmp(series, "loss") == 0 && step < 1e15) {
        if (a->iteration >= 0.0 && step > a->iteration)
            atomic_fetch_add(&l->counters->iteration_count, (unsigned long long)(step - a->iteration));
        a->iteration = step;
    }
    if (is_rays && value > a->rays && value < 1e18) {
        atomic_fetch_add(&l->counters->ray_count, (unsigned long long)(value - a->rays));
        a->rays = value;
    }
    return is_rays;
}

/* For who watches the check; the last ones are entered when it ends. */
static void note_facts(const struct message_listener *l) {
    struct attempt *a = l->attempt;
    struct error err;
    if (!a->facts)
        return;
    char *text = json_text(a->facts);
    if (store_scene_set_facts(l->store, a->scene_id, a->reading, text, &err) != STATUS_OK)
        complain(a, "scene", &err);
    mem_free(text);
}

/* A worker that works as intended never sends unknown lines. Logged once. */
static void say_unread(struct attempt *a, const char *what) {
    if (!a->said_unread && a->job_id)
        log_warning("job %lld: a line of its worker %s and is ignored", (long long)a->job_id, what);
    else if (!a->said_unread)
        log_warning("scene %.12s: a line of its check %s and is ignored", a->scene_id, what);
    a->said_unread = true;
}

static void take_line(void *user, const char *text, size_t length) {
    const struct message_listener *l = user;
    struct attempt *a = l->attempt;
    cJSON *line;
    if (json_parse(text, length, "a worker's line", &line, NULL) != STATUS_OK) {
        say_unread(a, "is no JSON object"); /* lines of an unknown type are ignored too */
        return;
    }
    /* An event's type is stored beside its data, not in it. */
    cJSON *kept = cJSON_DetachItemFromObjectCaseSensitive(line, "type");
    const char *type = kept && kept->valuestring ? kept->valuestring : "";
    if (strcmp(type, "stage") == 0) { /* a new stage starts without progress */
        json_add_number(line, "done", 0.0);
        json_add_number(line, "total", 0.0);
        json_add_number(line, "eta_sec", -1.0);
    }
    if (strcmp(type, "progress") == 0 || strcmp(type, "stage") == 0)
        enter_event(l, EVENT_PROGRESS, line);
    else if (strcmp(type, "metric") == 0) {
        if (!note_counters(l, line))
            enter_event(l, EVENT_METRIC, line);
    } else if (strcmp(type, "log") == 0)
        enter_event(l, EVENT_LOG, line);
    else if (strcmp(type, "preview") == 0)
        enter_file(l, EVENT_PREVIEW, line);
    else if (strcmp(type, "output") == 0)
        enter_file(l, EVENT_OUTPUT, line);
    else if (strcmp(type, "checkpoint") == 0)
        note_checkpoint(l, line);
    else if (strcmp(type, "space") == 0)
        note_space(l, line);
    else if (strcmp(type, "plan") == 0) {
        cJSON_Delete(a->plan);
        a->plan = line;
        line = NULL;
    } else if (strcmp(type, "end") == 0)
        note_end(a, line);
    else if (strcmp(type, "problem") == 0 && a->problems) {
        if (cJSON_GetArraySize(a->problems) < PROBLEMS_MAX) {
            cJSON_AddItemToArray(a->problems, line);
            line = NULL;
        } else {
            a->problems_left_out++;
        }
    } else if (strcmp(type, "scene") == 0) {
        cJSON_Delete(a->facts);
        a->facts = cJSON_DetachItemFromObjectCaseSensitive(line, "facts");
        note_facts(l);
    }
    cJSON_Delete(kept);
    cJSON_Delete(line);
}

void worker_messages_read(struct attempt *a, struct store *store, struct counters *counters) {
    struct message_listener listener = {.attempt = a, .store = store, .counters = counters};
    if (a->phase != ATTEMPT_ALIVE)
        return;
    run_read(a->run, take_line, &listener);
    if (run_ended(a->run, &a->end, take_line, &listener))
        a->phase = ATTEMPT_ENDED;
    else
        enter_late(a, store);
    if (a->run->long_lines > 0)
        say_unread(a, "is longer than a line may be");
}
