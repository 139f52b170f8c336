/* job_files.c -- see job_files.h.
 *
 * A file counts against its owner's share from its first byte: as an arrival, then as a part of its job's folder. It is
 * in its place, durably, before its row says so. */
#include "server/http/jobs/job_files.h"

#include "common/file.h"
#include "common/mem.h"
#include "server/data/layout.h"
#include "server/data/trash.h"
#include "server/http/auth.h"
#include "server/http/handlers.h"
#include "server/http/jobs/job_reply.h"
#include "server/http/limits.h"
#include "server/http/whole_body.h"
#include "server/job/disk_usage.h"
#include "server/store/job_files.h"
#include "server/transport/problem.h"
#include "server/uploads/upload.h"

#define NAME_SEGMENT 4 /* of the path */

struct response *job_files_begin(struct api *api, struct request *r) {
    struct response *refusal = NULL;
    struct error err;
    int64_t id = auth_job_id(api, r, ACCESS_CHANGE, &refusal);
    if (!refusal && (!r->has_body || r->content_length == 0))
        refusal = problem_full(r, 400, "the body, the file, is missing", "curl -T sky.hdr URL", NULL);
    if (!refusal && store_job_file_check(api->store, id, r->target.segments[NAME_SEGMENT], &err) != STATUS_OK)
        refusal = problem_from(r, &err);
    return refusal ? refusal : whole_body_begin(api, r, limits_check_file);
}

/* Moves the file to its place and enters it. The caller holds the mutex. */
static enum status put_in_place(struct api *api, struct request *r, int64_t id, const char *name, const char *hex,
                                bool *queued, struct error *err) {
    const struct count_limits limits = {api->config.queue_limit, api->config.user_queue_limit};
    uint64_t bytes = upload_bytes(r->upload);
    enum status status = store_job_file_check(api->store, id, name, err);
    if (status != STATUS_OK)
        return status;
    char *dir = layout_job(api->config.data_dir, id), *folder = layout_job_files(api->config.data_dir, id),
         *path = layout_job_file(api->config.data_dir, id, name);
    status = file_make_dirs(folder, err);
    if (status == STATUS_OK)
        status = upload_move(r->upload, path, err);
    if (status == STATUS_OK)
        status = store_job_file_put(api->store, id, name, bytes, hex, &limits, queued, err);
    if (status == STATUS_NOT_FOUND) { /* the job was deleted in between: its folder goes, too */
        char *inner = layout_job(NULL, id);
        (void)trash_take(api->folder.trash, inner, NULL);
        mem_free(inner);
    }
    struct error unmeasured; /* a size that is not known is measured later */
    if (status == STATUS_OK)
        (void)disk_usage_enter_job(api->store, id, dir, &unmeasured);
    mem_free(path);
    mem_free(folder);
    mem_free(dir);
    return status;
}

struct response *job_files_put(struct api *api, struct request *r) {
    struct response *refusal = NULL;
    struct error err;
    char hex[SHA256_HEX_SIZE];
    bool queued = false;
    int64_t id = auth_job_id(api, r, ACCESS_CHANGE, &refusal);
    if (!refusal)
        refusal = whole_body_end(r, hex);
    if (refusal)
        return refusal;
    pthread_mutex_lock(&api->folder.scene_mutex); /* job_files.h: one at a time */
    enum status status = put_in_place(api, r, id, r->target.segments[NAME_SEGMENT], hex, &queued, &err);
    pthread_mutex_unlock(&api->folder.scene_mutex);
    if (status != STATUS_OK)
        return problem_from(r, &err);
    if (queued)
        scheduler_wake(api->scheduler);
    return job_reply_of(api, r, id, 200);
}
