/* output_files.c -- see output_files.h. */
#include "server/export/output_files.h"

#include <errno.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

#include "common/file.h"
#include "common/mem.h"
#include "common/protocol.h"

#define MIME_EXR "image/x-exr"
#define MIME_PNG "image/png"

static enum status announce_file(const struct output_files *f, const char *type, const char *name,
                                 const char *content_type, struct error *err) {
    return f->announce ? f->announce(f->user, type, name, content_type, err) : STATUS_OK;
}

enum status output_files_list(struct output_files *f, const char *type, const char *name, const char *content_type,
                              const char *about, struct error *err) {
    if (f->written && about) {
        cJSON *file = cJSON_CreateObject();
        json_add_string(file, "name", name);
        json_add_string(file, "content_type", content_type);
        json_add_string(file, "about", about);
        cJSON_AddItemToArray(f->written, file);
    }
    return announce_file(f, type, name, content_type, err);
}

static enum status write_image(const struct output_files *f, const char *name, const struct image *image,
                               enum output_format format, const char *unit, struct parallel *pool, struct error *err) {
    struct image_note note[OUTPUT_NOTES_MAX + 1];
    char *path = file_join(f->dir, name), *temporary = mem_printf("%s.part", path);
    enum status status;
    memcpy(note, f->note, f->note_count * sizeof *note);
    note[f->note_count] = (struct image_note){"units", unit};
    if (format == OUTPUT_PNG)
        status = image_write_png(temporary, image, 1.0f, err);
    else
        status = image_write_exr_noted(temporary, image, format == OUTPUT_EXR_HALF ? IMAGE_HALF : IMAGE_FLOAT, true,
                                       note, f->note_count + 1, pool, err);
    if (status == STATUS_OK)
        status = file_put_in_place(temporary, path, err);
    else
        unlink(temporary);
    mem_free(temporary);
    mem_free(path);
    return status;
}

enum status output_files_image(struct output_files *f, const char *type, const char *name, const struct image *image,
                               enum output_format format, const char *unit, const char *about, struct error *err) {
    enum status status = write_image(f, name, image, format, unit, f->pool, err);
    if (status == STATUS_OK)
        status = output_files_list(f, type, name, format == OUTPUT_PNG ? MIME_PNG : MIME_EXR, about, err);
    return status;
}

struct picture_job {
    const struct output_files *files;
    const struct output_picture *picture;
    output_make *make;
    const void *user;
    size_t first;         /* of those that are written now */
    enum status *status;  /* [count] */
    struct error *errors; /* [count] */
};

static void write_picture(void *user, size_t index, int thread) {
    const struct picture_job *job = user;
    size_t i = job->first + index;
    struct image image;
    (void)thread;
    job->make(job->user, i, &image);
    job->status[i] = write_image(job->files, job->picture[i].name, &image, OUTPUT_PNG, NULL, NULL, &job->errors[i]);
    image_release(&image);
}

/* Announces the pictures up to the first that could not be written. */
static enum status list_pictures(struct output_files *f, const char *type, const struct picture_job *job, size_t count,
                                 struct error *err) {
    enum status status = STATUS_OK;
    for (size_t i = job->first; i < job->first + count && status == STATUS_OK; i++) {
        status = job->status[i];
        if (status == STATUS_OK)
            status = output_files_list(f, type, job->picture[i].name, MIME_PNG, job->picture[i].about, err);
        else if (err)
            *err = job->errors[i];
    }
    return status;
}

enum status output_files_pictures(struct output_files *f, const char *type, size_t count,
                                  const struct output_picture *picture, size_t bytes, output_make *make,
                                  const void *user, struct error *err) {
    struct picture_job job = {.files = f, .picture = picture, .make = make, .user = user};
    size_t group = bytes < OUTPUT_PICTURES_BYTES ? OUTPUT_PICTURES_BYTES / (bytes + 1) : 1;
    struct parallel *alone = f->pool ? NULL : parallel_new(1);
    enum status status = STATUS_OK;
    job.status = mem_calloc(count + 1, sizeof *job.status);
    job.errors = mem_calloc(count + 1, sizeof *job.errors);
    for (; job.first < count && status == STATUS_OK; job.first += group) {
        size_t now = count - job.first < group ? count - job.first : group;
        parallel_for(alone ? alone : f->pool, now, write_picture, &job);
        status = list_pictures(f, type, &job, now, err);
    }
    mem_free(job.errors);
    mem_free(job.status);
    parallel_free(alone);
    return status;
}

static bool file_holds(FILE *file, const char *data, size_t length) {
    char block[1 << 16];
    size_t done = 0, got;
    while ((got = fread(block, 1, sizeof block, file)) > 0) {
        if (got > length - done || memcmp(block, data + done, got) != 0)
            return false;
        done += got;
    }
    return done == length;
}

/* file_replace, then reads the file back. */
static enum status replace_checked(const char *path, const void *data, size_t length, struct error *err) {
    enum status status = file_replace(path, data, length, err);
    if (status != STATUS_OK)
        return status;
    FILE *file = fopen(path, "rbe");
    if (!file)
        return error_set_errno(err, errno, "cannot read back %s", path);
    if (!file_holds(file, data, length))
        status = ferror(file) ? error_set_errno(err, errno, "cannot read back %s", path)
                              : error_set(err, STATUS_CORRUPT, "%s: read back, it is not what was written", path);
    fclose(file);
    return status;
}

enum status output_files_bytes(struct output_files *f, const char *name, const char *content_type, const void *data,
                               size_t length, const char *about, struct error *err) {
    char *path = file_join(f->dir, name);
    enum status status = replace_checked(path, data, length, err);
    if (status == STATUS_OK)
        status = output_files_list(f, EVENT_OUTPUT, name, content_type, about, err);
    mem_free(path);
    return status;
}

enum status output_files_folder(const struct output_files *f, const char *name, struct error *err) {
    char *path = file_join(f->dir, name);
    enum status status = file_make_dirs(path, err);
    mem_free(path);
    return status;
}

void output_files_skip(struct output_files *f, const char *name, const struct error *why) {
    cJSON *entry = cJSON_CreateObject();
    json_add_string(entry, "name", name);
    json_add_string(entry, "reason", why->message);
    cJSON_AddItemToArray(f->left_out, entry);
    char *path = file_join(f->dir, name);
    unlink(path); /* of an earlier attempt */
    mem_free(path);
}
