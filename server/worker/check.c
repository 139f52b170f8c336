/* check.c -- whether an uploaded scene can be used: unpacked, read in full, every problem told.
 *
 * The archive is what is durable. What is unpacked from it is flushed to the disk before the
 * scene may be called ready, since nothing unpacks it a second time. */
#include <errno.h>
#include <fcntl.h>
#include <unistd.h>

#include "common/file.h"
#include "common/machine.h"
#include "common/mem.h"
#include "common/parallel.h"
#include "server/check/check_pictures.h"
#include "server/check/check_table.h"
#include "server/data/layout.h"
#include "server/ingest/facts.h"
#include "server/ingest/pixels.h"
#include "server/worker/pixel_memory.h"
#include "server/worker/tasks.h"

static enum status flush(const char *dir, struct error *err) {
    int fd = open(dir, O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    if (fd < 0)
        return error_set_errno(err, errno, "cannot open folder %s", dir);
    enum status status = STATUS_OK;
    if (syncfs(fd) != 0)
        status = error_set_errno(err, errno, "cannot flush folder %s", dir);
    close(fd);
    return status;
}

static const char *text_of(const cJSON *problem, const char *key) {
    const char *text = cJSON_GetStringValue(cJSON_GetObjectItemCaseSensitive(problem, key));
    return text ? text : "";
}

static void tell_problems(struct progress *progress, const cJSON *problems) {
    const cJSON *problem;
    cJSON_ArrayForEach(problem, problems)
        progress_problem(progress, text_of(problem, "file"), text_of(problem, "reason"), text_of(problem, "hint"));
}

/* All that there is to tell of a scene that is rejected, besides its problems. */
static void tell_warnings(struct progress *progress, const struct scene *scene) {
    cJSON *facts = cJSON_CreateObject();
    json_add(facts, "warnings", facts_warnings(scene));
    progress_scene(progress, facts);
}

/* What a job may use; 0 where that is not known. */
static double memory_of_jobs(const struct order *order) {
    uint64_t available = machine_memory_available("");
    return (double)(order->memory_bytes > 0 && order->memory_bytes < available ? order->memory_bytes : available);
}

/* Facts by now, for who watches the check. */
struct told {
    struct progress *progress;
    const cJSON *facts;
};

static void tell_read(void *user, const struct scene *scene) {
    const struct told *told = user;
    progress_scene(told->progress, facts_of(scene));
}

static void tell_drawn(void *user) {
    const struct told *told = user;
    progress_scene(told->progress, cJSON_Duplicate(told->facts, true));
}

/* The facts, with the pictures that were drawn of them, as they come; they are final with the last line. */
static enum status tell_facts(struct progress *progress, const struct order *order, const struct scene_check *room,
                              struct parallel *pool, struct error *err) {
    char *previews = layout_previews(order->dir);
    cJSON *facts = facts_of(&room->scene);
    struct told told = {progress, facts};
    struct settings settings; /* of a job for which nothing is set */
    settings_init(&settings);
    scene_check_facts(room, facts);
    check_table_add(facts, room, &settings, memory_of_jobs(order), pool);
    settings_release(&settings);
    tell_drawn(&told); /* nothing so far */
    enum status status = file_make_dirs(previews, err);
    if (status == STATUS_OK)
        status = check_pictures_write(room, previews, pool, cJSON_AddArrayToObject(facts, "previews"), tell_drawn,
                                      &told, err);
    if (status == STATUS_OK)
        status = flush(order->dir, err);
    if (status == STATUS_OK)
        progress_scene(progress, facts);
    else
        cJSON_Delete(facts);
    mem_free(previews);
    return status;
}

enum status task_check(const struct order *order, struct progress *progress, struct error *err) {
    struct bundle_limits limits = bundle_default_limits();
    char *archive = layout_archive(order->dir), *files = layout_files(order->dir);
    struct parallel *pool = parallel_new(order->thread_count);
    struct spill *spill = pixel_memory_new(order);
    pixels_use(spill, &limits);
    cJSON *problems = cJSON_CreateArray();
    struct scene_check room;
    struct reading reading;
    /* Removes what an earlier, killed check left, or one with another reading. */
    enum status status = reading_parse(order->reading, &reading, err);
    if (status == STATUS_OK)
        status = file_remove_tree(files, err);
    if (status == STATUS_OK)
        status = bundle_unpack(archive, files, &limits, err);
    if (status == STATUS_OK) {
        struct told told = {.progress = progress};
        status = scene_check(&room, files, &reading, &limits, pool, problems, tell_read, &told, err);
        tell_problems(progress, problems);
        if (status == STATUS_OK)
            status = tell_facts(progress, order, &room, pool, err);
        else
            tell_warnings(progress, &room.scene);
        if (status != STATUS_OK)
            file_remove_tree(files, NULL); /* a rejected scene keeps only its archive */
        scene_check_release(&room);
    }
    reading_release(&reading);
    cJSON_Delete(problems);
    spill_free(spill);
    parallel_free(pool);
    mem_free(files);
    mem_free(archive);
    return status;
}
