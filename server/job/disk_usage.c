/* disk_usage.c -- see disk_usage.h. */
#include "server/job/disk_usage.h"

#include "common/file.h"
#include "common/log.h"
#include "common/mem.h"
#include "server/data/layout.h"

#define AT_ONCE 64 /* rows entered in one transaction */

int64_t disk_usage_of_folder(const char *dir) {
    struct error err;
    uint64_t files, bytes;
    if (file_tree_size(dir, &files, &bytes, &err) == STATUS_OK)
        return (int64_t)bytes;
    log_warning("what %s takes of the disk is not known: %s", dir, err.message);
    return -1;
}

enum status disk_usage_enter_job(struct store *store, int64_t job_id, const char *dir, struct error *err) {
    const struct disk_use use = {.job_id = job_id, .bytes = disk_usage_of_folder(dir)};
    return store_disk_enter(store, &use, 1, err);
}

static void measure(const struct scheduler_config *config, struct disk_use *use) {
    char *dir = use->job_id ? layout_job(config->data_dir, use->job_id) : layout_scene(config->data_dir, use->scene_id);
    use->bytes = disk_usage_of_folder(dir);
    mem_free(dir);
}

void disk_usage_enter_unknown(const struct scheduler_config *config, struct store *store) {
    struct disk_use list[AT_ONCE];
    struct error err;
    enum status status;
    size_t count, failed = 0; /* the failed ones come first in the list, and are skipped */
    do {
        status = store_disk_unknown(store, failed, AT_ONCE, list, &count, &err);
        for (size_t i = 0; i < count; i++) {
            measure(config, &list[i]);
            failed += list[i].bytes < 0;
        }
        if (status == STATUS_OK && count > 0)
            status = store_disk_enter(store, list, count, &err);
    } while (status == STATUS_OK && count == AT_ONCE);
    if (status != STATUS_OK)
        log_warning("what jobs and scenes take of the disk is not known of all: %s", err.message);
}
