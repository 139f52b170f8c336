/* space.c -- see space.h. */
#include "server/http/space.h"

#include "server/http/limits.h"
#include "server/transport/problem.h"
#include "server/uploads/upload.h"

static struct response *refuse(const struct request *r, const struct error *err, enum status if_full) {
    return err->status == if_full ? problem_full(r, 507, err->message, err->hint, NULL) : problem_from(r, err);
}

static struct response *check_room(struct api *api, const struct request *r, uint64_t keep, uint64_t bytes) {
    struct error err;
    enum status status = folder_check_space(&api->folder, keep, bytes, &err);
    return status == STATUS_OK ? NULL : refuse(r, &err, STATUS_NO_SPACE);
}

struct response *space_check_free(struct api *api, const struct request *r, uint64_t bytes) {
    uint64_t keep = api->config.min_free_bytes + (limits_bind(r) ? api->config.admin_free_bytes : 0);
    return check_room(api, r, keep, bytes);
}

struct response *space_check_job(struct api *api, const struct request *r, uint64_t bytes) {
    return check_room(api, r, 0, bytes);
}

struct response *space_check_share(struct api *api, const struct request *r, const char *but_scene, uint64_t bytes) {
    struct error err;
    const struct share share = {api->config.user_max_bytes, r->caller.user_id, but_scene, 0};
    const struct arrivals_sum others = arrivals_of(api->arrivals, r->caller.user_id, r->upload);
    if (store_share_check(api->store, &share, others.bytes + bytes, &err) != STATUS_OK)
        return refuse(r, &err, STATUS_LIMIT);
    return NULL;
}
