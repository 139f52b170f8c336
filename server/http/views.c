/* views.c -- see views.h. */
#include "server/http/views.h"

#include <stdio.h>
#include <string.h>

#include "common/clock.h"
#include "common/mem.h"
#include "common/url.h"
#include "server/net/field.h"
#include "server/transport/problem.h"

#define LIMIT_DEFAULT 50 /* items of a page, without ?limit= */
#define LIMIT_MAX 200    /* with it */

void view_add_time(cJSON *object, const char *key, int64_t unix_ms) {
    char text[CLOCK_TEXT_SIZE];
    clock_text(unix_ms, text);
    json_add_string(object, key, unix_ms > 0 ? text : NULL);
}

/* Adds JSON text from the store, which checked it on the way in. */
static void add_text(cJSON *object, const char *key, const char *text) {
    cJSON *value = cJSON_Parse(text);
    json_add(object, key, value ? value : cJSON_CreateNull());
}

static const char *or_null(const char *text) { return text && *text ? text : NULL; }

static void add_disk_bytes(cJSON *object, int64_t bytes) {
    if (bytes >= 0)
        json_add_int(object, "disk_bytes", bytes);
    else
        json_add(object, "disk_bytes", cJSON_CreateNull());
}

/* Adds the job's webhook, and what became of its messages. */
static void add_webhook(cJSON *v, const struct job *job, const struct caller *who) {
    bool is_his = who->role == ROLE_ADMIN || who->user_id == job->owner_id;
    json_add_string(v, "webhook", is_his ? or_null(job->webhook) : NULL);
    json_add_bool(v, "has_webhook", *job->webhook != '\0');
    cJSON *known = is_his && *job->delivery ? cJSON_Parse(job->delivery) : NULL;
    if (!known) {
        json_add(v, "webhook_delivery", cJSON_CreateNull());
        return;
    }
    const cJSON *next = cJSON_GetObjectItemCaseSensitive(known, "next_ms");
    int64_t next_ms = cJSON_IsNumber(next) ? (int64_t)next->valuedouble : 0;
    int64_t at_ms = (int64_t)cJSON_GetNumberValue(cJSON_GetObjectItemCaseSensitive(known, "at_ms"));
    cJSON_DeleteItemFromObjectCaseSensitive(known, "next_ms");
    cJSON_DeleteItemFromObjectCaseSensitive(known, "at_ms");
    view_add_time(known, "last_at", at_ms);
    view_add_time(known, "next_try_at", next_ms);
    json_add(v, "webhook_delivery", known);
}

static void add_parts(cJSON *v, const struct job *job) {
    if (job->part_count == 0) {
        json_add(v, "parts", cJSON_CreateNull());
        return;
    }
    cJSON *parts = cJSON_AddObjectToObject(v, "parts");
    json_add_int(parts, "count", job->part_count);
    json_add_int(parts, "done", job->parts_done);
}

cJSON *view_job(const struct job *job, const struct caller *who) {
    cJSON *v = cJSON_CreateObject();
    json_add_int(v, "id", job->id);
    json_add_int(v, "revision", job->revision);
    json_add_string(v, "name", job->name);
    json_add_string(v, "kind", job_kind_name(job->kind));
    json_add_string(v, "scene", job->scene_id);
    if (job->source_id)
        json_add_int(v, "source", job->source_id);
    else
        json_add(v, "source", cJSON_CreateNull());
    add_text(v, "files", job->files);
    json_add_string(v, "owner", or_null(job->owner));
    json_add_bool(v, "shared", job->is_shared);
    json_add_string(v, "state", job_state_name(job->state));
    json_add_string(v, "wanted", job_wanted_name(job->wanted));
    json_add_int(v, "priority", job->priority);
    json_add_int(v, "turn", job->turn);
    add_text(v, "labels", job->labels);
    add_text(v, "settings", job->settings);
    json_add_int(v, "attempt", job->attempt);
    json_add_int(v, "attempts_left", job->attempts_left);
    add_parts(v, job);
    view_add_time(v, "created_at", job->created_ms);
    view_add_time(v, "started_at", job->started_ms);
    view_add_time(v, "finished_at", job->finished_ms);
    json_add_bool(v, "pinned", job->is_pinned);
    view_add_time(v, "expires_at", job->expires_ms);
    json_add_string(v, "stage", or_null(job->stage));
    /* A succeeded job may not have reported the end of its last stage. */
    json_add_number(v, "progress", job->state == JOB_SUCCEEDED ? 1.0 : job->progress);
    if (job->eta_sec >= 0)
        json_add_number(v, "eta_sec", job->eta_sec);
    else
        json_add(v, "eta_sec", cJSON_CreateNull());
    add_disk_bytes(v, job->disk_bytes);
    json_add_string(v, "reason", or_null(job->reason));
    json_add_string(v, "hint", or_null(job->hint));
    add_webhook(v, job, who);
    static const char *const parts[] = {"events", "outputs", "log"};
    cJSON *links = cJSON_AddObjectToObject(v, "links");
    char path[128];
    snprintf(path, sizeof path, "/v1/jobs/%lld", (long long)job->id);
    json_add_string(links, "self", path);
    for (size_t i = 0; i < sizeof parts / sizeof *parts; i++) {
        snprintf(path, sizeof path, "/v1/jobs/%lld/%s", (long long)job->id, parts[i]);
        json_add_string(links, parts[i], path);
    }
    snprintf(path, sizeof path, "/v1/scenes/%s", job->scene_id);
    json_add_string(links, "scene", path);
    snprintf(path, sizeof path, "/v1/jobs/%lld", (long long)job->source_id);
    if (job->source_id)
        json_add_string(links, "source", path);
    return v;
}

/* What the check found, and where its pictures are. */
static void add_facts(cJSON *v, const struct scene_row *row) {
    cJSON *facts = cJSON_Parse(row->facts), *preview;
    cJSON_ArrayForEach(preview, cJSON_GetObjectItemCaseSensitive(facts, "previews")) {
        const char *name = cJSON_GetStringValue(cJSON_GetObjectItemCaseSensitive(preview, "name"));
        struct buf href;
        if (!name)
            continue;
        buf_init(&href, SIZE_MAX / 2);
        buf_printf(&href, "/v1/scenes/%s/preview/", row->id);
        url_encode(&href, name, false);
        json_add_string(preview, "href", buf_text(&href));
        buf_release(&href);
    }
    json_add(v, "facts", facts ? facts : cJSON_CreateNull());
}

cJSON *view_scene(const struct scene_row *row) {
    cJSON *v = cJSON_CreateObject();
    json_add_string(v, "id", row->id);
    json_add_string(v, "name", row->name);
    json_add_string(v, "owner", or_null(row->owner));
    json_add_string(v, "state", scene_state_name(row->state));
    json_add_int(v, "bytes", (int64_t)row->bytes);
    add_disk_bytes(v, row->disk_bytes);
    view_add_time(v, "created_at", row->created_ms);
    json_add_bool(v, "pinned", row->is_pinned);
    view_add_time(v, "expires_at", row->expires_ms);
    add_text(v, "problems", row->problems);
    add_text(v, "reading", row->reading);
    add_facts(v, row);
    char path[128];
    snprintf(path, sizeof path, "/v1/scenes/%s", row->id);
    json_add_string(cJSON_AddObjectToObject(v, "links"), "self", path);
    return v;
}

cJSON *view_upload(const struct upload_row *row) {
    cJSON *v = cJSON_CreateObject();
    json_add_string(v, "id", row->id);
    json_add_string(v, "name", row->name);
    json_add_string(v, "owner", or_null(row->owner));
    json_add_int(v, "length", (int64_t)row->length);
    json_add_int(v, "offset", (int64_t)row->received);
    json_add_string(v, "sha256", or_null(row->sha256));
    json_add_string(v, "scene", or_null(row->scene_id));
    add_text(v, "reading", row->reading ? row->reading : "");
    view_add_time(v, "created_at", row->created_ms);
    view_add_time(v, "updated_at", row->updated_ms);
    json_add_bool(v, "pinned", row->is_pinned);
    view_add_time(v, "expires_at", row->expires_ms);
    char path[128];
    cJSON *links = cJSON_AddObjectToObject(v, "links");
    snprintf(path, sizeof path, "/v1/uploads/%s", row->id);
    json_add_string(links, "self", path);
    if (*row->scene_id) {
        snprintf(path, sizeof path, "/v1/scenes/%s", row->scene_id);
        json_add_string(links, "scene", path);
    }
    return v;
}

cJSON *view_output(int64_t job_id, const struct output_row *row) {
    cJSON *v = cJSON_CreateObject();
    json_add_string(v, "name", row->name);
    json_add_int(v, "bytes", (int64_t)row->bytes);
    json_add_string(v, "sha256", row->sha256);
    json_add_string(v, "content_type", row->content_type);
    view_add_time(v, "updated_at", row->updated_ms);
    json_add_int(v, "attempt", row->attempt);
    struct buf href;
    buf_init(&href, SIZE_MAX / 2);
    buf_printf(&href, "/v1/jobs/%lld/outputs/", (long long)job_id);
    url_encode(&href, row->name, true);
    json_add_string(v, "href", buf_text(&href));
    buf_release(&href);
    return v;
}

size_t view_limit(const struct request *r, struct response **refusal) {
    const char *text = target_query(&r->target, "limit");
    int64_t limit = LIMIT_DEFAULT;
    if (text && !field_number(text, 1, LIMIT_MAX, &limit))
        *refusal = problem(r, 400, "limit must be a number from 1 to %d", LIMIT_MAX);
    return (size_t)limit;
}

struct response *view_page(const struct request *r, cJSON *items, const char *next) {
    cJSON *page = cJSON_CreateObject();
    json_add(page, "items", items);
    json_add_string(page, "next", or_null(next));
    struct response *reply = response_json(200, page);
    if (!*next)
        return reply;
    struct buf link;
    buf_init(&link, 900);
    buf_printf(&link, "<%s?", r->target.path);
    for (size_t i = 0; i < r->target.query_count; i++) {
        if (strcmp(r->target.names[i], "cursor") == 0)
            continue;
        buf_printf(&link, "%s=", r->target.names[i]);
        url_encode(&link, r->target.values[i], false);
        buf_puts(&link, "&");
    }
    buf_puts(&link, "cursor=");
    url_encode(&link, next, false);
    buf_puts(&link, ">; rel=\"next\"");
    if (!link.overflowed) /* else `next` says it alone */
        response_field(reply, "Link", "%s", buf_text(&link));
    buf_release(&link);
    return reply;
}

struct response *view_tagged(const struct request *r, cJSON *value, const char *etag) {
    const char *known = request_field(r, "If-None-Match");
    struct response *reply;
    if (known && field_etag_listed(known, etag, true)) {
        cJSON_Delete(value);
        reply = response_new(304);
    } else {
        reply = response_json(200, value);
    }
    response_field(reply, "ETag", "%s", etag);
    return reply;
}
