/* node_body.c -- see node_body.h. */
#include "server/http/nodes/node_body.h"

#include <string.h>

#include "common/file.h"
#include "common/mem.h"
#include "server/http/space.h"
#include "server/net/field.h"
#include "server/transport/problem.h"
#include "server/uploads/upload.h"

#define NOBODY (-1) /* what arrives counts against no user's uploads: it is the job's as soon as it is there */

struct response *node_body_begin(struct api *api, struct request *r) {
    const char *digest = request_field(r, "Repr-Digest");
    char hex[SHA256_HEX_SIZE];
    struct error err;
    r->is_routine = true;
    if (r->has_body && r->content_length < 0)
        return problem(r, 400, "the length of the file must be given");
    if (!digest || !field_digest(digest, hex))
        return problem(r, 400, "Repr-Digest must give the file's sha-256");
    uint64_t length = r->content_length > 0 ? (uint64_t)r->content_length : 0;
    struct response *refusal = space_check_job(api, r, length);
    if (!refusal && upload_new(&r->upload, api->arrivals, NOBODY, api->config.data_dir, length, &err) != STATUS_OK)
        refusal = problem_from(r, &err);
    return refusal;
}

struct response *node_body_data(struct api *api, struct request *r, const void *data, size_t length) {
    struct error err;
    bool must_check_room;
    if (upload_write(r->upload, data, length, &must_check_room, &err) != STATUS_OK)
        return problem_from(r, &err);
    atomic_fetch_add(&api->uploaded_bytes, length);
    return must_check_room ? space_check_job(api, r, 0) : NULL;
}

/* Makes the folders below the attempt's, which is there as long as it runs, and moves the file to its place. */
static enum status put(struct request *r, const char *path, struct error *err) {
    char *dir = mem_strndup(path, (size_t)(strrchr(path, '/') - path));
    enum status status = file_make_dirs(dir, err);
    mem_free(dir);
    return status == STATUS_OK ? upload_move(r->upload, path, err) : status;
}

struct response *node_body_end(struct api *api, struct request *r, const struct node_key *key, const char *path,
                               enum status (*after)(void *user, struct error *err), void *user) {
    char found[SHA256_HEX_SIZE], wanted[SHA256_HEX_SIZE] = "";
    struct error err;
    upload_digest(r->upload, found);
    field_digest(request_field(r, "Repr-Digest"), wanted);
    if (strcmp(found, wanted) != 0)
        return problem(r, 422, "the body's SHA-256 is %s, and Repr-Digest says %s", found, wanted);
    if (upload_sync(r->upload, &err) != STATUS_OK)
        return problem_from(r, &err);
    if (store_remote_enter(api->store, &key->key, &err) != STATUS_OK)
        return node_refusal(api, r, &err);
    enum status status = put(r, path, &err);
    if (status == STATUS_OK && after)
        status = after(user, &err);
    store_remote_leave(api->store, &key->key);
    return status == STATUS_OK ? response_new(204) : problem_from(r, &err);
}
