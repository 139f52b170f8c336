/* scenes.c -- /v1/scenes: upload, look, remove. */
#include <stdio.h>
#include <string.h>

#include "common/mem.h"
#include "common/sha256.h"
#include "common/utf8.h"
#include "server/data/layout.h"
#include "server/data/trash.h"
#include "server/http/auth.h"
#include "server/http/handlers.h"
#include "server/http/limits.h"
#include "server/http/retention.h"
#include "server/http/scene_reading.h"
#include "server/http/space.h"
#include "server/http/views.h"
#include "server/http/whole_body.h"
#include "server/net/field.h"
#include "server/transport/body.h"
#include "server/transport/problem.h"
#include "server/uploads/upload.h"

/* A scene has no revision: what is shown of it is its tag. */
static void scene_tag(const struct scene_row *row, char tag[SHA256_HEX_SIZE + 2]) {
    cJSON *view = view_scene(row);
    char *text = json_text(view), hex[SHA256_HEX_SIZE];
    sha256_of(text, strlen(text), hex);
    snprintf(tag, SHA256_HEX_SIZE + 2, "\"%.32s\"", hex);
    mem_free(text);
    cJSON_Delete(view);
}

static struct response *tagged(const struct request *r, const struct scene_row *row) {
    char tag[SHA256_HEX_SIZE + 2];
    scene_tag(row, tag);
    return view_tagged(r, view_scene(row), tag);
}

struct response *scenes_get(struct api *api, struct request *r) {
    struct scene_row row;
    struct response *reply = NULL;
    if (!auth_scene(api, r, ACCESS_READ, &row, &reply))
        return reply;
    reply = tagged(r, &row);
    scene_row_release(&row);
    return reply;
}

struct response *scenes_list(struct api *api, struct request *r) {
    struct response *refusal = NULL;
    const char *cursor = target_query(&r->target, "cursor");
    size_t limit = view_limit(r, &refusal), count = 0;
    if (refusal)
        return refusal;
    struct scene_row *rows = mem_calloc(limit, sizeof *rows);
    char next[128] = "";
    struct error err;
    if (store_scene_list(api->store, &r->caller, cursor ? cursor : "", limit, rows, &count, next, &err) != STATUS_OK) {
        mem_free(rows);
        return err.status == STATUS_INPUT ? problem(r, 400, "%s", err.message) : problem_from(r, &err);
    }
    cJSON *items = cJSON_CreateArray();
    for (size_t i = 0; i < count; i++) {
        cJSON_AddItemToArray(items, view_scene(&rows[i]));
        scene_row_release(&rows[i]);
    }
    mem_free(rows);
    return view_page(r, items, next);
}

struct response *scenes_add(struct api *api, struct request *r) {
    char id[SHA256_HEX_SIZE], name[13];
    struct response *refusal = whole_body_end(r, id);
    if (refusal)
        return refusal;
    const char *given = target_query(&r->target, "name");
    snprintf(name, sizeof name, "%.12s", id);
    struct error err;
    struct scene_row row;
    bool existed = false;
    enum status status = STATUS_OK;
    char *reading = scene_reading_query(r, &refusal);
    if (refusal)
        return refusal;
    pthread_mutex_lock(&api->folder.scene_mutex);
    /* Not only when the body began: its length may have been unknown, and others have come meanwhile. */
    refusal = space_check_share(api, r, id, upload_bytes(r->upload));
    if (!refusal)
        status = upload_publish(r->upload, api->folder.dir, id, &err);
    if (!refusal && status == STATUS_OK)
        status = store_scene_add(api->store, id, given ? given : name, upload_bytes(r->upload), r->caller.user_id,
                                 &existed, &err);
    pthread_mutex_unlock(&api->folder.scene_mutex);
    if (!refusal && status == STATUS_OK && reading)
        status = store_scene_give_reading(api->store, &r->caller, id, reading, &err);
    mem_free(reading);
    if (refusal)
        return refusal;
    if (status == STATUS_OK)
        status = store_scene_find(api->store, &r->caller, id, &row, &err);
    if (status != STATUS_OK)
        return problem_from(r, &err);
    scheduler_wake(api->scheduler);
    struct response *reply = response_json(existed ? 200 : 201, view_scene(&row));
    response_field(reply, "Location", "/v1/scenes/%s", id);
    scene_row_release(&row);
    return reply;
}

/* What a PATCH asks for, checked; or *refusal. `body` keeps the name, *reading is the caller's. */
static void read_patch(const struct request *r, cJSON **body, struct scene_patch *patch, char **reading,
                       struct response **refusal) {
    *body = body_object(r, refusal);
    if (!*body)
        return;
    cJSON *params = cJSON_CreateArray();
    for (const cJSON *member = (*body)->child; member; member = member->next) {
        if (strcmp(member->string, "name") == 0) {
            const char *name = patch->name = cJSON_GetStringValue(member);
            if (!name || !*name || strlen(name) > API_NAME_MAX_BYTES || !utf8_is_name(name))
                problem_param(params, "name", NULL, "must be text of 1 to %d bytes without control characters",
                              API_NAME_MAX_BYTES);
        } else if (strcmp(member->string, "reading") == 0) {
            *reading = scene_reading_text(member, params);
        } else if (!retention_read(&patch->retention, member, params)) {
            problem_param(params, member->string, "known: name, reading, pinned, expires_at", "is unknown");
        }
    }
    patch->reading = *reading;
    if (cJSON_GetArraySize(params) > 0)
        *refusal = problem_invalid(r, "the change is invalid", params);
    else
        cJSON_Delete(params);
}

/* As whom it is removed: see store_scene_delete. */
static int64_t owner_of(const struct request *r) { return r->caller.role == ROLE_ADMIN ? -1 : r->caller.user_id; }

struct response *scenes_patch(struct api *api, struct request *r) {
    struct scene_row row;
    struct error err;
    struct scene_patch patch = {0};
    struct response *reply = NULL;
    cJSON *body = NULL;
    char *reading = NULL;
    const char *match = request_field(r, "If-Match");
    char tag[SHA256_HEX_SIZE + 2];
    if (!auth_scene(api, r, ACCESS_CHANGE, &row, &reply))
        return reply;
    scene_tag(&row, tag);
    if (match && !field_etag_listed(match, tag, false))
        reply = problem_full(r, 412, "the scene is not as If-Match says", "GET it and try again", NULL);
    if (!reply)
        read_patch(r, &body, &patch, &reading, &reply);
    pthread_mutex_lock(&api->folder.scene_mutex); /* two at once would both find the limit unreached */
    if (!reply && reading && row.state != SCENE_CHECKING)
        reply = limits_check_checks(api, r);
    if (!reply && store_scene_patch(api->store, &r->caller, row.id, &patch, &err) != STATUS_OK)
        reply = problem_from(r, &err);
    pthread_mutex_unlock(&api->folder.scene_mutex);
    if (!reply && reading)
        scheduler_wake(api->scheduler);
    mem_free(reading);
    char id[SCENE_ID_SIZE];
    memcpy(id, row.id, sizeof id);
    scene_row_release(&row);
    cJSON_Delete(body);
    if (reply)
        return reply;
    if (store_scene_find(api->store, &r->caller, id, &row, &err) != STATUS_OK)
        return problem_from(r, &err);
    scene_tag(&row, tag);
    reply = response_json(200, view_scene(&row));
    response_field(reply, "ETag", "%s", tag);
    scene_row_release(&row);
    return reply;
}

struct response *scenes_delete(struct api *api, struct request *r) {
    struct scene_row row;
    struct error err;
    bool is_gone, dry_run;
    struct response *reply = retention_dry_run(r, &dry_run);
    if (reply || !auth_scene(api, r, ACCESS_CHANGE, &row, &reply))
        return reply;
    char *path = layout_scene(NULL, row.id);
    pthread_mutex_lock(&api->folder.scene_mutex);
    enum status status = store_scene_delete(api->store, row.id, owner_of(r), dry_run, &is_gone, &err);
    if (is_gone && !dry_run)
        status = trash_take(api->folder.trash, path, &err);
    pthread_mutex_unlock(&api->folder.scene_mutex);
    if (status == STATUS_OK && dry_run) /* others may own it, too: then nothing is freed */
        reply = retention_would_free(api, r, is_gone ? path : NULL);
    mem_free(path);
    scene_row_release(&row);
    return reply ? reply : status == STATUS_OK ? response_new(204) : problem_from(r, &err);
}
