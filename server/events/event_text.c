/* event_text.c -- see event_text.h. */
#include "server/events/event_text.h"

#include "common/clock.h"
#include "common/mem.h"
#include "common/protocol.h"

static void set(cJSON *data, const char *name, cJSON *value) {
    cJSON_DeleteItemFromObjectCaseSensitive(data, name);
    json_add(data, name, value);
}

/* Appends one event. Takes data, an object, and sets its `at`, `job` and `attempt`. */
static void add(struct buf *text, bool is_ndjson, const struct event_row *row, cJSON *data) {
    char at[CLOCK_TEXT_SIZE];
    clock_text(row->at_ms, at);
    set(data, "at", json_new_string(at));
    if (row->job_id) {
        set(data, "job", cJSON_CreateNumber((double)row->job_id));
        set(data, "attempt", cJSON_CreateNumber(row->attempt));
    }
    char *line = json_text(data);
    if (is_ndjson)
        buf_printf(text, "{\"id\":%lld,\"event\":\"%s\",\"data\":%s}\n", (long long)row->id, row->type, line);
    else
        buf_printf(text, "id: %lld\nevent: %s\ndata: %s\n\n", (long long)row->id, row->type, line);
    mem_free(line);
    cJSON_Delete(data);
}

void event_text_add_row(struct buf *text, bool is_ndjson, const struct event_row *row) {
    cJSON *object = cJSON_Parse(row->data);
    add(text, is_ndjson, row, object ? object : cJSON_CreateObject());
}

void event_text_add_snapshot(struct buf *text, bool is_ndjson, int64_t job_id, int64_t id, cJSON *view) {
    const cJSON *attempt = cJSON_GetObjectItemCaseSensitive(view, "attempt");
    struct event_row row = {
        .id = id, .job_id = job_id, .at_ms = clock_unix_ms(), .type = EVENT_STATE, .attempt = attempt->valueint};
    json_add_bool(view, "snapshot", true);
    add(text, is_ndjson, &row, view);
}

void event_text_add_resync(struct buf *text, bool is_ndjson, int64_t id, const char *reason) {
    cJSON *data = cJSON_CreateObject();
    json_add_string(data, "reason", reason);
    struct event_row row = {.id = id, .at_ms = clock_unix_ms(), .type = EVENT_RESYNC};
    add(text, is_ndjson, &row, data);
}

void event_text_add_keepalive(struct buf *text, bool is_ndjson) {
    buf_puts(text, is_ndjson ? "\n" : ": keepalive\n\n");
}
