/* whole_body.c -- see whole_body.h. */
#include "server/http/whole_body.h"

#include <string.h>
#include <strings.h>

#include "server/http/space.h"
#include "server/net/field.h"
#include "server/transport/problem.h"
#include "server/uploads/upload.h"

struct response *whole_body_begin(struct api *api, struct request *r, whole_body_check *check) {
    uint64_t length = r->content_length > 0 ? (uint64_t)r->content_length : 0;
    struct error err;
    pthread_mutex_lock(&api->folder.scene_mutex); /* two at once would both find room */
    struct response *refusal = check(api, r, length);
    if (!refusal)
        refusal = space_check_free(api, r, length);
    if (!refusal)
        refusal = space_check_share(api, r, NULL, length);
    if (!refusal &&
        upload_new(&r->upload, api->arrivals, r->caller.user_id, api->folder.dir, length, &err) != STATUS_OK)
        refusal = problem_from(r, &err);
    pthread_mutex_unlock(&api->folder.scene_mutex);
    return refusal;
}

struct response *whole_body_data(struct api *api, struct request *r, const void *data, size_t length) {
    struct error err;
    bool must_check_room;
    if (upload_write(r->upload, data, length, &must_check_room, &err) != STATUS_OK)
        return problem_from(r, &err);
    atomic_fetch_add(&api->uploaded_bytes, length);
    struct response *refusal = must_check_room ? space_check_free(api, r, 0) : NULL;
    return must_check_room && !refusal ? space_check_share(api, r, NULL, upload_bytes(r->upload)) : refusal;
}

struct response *whole_body_end(struct request *r, char hex[SHA256_HEX_SIZE]) {
    const char *sha256 = request_field(r, "X-Content-SHA256");
    const char *digest = request_field(r, "Repr-Digest");
    char wanted[SHA256_HEX_SIZE];
    struct error err;
    upload_digest(r->upload, hex);
    if (sha256 && strcasecmp(sha256, hex) != 0)
        return problem(r, 422, "the body's SHA-256 is %s, and X-Content-SHA256 says %s", hex, sha256);
    if (digest && field_digest(digest, wanted) && strcmp(wanted, hex) != 0)
        return problem(r, 422, "the body's SHA-256 is %s, and Repr-Digest says %s", hex, wanted);
    if (upload_bytes(r->upload) == 0)
        return problem(r, 400, "the body is empty");
    return upload_sync(r->upload, &err) == STATUS_OK ? NULL : problem_from(r, &err);
}
