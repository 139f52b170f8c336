/* memory_reduction.c -- see memory_reduction.h. */
#include "server/job/memory_reduction.h"

#include <string.h>

#include "common/settings.h"

#define TEXELS_MIN 64 /* texels_per_iteration is not reduced below this */
#define SIDE_MIN 64   /* nor texture_size below this */

static double halved(double value, int times, double least) {
    for (; times > 0 && value / 2.0 >= least; times--)
        value = (double)(int64_t)(value / 2.0);
    return value;
}

/* Replaces one setting if `smaller` is smaller. */
static void replace(cJSON *settings, const char *name, double present, double smaller, struct buf *what) {
    if (smaller >= present)
        return;
    cJSON_DeleteItemFromObjectCaseSensitive(settings, name);
    json_add_number(settings, name, smaller);
    buf_printf(what, "%s%s %.0f", what->length ? ", " : "", name, smaller);
}

cJSON *memory_reduction_apply(enum job_kind kind, const cJSON *settings, int step, int *thread_count,
                              struct buf *what) {
    cJSON *smaller = cJSON_Duplicate(settings, true);
    struct settings full;
    int threads = (int)halved(*thread_count, step, 1.0);
    if (threads < *thread_count)
        buf_printf(what, "%d thread%s", threads, threads == 1 ? "" : "s");
    *thread_count = threads;
    settings_init(&full);
    if (kind == JOB_RECONSTRUCT && settings_apply(&full, settings, NULL, NULL) == STATUS_OK) {
        double texels = settings_number(&full, "texels_per_iteration");
        double side = settings_number(&full, "texture_size");
        replace(smaller, "texels_per_iteration", texels, halved(texels, 2 * step, TEXELS_MIN), what);
        replace(smaller, "texture_size", side, halved(side, step - 1, SIDE_MIN), what);
    }
    settings_release(&full);
    return smaller;
}

bool memory_reduction_is_possible(enum job_kind kind, const cJSON *settings, int step, int thread_count,
                                  struct buf *what) {
    struct buf present;
    int threads = thread_count;
    buf_init(&present, 4096);
    cJSON_Delete(memory_reduction_apply(kind, settings, step, &threads, &present));
    threads = thread_count;
    cJSON_Delete(memory_reduction_apply(kind, settings, step + 1, &threads, what));
    bool differs = strcmp(buf_text(&present), buf_text(what)) != 0;
    buf_release(&present);
    return differs;
}
