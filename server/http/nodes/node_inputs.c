/* node_inputs.c -- see node_inputs.h. */
#include "server/http/nodes/node_inputs.h"

#include <stdio.h>
#include <string.h>

#include "common/mem.h"
#include "common/output_names.h"
#include "common/sha256.h"
#include "server/data/scene_files.h"
#include "server/data/work_file.h"

#define OUTPUTS "outputs/"
#define FILES "files/"
#define PREVIEWS "preview/" /* outputs that no render reads */

static bool begins_with(const char *name, const char *prefix) { return strncmp(name, prefix, strlen(prefix)) == 0; }

/* Takes name. */
static void add_file(cJSON *list, char *name, double bytes, const char *sha256) {
    cJSON *file = cJSON_CreateObject();
    json_add_string(file, "name", name);
    json_add_number(file, "bytes", bytes);
    json_add_string(file, "sha256", sha256);
    cJSON_AddItemToArray(list, file);
    mem_free(name);
}

/* The outputs of the attempt that has made all of them. */
static enum status add_outputs(struct api *api, int64_t source, cJSON *list, struct error *err) {
    struct output_row *rows = NULL, first = {0};
    size_t count = 0;
    enum status status = store_output_get(api->store, source, OUTPUT_MESH, &first, err);
    if (status == STATUS_OK)
        status = store_output_list(api->store, source, &rows, &count, err);
    for (size_t i = 0; i < count; i++) {
        if (rows[i].attempt == first.attempt && !begins_with(rows[i].name, PREVIEWS))
            add_file(list, mem_printf(OUTPUTS "%s", rows[i].name), (double)rows[i].bytes,
                     rows[i].digest[0] ? rows[i].digest : rows[i].sha256);
        output_row_release(&rows[i]);
    }
    mem_free(rows);
    output_row_release(&first);
    return status;
}

static void add_files(const struct job *job, cJSON *list) {
    cJSON *files = cJSON_Parse(job->files), *file;
    cJSON_ArrayForEach(file, files) {
        const char *name = cJSON_GetStringValue(cJSON_GetObjectItemCaseSensitive(file, "name"));
        const char *sha256 = cJSON_GetStringValue(cJSON_GetObjectItemCaseSensitive(file, "sha256"));
        if (name && sha256)
            add_file(list, mem_printf(FILES "%s", name),
                     cJSON_GetNumberValue(cJSON_GetObjectItemCaseSensitive(file, "bytes")), sha256);
    }
    cJSON_Delete(files);
}

enum status node_inputs_list(struct api *api, const struct job *job, char id[SCENE_ID_SIZE], cJSON **list,
                             struct error *err) {
    *list = NULL;
    snprintf(id, SCENE_ID_SIZE, "%s", job->scene_id);
    if (job->kind != JOB_RENDER)
        return scene_files_list(api->config.data_dir, id, list, err);
    *list = cJSON_CreateArray();
    enum status status = add_outputs(api, job->source_id, *list, err);
    add_files(job, *list);
    char *text = json_text(*list);
    sha256_of(text, strlen(text), id);
    mem_free(text);
    return status;
}

static enum status open_output(struct api *api, int64_t source, const char *name, int *fd, struct error *err) {
    struct output_row row = {0}, first = {0};
    enum status status = store_output_get(api->store, source, OUTPUT_MESH, &first, err);
    if (status == STATUS_OK) /* the row says that there is such an output: no other file of the folder is given out */
        status = store_output_get(api->store, source, name, &row, err);
    if (status == STATUS_OK)
        status = work_file_open_output(api->config.data_dir, source, first.attempt, row.name, fd, err);
    output_row_release(&row);
    output_row_release(&first);
    return status;
}

enum status node_inputs_open(struct api *api, const struct job *job, const char *name, int *fd, struct error *err) {
    *fd = -1;
    if (job->kind != JOB_RENDER)
        return work_file_open_scene(api->config.data_dir, job->scene_id, name, fd, err);
    if (begins_with(name, OUTPUTS))
        return open_output(api, job->source_id, name + strlen(OUTPUTS), fd, err);
    if (begins_with(name, FILES))
        return work_file_open_job_file(api->config.data_dir, job->id, name + strlen(FILES), fd, err);
    return error_set(err, STATUS_NOT_FOUND, "the job reads no file %.100s", name);
}
