/* fetch.c -- see fetch.h. */
#include "server/node/fetch.h"

#include <string.h>

#include "common/clock.h"
#include "common/file.h"
#include "common/log.h"
#include "common/mem.h"
#include "common/sha256.h"
#include "server/net/field.h"

static enum status from_scene(void *user, const char *name, int fd, struct error *err) {
    return link_fetch(&((struct relay *)user)->link, "scene", name, fd, err);
}

static enum status from_checkpoint(void *user, const char *name, int fd, struct error *err) {
    return link_fetch(&((struct relay *)user)->link, "checkpoint", name, fd, err);
}

static bool go_on(void *user, struct error *err) { return relay_may_begin(user, err) == STATUS_OK; }

enum status fetch_scene(struct relay *r, const char *cache_dir, uint64_t cache_bytes, struct cached_scene *scene,
                        struct error *err) {
    const struct scene_source source = {.user = r, .fetch = from_scene, .go_on = go_on};
    const char *id = "";
    cJSON *list;
    double start = clock_sec();
    *scene = (struct cached_scene){.use_fd = -1};
    enum status status = link_list(&r->link, "scene", &list, err);
    if (status == STATUS_OK)
        status = json_string(list, "scene_id", "the list of files", "", &id, err);
    if (status == STATUS_OK && !sha256_is_hex(id))
        status = error_set(err, STATUS_INPUT, "the daemon names a scene \"%.80s\"", id);
    if (status == STATUS_OK)
        status = scene_cache_take(scene, cache_dir, cache_bytes, id, cJSON_GetObjectItemCaseSensitive(list, "files"),
                                  &source, err);
    if (status == STATUS_OK)
        log_info("scene %.12s: %.1f MB fetched, %.1f s", id, (double)scene->fetched_bytes * 1e-6, clock_sec() - start);
    cJSON_Delete(list);
    return status;
}

enum status fetch_checkpoint(struct relay *r, const char *folder, struct error *err) {
    const struct scene_source source = {.user = r, .fetch = from_checkpoint, .go_on = go_on};
    const cJSON *file;
    cJSON *list;
    double start = clock_sec();
    uint64_t before = r->link.fetched_bytes;
    enum status status = link_list(&r->link, "checkpoint", &list, err);
    cJSON_ArrayForEach(file, cJSON_GetObjectItemCaseSensitive(list, "files")) {
        const char *name;
        if (status == STATUS_OK)
            status = json_string(file, "name", "the list of files", "", &name, err);
        if (status == STATUS_OK && strchr(name, '/'))
            status = error_set(err, STATUS_INPUT, "the daemon names a checkpoint \"%.80s\"", name);
        if (status != STATUS_OK)
            break;
        char *path = file_join(folder, name);
        status = scene_cache_fetch_file(path, file, &source, err);
        mem_free(path);
    }
    if (status == STATUS_OK && r->link.fetched_bytes > before)
        log_info("checkpoint: %.1f MB fetched, %.1f s", (double)(r->link.fetched_bytes - before) * 1e-6,
                 clock_sec() - start);
    cJSON_Delete(list);
    return status;
}
