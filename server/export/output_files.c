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

enum status output_files_image(struct output_files *f, const char *type, const char *name, const struct image *image,
                               enum output_format format, const char *unit, const char *about, struct error *err) {
    struct image_note note[OUTPUT_NOTES_MAX + 1];
    char *path = file_join(f->dir, name), *temporary = mem_printf("%s.part", path);
    enum status status;
    memcpy(note, f->note, f->note_count * sizeof *note);
    note[f->note_count] = (struct image_note){"units", unit};
    if (format == OUTPUT_PNG)
        status = image_write_png(temporary, image, 1.0f, err);
    else
        status = image_write_exr_noted(temporary, image, format == OUTPUT_EXR_HALF ? IMAGE_HALF : IMAGE_FLOAT, true,
                                       note, f->note_count + 1, err);
    if (status == STATUS_OK)
        status = file_put_in_place(temporary, path, err);
    else
        unlink(temporary);
    if (status == STATUS_OK)
        status = output_files_list(f, type, name, format == OUTPUT_PNG ? MIME_PNG : MIME_EXR, about, err);
    mem_free(temporary);
    mem_free(path);
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
