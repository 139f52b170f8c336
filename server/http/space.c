/* space.c -- see space.h. */
#include "server/http/space.h"

#include <stdio.h>

#include "common/file.h"
#include "server/data/trash.h"
#include "server/http/limits.h"
#include "server/http/problem.h"

struct response *space_check_room(struct api *api, const struct request *r, uint64_t bytes) {
    struct error err;
    uint64_t room;
    if (file_free_bytes(api->config.data_dir, &room, &err) != STATUS_OK)
        return problem_from(r, &err);
    uint64_t keep = api->config.min_free_bytes + (limits_bind(r) ? api->config.admin_free_bytes : 0);
    if (room >= keep && room - keep >= bytes)
        return NULL;
    char detail[256];
    snprintf(detail, sizeof detail,
             "%llu MiB are wanted, and of the %llu MiB that are free, %llu MiB must stay so",
             (unsigned long long)(bytes >> 20), (unsigned long long)(room >> 20),
             (unsigned long long)(keep >> 20));
    return problem_full(r, 507, detail,
                        trash_is_busy(api->trash) ? "what was deleted is still being removed: try again in a moment"
                                                  : "delete jobs or scenes that nobody needs; an administrator can lower"
                                                    " the options min_free_mib and admin_free_mib", NULL);
}

struct response *space_check_share(struct api *api, const struct request *r, const char *but_scene, uint64_t bytes) {
    struct error err;
    const struct share share = {api->config.user_max_bytes, r->caller.user_id, but_scene, 0};
    enum status status = store_share_check(api->store, &share, bytes, &err);
    if (status == STATUS_LIMIT)
        return problem_full(r, 507, err.message, err.hint, NULL);
    return status == STATUS_OK ? NULL : problem_from(r, &err);
}
