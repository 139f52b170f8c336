/* attempt_folder.c -- see attempt_folder.h. */
#include "server/data/attempt_folder.h"

#include <errno.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "common/file.h"
#include "common/log.h"
#include "common/mem.h"
#include "common/output_names.h"
#include "server/data/layout.h"
#include "server/data/picture_record.h"

enum status attempt_folder_list(const char *data_dir, int64_t job_id, int **numbers, size_t *count, struct error *err) {
    char *dir = layout_job(data_dir, job_id);
    enum status status = file_list_numbered(dir, layout_attempt_number, numbers, count, err);
    if (status == STATUS_NOT_FOUND) /* a job that has not begun */
        status = STATUS_OK;
    mem_free(dir);
    return status;
}

/* Whether there is such a file or folder. */
static enum status look(const char *path, bool *exists, struct error *err) {
    struct stat info;
    *exists = lstat(path, &info) == 0;
    return *exists || errno == ENOENT || errno == ENOTDIR ? STATUS_OK
                                                          : error_set_errno(err, errno, "cannot access %s", path);
}

bool attempt_folder_is_checkpoint_name(const char *name) {
    return layout_part_number(name) > 0 || layout_is_checkpoint(name);
}

enum status attempt_folder_has_checkpoint(const char *dir, bool *exists, struct error *err) {
    char *folder = layout_checkpoint_folder(dir), **names = NULL;
    size_t count = 0;
    enum status status = file_list(folder, &names, &count, err);
    *exists = false;
    for (size_t i = 0; i < count; i++)
        *exists = *exists || attempt_folder_is_checkpoint_name(names[i]);
    file_free_names(names, count);
    mem_free(folder);
    return status == STATUS_NOT_FOUND ? STATUS_OK : status;
}

/* Moves a file or folder, durably; one that is absent is no error. */
static enum status move(const char *from, const char *to, struct error *err) {
    if (rename(from, to) != 0)
        return errno == ENOENT ? STATUS_OK : error_set_errno(err, errno, "cannot move %s to %s", from, to);
    enum status status = file_sync_parent(to, err);
    return status == STATUS_OK ? file_sync_parent(from, err) : status;
}

/* --- checkpoints --------------------------------------------------------------------------- */

/* Moves the checkpoint's folder of the newest attempt that has one. */
static enum status take_over(const char *data_dir, int64_t job_id, int number, const char *to, struct error *err) {
    int *others;
    size_t count;
    bool exists = false;
    enum status status = attempt_folder_list(data_dir, job_id, &others, &count, err);
    for (size_t i = count; i-- > 0 && status == STATUS_OK && !exists;) {
        char *dir = layout_attempt(data_dir, job_id, others[i]), *from = layout_checkpoint_folder(dir);
        if (others[i] != number)
            status = look(from, &exists, err);
        if (status == STATUS_OK && exists)
            status = move(from, to, err);
        mem_free(from);
        mem_free(dir);
    }
    mem_free(others);
    return status;
}

static enum status begin(const char *data_dir, int64_t job_id, int number, bool takes_over, struct error *err) {
    char *dir = layout_attempt(data_dir, job_id, number), *out = layout_out(dir);
    char *checkpoint = layout_checkpoint_folder(dir);
    bool exists = false;
    enum status status = file_make_dirs(out, err);
    if (status == STATUS_OK)
        status = look(checkpoint, &exists, err);
    if (status == STATUS_OK && !exists && takes_over)
        status = take_over(data_dir, job_id, number, checkpoint, err);
    if (status == STATUS_OK)
        status = file_make_dirs(checkpoint, err);
    mem_free(checkpoint);
    mem_free(out);
    mem_free(dir);
    return status;
}

enum status attempt_folder_begin(const char *data_dir, int64_t job_id, int number, struct error *err) {
    return begin(data_dir, job_id, number, true, err);
}

enum status attempt_folder_begin_part(const char *data_dir, int64_t job_id, int number, struct error *err) {
    return begin(data_dir, job_id, number, false, err);
}

enum status attempt_folder_with_checkpoint(const char *data_dir, int64_t job_id, char **work_dir, struct error *err) {
    int *numbers;
    size_t count;
    bool exists = false;
    *work_dir = NULL;
    enum status status = attempt_folder_list(data_dir, job_id, &numbers, &count, err);
    for (size_t i = count; i-- > 0 && status == STATUS_OK && !exists;) {
        char *dir = layout_attempt(data_dir, job_id, numbers[i]);
        status = attempt_folder_has_checkpoint(dir, &exists, err);
        if (exists)
            *work_dir = layout_attempt(NULL, job_id, numbers[i]);
        mem_free(dir);
    }
    mem_free(numbers);
    return status;
}

enum status attempt_folder_drop_checkpoint(const char *data_dir, int64_t job_id, struct error *err) {
    int *numbers;
    size_t count;
    enum status status = attempt_folder_list(data_dir, job_id, &numbers, &count, err);
    for (size_t i = 0; i < count; i++) {
        /* The journal first: it must never meet another database. */
        char *dir = layout_attempt(data_dir, job_id, numbers[i]);
        char *parts[] = {layout_checkpoint_journal(dir), layout_checkpoint(dir), layout_checkpoint_folder(dir)};
        for (size_t k = 0; k < sizeof parts / sizeof *parts; k++) {
            if (status == STATUS_OK)
                status = file_remove_tree(parts[k], err);
            mem_free(parts[k]);
        }
        mem_free(dir);
    }
    mem_free(numbers);
    return status;
}

enum status attempt_folder_drop_older(const char *data_dir, int64_t job_id, int attempt, int first, struct error *err) {
    char *dir = layout_attempt(data_dir, job_id, attempt), *folder = layout_checkpoint_folder(dir), **names = NULL;
    size_t count = 0;
    enum status status = file_list(folder, &names, &count, err);
    for (size_t i = count; i-- > 0 && status == STATUS_OK;) { /* backwards: the journal before the database */
        int number = layout_part_number(names[i]);
        char *path = file_join(folder, names[i]);
        if (number > 0 ? number < first : attempt_folder_is_checkpoint_name(names[i]))
            status = file_remove_tree(path, err);
        mem_free(path);
    }
    file_free_names(names, count);
    mem_free(folder);
    mem_free(dir);
    return status;
}

enum status attempt_folder_list_checkpoint(const char *data_dir, int64_t job_id, int attempt, char ***names,
                                           size_t *count, struct error *err) {
    char *dir = layout_attempt(data_dir, job_id, attempt), *folder = layout_checkpoint_folder(dir);
    enum status status = file_list(folder, names, count, err);
    size_t kept = 0;
    for (size_t i = 0; status == STATUS_OK && i < *count; i++) {
        if (attempt_folder_is_checkpoint_name((*names)[i]))
            (*names)[kept++] = (*names)[i];
        else
            mem_free((*names)[i]);
    }
    if (status == STATUS_OK)
        *count = kept;
    mem_free(folder);
    mem_free(dir);
    return status;
}

/* --- outputs of earlier attempts --------------------------------------------------------------- */

/* Lines are appended to it in place, so it is not linked; it is kept though no row names it. */
static bool is_record(const char *name) { return strcmp(name, OUTPUT_RECORD) == 0; }

static enum status link_files(const char *from, const char *to, struct error *err) {
    char **names = NULL;
    size_t count = 0;
    enum status status = file_list(from, &names, &count, err);
    if (status == STATUS_NOT_FOUND)
        status = STATUS_OK;
    for (size_t i = 0; status == STATUS_OK && i < count; i++) {
        struct stat info;
        char *old = file_join(from, names[i]), *new = file_join(to, names[i]);
        bool is_there = lstat(old, &info) == 0;
        if (is_there && S_ISDIR(info.st_mode)) {
            status = file_make_dirs(new, err);
            if (status == STATUS_OK)
                status = link_files(old, new, err);
        } else if (is_there && S_ISREG(info.st_mode) && !is_record(names[i]) && link(old, new) != 0 &&
                   errno != EEXIST) {
            log_warning("%s is made again: it cannot be linked: %s", new, strerror(errno));
        }
        mem_free(new);
        mem_free(old);
    }
    file_free_names(names, count);
    return status;
}

enum status attempt_folder_carry_outputs(const char *data_dir, int64_t job_id, int number, struct error *err) {
    int *numbers;
    size_t count;
    char *dir = layout_attempt(data_dir, job_id, number), *to = layout_out(dir);
    enum status status = attempt_folder_list(data_dir, job_id, &numbers, &count, err);
    for (size_t i = count; i-- > 0 && status == STATUS_OK;) { /* newest first: an older file of a name is left out */
        char *other = layout_attempt(data_dir, job_id, numbers[i]), *from = layout_out(other);
        if (numbers[i] != number)
            status = link_files(from, to, err);
        mem_free(from);
        mem_free(other);
    }
    for (size_t i = 0; i < count && status == STATUS_OK; i++) { /* oldest first: a later line of a picture counts */
        char *other = layout_attempt(data_dir, job_id, numbers[i]), *from = layout_output(other, OUTPUT_RECORD);
        char *record = layout_output(dir, OUTPUT_RECORD);
        if (numbers[i] != number)
            status = picture_record_move(from, record, err);
        mem_free(record);
        mem_free(from);
        mem_free(other);
    }
    mem_free(numbers);
    mem_free(to);
    mem_free(dir);
    return status;
}

enum status attempt_folder_pictures_done(const char *data_dir, int64_t job_id, const char *digest, int64_t first,
                                         int64_t count, int64_t *done, struct error *err) {
    int *numbers;
    size_t number_count;
    *done = 0;
    enum status status = attempt_folder_list(data_dir, job_id, &numbers, &number_count, err);
    if (status == STATUS_OK)
        status = picture_record_done(data_dir, job_id, numbers, number_count, digest, first, count, done, err);
    mem_free(numbers);
    return status;
}

/* --- folders of earlier versions --------------------------------------------------------------- */

/* The parts are gathered under a name that nobody reads, so that a database is never seen without its journal. */
static enum status adopt_checkpoint(const char *job_dir, const char *dir, struct error *err) {
    char *from[] = {layout_former_journal(job_dir), layout_former_checkpoint(job_dir)};
    char *unready = layout_checkpoint_unready(dir), *ready = layout_checkpoint_folder(dir);
    bool exists[2] = {false, false}, is_begun = false;
    enum status status = look(unready, &is_begun, err);
    for (size_t i = 0; i < 2 && status == STATUS_OK; i++)
        status = look(from[i], &exists[i], err);
    if (status == STATUS_OK && (exists[0] || exists[1])) {
        status = file_make_dirs(unready, err);
        is_begun = true;
    }
    for (size_t i = 0; i < 2 && status == STATUS_OK; i++) {
        char *to = file_join(unready, strrchr(from[i], '/') + 1);
        if (exists[i])
            status = move(from[i], to, err);
        mem_free(to);
    }
    if (status == STATUS_OK && is_begun)
        status = move(unready, ready, err);
    mem_free(ready);
    mem_free(unready);
    mem_free(from[0]);
    mem_free(from[1]);
    return status;
}

static enum status adopt(const char *data_dir, int64_t job_id, int number, struct error *err) {
    char *job_dir = layout_job(data_dir, job_id), *dir = layout_attempt(data_dir, job_id, number);
    char *from = layout_out(job_dir), *to = layout_out(dir), *order = layout_order(job_dir);
    bool exists = false;
    enum status status = look(job_dir, &exists, err); /* without files there is nothing to move */
    if (status == STATUS_OK && exists)
        status = file_make_dirs(dir, err);
    if (status == STATUS_OK && exists)
        status = adopt_checkpoint(job_dir, dir, err);
    if (status == STATUS_OK && exists)
        status = move(from, to, err);
    if (status == STATUS_OK && exists) /* the next attempt gets its own */
        status = file_remove_tree(order, err);
    mem_free(order);
    mem_free(to);
    mem_free(from);
    mem_free(dir);
    mem_free(job_dir);
    return status;
}

enum status attempt_folder_adopt(const char *data_dir, struct store *store, struct error *err) {
    for (size_t count = 0;; count++) {
        int64_t job_id;
        int number;
        enum status status = store_attempt_former(store, &job_id, &number, err);
        if (status == STATUS_NOT_FOUND) {
            if (count > 0)
                log_info("the files of %zu jobs now lie in folders of their attempts", count);
            return STATUS_OK;
        }
        if (status == STATUS_OK)
            status = adopt(data_dir, job_id, number, err);
        if (status == STATUS_OK)
            status = store_attempt_adopted(store, job_id, number, err);
        if (status != STATUS_OK)
            return status;
    }
}
