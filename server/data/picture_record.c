/* picture_record.c -- see picture_record.h. */
#include "server/data/picture_record.h"

#include <errno.h>
#include <fcntl.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "common/file.h"
#include "common/json.h"
#include "common/mem.h"
#include "common/output_names.h"
#include "server/data/layout.h"
#include "server/store/outputs.h"

#define RECORD_LIMIT ((size_t)1 << 30) /* bytes: some million pictures */

struct record_reader {
    const char *dir; /* the attempt's */
    const char *digest;
    int64_t first, count;
    bool *is_done; /* [count] */
};

/* Whether the files that a line lists are there. */
static bool has_files(const char *dir, const cJSON *files) {
    for (const cJSON *f = files ? files->child : NULL; f; f = f->next) {
        const char *name = cJSON_GetStringValue(cJSON_GetObjectItemCaseSensitive(f, "name"));
        double bytes = cJSON_GetNumberValue(cJSON_GetObjectItemCaseSensitive(f, "bytes"));
        struct stat info;
        if (!name || !store_output_is_name(name))
            return false;
        char *path = layout_output(dir, name);
        bool is_there = lstat(path, &info) == 0 && S_ISREG(info.st_mode) && (double)info.st_size == bytes;
        mem_free(path);
        if (!is_there)
            return false;
    }
    return files && files->child;
}

static void read_line(const struct record_reader *r, const char *text, size_t length) {
    cJSON *line = NULL;
    if (json_parse(text, length, OUTPUT_RECORD, &line, NULL) != STATUS_OK)
        return;
    const char *digest = cJSON_GetStringValue(cJSON_GetObjectItemCaseSensitive(line, "digest"));
    double number = cJSON_GetNumberValue(cJSON_GetObjectItemCaseSensitive(line, "picture"));
    bool is_ours = digest && strcmp(digest, r->digest) == 0 && number >= (double)r->first &&
                   number < (double)(r->first + r->count);
    if (is_ours && has_files(r->dir, cJSON_GetObjectItemCaseSensitive(line, "files")))
        r->is_done[(int64_t)number - r->first] = true;
    cJSON_Delete(line);
}

static enum status read_record(const struct record_reader *r, struct error *err) {
    struct buf text;
    char *out = layout_out(r->dir), *path = file_join(out, OUTPUT_RECORD);
    buf_init(&text, RECORD_LIMIT);
    enum status status = file_read(path, &text, err);
    for (const char *at = buf_text(&text), *end; status == STATUS_OK && (end = strchr(at, '\n')) != NULL; at = end + 1)
        read_line(r, at, (size_t)(end - at));
    buf_release(&text);
    mem_free(path);
    mem_free(out);
    return status == STATUS_NOT_FOUND ? STATUS_OK : status;
}

enum status picture_record_done(const char *data_dir, int64_t job_id, const int *numbers, size_t number_count,
                                const char *digest, int64_t first, int64_t count, int64_t *done, struct error *err) {
    bool *is_done = mem_calloc((size_t)count, sizeof *is_done);
    enum status status = STATUS_OK;
    for (size_t i = 0; i < number_count && status == STATUS_OK; i++) {
        char *dir = layout_attempt(data_dir, job_id, numbers[i]);
        const struct record_reader r = {dir, digest, first, count, is_done};
        status = read_record(&r, err);
        mem_free(dir);
    }
    for (*done = 0; *done < count && is_done[*done];)
        ++*done;
    mem_free(is_done);
    return status;
}

enum status picture_record_move(const char *from, const char *to, struct error *err) {
    struct buf text;
    buf_init(&text, RECORD_LIMIT);
    enum status status = file_read(from, &text, err);
    if (status == STATUS_NOT_FOUND) {
        buf_release(&text);
        return STATUS_OK;
    }
    int fd = status == STATUS_OK ? open(to, O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC | O_NOFOLLOW, 0640) : -1;
    if (status == STATUS_OK && fd < 0)
        status = error_set_errno(err, errno, "cannot open %s", to);
    if (status == STATUS_OK) /* a last line that was cut off must not swallow the next one */
        status = file_write_all(fd, buf_text(&text), text.length, to, err);
    if (status == STATUS_OK && text.length > 0 && buf_text(&text)[text.length - 1] != '\n')
        status = file_write_all(fd, "\n", 1, to, err);
    if (status == STATUS_OK && fsync(fd) != 0)
        status = error_set_errno(err, errno, "cannot write %s", to);
    if (fd >= 0 && close(fd) != 0 && status == STATUS_OK)
        status = error_set_errno(err, errno, "cannot close %s", to);
    if (status == STATUS_OK)
        status = file_sync_parent(to, err);
    if (status == STATUS_OK && unlink(from) != 0)
        status = error_set_errno(err, errno, "cannot remove %s", from);
    buf_release(&text);
    return status;
}
