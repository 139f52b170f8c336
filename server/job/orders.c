/* orders.c -- see orders.h. */
#include "server/job/orders.h"

#include <math.h>
#include <string.h>

#include "common/render_settings.h"
#include "server/data/attempt_folder.h"
#include "server/job/memory_reduction.h"
#include "server/job/scene_fit.h"

cJSON *orders_new(const char *kind, const struct scheduler_config *config, int thread_count) {
    cJSON *order = cJSON_CreateObject();
    json_add_string(order, "kind", kind);
    json_add_int(order, "thread_count", thread_count);
    json_add_int(order, "memory_bytes", (int64_t)config->worker_memory_bytes);
    json_add_int(order, "photograph_memory_bytes", (int64_t)config->photograph_memory_bytes);
    /* a quarter more than what stops jobs (disk_watch.h): its own pixels are not to stop it */
    json_add_int(order, "keep_free_bytes", (int64_t)(config->low_disk_bytes + config->low_disk_bytes / 4));
    json_add_bool(order, "sandbox", config->sandbox);
    return order;
}

/* Pictures of the part that earlier attempts have done; an attempt renders one at least. */
static enum status find_done(const struct job_work *work, const struct scheduler_config *config, int64_t *done,
                             struct error *err) {
    const struct job_part *part = work->part;
    *done = 0;
    if (part->part == 0)
        return STATUS_OK;
    enum status status = attempt_folder_pictures_done(config->data_dir, work->job->id, part->digest, part->first,
                                                      part->count, done, err);
    *done = *done < part->count ? *done : part->count - 1;
    return status;
}

/* What the job's owner may still take of the disk beside the job; of a part its share of that, for the pictures that
 * are not done, since the others take theirs at the same time. 0: no limit. */
static enum status disk_left(const struct job_work *work, const struct scheduler_config *config, struct store *store,
                             int64_t done, uint64_t *bytes, struct error *err) {
    const struct job *job = work->job;
    uint64_t kept = 0;
    *bytes = 0;
    if (config->user_max_bytes == 0 || job->owner_id == 0)
        return STATUS_OK;
    enum status status = store_user_bytes(store, job->owner_id, NULL, job->id, &kept, err);
    double left = kept < config->user_max_bytes ? (double)(config->user_max_bytes - kept) : 1.0;
    if (work->part->part > 0)
        left *= (double)(work->part->count - done) / (double)work->part->pictures;
    *bytes = (uint64_t)fmax(1.0, left);
    return status;
}

/* What orders for jobs of all kinds have. Takes settings. */
static cJSON *new_job_order(const struct job_work *work, const struct scheduler_config *config, int thread_count,
                            uint64_t disk_bytes, cJSON *settings) {
    cJSON *order = orders_new(job_kind_name(work->job->kind), config, thread_count);
    json_add_string(order, "scene_id", work->job->scene_id);
    json_add_string(order, "name", work->job->name);
    json_add_int(order, "job_id", work->job->id);
    json_add_int(order, "attempt", work->number);
    json_add_int(order, "memory_step", work->job->memory_step);
    json_add_int(order, "disk_bytes", (int64_t)disk_bytes);
    json_add(order, "settings", settings);
    return order;
}

/* What a reconstruction's order has besides. */
static void complete_order(cJSON *order, const struct scheduler_config *config, const struct buf *reduced) {
    json_add_number(order, "checkpoint_interval_sec", config->checkpoint_interval_sec);
    if (reduced->length > 0)
        json_add_string(order, "reduced", buf_text(reduced));
}

/* What a render's order has besides: its part, or how it may split, which a small one does not. What its pictures are
 * does not depend on the settings that say where and in how many parts it runs: these stay here. */
static void add_parts(cJSON *order, const struct job_work *work, const struct scheduler_config *config, int64_t done) {
    const struct job *job = work->job;
    const struct job_part *part = work->part;
    cJSON *settings = cJSON_GetObjectItemCaseSensitive(order, "settings");
    int64_t parts = (int64_t)render_settings_number(settings, "parts");
    bool is_small = job->cost > 0.0 && job->cost <= config->small_render_cost;
    cJSON_DeleteItemFromObjectCaseSensitive(settings, "parts");
    cJSON_DeleteItemFromObjectCaseSensitive(settings, "executor");
    if (part->pictures == 0 && !is_small && parts != 1) {
        cJSON *split = cJSON_AddObjectToObject(order, "split");
        json_add_int(split, "parts", parts);
        json_add_number(split, "paths", config->render_part_cost);
    }
    if (part->part == 0)
        return;
    cJSON *member = cJSON_AddObjectToObject(order, "part");
    json_add_int(member, "first", part->first);
    json_add_int(member, "count", part->count);
    json_add_int(member, "done", done);
}

enum status orders_of_job(const struct job_work *work, const struct scheduler_config *config, struct store *store,
                          cJSON **order, struct error *err) {
    const struct job *job = work->job;
    int thread_count = work->thread_count;
    cJSON *settings;
    uint64_t disk_bytes;
    *order = NULL;
    int64_t done;
    enum status status = find_done(work, config, &done, err);
    if (status == STATUS_OK)
        status = disk_left(work, config, store, done, &disk_bytes, err);
    if (status == STATUS_OK)
        status = json_parse(job->settings, strlen(job->settings), "the job's settings", &settings, err);
    if (status != STATUS_OK)
        return status;
    struct buf reduced;
    buf_init(&reduced, 4096);
    cJSON *smaller = memory_reduction_apply(job->kind, settings, job->memory_step, &thread_count, &reduced);
    *order = new_job_order(work, config, thread_count, disk_bytes, smaller);
    if (job->kind == JOB_RENDER)
        add_parts(*order, work, config, done);
    else
        json_add(*order, "reading", scene_fit_reading(work->scene));
    if (job->kind == JOB_RECONSTRUCT)
        complete_order(*order, config, &reduced);
    cJSON_Delete(settings);
    buf_release(&reduced);
    return status;
}
