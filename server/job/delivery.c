/* delivery.c -- see delivery.h. */
#include "server/job/delivery.h"

#include <poll.h>
#include <stdio.h>
#include <string.h>

#include "common/clock.h"
#include "common/file.h"
#include "common/json.h"
#include "common/log.h"
#include "common/mem.h"
#include "server/data/layout.h"
#include "server/worker/progress.h"

/* Every receiver that timed out has less time at the next try: others wait for their turns. */
#define LIMIT_SEC 20.0
#define LIMIT_AGAIN_SEC 10.0

/* Cleans up after the process: its pipe and its order. */
static void clear_away(struct delivery *d) {
    struct error err;
    run_free(d->run);
    d->run = NULL;
    if (file_remove_tree(d->dir, &err) != STATUS_OK)
        log_warning("%s", err.message);
    mem_free(d->dir);
    d->dir = NULL;
}

static void forget(struct delivery *d) { *d = (struct delivery){0}; }

enum status delivery_start(struct delivery *d, const struct scheduler_config *config, const struct outbox_row *row,
                           struct error *err) {
    char number[32];
    *d = (struct delivery){.id = row->id,
                           .job_id = row->job_id,
                           .owner_id = row->owner_id,
                           .kill_at_sec = clock_sec() + (row->tries > 0 ? LIMIT_AGAIN_SEC : LIMIT_SEC),
                           .dir = layout_message(config->data_dir, row->id)};
    cJSON *order = cJSON_CreateObject();
    json_add_string(order, "kind", "deliver");
    json_add_bool(order, "sandbox", config->sandbox);
    json_add_string(order, "url", row->url);
    json_add_string(order, "secret", row->secret);
    json_add_string(order, "body", row->body);
    snprintf(number, sizeof number, "msg_%lld", (long long)row->id);
    json_add_string(order, "message_id", number);
    json_add_bool(order, "allow_private", config->webhook_private);
    char *folder = layout_message(NULL, row->id), *log = layout_log(folder);
    const struct run_work work = {.folder = folder, .log = log, .order = order};
    enum status status = file_make_dirs(d->dir, err);
    if (status == STATUS_OK)
        status = config->executor->start(config->executor, &work, &d->run, err);
    mem_free(log);
    mem_free(folder);
    cJSON_Delete(order);
    if (status != STATUS_OK) {
        clear_away(d);
        forget(d);
    }
    return status;
}

/* Reads the lines with the HTTP status and with how it ended. */
static void take_line(void *user, const char *text, size_t length) {
    struct delivery *d = user;
    const char *type, *message, *word;
    double code;
    cJSON *line;
    if (json_parse(text, length, "a worker's line", &line, NULL) != STATUS_OK)
        return;
    if (json_string(line, "type", "line", "", &type, NULL) == STATUS_OK && strcmp(type, "end") == 0 &&
        json_string(line, "message", "line", "", &message, NULL) == STATUS_OK)
        snprintf(d->reason, sizeof d->reason, "%s", message);
    if (json_string(line, "status", "line", "", &word, NULL) == STATUS_OK)
        d->is_final = d->is_final || strcmp(word, status_name(STATUS_INPUT)) == 0;
    if (json_string(line, "series", "line", "", &word, NULL) == STATUS_OK && strcmp(word, "status") == 0 &&
        json_number(line, "value", "line", 0, &code, NULL) == STATUS_OK && code >= 100 && code <= 999)
        d->status = (int)code;
    cJSON_Delete(line);
}

/* Enters the outcome in the store. */
static bool settle(struct delivery *d, struct store *store) {
    struct error err;
    bool gave_up;
    const struct outbox_outcome outcome = {.delivered = d->delivered,
                                           .is_final = d->is_final,
                                           .status = d->status,
                                           .reason = d->delivered   ? NULL
                                                     : d->reason[0] ? d->reason
                                                                    : "it timed out"};
    if (store_outbox_settle(store, d->id, &outcome, &gave_up, &err) != STATUS_OK) {
        if (!d->complained)
            log_warning("a webhook's outcome cannot be recorded: %s", err.message);
        d->complained = true;
        return false;
    }
    if (!d->delivered)
        log_warning("job %lld: its webhook cannot be called%s: %s", (long long)d->job_id,
                    gave_up ? ", and will not be again" : "", d->reason[0] ? d->reason : "it timed out");
    forget(d);
    return true;
}

bool delivery_poll(struct delivery *d, struct store *store) {
    struct run_end end;
    if (d->id == 0)
        return true;
    if (!d->has_ended) {
        run_read(d->run, take_line, d);
        if (clock_sec() >= d->kill_at_sec)
            run_ask(d->run, RUN_KILL);
        if (!run_ended(d->run, &end, take_line, d))
            return false;
        d->has_ended = true;
        d->delivered = end.way == RUN_EXIT && end.code == PROGRESS_EXIT_OK;
        clear_away(d);
    }
    return settle(d, store);
}

void delivery_stop(struct delivery *d, struct store *store) {
    run_ask(d->run, RUN_KILL);
    while (!delivery_poll(d, store) && !d->has_ended)
        poll(NULL, 0, 5);
    forget(d);
}
