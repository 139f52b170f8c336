/* outputs.c -- see outputs.h. Which files there are, and their order; pictures are made in pictures.c, the page in
 * report_html.c. */
#include "server/export/outputs.h"

#include <stdio.h>
#include <string.h>
#include <unistd.h>

#include "common/file.h"
#include "common/mem.h"
#include "common/output_names.h"
#include "common/protocol.h"
#include "server/export/formats.h"
#include "server/export/mesh_ply.h"
#include "server/export/pictures.h"
#include "server/export/report_html.h"
#include "server/export/segments_json.h"
#include "server/export/sky.h"
#include "server/export/texture_files.h"
#include "server/export/uv_bake.h"
#include "server/export/views_json.h"

#define MIME_PLY "model/ply"
#define MIME_HTML "text/html; charset=utf-8"

#define PAGE_LIMIT ((size_t)1 << 29) /* bytes */
#define PAGE_COMPARISONS 24          /* side-by-sides embedded in the page; files of all are written */

struct export {
    const struct export_input *input;
    struct output_files files;
    struct uv_bake bake;
    struct export_input with_baked; /* the input with `baked`, where that is made */
    cJSON *input_uv;                /* for the report; NULL: the input has no texture coordinates */
};

    /* --- distant light ------------------------------------------------------------------------ */

#define ENVIRONMENT_TITLE "Distant light"
#define ENVIRONMENT_ABOUT                                                                                              \
    "by latitude and longitude, what the photographs show where they look out of the room; "                           \
    "dimmed in the preview where it was filled in"

static enum status put_environment_preview(struct export *e, struct error *err) {
    struct image image;
    if (!e->input->environment)
        return STATUS_OK;
    picture_environment(e->input, &image);
    enum status status = output_files_image(&e->files, EVENT_PREVIEW, "preview/environment.png", &image, OUTPUT_PNG,
                                            NULL, ENVIRONMENT_ABOUT, err);
    image_release(&image);
    return status;
}

static enum status put_sky(struct export *e, struct error *err) {
    struct image sky;
    sky_without_sun(e->input, &sky);
    enum status status = output_files_image(&e->files, EVENT_OUTPUT, OUTPUT_SKY, &sky, OUTPUT_EXR_FLOAT, RADIANCE_UNIT,
                                            "distant light without the sun, for formats that have a sun", err);
    image_release(&sky);
    return status;
}

static enum status put_environment(struct export *e, struct error *err) {
    const struct export_input *in = e->input;
    if (!in->environment)
        return STATUS_OK;
    enum status status = output_files_image(&e->files, EVENT_OUTPUT, OUTPUT_ENVIRONMENT, in->environment,
                                            OUTPUT_EXR_FLOAT, RADIANCE_UNIT, ENVIRONMENT_ABOUT, err);
    if (status == STATUS_OK)
        status = output_files_image(&e->files, EVENT_OUTPUT, "environment_confidence.exr", in->environment_confidence,
                                    OUTPUT_EXR_FLOAT, "count: photographs; spread: standard deviation of log radiance",
                                    "photographs by direction, 0 where it was filled in, and the spread of what "
                                    "they show",
                                    err);
    return status == STATUS_OK && in->sun.is_there ? put_sky(e, err) : status;
}

static enum status put_radiance_preview(struct export *e, struct error *err) {
    struct image image;
    if (!e->input->radiance)
        return STATUS_OK;
    picture_radiance(e->input, &image);
    enum status status =
        output_files_image(&e->files, EVENT_PREVIEW, "preview/radiance.png", &image, OUTPUT_PNG, NULL,
                           "measured light: what the photographs show of each texel, its median at mid grey", err);
    image_release(&image);
    return status;
}

/* --- previews and textures ---------------------------------------------------------------- */

static enum status put_previews(struct export *e, struct error *err) {
    enum status status = output_files_folder(&e->files, "preview", err);
    if (status == STATUS_OK)
        status = put_radiance_preview(e, err);
    if (status == STATUS_OK && e->input->has_materials)
        status = texture_files_preview(&e->files, e->input, err);
    return status == STATUS_OK ? put_environment_preview(e, err) : status;
}

/* What became of the input's own texture coordinates, for the report. */
static void say_bake(struct export *e, const struct uv_bake *bake) {
    e->input_uv = cJSON_CreateObject();
    json_add_number(e->input_uv, "share_of_area", bake->uv_share);
    json_add_bool(e->input_uv, "baked", bake->is_made);
    if (bake->is_made) {
        json_add_int(e->input_uv, "texture_size", bake->atlas.width);
        json_add_number(e->input_uv, "utilisation", bake->atlas.utilisation);
        json_add_number(e->input_uv, "overlap", bake->overlap_share);
    } else {
        json_add_string(e->input_uv, "reason", bake->reason);
    }
}

/* Textures in the input's own layout, where it has one; e->baked is what they were made of. */
static enum status put_baked(struct export *e, struct error *err) {
    if (!e->input->mesh->uv)
        return STATUS_OK;
    uv_bake_make(&e->bake, e->input);
    say_bake(e, &e->bake);
    if (!e->bake.is_made)
        return STATUS_OK;
    e->with_baked = *e->input;
    e->with_baked.baked = &e->bake.input;
    e->input = &e->with_baked;
    return texture_files_write(&e->files, &e->bake.input, FORMATS_BAKED, err);
}

static enum status put_mesh(struct export *e, const char *type, struct error *err) {
    const struct export_input *in = e->input;
    char *path = file_join(e->files.dir, OUTPUT_MESH);
    enum status status = mesh_ply_write(path, in->mesh, in->segments, in->atlas, err);
    if (status == STATUS_OK)
        status = output_files_list(&e->files, type, OUTPUT_MESH, MIME_PLY,
                                   "the mesh with its atlas coordinates s, t and its segments", err);
    mem_free(path);
    return status;
}

/* --- for other programs --------------------------------------------------------------------- */

static enum status put_format(struct export *e, const struct format *format, const struct parts *parts,
                              struct error *err) {
    struct error own = {0};
    enum status status = format->write(e->files.dir, e->input, parts, &own);
    if (status == STATUS_OK)
        return output_files_list(&e->files, EVENT_OUTPUT, format->name, format->content_type, format->about, err);
    if (status == STATUS_LIMIT) {
        output_files_skip(&e->files, format->name, &own);
        return STATUS_OK;
    }
    if (err)
        *err = own;
    return status;
}

static enum status put_formats(struct export *e, struct error *err) {
    const struct export_input *in = e->input;
    struct parts parts;
    struct error own = {0};
    enum status status = STATUS_OK;
    if (parts_make(&parts, in->mesh, in->segments, in->atlas, &own) != STATUS_OK) {
        for (size_t f = 0; f < FORMATS_COUNT; f++)
            output_files_skip(&e->files, formats[f].name, &own);
        return STATUS_OK;
    }
    for (size_t f = 0; f < FORMATS_COUNT && status == STATUS_OK; f++)
        status = put_format(e, &formats[f], &parts, err);
    parts_release(&parts);
    return status;
}

/* --- held-out views -------------------------------------------------------------------------- */

/* Takes the tree. */
static enum status put_json(struct export *e, const char *name, cJSON *tree, const char *about, struct error *err) {
    char *text = json_page(tree);
    enum status status = output_files_bytes(&e->files, name, MIME_JSON, text, strlen(text), about, err);
    mem_free(text);
    cJSON_Delete(tree);
    return status;
}

static enum status put_views(struct export *e, struct error *err) {
    return put_json(e, OUTPUT_VIEWS,
                    views_json(e->input->comparison, e->input->comparison_count, e->input->mesh->offset),
                    "the cameras of the held-out views, as transforms.json has them", err);
}

static enum status put_cameras(struct export *e, struct error *err) {
    if (e->input->camera_count == 0)
        return STATUS_OK;
    return put_json(e, OUTPUT_CAMERAS, cameras_json(e->input),
                    "the cameras of all photographs, corrected, as transforms.json has them", err);
}

static void comparison_file(char name[64], size_t i) { snprintf(name, 64, "compare/%03zu.png", i); }

static void make_comparison(const void *user, size_t index, struct image *image) {
    const struct export *e = user;
    picture_comparison(&e->input->comparison[index], image);
}

static enum status put_comparisons(struct export *e, struct error *err) {
    size_t count = e->input->comparison_count, pixels = 0;
    if (count == 0)
        return STATUS_OK;
    struct output_picture *picture = mem_array(count, sizeof *picture);
    for (size_t i = 0; i < count; i++) {
        const struct image *photograph = e->input->comparison[i].photograph;
        size_t here = (size_t)photograph->width * photograph->height;
        pixels = here > pixels ? here : pixels;
        picture[i].about = "held-out photograph, its re-render, their difference";
        comparison_file(picture[i].name, i);
    }
    enum status status = output_files_folder(&e->files, "compare", err);
    if (status == STATUS_OK)
        status = output_files_pictures(&e->files, EVENT_OUTPUT, count, picture, 3 * pixels * 3 * sizeof(float),
                                       make_comparison, e, err);
    mem_free(picture);
    return status == STATUS_OK ? put_views(e, err) : status;
}

/* --- the report --------------------------------------------------------------------------- */

static bool is_black(const struct image *image) {
    for (size_t i = 0; i < (size_t)image->width * image->height * image->channel_count; i++)
        if (image->pixel[i] > 0.0f)
            return false;
    return true;
}

/* The previews that put_previews has written, without distant light where none was found; returns their number. Their
 * paths are the caller's. */
static size_t list_textures(const struct export *e, struct report_picture texture[TEXTURE_FILES_MAX + 1]) {
    size_t count = texture_files_list(e->files.dir, e->input, texture);
    if (e->input->environment && !is_black(e->input->environment))
        texture[count++] = (struct report_picture){file_join(e->files.dir, "preview/environment.png"),
                                                   ENVIRONMENT_TITLE, ENVIRONMENT_ABOUT};
    return count;
}

static enum status put_page(struct export *e, const cJSON *report, struct error *err) {
    size_t shown = e->input->comparison_count;
    if (shown > PAGE_COMPARISONS)
        shown = PAGE_COMPARISONS;
    struct report_picture texture[TEXTURE_FILES_MAX + 1];
    size_t texture_count = list_textures(e, texture);
    struct report_picture *comparison = mem_array(shown, sizeof *comparison);
    for (size_t i = 0; i < shown; i++) {
        char name[64];
        comparison_file(name, i);
        comparison[i] = (struct report_picture){file_join(e->files.dir, name), e->input->comparison[i].name, NULL};
    }
    struct report_page page = {e->input->title, report, texture_count, shown, texture, comparison};
    struct buf html;
    buf_init(&html, PAGE_LIMIT);
    enum status status = report_html(&page, &html, err);
    if (status == STATUS_OK)
        status = output_files_bytes(&e->files, "report.html", MIME_HTML, html.data, html.length, NULL, err);
    buf_release(&html);
    for (size_t i = 0; i < shown; i++)
        mem_free((char *)comparison[i].path);
    mem_free(comparison);
    for (size_t k = 0; k < texture_count; k++)
        mem_free((char *)texture[k].path);
    return status;
}

static enum status put_report(struct export *e, struct error *err) {
    cJSON *report = cJSON_Duplicate(e->input->report, true);
    json_add_string(report, "title", e->input->title);
    json_add(report, "offset", cJSON_CreateDoubleArray(e->input->mesh->offset, 3));
    vec3 up = e->input->up;
    bool is_known = up.x != 0.0f || up.y != 0.0f || up.z != 0.0f;
    double axis[3] = {(double)up.x, is_known ? (double)up.y : 1.0, (double)up.z};
    json_add(report, "up", cJSON_CreateDoubleArray(axis, 3));
    if (e->input_uv)
        json_add(report, "input_uv", cJSON_Duplicate(e->input_uv, true));
    json_add(report, "segments", segments_json(e->input));
    json_add(report, "files", cJSON_Duplicate(e->files.written, true));
    if (e->files.left_out->child)
        json_add(report, "left_out", cJSON_Duplicate(e->files.left_out, true));
    char *text = json_page(report);
    enum status status = output_files_bytes(&e->files, OUTPUT_REPORT, MIME_JSON, text, strlen(text), NULL, err);
    mem_free(text);
    if (status == STATUS_OK)
        status = put_page(e, report, err);
    cJSON_Delete(report);
    return status;
}

/* --- entry points ------------------------------------------------------------------------- */

/* The mesh as it is by now, once: what is drawn of the room while the job goes on. Of the texture's charts and the
 * triangles nothing changes later; segments may be split. */
static enum status put_early_mesh(struct export *e, struct error *err) {
    char *path = file_join(e->files.dir, OUTPUT_MESH);
    bool is_there = access(path, F_OK) == 0;
    mem_free(path);
    return is_there ? STATUS_OK : put_mesh(e, EVENT_PREVIEW, err);
}

enum status export_preview(const char *dir, const struct export_input *input, export_announce *announce, void *user,
                           struct error *err) {
    struct export e = {.input = input, .files = {.dir = dir, .pool = input->pool, .announce = announce, .user = user}};
    enum status status = put_early_mesh(&e, err);
    return status == STATUS_OK ? put_previews(&e, err) : status;
}

static void add_note(struct export *e, const char *name, const char *text) {
    e->files.note[e->files.note_count++] = (struct image_note){name, text};
}

enum status export_outputs(const char *dir, const struct export_input *input, export_announce *announce, void *user,
                           struct error *err) {
    struct export e = {.input = input,
                       .files = {.dir = dir,
                                 .pool = input->pool,
                                 .announce = announce,
                                 .user = user,
                                 .written = cJSON_CreateArray(),
                                 .left_out = cJSON_CreateArray()}};
    const cJSON *seed = cJSON_GetObjectItem(cJSON_GetObjectItem(input->report, "settings"), "seed");
    char number[32];
    snprintf(number, sizeof number, "%.17g", cJSON_IsNumber(seed) ? seed->valuedouble : 0.0);
    add_note(&e, "software", "unbake " UNBAKE_VERSION);
    add_note(&e, "job", input->title);
    if (cJSON_IsNumber(seed))
        add_note(&e, "seed", number);
    enum status status = put_previews(&e, err);
    if (status == STATUS_OK)
        status = texture_files_write(&e.files, input, "", err);
    if (status == STATUS_OK)
        status = put_baked(&e, err);
    if (status == STATUS_OK)
        status = put_environment(&e, err);
    if (status == STATUS_OK)
        status = put_mesh(&e, EVENT_OUTPUT, err);
    if (status == STATUS_OK)
        status = put_formats(&e, err);
    if (status == STATUS_OK)
        status = put_comparisons(&e, err);
    if (status == STATUS_OK)
        status = put_cameras(&e, err);
    if (status == STATUS_OK)
        status = put_report(&e, err);
    uv_bake_release(&e.bake);
    cJSON_Delete(e.input_uv);
    cJSON_Delete(e.files.left_out);
    cJSON_Delete(e.files.written);
    return status;
}
