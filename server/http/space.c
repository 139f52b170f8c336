/* space.c -- see space.h. */
#include "server/http/space.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <unistd.h>

#include "common/file.h"
#include "common/mem.h"
#include "server/http/limits.h"
#include "server/http/problem.h"

enum status space_discard(struct api *api, const char *path, struct error *err) {
    char *from = file_join(api->config.data_dir, path);
    char *to = file_join(api->config.data_dir, "trash/XXXXXX");
    enum status status = STATUS_OK;
    /* Into a folder of its own, so that two discards of one name do not meet. */
    if (!mkdtemp(to)) {
        if (errno == ENOSPC || errno == EDQUOT) /* removing must work on a full disk */
            status = file_remove_tree(from, err);
        else
            status = error_set_errno(err, errno, "cannot make a folder in %s/trash", api->config.data_dir);
        goto out;
    }
    char *inside = file_join(to, "it");
    if (rename(from, inside) != 0 && errno != ENOENT)
        status = error_set_errno(err, errno, "cannot move %s away", from);
    mem_free(inside);
    enum status removed = file_remove_tree(to, status == STATUS_OK ? err : NULL);
    if (status == STATUS_OK)
        status = removed;
out:
    mem_free(from);
    mem_free(to);
    store_reserve_renew(api->store);
    return status;
}

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
    return problem_full(r, 507, detail, "delete jobs or scenes that nobody needs; an administrator can lower the options"
                        " min_free_mib and admin_free_mib", NULL);
}

struct response *space_check_share(struct api *api, const struct request *r, const char *but_scene, uint64_t bytes) {
    struct error err;
    const struct share share = {api->config.user_max_bytes, r->caller.user_id, but_scene, 0};
    enum status status = store_share_check(api->store, &share, bytes, &err);
    if (status == STATUS_LIMIT)
        return problem_full(r, 507, err.message, err.hint, NULL);
    return status == STATUS_OK ? NULL : problem_from(r, &err);
}
