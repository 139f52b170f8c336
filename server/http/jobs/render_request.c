/* render_request.c -- see render_request.h. */
#include "server/http/jobs/render_request.h"

#include <string.h>
#include <unistd.h>

#include "common/buf.h"
#include "common/mem.h"
#include "common/output_names.h"
#include "common/render_settings.h"
#include "common/utf8.h"
#include "server/data/work_file.h"
#include "server/http/jobs/job_request.h"
#include "server/transport/problem.h"

#define OUTPUT_LIMIT ((size_t)64 << 20) /* bytes of either */

/* Notes the files; their names become names in a folder and in paths of URLs. */
static void find_files(struct render_request *q, cJSON *params) {
    cJSON *files = render_settings_files(q->settings);
    const cJSON *name;
    cJSON_ArrayForEach(name, files) {
        if (!utf8_is_name(name->valuestring)) {
            problem_param(params, "settings", NULL, "name a file with a control character");
            continue;
        }
        q->file = mem_realloc_array(q->file, q->file_count + 1, sizeof *q->file);
        q->file[q->file_count++] = mem_strdup(name->valuestring);
    }
    cJSON_Delete(files);
}

void render_request_read(struct render_request *q, const cJSON *settings, cJSON *params) {
    cJSON *problems = cJSON_CreateArray();
    struct error err;
    q->settings = settings;
    if (settings && render_settings_check(settings, RENDER_FILES_ATTACHED, problems, &err) != STATUS_OK)
        job_request_faults(problems, params);
    else if (settings)
        find_files(q, params);
    cJSON_Delete(problems);
}

/* --- what it costs ----------------------------------------------------------------------------- */

/* An output of the source that is JSON; NULL where it cannot be read. The caller's. */
static cJSON *read_output(struct api *api, int64_t source, const char *name) {
    struct output_row row = {0};
    struct buf text;
    char chunk[65536];
    int fd = -1;
    cJSON *value = NULL;
    buf_init(&text, OUTPUT_LIMIT);
    if (store_output_get(api->store, source, name, &row, NULL) == STATUS_OK &&
        work_file_open_output(api->config.data_dir, source, row.attempt, row.name, &fd, NULL) == STATUS_OK) {
        ssize_t got;
        bool fits = true;
        while (fits && (got = read(fd, chunk, sizeof chunk)) > 0)
            fits = buf_append(&text, chunk, (size_t)got);
        close(fd);
        if (fits)
            value = cJSON_ParseWithLength(buf_text(&text), text.length);
    }
    buf_release(&text);
    output_row_release(&row);
    return value;
}

static double number_of(const cJSON *object, const char *name) {
    const cJSON *value = cJSON_GetObjectItemCaseSensitive(object, name);
    return cJSON_IsNumber(value) ? value->valuedouble : 0.0;
}

/* Pixels of the largest of the cameras. */
static double pixels_of(const cJSON *frames) {
    double most = 0.0;
    const cJSON *frame;
    cJSON_ArrayForEach(frame, frames) {
        double pixels = number_of(frame, "w") * number_of(frame, "h");
        most = pixels > most ? pixels : most;
    }
    return most;
}

/* How many views the setting `view` names; 0: not known. */
static double count_views(const cJSON *settings, const cJSON *frames) {
    if (render_settings_has(settings, "path"))
        return render_settings_number(settings, "path_count");
    if (render_settings_is(settings, "view", "all"))
        return (double)cJSON_GetArraySize(frames);
    double count = 1.0;
    for (const char *at = render_settings_text(settings, "view"); *at; at++)
        count += *at == ',';
    return count;
}

static double count_family(const cJSON *settings, const char *family) {
    size_t count;
    mem_free(render_settings_family(settings, family, &count));
    return (double)count;
}

/* Pictures of a view: with per_light one of each source too, at most: of the emitters found, of those that the settings
 * add or light, of sky and sun. 0: not known. */
static double count_pictures(const cJSON *settings, const cJSON *segments) {
    const cJSON *segment;
    double count = 0.0;
    if (!render_settings_bool(settings, "per_light"))
        return 1.0;
    if (segments)
        count = 3.0 + count_family(settings, "segment.") + count_family(settings, "lamp.") +
                count_family(settings, "insert.");
    cJSON_ArrayForEach(segment, segments)
        count += cJSON_IsTrue(cJSON_GetObjectItemCaseSensitive(segment, "emitter"));
    return count;
}

/* 0: not known. */
static double cost_of(const cJSON *settings, const cJSON *frames) {
    uint32_t width, height;
    double pixels = render_settings_size(settings, &width, &height) ? (double)width * height : pixels_of(frames);
    return pixels * count_views(settings, frames) * render_settings_number(settings, "suns") *
           render_settings_number(settings, "spp");
}

/* The cameras that the settings mean; NULL: a file has them that is still to come. The caller's. */
static cJSON *read_cameras(struct api *api, const cJSON *settings, int64_t source) {
    if (render_settings_is(settings, "cameras", "held_out"))
        return read_output(api, source, OUTPUT_VIEWS);
    return render_settings_is(settings, "cameras", "photographs") ? read_output(api, source, OUTPUT_CAMERAS) : NULL;
}

void render_request_check_room(struct api *api, struct render_request *q, int64_t source, cJSON *params) {
    cJSON *none = cJSON_CreateObject(), *problems = cJSON_CreateArray();
    const cJSON *settings = q->settings ? q->settings : none;
    bool needs_report = render_settings_bool(settings, "per_light") || render_settings_need_report(settings);
    cJSON *views = read_cameras(api, settings, source);
    cJSON *report = needs_report ? read_output(api, source, OUTPUT_REPORT) : NULL;
    const cJSON *frames = cJSON_GetObjectItemCaseSensitive(views, "frames"),
                *segments = cJSON_GetObjectItemCaseSensitive(report, "segments");
    if (render_settings_check_room(settings, report, frames, problems, NULL) != STATUS_OK)
        job_request_faults(problems, params);
    q->cost = cost_of(settings, frames) * count_pictures(settings, segments);
    cJSON_Delete(report);
    cJSON_Delete(views);
    cJSON_Delete(problems);
    cJSON_Delete(none);
}

void render_request_describe(const struct api *api, const struct render_request *q, cJSON *value) {
    cJSON *files = cJSON_AddArrayToObject(value, "files");
    for (size_t i = 0; i < q->file_count; i++)
        cJSON_AddItemToArray(files, json_new_string(q->file[i]));
    if (q->cost > 0.0)
        json_add_number(value, "paths", q->cost);
    else
        json_add(value, "paths", cJSON_CreateNull());
    json_add_bool(value, "small", q->cost > 0.0 && q->cost <= api->config.small_render_cost);
}

void render_request_release(struct render_request *q) {
    for (size_t i = 0; i < q->file_count; i++)
        mem_free(q->file[i]);
    mem_free(q->file);
    *q = (struct render_request){0};
}
