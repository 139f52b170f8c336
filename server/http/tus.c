/* tus.c -- see tus.h. */
#include "server/http/tus.h"

#include <inttypes.h>
#include <string.h>
#include <time.h>

#include "common/protocol.h"
#include "server/transport/problem.h"

struct response *tus_check_version(const struct request *r, bool is_needed) {
    const char *version = request_field(r, "Tus-Resumable");
    if (version ? strcmp(version, TUS_VERSION) == 0 : !is_needed)
        return NULL;
    struct response *reply =
        problem_full(r, 412, version ? "Tus-Resumable names another version" : "the field Tus-Resumable is missing",
                     "send Tus-Resumable: " TUS_VERSION, NULL);
    response_field(reply, "Tus-Version", TUS_VERSION);
    return reply;
}

struct response *tus_refuse(const struct request *r, const struct error *err) {
    if (err->status == STATUS_LIMIT) /* longer than announced; a full queue has another message */
        return problem_full(r, 413, err->message, err->hint, NULL);
    return problem_from(r, err);
}

bool tus_is_upload_id(const char *id) {
    return strlen(id) == UPLOAD_ID_SIZE - 1 && strspn(id, "0123456789abcdef") == UPLOAD_ID_SIZE - 1;
}

const char *tus_find_upload(struct api *api, const struct request *r, struct response **refusal) {
    const char *id = r->target.segments[2];
    struct upload_row row = {0};
    struct error err;
    enum status status = error_set(&err, STATUS_NOT_FOUND, "there is no upload %.80s", id);
    if (tus_is_upload_id(id))
        status = store_upload_get(api->store, id, &row, NULL, 0, &err);
    if (status == STATUS_OK && row.owner_id != r->caller.user_id && r->caller.role != ROLE_ADMIN)
        status = error_set(&err, STATUS_NOT_FOUND, "there is no upload %.80s", id);
    upload_row_release(&row);
    if (status == STATUS_OK)
        return id;
    *refusal = tus_refuse(r, &err);
    return NULL;
}

void tus_add_expiry(struct response *reply, int64_t expires_ms) {
    char text[64];
    struct tm utc;
    if (expires_ms <= 0) /* pinned */
        return;
    time_t seconds = (time_t)(expires_ms / 1000);
    gmtime_r(&seconds, &utc);
    strftime(text, sizeof text, "%a, %d %b %Y %H:%M:%S GMT", &utc);
    response_field(reply, "Upload-Expires", "%s", text);
}

void tus_add_place(struct response *reply, const struct upload_row *row) {
    response_field(reply, "Upload-Offset", "%" PRIu64, row->received);
    if (*row->scene_id)
        response_field(reply, "Link", "</v1/scenes/%s>; rel=\"related\"", row->scene_id);
    else
        tus_add_expiry(reply, row->expires_ms);
}
