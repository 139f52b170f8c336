/* order.c -- see order.h. */
#include "server/worker/order.h"

#include <limits.h>
#include <math.h>
#include <string.h>

#include "common/mem.h"
#include "server/data/layout.h"
#include "server/store/parts.h"

#define WHAT "job.json"

/* A whole number from 0 to `most`. */
static enum status read_whole(const struct order *o, const char *key, double fallback, double most, double *value,
                              struct error *err) {
    enum status status = json_number(o->json, key, WHAT, fallback, value, err);
    if (status == STATUS_OK && !(*value >= 0.0 && *value <= most && *value == floor(*value)))
        status = error_set(err, STATUS_INTERNAL, WHAT ": %s is %g", key, *value);
    return status;
}

static enum status read_memory(struct order *o, struct error *err) {
    double memory_bytes, photograph_memory_bytes, step, keep_free_bytes, disk_bytes;
    enum status status = read_whole(o, "memory_bytes", 0.0, 0x1p53, &memory_bytes, err);
    if (status == STATUS_OK)
        status = read_whole(o, "photograph_memory_bytes", 0.0, 0x1p53, &photograph_memory_bytes, err);
    if (status == STATUS_OK)
        status = read_whole(o, "memory_step", 0.0, INT_MAX, &step, err);
    if (status == STATUS_OK)
        status = read_whole(o, "keep_free_bytes", 0.0, 0x1p53, &keep_free_bytes, err);
    if (status == STATUS_OK)
        status = read_whole(o, "disk_bytes", 0.0, 0x1p53, &disk_bytes, err);
    if (status != STATUS_OK)
        return status;
    o->memory_bytes = (uint64_t)memory_bytes;
    o->photograph_memory_bytes = (uint64_t)photograph_memory_bytes;
    o->memory_step = (int)step;
    o->keep_free_bytes = (uint64_t)keep_free_bytes;
    o->disk_bytes = (uint64_t)disk_bytes;
    return STATUS_OK;
}

static enum status read_member(const cJSON *object, const char *key, double *value, struct error *err) {
    enum status status = json_number(object, key, WHAT, 0.0, value, err);
    if (status == STATUS_OK && !(*value >= 0.0 && *value <= 0x1p53 && *value == floor(*value)))
        status = error_set(err, STATUS_INTERNAL, WHAT ": %s is %g", key, *value);
    return status;
}

/* Of a render: whether it may split, or which part of one it is. */
static enum status read_parts(struct order *o, struct error *err) {
    const cJSON *split = cJSON_GetObjectItemCaseSensitive(o->json, "split");
    const cJSON *part = cJSON_GetObjectItemCaseSensitive(o->json, "part");
    double parts = 0.0, first = 0.0, count = 0.0, done = 0.0;
    enum status status = read_member(split, "parts", &parts, err);
    if (status == STATUS_OK)
        status = read_member(split, "paths", &o->split_paths, err);
    if (status == STATUS_OK)
        status = read_member(part, "first", &first, err);
    if (status == STATUS_OK)
        status = read_member(part, "count", &count, err);
    if (status == STATUS_OK)
        status = read_member(part, "done", &done, err);
    if (status == STATUS_OK && (parts > JOB_PARTS_MAX || (part && !(done < count))))
        status = error_set(err, STATUS_INTERNAL, WHAT ": part %g of %g, %g parts", done, count, parts);
    o->may_split = split != NULL;
    o->split_parts = (int)parts;
    o->first_view = (uint64_t)first;
    o->view_count = (uint64_t)count;
    o->views_done = (uint64_t)done;
    return status;
}

/* What orders for jobs of all kinds have. */
static enum status read_job(struct order *o, struct error *err) {
    double job_id, attempt;
    bool is_render = strcmp(o->kind, "render") == 0, is_evaluation = strcmp(o->kind, "evaluate") == 0;
    enum status status = json_string(o->json, "scene", WHAT, "", &o->scene, err);
    if (status == STATUS_OK)
        status = json_string(o->json, "outputs", WHAT, "", &o->outputs, err);
    if (status == STATUS_OK)
        status = json_string(o->json, "files", WHAT, "", &o->files, err);
    if (status == STATUS_OK)
        status = json_string(o->json, "name", WHAT, "", &o->name, err);
    if (status == STATUS_OK)
        status = json_string(o->json, "reduced", WHAT, "", &o->reduced, err);
    if (status == STATUS_OK)
        status = read_whole(o, "job_id", 0.0, 0x1p53, &job_id, err);
    if (status == STATUS_OK)
        status = read_whole(o, "attempt", 0.0, INT_MAX, &attempt, err);
    if (status == STATUS_OK)
        status = json_number(o->json, "checkpoint_interval_sec", WHAT, 60.0, &o->checkpoint_interval_sec, err);
    if (status == STATUS_OK)
        status = json_bool(o->json, "parts", WHAT, false, &o->parts, err);
    if (status == STATUS_OK)
        status = read_parts(o, err);
    if (status != STATUS_OK)
        return status;
    o->job_id = (int64_t)job_id;
    o->attempt = (int)attempt;
    o->settings = cJSON_GetObjectItemCaseSensitive(o->json, "settings");
    if ((!is_render && !o->scene[0]) || !cJSON_IsObject(o->settings))
        return error_set(err, STATUS_INTERNAL, WHAT ": no scene or no settings");
    if ((is_render || is_evaluation) && !o->outputs[0])
        return error_set(err, STATUS_INTERNAL, WHAT ": no outputs");
    return STATUS_OK;
}

static bool is_job(const struct order *o) {
    return strcmp(o->kind, "reconstruct") == 0 || strcmp(o->kind, "render") == 0 || strcmp(o->kind, "evaluate") == 0;
}

static enum status read_deliver(struct order *o, struct error *err) {
    enum status status = json_string(o->json, "url", WHAT, "", &o->url, err);
    if (status == STATUS_OK)
        status = json_string(o->json, "secret", WHAT, "", &o->secret, err);
    if (status == STATUS_OK)
        status = json_string(o->json, "body", WHAT, "", &o->body, err);
    if (status == STATUS_OK)
        status = json_string(o->json, "message_id", WHAT, "", &o->message_id, err);
    return status == STATUS_OK ? json_bool(o->json, "allow_private", WHAT, false, &o->allow_private, err) : status;
}

enum status order_read(struct order *o, const char *dir, struct error *err) {
    *o = (struct order){.dir = dir};
    double thread_count;
    char *path = layout_order(dir);
    enum status status = json_read(path, (size_t)1 << 20, &o->json, err);
    mem_free(path);
    if (status == STATUS_OK)
        status = json_string(o->json, "kind", WHAT, "", &o->kind, err);
    if (status == STATUS_OK)
        status = json_string(o->json, "scene_id", WHAT, "", &o->scene_id, err);
    if (status == STATUS_OK)
        status = read_whole(o, "thread_count", 1.0, INT_MAX, &thread_count, err);
    if (status == STATUS_OK)
        status = read_memory(o, err);
    if (status == STATUS_OK)
        status = json_bool(o->json, "sandbox", WHAT, true, &o->sandbox, err);
    if (status == STATUS_OK) {
        o->reading = cJSON_GetObjectItemCaseSensitive(o->json, "reading");
        o->thread_count = (int)thread_count;
    }
    if (status == STATUS_OK && is_job(o))
        status = read_job(o, err);
    if (status == STATUS_OK && strcmp(o->kind, "deliver") == 0)
        status = read_deliver(o, err);
    /* The daemon wrote the file: a fault in it is a bug, not the user's. */
    if (status == STATUS_INPUT && err)
        status = err->status = STATUS_INTERNAL;
    return status;
}

void order_release(struct order *o) {
    cJSON_Delete(o->json);
    *o = (struct order){0};
}
