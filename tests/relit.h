/* relit.h -- renders of a room's outputs, for tests. */
#ifndef UNBAKE_TESTS_RELIT_H
#define UNBAKE_TESTS_RELIT_H

#include <stdlib.h>
#include <string.h>

#include "common/file.h"
#include "common/image.h"
#include "common/mem.h"
#include "server/relight/relight.h"

/* Renders all pictures into the folder `out`, which exists. Settings are checked as a user's are. */
static inline enum status relit_into(const char *out, const char *outputs, const char *settings, struct parallel *pool,
                                     struct error *err) {
    cJSON *tree = NULL;
    enum status status = json_parse(settings, strlen(settings), "settings", &tree, err);
    if (status == STATUS_OK)
        status = render_settings_check(tree, RENDER_FILES_ANYWHERE, NULL, err);
    struct relight_job job = {.outputs = outputs, .settings = tree, .out = out};
    if (status == STATUS_OK)
        status = relight_run(&job, NULL, pool, err);
    cJSON_Delete(tree);
    return status;
}

/* The same into a new folder, *out, the caller's. */
static inline enum status relit_run(const char *outputs, const char *settings, struct parallel *pool, char **out,
                                    struct error *err) {
    *out = mem_strdup("/tmp/unbake-relit-XXXXXX");
    if (!mkdtemp(*out))
        return error_set(err, STATUS_IO, "no temporary folder");
    return relit_into(*out, outputs, settings, pool, err);
}

/* Reads a file of it. */
static inline enum status relit_read(const char *out, const char *name, struct image *image, struct error *err) {
    char *path = file_join(out, name);
    enum status status = image_read(path, image, NULL, err);
    mem_free(path);
    return status;
}

static inline void relit_remove(char *out) {
    file_remove_tree(out, NULL);
    mem_free(out);
}

/* Radiance of the one picture that the settings mean; they have "format": "exr". The image is empty after a failure. */
static inline enum status relit_picture(const char *outputs, const char *settings, struct parallel *pool,
                                        struct image *image, struct error *err) {
    char *out;
    *image = (struct image){0};
    enum status status = relit_run(outputs, settings, pool, &out, err);
    if (status == STATUS_OK)
        status = relit_read(out, "00000_radiance.exr", image, err);
    relit_remove(out);
    return status;
}

#endif
