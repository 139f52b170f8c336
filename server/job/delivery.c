/* delivery.c -- see delivery.h. */
#include "server/job/delivery.h"

#include <poll.h>
#include <signal.h>
#include <stdio.h>
#include <string.h>
#include <sys/wait.h>

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
    supervisor_release(&d->worker);
    if (file_remove_tree(d->dir, &err) != STATUS_OK)
        log_warning("%s", err.message);
    mem_free(d->dir);
    d->dir = NULL;
}

static void forget(struct delivery *d) { *d = (struct delivery){.worker = {.pid_fd = -1, .pipe_fd = -1}}; }

enum status delivery_start(struct delivery *d, const struct scheduler_config *config, const struct outbox_row *row,
                           struct error *err) {
    char number[32];
    *d = (struct delivery){.id = row->id,
                           .job_id = row->job_id,
                           .owner_id = row->owner_id,
                           .worker = {.pid_fd = -1, .pipe_fd = -1},
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
    char *text = json_text(order), *path = layout_order(d->dir);
    enum status status = file_make_dirs(d->dir, err);
    if (status == STATUS_OK)
        status = file_replace(path, text, strlen(text), err);
    if (status == STATUS_OK)
        status = supervisor_start(&d->worker, config->worker_binary, d->dir, err);
    mem_free(path);
    mem_free(text);
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

bool delivery_listen(struct delivery *d, struct store *store) {
    int wait_status;
    if (d->id == 0)
        return true;
    if (!d->has_ended) {
        supervisor_read(&d->worker, take_line, d);
        if (clock_sec() >= d->kill_at_sec)
            supervisor_signal(&d->worker, SIGKILL);
        if (!supervisor_reap(&d->worker, &wait_status, take_line, d))
            return false;
        d->has_ended = true;
        d->delivered = WIFEXITED(wait_status) && WEXITSTATUS(wait_status) == PROGRESS_EXIT_OK;
        clear_away(d);
    }
    return settle(d, store);
}

void delivery_stop(struct delivery *d, struct store *store) {
    supervisor_signal(&d->worker, SIGKILL);
    while (!delivery_listen(d, store) && !d->has_ended)
        poll(NULL, 0, 5);
    forget(d);
}
