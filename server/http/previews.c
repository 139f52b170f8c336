/* previews.c -- the pictures that the check of a scene has drawn: who may read the scene may see them.
 *
 * A picture's name is one that the scene's facts list, and is checked again: a worker that had parsed untrusted files
 * wrote both. */
#include <string.h>
#include <unistd.h>

#include "server/data/work_file.h"
#include "server/http/auth.h"
#include "server/http/file_reply.h"
#include "server/http/handlers.h"
#include "server/transport/problem.h"

static bool is_picture_name(const char *name) {
    static const char letters[] = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_-.",
                      ending[] = ".png";
    size_t length = strlen(name);
    return length > sizeof ending - 1 && length <= 100 && name[0] != '.' && strspn(name, letters) == length &&
           strcmp(name + length - (sizeof ending - 1), ending) == 0;
}

static bool is_listed(const struct scene_row *row, const char *name) {
    cJSON *facts = cJSON_Parse(row->facts);
    const cJSON *preview;
    bool is = false;
    cJSON_ArrayForEach(preview, cJSON_GetObjectItemCaseSensitive(facts, "previews")) {
        const char *listed = cJSON_GetStringValue(cJSON_GetObjectItemCaseSensitive(preview, "name"));
        is = is || (listed && strcmp(listed, name) == 0);
    }
    cJSON_Delete(facts);
    return is;
}

struct response *previews_get(struct api *api, struct request *r) {
    struct scene_row row;
    struct response *reply = NULL;
    const char *name = r->target.segments[4];
    struct digests_file file;
    struct error err;
    int fd = -1;
    if (!auth_scene(api, r, ACCESS_READ, &row, &reply))
        return reply;
    enum status status = STATUS_OK;
    if (!is_picture_name(name) || !is_listed(&row, name))
        status = error_set(&err, STATUS_NOT_FOUND, "scene %.12s has no picture %.100s", row.id, name);
    if (status == STATUS_OK)
        status = work_file_open_preview(api->config.data_dir, row.id, name, &fd, &err);
    if (status == STATUS_OK)
        status = digests_identify_file(fd, row.id, name, &file, &err);
    scene_row_release(&row);
    if (status == STATUS_OK)
        return file_reply(r, fd, &file, "image/png");
    if (fd >= 0)
        close(fd);
    return problem_from(r, &err);
}
