/* scene_files.c -- see scene_files.h. The list that is kept has the time of each file, too. */
#include "server/data/scene_files.h"

#include <errno.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>

#include "common/file.h"
#include "common/mem.h"
#include "common/sha256.h"
#include "server/data/layout.h"

#define KEPT_MAX ((size_t)64 << 20) /* bytes of a kept list */

struct walk {
    const cJSON *kept; /* the list as it was kept; an object by name; NULL: none */
    cJSON *list;       /* of files with their times */
    bool is_changed;   /* a digest was made */
};

/* Time and size of a file's version, as text. */
static void version_of(const struct stat *info, char text[64]) {
    snprintf(text, 64, "%lld.%09ld %lld", (long long)info->st_mtim.tv_sec, (long)info->st_mtim.tv_nsec,
             (long long)info->st_size);
}

static const char *text_of(const cJSON *object, const char *key) {
    const char *text = cJSON_GetStringValue(cJSON_GetObjectItemCaseSensitive(object, key));
    return text ? text : "";
}

static enum status add_file(struct walk *w, const char *path, const char *name, const struct stat *info,
                            struct error *err) {
    char version[64], hex[SHA256_HEX_SIZE];
    version_of(info, version);
    const cJSON *before = cJSON_GetObjectItemCaseSensitive(w->kept, name);
    enum status status = STATUS_OK;
    if (strcmp(text_of(before, "version"), version) == 0 && strlen(text_of(before, "sha256")) == sizeof hex - 1) {
        snprintf(hex, sizeof hex, "%s", text_of(before, "sha256"));
    } else {
        w->is_changed = true;
        status = sha256_of_file(path, hex, err);
    }
    if (status != STATUS_OK)
        return status;
    cJSON *file = cJSON_CreateObject();
    json_add_string(file, "name", name);
    json_add_int(file, "bytes", (int64_t)info->st_size);
    json_add_string(file, "sha256", hex);
    json_add_string(file, "version", version);
    json_add(w->list, name, file);
    return STATUS_OK;
}

/* `name`: of the folder, below the scene's files; "": these. Only plain files count. */
static enum status walk(struct walk *w, const char *path, const char *name, struct error *err) {
    char **names = NULL;
    size_t count = 0;
    enum status status = file_list(path, &names, &count, err);
    for (size_t i = 0; status == STATUS_OK && i < count; i++) {
        struct stat info;
        char *inner = file_join(path, names[i]), *below = *name ? file_join(name, names[i]) : mem_strdup(names[i]);
        if (lstat(inner, &info) != 0)
            status = error_set_errno(err, errno, "cannot access %s", inner);
        else if (S_ISDIR(info.st_mode))
            status = walk(w, inner, below, err);
        else if (S_ISREG(info.st_mode))
            status = add_file(w, inner, below, &info, err);
        mem_free(below);
        mem_free(inner);
    }
    file_free_names(names, count);
    return status;
}

/* Keeps the list; without room for it the next one who asks waits again. */
static void keep(const char *path, const cJSON *list) {
    char *text = json_text(list);
    (void)file_replace(path, text, strlen(text), NULL);
    mem_free(text);
}

enum status scene_files_list(const char *data_dir, const char *scene_id, cJSON **list, struct error *err) {
    char *scene = layout_scene(data_dir, scene_id), *files = layout_files(scene), *path = layout_file_list(scene);
    cJSON *kept = NULL, *file;
    (void)json_read(path, KEPT_MAX, &kept, NULL);
    struct walk w = {.kept = kept, .list = cJSON_CreateObject()};
    enum status status = walk(&w, files, "", err);
    if (status == STATUS_OK && w.is_changed)
        keep(path, w.list);
    *list = status == STATUS_OK ? cJSON_CreateArray() : NULL;
    while (*list && (file = cJSON_DetachItemFromArray(w.list, 0)) != NULL) {
        cJSON_DeleteItemFromObjectCaseSensitive(file, "version");
        cJSON_AddItemToArray(*list, file);
    }
    cJSON_Delete(w.list);
    cJSON_Delete(kept);
    mem_free(path);
    mem_free(files);
    mem_free(scene);
    return status;
}
