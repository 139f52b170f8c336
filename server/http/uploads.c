/* uploads.c -- /v1/uploads: bundles in parts, by the tus protocol 1.0.0 (tus.io) with its
 * extensions creation, termination, expiration and checksum. What is on disk is resumable.c's. A PATCH
 * whose body is JSON is not of the protocol: it changes how long the upload is kept. */
#include <inttypes.h>
#include <stdio.h>
#include <string.h>
#include <time.h>

#include "common/base64.h"
#include "common/mem.h"
#include "common/protocol.h"
#include "common/sha256.h"
#include "common/utf8.h"
#include "server/data/layout.h"
#include "server/http/handlers.h"
#include "server/http/limits.h"
#include "server/http/retention.h"
#include "server/http/scene_reading.h"
#include "server/http/space.h"
#include "server/http/tus.h"
#include "server/http/upload_body.h"
#include "server/http/views.h"
#include "server/net/field.h"
#include "server/transport/body.h"
#include "server/transport/problem.h"
#include "server/uploads/resumable.h"

#define METADATA_MAX 1000 /* bytes; it is sent back in a header field */
#define METADATA_HINT "name has 1 to 200 bytes of UTF-8 without control characters, sha256 has 64 lower-case hex digits"

struct response *uploads_options(struct api *api, struct request *r) {
    if (r->target.segment_count > 2 && !tus_is_upload_id(r->target.segments[2]))
        return problem(r, 404, "\"%.80s\" is not an upload's id", r->target.segments[2]);
    struct response *reply = response_new(204);
    response_field(reply, "Tus-Version", TUS_VERSION);
    response_field(reply, "Tus-Extension", "creation,termination,expiration,checksum");
    response_field(reply, "Tus-Checksum-Algorithm", "sha1,sha256");
    response_field(reply, "Tus-Max-Size", "%" PRIu64, api->config.max_upload_bytes);
    return reply;
}

/* --- creation ------------------------------------------------------------------------------- */

/* Takes a pair of Upload-Metadata that we know; others are stored but have no effect. */
static bool take_pair(struct upload_row *row, const char *key, size_t key_length, const char *value,
                      size_t value_length, struct error *err) {
    error_set(err, STATUS_INPUT, "Upload-Metadata is not a list of keys with values in base64");
    error_hint(err, METADATA_HINT);
    char bytes[METADATA_MAX + 1];
    size_t used;
    if (!base64_decode(value, value_length, bytes, METADATA_MAX, &used))
        return false;
    bytes[used] = '\0';
    bool is_text = strlen(bytes) == used && utf8_valid(bytes, used, NULL);
    if (key_length == 6 && memcmp(key, "sha256", 6) == 0) {
        if (!sha256_is_hex(bytes) || !is_text)
            return false;
        memcpy(row->sha256, bytes, SCENE_ID_SIZE);
    } else if (key_length == 7 && memcmp(key, "reading", 7) == 0) {
        mem_free(row->reading);
        row->reading = is_text ? scene_reading_parse(bytes, used, "the reading", err) : NULL;
        return row->reading != NULL;
    } else if ((key_length == 4 && memcmp(key, "name", 4) == 0) ||
               (key_length == 8 && memcmp(key, "filename", 8) == 0 && !row->name)) {
        if (!is_text || used == 0 || used > API_NAME_MAX_BYTES || !utf8_is_name(bytes))
            return false;
        mem_free(row->name);
        row->name = mem_strdup(bytes);
    }
    return true;
}

static struct response *read_metadata(const struct request *r, struct upload_row *row) {
    const char *text = request_field(r, "Upload-Metadata");
    struct error err;
    row->metadata = mem_strdup(text ? text : "");
    if (strlen(row->metadata) > METADATA_MAX)
        return problem(r, 400, "Upload-Metadata is longer than %d bytes", METADATA_MAX);
    for (const char *at = row->metadata; *at;) {
        size_t length = strcspn(at, ","), key = strcspn(at, " ,");
        size_t value = key + strspn(at + key, " "), end = length;
        while (end > value && at[end - 1] == ' ')
            end--;
        if (key == 0 || !take_pair(row, at, key, at + value, end > value ? end - value : 0, &err))
            return problem_full(r, 400, err.message, err.hint, NULL);
        at += length;
        at += *at == ',';
        at += strspn(at, " ");
    }
    return NULL;
}

/* Checks the creation request and fills *row; NULL, or the refusal. */
static struct response *read_creation(struct api *api, const struct request *r, struct upload_row *row) {
    const char *text = request_field(r, "Upload-Length");
    int64_t length = 0;
    struct response *refusal = tus_check_version(r, true);
    if (refusal)
        return refusal;
    if (r->has_body)
        return problem(r, 400, "an upload is created without a body; its bytes come by PATCH");
    if (!text)
        return problem(r, 400, "the field Upload-Length is missing%s",
                       request_field(r, "Upload-Defer-Length") ? "; it cannot be given later" : "");
    if (!field_number(text, 1, INT64_MAX, &length))
        return problem(r, 400, "Upload-Length must be a number of bytes, 1 or more");
    if ((uint64_t)length > api->config.max_upload_bytes) {
        cJSON *members = cJSON_CreateObject();
        json_add_int(members, "limit_bytes", (int64_t)api->config.max_upload_bytes);
        char detail[128];
        snprintf(detail, sizeof detail, "the upload is larger than %" PRIu64 " bytes", api->config.max_upload_bytes);
        return problem_full(r, 413, detail, "an administrator can raise the option max_upload_mib", members);
    }
    row->length = (uint64_t)length;
    return read_metadata(r, row);
}

/* Creates the upload if there is room; or returns the refusal. */
static struct response *create(struct api *api, const struct request *r, struct upload_row *row) {
    struct error err;
    pthread_mutex_lock(&api->folder.scene_mutex); /* two at once would both find room */
    struct response *refusal = limits_check_upload(api, r, row->length);
    if (!refusal)
        refusal = space_check_free(api, r, row->length);
    if (!refusal)
        refusal = space_check_share(api, r, NULL, row->length);
    if (!refusal && resumable_create(api->resumables, row, api->config.user_max_uploads, &err) != STATUS_OK)
        refusal = problem_from(r, &err);
    pthread_mutex_unlock(&api->folder.scene_mutex);
    return refusal;
}

struct response *uploads_add(struct api *api, struct request *r) {
    struct upload_row row = {.owner_id = r->caller.user_id};
    struct response *reply = read_creation(api, r, &row);
    if (!row.name)
        row.name = mem_strndup(*row.sha256 ? row.sha256 : "upload", 12);
    if (!reply)
        reply = create(api, r, &row);
    if (!reply) {
        struct timespec now;
        clock_gettime(CLOCK_REALTIME, &now);
        reply = response_new(201);
        response_field(reply, "Location", "/v1/uploads/%s", row.id);
        tus_add_expiry(reply, (int64_t)now.tv_sec * 1000 + api->config.empty_upload_ms);
    }
    upload_row_release(&row);
    return reply;
}

/* --- reading -------------------------------------------------------------------------------- */

struct response *uploads_get(struct api *api, struct request *r) {
    struct response *reply = tus_check_version(r, r->is_head);
    struct upload_row row;
    struct error err;
    const char *id = reply ? NULL : tus_find_upload(api, r, &reply);
    if (reply)
        return reply;
    if (resumable_status(api->resumables, id, &row, &err) != STATUS_OK)
        return tus_refuse(r, &err);
    reply = response_json(200, view_upload(&row));
    response_field(reply, "Cache-Control", "no-store");
    response_field(reply, "Upload-Length", "%" PRIu64, row.length);
    if (*row.metadata)
        response_field(reply, "Upload-Metadata", "%s", row.metadata);
    tus_add_place(reply, &row);
    upload_row_release(&row);
    return reply;
}

struct response *uploads_list(struct api *api, struct request *r) {
    struct response *refusal = NULL;
    const char *cursor = target_query(&r->target, "cursor"), *sha256 = target_query(&r->target, "sha256");
    size_t limit = view_limit(r, &refusal), count = 0;
    if (!refusal && sha256 && !sha256_is_hex(sha256))
        refusal = problem(r, 400, "sha256 must be 64 lower-case hex digits");
    if (refusal)
        return refusal;
    struct upload_row *rows = mem_calloc(limit, sizeof *rows);
    char next[128] = "";
    struct error err;
    if (store_upload_list(api->store, &r->caller, sha256 ? sha256 : "", cursor ? cursor : "", limit, rows, &count, next,
                          &err) != STATUS_OK) {
        mem_free(rows);
        return err.status == STATUS_INPUT ? problem(r, 400, "%s", err.message) : problem_from(r, &err);
    }
    cJSON *items = cJSON_CreateArray();
    for (size_t i = 0; i < count; i++) {
        cJSON_AddItemToArray(items, view_upload(&rows[i]));
        upload_row_release(&rows[i]);
    }
    mem_free(rows);
    return view_page(r, items, next);
}

/* --- continuing ----------------------------------------------------------------------------- */

/* A PATCH with a JSON body. */
static struct response *change(struct api *api, const struct request *r) {
    struct retention retention = {0};
    struct upload_row row;
    struct error err;
    struct response *reply = tus_check_version(r, false);
    if (!reply && (request_field(r, "Upload-Offset") || request_field(r, "Upload-Checksum")))
        reply = problem(r, 400, "Upload-Offset and Upload-Checksum belong to bytes (" MIME_TUS "), not to JSON");
    const char *id = reply ? NULL : tus_find_upload(api, r, &reply);
    cJSON *body = reply ? NULL : body_object(r, &reply);
    if (reply)
        return reply;
    cJSON *params = cJSON_CreateArray();
    for (const cJSON *member = body->child; member; member = member->next)
        if (!retention_read(&retention, member, params))
            problem_param(params, member->string, "known: pinned, expires_at", "is unknown");
    cJSON_Delete(body);
    if (cJSON_GetArraySize(params) > 0)
        return problem_invalid(r, "the change is invalid", params);
    cJSON_Delete(params);
    if (store_upload_set_retention(api->store, id, &retention, &err) != STATUS_OK ||
        store_upload_get(api->store, id, &row, NULL, 0, &err) != STATUS_OK)
        return problem_from(r, &err);
    reply = response_json(200, view_upload(&row));
    upload_row_release(&row);
    return reply;
}

struct response *uploads_patch(struct api *api, struct request *r) {
    struct upload_row row = {0};
    if (!r->patch)
        return change(api, r);
    struct response *reply = upload_body_end(r, &row);
    if (reply)
        return reply;
    reply = response_new(204);
    tus_add_place(reply, &row);
    upload_row_release(&row);
    return reply;
}

struct response *uploads_delete(struct api *api, struct request *r) {
    bool dry_run = false;
    struct response *reply = tus_check_version(r, false);
    struct error err;
    if (!reply)
        reply = retention_dry_run(r, &dry_run);
    const char *id = reply ? NULL : tus_find_upload(api, r, &reply);
    if (reply)
        return reply;
    if (dry_run) {
        char *path = layout_upload(NULL, id);
        reply = retention_would_free(api, r, path);
        mem_free(path);
        return reply;
    }
    if (resumable_remove(api->resumables, id, &err) != STATUS_OK)
        return tus_refuse(r, &err);
    return response_new(204);
}
