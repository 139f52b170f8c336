/* node_files.c -- the files of an attempt that runs elsewhere: its node reads what its job reads, and the checkpoint,
 * and writes checkpoints and outputs.
 *
 * 1. What is read is opened component by component, without symbolic links, below the one folder that is meant.
 * 2. What is written has a name that an output or a part may have, and lies whole in its place before 204 is said.
 * 3. Of checkpoints there are at any time whole ones here: a part says from which number on they are needed, and what
 *    is older goes after it has come. */
#include <string.h>
#include <unistd.h>

#include "common/file.h"
#include "common/mem.h"
#include "common/protocol.h"
#include "server/data/attempt_folder.h"
#include "server/data/layout.h"
#include "server/data/work_file.h"
#include "server/http/file_reply.h"
#include "server/http/handlers.h"
#include "server/http/nodes/node.h"
#include "server/http/nodes/node_body.h"
#include "server/http/nodes/node_inputs.h"
#include "server/net/field.h"
#include "server/transport/problem.h"

/* --- what a node reads ----------------------------------------------------------------------- */

/* The job of the attempt; *job needs job_release in any case. */
static enum status job_of(struct api *api, const struct request *r, struct job *job, struct error *err) {
    struct node_key key;
    struct response *refusal = node_key(r, &key); /* it was checked: it is there */
    response_free(refusal);
    *job = (struct job){0};
    return store_job_get(api->store, key.key.job_id, job, err);
}

static struct response *send_file(const struct request *r, enum status status, int fd, const char *thing,
                                  const char *name, struct error *err) {
    struct digests_file file;
    if (status == STATUS_OK)
        status = digests_identify_file(fd, thing, name, &file, err);
    if (status == STATUS_OK)
        return file_reply(r, fd, &file, "application/octet-stream");
    if (fd >= 0)
        close(fd);
    return problem_from(r, err);
}

struct response *node_files_scene(struct api *api, struct request *r) {
    char id[SCENE_ID_SIZE];
    struct error err;
    struct job job;
    cJSON *list = NULL;
    enum status status = job_of(api, r, &job, &err);
    if (status == STATUS_OK)
        status = node_inputs_list(api, &job, id, &list, &err);
    job_release(&job);
    if (status != STATUS_OK) {
        cJSON_Delete(list);
        return problem_from(r, &err);
    }
    cJSON *reply = cJSON_CreateObject();
    json_add_string(reply, "scene_id", id);
    json_add(reply, "files", list);
    return response_json(200, reply);
}

struct response *node_files_scene_get(struct api *api, struct request *r) {
    char *name = target_rest(&r->target, 5);
    struct error err;
    struct job job;
    int fd = -1;
    enum status status = job_of(api, r, &job, &err);
    if (status == STATUS_OK)
        status = node_inputs_open(api, &job, name, &fd, &err);
    struct response *reply = send_file(r, status, fd, job.scene_id, name, &err);
    job_release(&job);
    mem_free(name);
    return reply;
}

/* Appends a file of the checkpoint to the list, with its digest. */
static enum status add_file(struct api *api, const struct node_key *key, const char *name, cJSON *list,
                            struct error *err) {
    struct file_version version;
    char hex[SHA256_HEX_SIZE];
    int fd;
    enum status status =
        work_file_open_checkpoint(api->config.data_dir, key->key.job_id, key->key.number, name, &fd, err);
    if (status != STATUS_OK)
        return status;
    status = digests_hash(fd, NULL, &version, hex, err);
    close(fd);
    if (status != STATUS_OK)
        return status;
    cJSON *file = cJSON_CreateObject();
    json_add_string(file, "name", name);
    json_add_int(file, "bytes", (int64_t)version.bytes);
    json_add_string(file, "sha256", hex);
    cJSON_AddItemToArray(list, file);
    return STATUS_OK;
}

struct response *node_files_checkpoint(struct api *api, struct request *r) {
    struct node_key key;
    struct error err;
    char **names = NULL;
    size_t count = 0;
    struct response *refusal = node_key(r, &key);
    if (refusal)
        return refusal;
    cJSON *reply = cJSON_CreateObject(), *list = cJSON_AddArrayToObject(reply, "files");
    enum status status =
        attempt_folder_list_checkpoint(api->config.data_dir, key.key.job_id, key.key.number, &names, &count, &err);
    for (size_t i = 0; i < count && status == STATUS_OK; i++)
        status = add_file(api, &key, names[i], list, &err);
    file_free_names(names, count);
    if (status == STATUS_OK)
        return response_json(200, reply);
    cJSON_Delete(reply);
    return problem_from(r, &err);
}

struct response *node_files_checkpoint_get(struct api *api, struct request *r) {
    struct node_key key;
    struct error err;
    const char *name = r->target.segments[5];
    int fd = -1;
    struct response *refusal = node_key(r, &key);
    if (refusal)
        return refusal;
    enum status status =
        attempt_folder_is_checkpoint_name(name)
            ? work_file_open_checkpoint(api->config.data_dir, key.key.job_id, key.key.number, name, &fd, &err)
            : error_set(&err, STATUS_NOT_FOUND, "a checkpoint has no file %.100s", name);
    return send_file(r, status, fd, "checkpoint", name, &err);
}

/* --- what it writes -------------------------------------------------------------------------- */

struct new_part {
    struct api *api;
    const struct node_key *key;
    int first;
};

static enum status drop_older(void *user, struct error *err) {
    const struct new_part *part = user;
    return attempt_folder_drop_older(part->api->config.data_dir, part->key->key.job_id, part->key->key.number,
                                     part->first, err);
}

struct response *node_files_checkpoint_put(struct api *api, struct request *r) {
    const char *name = r->target.segments[5], *first = target_query(&r->target, "first");
    int number = layout_part_number(name);
    int64_t wanted;
    struct node_key key;
    struct response *reply = node_key(r, &key);
    if (reply)
        return reply;
    if (number == 0)
        return problem(r, 422, "a part of a checkpoint is called part-N, not %.100s", name);
    if (!first || !field_number(first, 1, number, &wanted))
        return problem(r, 400, "first must be the number of the oldest part that is needed, from 1 to %d", number);
    struct new_part part = {.api = api, .key = &key, .first = (int)wanted};
    char *dir = layout_attempt(api->config.data_dir, key.key.job_id, key.key.number);
    char *folder = layout_checkpoint_folder(dir), *path = layout_part(folder, number);
    reply = node_body_end(api, r, &key, path, drop_older, &part);
    mem_free(path);
    mem_free(folder);
    mem_free(dir);
    return reply;
}

struct response *node_files_output_put(struct api *api, struct request *r) {
    struct node_key key;
    struct response *reply = node_key(r, &key);
    if (reply)
        return reply;
    char *name = target_rest(&r->target, 5);
    if (store_output_is_name(name)) {
        char *dir = layout_attempt(api->config.data_dir, key.key.job_id, key.key.number);
        char *path = layout_output(dir, name);
        reply = node_body_end(api, r, &key, path, NULL, NULL);
        mem_free(path);
        mem_free(dir);
    } else {
        reply = problem(r, 422, "\"%.100s\" is no name for an output", name);
    }
    mem_free(name);
    return reply;
}

struct response *node_files_log_put(struct api *api, struct request *r) {
    struct node_key key;
    struct response *reply = node_key(r, &key);
    if (reply)
        return reply;
    if (r->content_length > NODE_LOG_MAX)
        return problem(r, 413, "of a log the last %d bytes are kept", NODE_LOG_MAX);
    char *dir = layout_attempt(api->config.data_dir, key.key.job_id, key.key.number), *path = layout_log(dir);
    reply = node_body_end(api, r, &key, path, NULL, NULL);
    mem_free(path);
    mem_free(dir);
    return reply;
}
