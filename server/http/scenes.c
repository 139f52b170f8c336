/* scenes.c -- /v1/scenes: upload, look, remove. */
#include <stdio.h>
#include <string.h>

#include "common/mem.h"
#include "server/http/auth.h"
#include "server/http/field.h"
#include "server/http/handlers.h"
#include "server/http/problem.h"
#include "server/http/upload.h"
#include "server/http/views.h"

/* Changes when the row does: a scene has no revision, but only these members ever change. */
static struct response *tagged(const struct request *r, const struct scene_row *row) {
    char etag[128];
    snprintf(etag, sizeof etag, "\"%.16s-%s-%lld\"", row->id, scene_state_name(row->state),
             (long long)row->created_ms);
    return view_tagged(r, view_scene(row), etag);
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
    struct response *refusal = upload_seal(api, r, id);
    if (refusal)
        return refusal;
    const char *given = target_query(&r->target, "name");
    snprintf(name, sizeof name, "%.12s", id);
    struct error err;
    struct scene_row row;
    bool existed = false;
    pthread_mutex_lock(&api->scene_mutex);
    enum status status = upload_publish(api, r->upload, id, &err);
    if (status == STATUS_OK)
        status = store_scene_add(api->store, id, given ? given : name, upload_bytes(r->upload),
                                 r->caller.user_id, &existed, &err);
    pthread_mutex_unlock(&api->scene_mutex);
    if (status == STATUS_OK)
        status = store_scene_get(api->store, id, &row, &err);
    if (status != STATUS_OK)
        return problem_from(r, &err);
    scheduler_wake(api->scheduler);
    struct response *reply = response_json(existed ? 200 : 201, view_scene(&row));
    response_field(reply, "Location", "/v1/scenes/%s", id);
    scene_row_release(&row);
    return reply;
}

struct response *scenes_delete(struct api *api, struct request *r) {
    struct scene_row row;
    struct error err;
    struct response *refusal = NULL;
    bool is_gone;
    if (!auth_scene(api, r, ACCESS_CHANGE, &row, &refusal))
        return refusal;
    char *path = mem_printf("scenes/%s", row.id);
    pthread_mutex_lock(&api->scene_mutex);
    enum status status = store_scene_delete(api->store, row.id,
                                            r->caller.role == ROLE_ADMIN ? -1 : r->caller.user_id,
                                            &is_gone, &err);
    if (is_gone)
        status = api_discard(api, path, &err);
    pthread_mutex_unlock(&api->scene_mutex);
    mem_free(path);
    scene_row_release(&row);
    return status == STATUS_OK ? response_new(204) : problem_from(r, &err);
}
