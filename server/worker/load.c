/* load.c -- see load.h. */
#include "server/worker/load.h"

#include <string.h>

#include "common/kept_pixels.h"
#include "common/mem.h"
#include "server/ingest/bundle.h"
#include "server/ingest/photo_color.h"
#include "server/ingest/photos.h"
#include "server/ingest/pixels.h"
#include "server/scene/select.h"

/* Leaves out what the settings exclude and crop. */
static enum status select_parts(struct progress *progress, const struct settings *settings, struct scene *scene,
                                struct error *err) {
    double lower[3], upper[3];
    size_t frames = 0, triangles = 0;
    enum status status = scene_exclude(scene, settings_text(settings, "exclude"), &frames, err);
    if (status == STATUS_OK && settings_box(settings, "crop", lower, upper))
        status = scene_crop(scene, lower, upper, &triangles, err);
    if (status != STATUS_OK || frames + triangles == 0)
        return status;
    char *text = mem_printf("left out as the settings say: %zu photographs, %zu triangles", frames, triangles);
    progress_log(progress, "info", text);
    mem_free(text);
    if (scene->photograph_count < PHOTOS_MIN_COUNT)
        return error_set(err, STATUS_INPUT, "exclude leaves %zu photographs; %d are needed", scene->photograph_count,
                         PHOTOS_MIN_COUNT);
    return STATUS_OK;
}

static void tell_reduced(struct progress *progress, const struct scene *scene) {
    size_t count = 0;
    const struct photograph *last = NULL;
    for (size_t i = 0; i < scene->photograph_count; i++) {
        if (scene->photograph[i].file.step > 1) {
            last = &scene->photograph[i];
            count++;
        }
    }
    if (count == 0)
        return;
    char *text = mem_printf("photographs: %zu of %zu are reduced, %s from %u x %u to %u x %u pixels "
                            "(photograph_megapixels)",
                            count, scene->photograph_count, last->name, last->file.width, last->file.height,
                            last->camera.width, last->camera.height);
    progress_log(progress, "info", text);
    mem_free(text);
}

static void tell_pixels(struct progress *progress, struct spill *spill, const struct scene *scene) {
    uint64_t bytes = spill_file_bytes(spill);
    if (bytes == 0)
        return;
    char *text =
        mem_printf("photographs: the pixels of all %zu do not fit the %.0f MiB that they may have of the memory "
                   "(photograph_memory_mib): they are read from the disk",
                   scene->photograph_count, (double)spill_memory_bytes(spill) / 1048576.0);
    progress_log(progress, "info", text);
    mem_free(text);
}

enum status load_scene(const struct order *order, struct progress *progress, struct spill *spill,
                       const struct settings *settings, struct parallel *pool, struct scene *scene, struct error *err) {
    struct bundle_limits limits = bundle_default_limits();
    pixels_use(spill, &limits);
    limits.later_bytes = PHOTOGRAPH_LATER_BYTES;
    limits.kept_pixels = kept_pixels(settings, settings_number(settings, "texture_size"));
    struct reading reading;
    const char *transforms = settings_text(settings, "transforms");
    enum status status = reading_parse(order->reading, &reading, err);
    if (status != STATUS_OK)
        return status;
    if (strcmp(transforms, BUNDLE_TRANSFORMS) != 0) { /* the job's own file, in place of the scene's */
        mem_free(reading.transforms);
        reading.transforms = mem_strdup(transforms);
    }
    cJSON *problems = cJSON_CreateArray();
    status = bundle_load(order->scene, &reading, &limits, pool, scene, problems, err);
    reading_release(&reading);
    /* Only with another transforms file than the scene's check has read. */
    const cJSON *problem;
    cJSON_ArrayForEach(problem, problems) {
        char *text = json_text(problem);
        progress_log(progress, "error", text);
        mem_free(text);
    }
    cJSON_Delete(problems);
    if (status == STATUS_OK) {
        status = select_parts(progress, settings, scene, err);
        if (status != STATUS_OK)
            scene_release(scene);
    }
    for (size_t i = 0; i < scene->warning_count; i++)
        progress_log(progress, "warning", scene->warning[i]);
    char *color = status == STATUS_OK ? photo_color_fact(scene) : NULL;
    if (color) {
        char *text = mem_printf("photographs: %s", color);
        progress_log(progress, "info", text);
        mem_free(text);
    }
    mem_free(color);
    if (status == STATUS_OK) {
        tell_reduced(progress, scene);
        tell_pixels(progress, spill, scene);
    }
    return status;
}
