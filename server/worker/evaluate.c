/* evaluate.c -- a reconstruction compared with the truth of its room, inside a worker. It is short and has no
 * checkpoint: a request to stop ends the process, and a later attempt begins anew. */
#include <string.h>

#include "common/file.h"
#include "common/mem.h"
#include "common/output_names.h"
#include "common/parallel.h"
#include "common/protocol.h"
#include "common/reading.h"
#include "server/data/layout.h"
#include "server/evaluate/evaluate.h"
#include "server/worker/announce.h"
#include "server/worker/tasks.h"

#define PICTURES "pictures"

/* Announces the pictures, in the order of their names. */
static enum status announce_pictures(struct progress *progress, const char *folder, struct error *err) {
    char **names = NULL;
    size_t count = 0;
    enum status status = file_list(folder, &names, &count, err);
    for (size_t i = 0; i < count && status == STATUS_OK; i++) {
        char *path = file_join(folder, names[i]), *name = file_join(PICTURES, names[i]);
        status = announce_file(progress, EVENT_OUTPUT, path, name, announce_content_type(name), NULL, err);
        mem_free(name);
        mem_free(path);
    }
    file_free_names(names, count);
    return status;
}

static enum status write_figures(struct progress *progress, const char *out, const struct evaluation *evaluation,
                                 struct error *err) {
    cJSON *json = evaluate_to_json(evaluation);
    char *text = json_text(json), *path = file_join(out, OUTPUT_EVALUATION);
    enum status status = file_replace(path, text, strlen(text), err);
    if (status == STATUS_OK)
        status = announce_file(progress, EVENT_OUTPUT, path, OUTPUT_EVALUATION, MIME_JSON, NULL, err);
    mem_free(path);
    mem_free(text);
    cJSON_Delete(json);
    return status;
}

enum status task_evaluate(const struct order *order, struct progress *progress, struct error *err) {
    struct evaluate_settings settings = evaluate_default_settings();
    struct evaluation evaluation;
    char *out = layout_out(order->dir), *pictures = file_join(out, PICTURES);
    struct parallel *pool = parallel_new(order->thread_count);
    struct reading reading;
    settings.pictures_dir = pictures;
    settings.reading = &reading;
    progress_stage(progress, "evaluate");
    enum status status = reading_parse(order->reading, &reading, err);
    if (status == STATUS_OK)
        status = file_make_dirs(pictures, err);
    if (status == STATUS_OK)
        status = evaluate_outputs(order->scene, order->outputs, &settings, pool, &evaluation, err);
    if (status == STATUS_OK)
        status = announce_pictures(progress, pictures, err);
    if (status == STATUS_OK)
        status = write_figures(progress, out, &evaluation, err);
    reading_release(&reading);
    parallel_free(pool);
    mem_free(pictures);
    mem_free(out);
    return status;
}
