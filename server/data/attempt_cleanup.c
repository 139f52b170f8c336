/* attempt_cleanup.c -- see attempt_cleanup.h. */
#include "server/data/attempt_cleanup.h"

#include <errno.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "common/file.h"
#include "common/mem.h"
#include "common/output_names.h"
#include "server/data/attempt_folder.h"
#include "server/data/layout.h"
#include "server/data/picture_record.h"

struct tidying {
    const struct output_row *rows; /* [count], by name */
    size_t count;
    int number;     /* of the attempt */
    bool has_files; /* something of it stays */
};

static bool is_named(const struct tidying *t, const char *name) {
    size_t low = 0, high = t->count;
    while (low < high) {
        size_t middle = low + (high - low) / 2;
        int order = strcmp(name, t->rows[middle].name);
        if (order == 0)
            return t->rows[middle].attempt == t->number;
        low = order > 0 ? middle + 1 : low;
        high = order < 0 ? middle : high;
    }
    return false;
}

/* `name` is that of the folder as outputs have it; "": out/ itself. Symbolic links are files here. */
static enum status tidy_folder(struct tidying *t, const char *path, const char *name, struct error *err) {
    char **names = NULL;
    size_t count = 0;
    enum status status = file_list(path, &names, &count, err);
    if (status == STATUS_NOT_FOUND)
        status = STATUS_OK;
    for (size_t i = 0; status == STATUS_OK && i < count; i++) {
        struct stat info;
        char *inner = file_join(path, names[i]), *output = *name ? file_join(name, names[i]) : mem_strdup(names[i]);
        if (lstat(inner, &info) != 0)
            status = error_set_errno(err, errno, "cannot access %s", inner);
        else if (S_ISDIR(info.st_mode)) {
            status = tidy_folder(t, inner, output, err);
            if (status == STATUS_OK && rmdir(inner) != 0 && errno != ENOTEMPTY && errno != EEXIST)
                status = error_set_errno(err, errno, "cannot remove %s", inner);
        } else if (is_named(t, output) || strcmp(names[i], OUTPUT_RECORD) == 0)
            t->has_files = true;
        else
            status = file_remove_tree(inner, err);
        mem_free(output);
        mem_free(inner);
    }
    file_free_names(names, count);
    return status;
}

/* Whether the attempt still writes. */
static enum status is_running(struct store *store, int64_t job_id, int number, int ended, bool *runs,
                              struct error *err) {
    struct attempt_row row;
    enum status status = store_attempt_get(store, &(struct attempt_key){job_id, number}, &row, err);
    *runs = status == STATUS_OK && row.phase == ATTEMPT_ROW_RUNNING && number != ended;
    return status == STATUS_NOT_FOUND ? STATUS_OK : status;
}

static enum status tidy_attempt(struct tidying *t, const char *dir, struct error *err) {
    char *out = layout_out(dir);
    bool has_checkpoint = false;
    enum status status = tidy_folder(t, out, "", err);
    if (status == STATUS_OK)
        status = attempt_folder_has_checkpoint(dir, &has_checkpoint, err);
    if (status == STATUS_OK && !t->has_files && !has_checkpoint)
        status = file_remove_tree(dir, err);
    mem_free(out);
    return status;
}

enum status attempt_cleanup(const char *data_dir, struct store *store, int64_t job_id, int ended, struct error *err) {
    struct output_row *rows = NULL;
    size_t row_count = 0, count = 0;
    int *numbers = NULL;
    enum status status = store_output_list(store, job_id, &rows, &row_count, err);
    if (status == STATUS_OK)
        status = attempt_folder_list(data_dir, job_id, &numbers, &count, err);
    for (size_t i = 0; status == STATUS_OK && i < count; i++) {
        struct tidying t = {.rows = rows, .count = row_count, .number = numbers[i]};
        char *dir = layout_attempt(data_dir, job_id, numbers[i]);
        bool runs = false;
        status = is_running(store, job_id, numbers[i], ended, &runs, err);
        if (status == STATUS_OK && !runs)
            status = tidy_attempt(&t, dir, err);
        mem_free(dir);
    }
    for (size_t i = 0; i < row_count; i++)
        output_row_release(&rows[i]);
    mem_free(rows);
    mem_free(numbers);
    return status;
}
