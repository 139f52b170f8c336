/* time_limit.c -- see time_limit.h. */
#include "server/executor/time_limit.h"

#include <errno.h>
#include <sys/stat.h>

#include "common/file.h"
#include "common/mem.h"
#include "common/output_names.h"
#include "server/data/layout.h"
#include "server/data/picture_record.h"

/* A site signals before the time is up (Slurm's script 120 s), and counts from before the claim. */
#define EARLY_SEC 300.0
#define EARLY_PART 0.5 /* of short limits */

/* Whether the file has come since the attempt was claimed; in doubt it has. */
static bool is_newer(const char *path, const struct remote_row *row) {
    struct stat info;
    if (stat(path, &info) != 0)
        return errno != ENOENT;
    return (double)info.st_mtim.tv_sec * 1e3 + (double)info.st_mtim.tv_nsec * 1e-6 > (double)row->claimed_ms;
}

/* A part of a checkpoint, or of a render the record of its pictures. Files are written when they arrive, and keep that
 * time when a later attempt takes the folder over. */
static bool has_saved(const char *data_dir, const struct remote_row *row) {
    char *dir = layout_attempt(data_dir, row->job_id, row->number), *folder = layout_checkpoint_folder(dir);
    char *record = layout_output(dir, OUTPUT_RECORD), **names = NULL;
    size_t count = 0;
    bool found = is_newer(record, row) || file_list(folder, &names, &count, NULL) != STATUS_OK;
    for (size_t i = 0; i < count; i++) {
        char *path = file_join(folder, names[i]);
        found |= is_newer(path, row);
        mem_free(path);
    }
    file_free_names(names, count);
    mem_free(record);
    mem_free(folder);
    mem_free(dir);
    return found;
}

bool time_limit_is_futile(const struct site *site, const char *data_dir, const struct remote_row *row) {
    double limit_sec = 60.0 * site->time_min, ran_sec = 1e-3 * (double)(row->heard_ms - row->claimed_ms);
    bool is_up = row->claimed_ms > 0 && ran_sec >= limit_sec - EARLY_SEC && ran_sec >= EARLY_PART * limit_sec;
    return is_up && !has_saved(data_dir, row);
}
