/* output.c -- see output.h. */
#include "server/relight/output.h"

#include <errno.h>
#include <fcntl.h>
#include <math.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "common/file.h"
#include "common/mem.h"
#include "common/output_names.h"

#define RECORD_LIMIT ((size_t)1 << 30) /* bytes of views.jsonl */
#define MIN_DIGITS 5                   /* of a picture's number in names */
#define HALF_MAX 65504.0f              /* largest finite number of IEEE 754 binary16 */

/* --- the record ------------------------------------------------------------------------------------------------- */

/* Settings in the order of their names, so that the same ones have the same text. */
static void digest_settings(struct sha256 *hash, const cJSON *settings) {
    size_t count;
    const struct render_setting *t = render_settings_table(&count);
    for (size_t i = 0; i < count; i++) {
        for (const cJSON *s = settings->child; s; s = s->next) {
            if (render_settings_find(s->string, NULL) != &t[i])
                continue;
            char *text = json_text(s);
            sha256_update(hash, s->string, strlen(s->string) + 1);
            sha256_update(hash, text, strlen(text) + 1);
            mem_free(text);
        }
    }
}

/* The settings, the files that they name, and all that is read of the outputs: somebody may have painted a texture
 * over. */
void output_digest(const struct relight_job *job, char digest[SHA256_HEX_SIZE]) {
    static const char *const names[] = {OUTPUT_REPORT,      OUTPUT_MESH,      OUTPUT_VIEWS,    OUTPUT_CAMERAS,
                                        OUTPUT_BASE_COLOR,  OUTPUT_ROUGHNESS, OUTPUT_SPECULAR, OUTPUT_EMISSION,
                                        OUTPUT_ENVIRONMENT, OUTPUT_SKY};
    struct sha256 hash;
    char hex[SHA256_HEX_SIZE];
    sha256_init(&hash);
    digest_settings(&hash, job->settings);
    for (size_t i = 0; i < sizeof names / sizeof *names; i++) {
        char *path = file_join(job->outputs, names[i]);
        if (sha256_of_file(path, hex, NULL) == STATUS_OK)
            sha256_update(&hash, hex, sizeof hex);
        mem_free(path);
    }
    cJSON *files = render_settings_files(job->settings);
    for (const cJSON *f = files->child; f; f = f->next) {
        char *path = job->files ? file_join(job->files, f->valuestring) : mem_strdup(f->valuestring);
        if (sha256_of_file(path, hex, NULL) == STATUS_OK)
            sha256_update(&hash, hex, sizeof hex);
        mem_free(path);
    }
    cJSON_Delete(files);
    sha256_hex(&hash, digest);
}

void output_count(struct output *o, uint64_t pictures) {
    o->digits = MIN_DIGITS;
    for (uint64_t most = 100000; most < pictures && o->digits < 19; most *= 10)
        o->digits++;
}

static void key_of(uint64_t picture, char key[24]) { snprintf(key, 24, "%llu", (unsigned long long)picture); }

/* Takes the record; a later one of the same picture replaces it. */
static void keep(struct output *o, uint64_t picture, cJSON *record) {
    char key[24];
    key_of(picture, key);
    cJSON_DeleteItemFromObjectCaseSensitive(o->done, key);
    cJSON_AddItemToObject(o->done, key, record);
}

static void read_lines(struct output *o, const char *text) {
    for (const char *at = text, *end; (end = strchr(at, '\n')) != NULL; at = end + 1) {
        cJSON *record = NULL;
        if (json_parse(at, (size_t)(end - at), OUTPUT_RECORD, &record, NULL) != STATUS_OK)
            continue;
        const char *digest = cJSON_GetStringValue(cJSON_GetObjectItemCaseSensitive(record, "digest"));
        double number = cJSON_GetNumberValue(cJSON_GetObjectItemCaseSensitive(record, "picture"));
        if (digest && strcmp(digest, o->digest) == 0 && number >= 0.0 && number < 9e15)
            keep(o, (uint64_t)number, record);
        else
            cJSON_Delete(record);
    }
}

enum status output_open(struct output *o, const struct relight_job *job, const struct relight_watch *watch,
                        struct error *err) {
    struct buf text;
    *o = (struct output){.job = job, .watch = watch, .digits = MIN_DIGITS, .done = cJSON_CreateObject()};
    output_digest(job, o->digest);
    char *path = file_join(job->out, OUTPUT_RECORD);
    buf_init(&text, RECORD_LIMIT);
    enum status status = file_read(path, &text, err);
    if (status == STATUS_OK)
        read_lines(o, buf_text(&text));
    buf_release(&text);
    mem_free(path);
    return status == STATUS_NOT_FOUND ? STATUS_OK : status;
}

void output_close(struct output *o) {
    cJSON_Delete(o->done);
    *o = (struct output){0};
}

/* Tells the watch of files whose hashes have been found to be those of the record. */
static void tell_kept(const struct output *o, const cJSON *files) {
    for (const cJSON *f = files->child; f && o->watch->kept; f = f->next)
        o->watch->kept(o->watch->user, cJSON_GetStringValue(cJSON_GetObjectItemCaseSensitive(f, "name")),
                       cJSON_GetStringValue(cJSON_GetObjectItemCaseSensitive(f, "sha256")));
}

bool output_is_done(const struct output *o, uint64_t picture) {
    char key[24];
    key_of(picture, key);
    const cJSON *record = cJSON_GetObjectItemCaseSensitive(o->done, key);
    const cJSON *files = cJSON_GetObjectItemCaseSensitive(record, "files");
    for (const cJSON *f = files ? files->child : NULL; f; f = f->next) {
        const char *name = cJSON_GetStringValue(cJSON_GetObjectItemCaseSensitive(f, "name"));
        const char *wanted = cJSON_GetStringValue(cJSON_GetObjectItemCaseSensitive(f, "sha256"));
        char found[SHA256_HEX_SIZE] = "", *path = name && wanted ? file_join(o->job->out, name) : NULL;
        bool is_there = path && sha256_of_file(path, found, NULL) == STATUS_OK && strcmp(found, wanted) == 0;
        mem_free(path);
        if (!is_there)
            return false;
    }
    if (!files || !files->child)
        return false;
    tell_kept(o, files);
    return true;
}

enum status output_record(struct output *o, uint64_t picture, cJSON *record, struct error *err) {
    json_add_string(record, "digest", o->digest);
    char *text = json_text(record), *line = mem_printf("%s\n", text), *path = file_join(o->job->out, OUTPUT_RECORD);
    enum status status = STATUS_OK;
    int fd = open(path, O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC, 0640);
    if (fd < 0)
        status = error_set_errno(err, errno, "cannot open %s", path);
    if (status == STATUS_OK)
        status = file_write_all(fd, line, strlen(line), path, err);
    if (fd >= 0 && close(fd) != 0 && status == STATUS_OK)
        status = error_set_errno(err, errno, "cannot close %s", path);
    keep(o, picture, record);
    mem_free(path);
    mem_free(line);
    mem_free(text);
    return status;
}

/* One line a picture, in their order, whoever has rendered them when. */
static enum status sort_record(struct output *o, uint64_t pictures, struct error *err) {
    struct buf lines;
    char *path = file_join(o->job->out, OUTPUT_RECORD);
    buf_init(&lines, RECORD_LIMIT);
    bool fits = true;
    for (uint64_t i = 0; i < pictures && fits; i++) {
        char key[24], *text;
        key_of(i, key);
        text = json_text(cJSON_GetObjectItemCaseSensitive(o->done, key));
        fits = buf_puts(&lines, text) && buf_puts(&lines, "\n");
        mem_free(text);
    }
    enum status status = fits ? file_replace(path, buf_text(&lines), lines.length, err) : STATUS_OK;
    buf_release(&lines);
    mem_free(path);
    return status;
}

enum status output_views(struct output *o, uint64_t pictures, cJSON *head, struct error *err) {
    enum status status = sort_record(o, pictures, err);
    cJSON *frames = cJSON_AddArrayToObject(head, "frames");
    for (uint64_t i = 0; i < pictures; i++) {
        char key[24];
        key_of(i, key);
        cJSON *record = cJSON_DetachItemFromObjectCaseSensitive(o->done, key);
        cJSON_DeleteItemFromObjectCaseSensitive(record, "digest");
        cJSON_AddItemToArray(frames, record ? record : cJSON_CreateNull());
    }
    char *text = json_page(head), *path = file_join(o->job->out, OUTPUT_VIEWS);
    if (status == STATUS_OK)
        status = file_replace(path, text, strlen(text), err);
    if (status == STATUS_OK && o->watch->file)
        o->watch->file(o->watch->user, OUTPUT_VIEWS, NULL);
    mem_free(path);
    mem_free(text);
    cJSON_Delete(head);
    return status;
}

/* --- files ------------------------------------------------------------------------------------------------------ */

enum file_form { FORM_PNG, FORM_HALF, FORM_FLOAT };

static enum status put(struct output *o, const char *name, enum file_form form, const struct image *image,
                       struct error *err) {
    char *path = file_join(o->job->out, name), *temporary = mem_printf("%s.part", path);
    const struct image_note note = {"comments", o->note};
    enum image_exr_type type = form == FORM_HALF ? IMAGE_HALF : IMAGE_FLOAT;
    enum status status = form == FORM_PNG
                             ? image_write_png(temporary, image, 1.0f, err)
                             : image_write_exr_noted(temporary, image, type, false, &note, o->note ? 1 : 0, NULL, err);
    if (status == STATUS_OK)
        status = file_put_in_place(temporary, path, err);
    else
        unlink(temporary);
    mem_free(temporary);
    mem_free(path);
    return status;
}

static enum status list(struct output *o, const char *name, const char *pass, cJSON *files, struct error *err) {
    char hex[SHA256_HEX_SIZE], *path = file_join(o->job->out, name);
    struct stat facts;
    enum status status = sha256_of_file(path, hex, err);
    if (status == STATUS_OK && stat(path, &facts) != 0)
        status = error_set_errno(err, errno, "cannot examine %s", path);
    if (status == STATUS_OK) {
        cJSON *file = cJSON_CreateObject();
        json_add_string(file, "name", name);
        json_add_string(file, "pass", pass);
        json_add_int(file, "bytes", facts.st_size);
        json_add_string(file, "sha256", hex);
        cJSON_AddItemToArray(files, file);
        if (o->watch->file)
            o->watch->file(o->watch->user, name, hex);
    }
    mem_free(path);
    return status;
}

/* A seen sun is brighter than half precision can say; the infinity that it would become spoils every sum. */
static void fit_half(struct image *image) {
    for (size_t i = 0; i < (size_t)image->width * image->height * image->channel_count; i++)
        image->pixel[i] = fminf(image->pixel[i], HALF_MAX);
}

enum status output_pass(struct output *o, uint64_t picture, const struct render_pass *pass, const char *name,
                        struct output_formats formats, struct image *image, cJSON *files, struct error *err) {
    bool is_data = pass->kind == PASS_DATA;
    bool is_half = !is_data && render_settings_is(o->job->settings, "precision", "half");
    enum status status = STATUS_OK;
    if (formats.is_exr || (is_data && formats.is_png)) {
        struct image measured;
        char *file = mem_printf("%0*llu_%s.exr", o->digits, (unsigned long long)picture, name);
        image_copy(image, &measured);
        pass_measure(pass, &o->look, &measured);
        if (is_half)
            fit_half(&measured);
        status = put(o, file, is_half ? FORM_HALF : FORM_FLOAT, &measured, err);
        if (status == STATUS_OK)
            status = list(o, file, name, files, err);
        image_release(&measured);
        mem_free(file);
    }
    if (formats.is_png && !is_data && status == STATUS_OK) {
        char *file = mem_printf("%0*llu_%s.png", o->digits, (unsigned long long)picture, name);
        pass_show(pass, &o->look, image);
        status = put(o, file, FORM_PNG, image, err);
        if (status == STATUS_OK)
            status = list(o, file, name, files, err);
        mem_free(file);
    }
    return status;
}

enum status output_layers(struct output *o, uint64_t picture, const struct image *image, cJSON *files,
                          struct error *err) {
    char *file = mem_printf("%0*llu.exr", o->digits, (unsigned long long)picture);
    enum status status = put(o, file, FORM_FLOAT, image, err);
    if (status == STATUS_OK)
        status = list(o, file, "all", files, err);
    mem_free(file);
    return status;
}

enum status output_preview(struct output *o, uint64_t picture, struct image *image, struct error *err) {
    char *folder = file_join(o->job->out, "preview");
    char *file = mem_printf("preview/%0*llu.png", o->digits, (unsigned long long)picture);
    enum status status = file_make_dirs(folder, err);
    pass_show(passes_radiance(), &o->look, image);
    if (status == STATUS_OK)
        status = put(o, file, FORM_PNG, image, err);
    if (status == STATUS_OK)
        o->watch->preview(o->watch->user, file);
    mem_free(file);
    mem_free(folder);
    return status;
}
