/* scene_body.c -- see scene_body.h. */
#include "server/http/scene_body.h"

#include <string.h>
#include <strings.h>

#include "common/mem.h"
#include "common/utf8.h"
#include "server/http/limits.h"
#include "server/http/scene_reading.h"
#include "server/http/space.h"
#include "server/net/field.h"
#include "server/transport/problem.h"
#include "server/uploads/upload.h"

static struct response *check_request(const struct request *r) {
    const char *sha256 = request_field(r, "X-Content-SHA256");
    const char *digest = request_field(r, "Repr-Digest");
    const char *name = target_query(&r->target, "name");
    char hex[SHA256_HEX_SIZE];
    if (!r->has_body || r->content_length == 0)
        return problem_full(r, 400, "the body, an archive of the bundle, is missing", "curl -T room.zip -X POST URL",
                            NULL);
    if (sha256 && (strspn(sha256, "0123456789abcdefABCDEF") != 64 || sha256[64] != '\0'))
        return problem(r, 400, "X-Content-SHA256 is not 64 hex digits");
    if (digest && !field_digest(digest, hex))
        return problem(r, 400, "Repr-Digest has no sha-256 that can be read");
    if (name && (strlen(name) > API_NAME_MAX_BYTES || *name == '\0'))
        return problem(r, 400, "name must have 1 to %d bytes, not %zu", API_NAME_MAX_BYTES, strlen(name));
    if (name && !utf8_is_name(name))
        return problem(r, 400, "name has a control character");
    return NULL;
}

struct response *scene_body_begin(struct api *api, struct request *r) {
    uint64_t length = r->content_length > 0 ? (uint64_t)r->content_length : 0;
    struct error err;
    struct response *refusal = check_request(r);
    if (!refusal)
        mem_free(scene_reading_query(r, &refusal));
    if (refusal)
        return refusal;
    pthread_mutex_lock(&api->folder.scene_mutex); /* two at once would both find room */
    refusal = limits_check_upload(api, r, length);
    if (!refusal)
        refusal = space_check_room(api, r, length);
    if (!refusal)
        refusal = space_check_share(api, r, NULL, length);
    if (!refusal &&
        upload_new(&r->upload, api->arrivals, r->caller.user_id, api->folder.dir, length, &err) != STATUS_OK)
        refusal = problem_from(r, &err);
    pthread_mutex_unlock(&api->folder.scene_mutex);
    return refusal;
}

struct response *scene_body_data(struct api *api, struct request *r, const void *data, size_t length) {
    struct error err;
    bool must_check_room;
    if (upload_write(r->upload, data, length, &must_check_room, &err) != STATUS_OK)
        return problem_from(r, &err);
    atomic_fetch_add(&api->uploaded_bytes, length);
    struct response *refusal = must_check_room ? space_check_room(api, r, 0) : NULL;
    return must_check_room && !refusal ? space_check_share(api, r, NULL, upload_bytes(r->upload)) : refusal;
}

struct response *scene_body_end(struct request *r, char id[SHA256_HEX_SIZE]) {
    const char *sha256 = request_field(r, "X-Content-SHA256");
    const char *digest = request_field(r, "Repr-Digest");
    char wanted[SHA256_HEX_SIZE];
    struct error err;
    upload_digest(r->upload, id);
    if (sha256 && strcasecmp(sha256, id) != 0)
        return problem(r, 422, "the body's SHA-256 is %s, and X-Content-SHA256 says %s", id, sha256);
    if (digest && field_digest(digest, wanted) && strcmp(wanted, id) != 0)
        return problem(r, 422, "the body's SHA-256 is %s, and Repr-Digest says %s", id, wanted);
    if (upload_bytes(r->upload) == 0)
        return problem(r, 400, "the body is empty");
    return upload_sync(r->upload, &err) == STATUS_OK ? NULL : problem_from(r, &err);
}
