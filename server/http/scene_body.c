/* scene_body.c -- see scene_body.h. */
#include "server/http/scene_body.h"

#include <string.h>

#include "common/mem.h"
#include "common/utf8.h"
#include "server/http/limits.h"
#include "server/http/scene_reading.h"
#include "server/http/whole_body.h"
#include "server/net/field.h"
#include "server/transport/problem.h"

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
    struct response *refusal = check_request(r);
    if (!refusal)
        mem_free(scene_reading_query(r, &refusal));
    return refusal ? refusal : whole_body_begin(api, r, limits_check_upload);
}
