/* outputs.c -- see outputs.h. Order of the files, and atomic replacement of each; pictures are made in pictures.c,
 * the page in report_html.c. */
#include "server/export/outputs.h"

#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

#include "common/file.h"
#include "common/mem.h"
#include "common/protocol.h"
#include "common/vec.h"
#include "server/export/emission_texture.h"
#include "server/export/formats.h"
#include "server/export/mesh_ply.h"
#include "server/export/pictures.h"
#include "server/export/report_html.h"
#include "server/export/views_json.h"

#define MIME_EXR "image/x-exr"
#define MIME_PNG "image/png"
#define MIME_PLY "model/ply"
#define MIME_HTML "text/html; charset=utf-8"

#define PAGE_LIMIT ((size_t)1 << 29) /* bytes */
#define PAGE_COMPARISONS 24          /* side-by-sides embedded in the page; files of all are written */

struct output_kind {
    enum picture_kind kind;
    const char *stem;
    enum image_exr_type type;
    const char *title, *about; /* `about` is for report.json and the page */
};

static const struct output_kind kinds[] = {
    {PICTURE_BASE_COLOR, "base_color", IMAGE_HALF, "Base colour", "linear Rec. 709 reflectance by texel"},
    {PICTURE_EMISSION, "emission", IMAGE_HALF, "Emission",
     "radiance of each emitter's front side, exactly 0 elsewhere; compressed by 1 / (1 + maximum) "
     "in the preview"},
    {PICTURE_ROUGHNESS, "roughness", IMAGE_HALF, "Roughness", "by segment, 0 to 1; the microfacet width is its square"},
    {PICTURE_SPECULAR, "specular", IMAGE_HALF, "Specular", "by segment, 0 to 1; 0.5 is an index of refraction of 1.5"},
    {PICTURE_CONFIDENCE, "confidence", IMAGE_FLOAT, "Confidence",
     "observations by texel and the spread of their radiance; in the preview from blue (few) to "
     "yellow (many), red where no photograph sees the surface"},
};
#define KIND_COUNT (sizeof kinds / sizeof *kinds)

struct export {
    const char *dir;
    const struct export_input *input;
    export_announce *announce;
    void *user;
    cJSON *files;    /* array of written files; NULL when only previews are written */
    cJSON *left_out; /* array of {"name", "reason"} of files that were not written */
};

/* --- putting files in place --------------------------------------------------------------- */

static enum status announce_file(const struct export *e, const char *type, const char *name, const char *content_type,
                                 struct error *err) {
    return e->announce ? e->announce(e->user, type, name, content_type, err) : STATUS_OK;
}

/* Lists a finished file in the report and announces it. */
static enum status list_file(struct export *e, const char *type, const char *name, const char *content_type,
                             const char *about, struct error *err) {
    if (e->files) {
        cJSON *file = cJSON_CreateObject();
        json_add_string(file, "name", name);
        json_add_string(file, "content_type", content_type);
        json_add_string(file, "about", about);
        cJSON_AddItemToArray(e->files, file);
    }
    return announce_file(e, type, name, content_type, err);
}

enum image_format { FORMAT_PNG, FORMAT_EXR_HALF, FORMAT_EXR_FLOAT };

static enum status put_image(struct export *e, const char *type, const char *name, const struct image *image,
                             enum image_format format, const char *about, struct error *err) {
    char *path = file_join(e->dir, name), *temporary = mem_printf("%s.part", path);
    enum status status;
    if (format == FORMAT_PNG)
        status = image_write_png(temporary, image, 1.0f, err);
    else
        status = image_write_exr(temporary, image, format == FORMAT_EXR_HALF ? IMAGE_HALF : IMAGE_FLOAT, true, err);
    if (status == STATUS_OK)
        status = file_put_in_place(temporary, path, err);
    else
        unlink(temporary);
    if (status == STATUS_OK)
        status = list_file(e, type, name, format == FORMAT_PNG ? MIME_PNG : MIME_EXR, about, err);
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

static enum status put_bytes(struct export *e, const char *name, const char *content_type, const void *data,
                             size_t length, struct error *err) {
    char *path = file_join(e->dir, name);
    enum status status = replace_checked(path, data, length, err);
    if (status == STATUS_OK)
        status = announce_file(e, EVENT_OUTPUT, name, content_type, err);
    mem_free(path);
    return status;
}

static enum status make_folder(const struct export *e, const char *name, struct error *err) {
    char *path = file_join(e->dir, name);
    enum status status = file_make_dirs(path, err);
    mem_free(path);
    return status;
}

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
    enum status status =
        put_image(e, EVENT_PREVIEW, "preview/environment.png", &image, FORMAT_PNG, ENVIRONMENT_ABOUT, err);
    image_release(&image);
    return status;
}

static enum status put_environment(struct export *e, struct error *err) {
    const struct export_input *in = e->input;
    if (!in->environment)
        return STATUS_OK;
    enum status status =
        put_image(e, EVENT_OUTPUT, "environment.exr", in->environment, FORMAT_EXR_FLOAT, ENVIRONMENT_ABOUT, err);
    if (status == STATUS_OK)
        status = put_image(e, EVENT_OUTPUT, "environment_confidence.exr", in->environment_confidence, FORMAT_EXR_FLOAT,
                           "photographs by direction, 0 where it was filled in, and the spread of what "
                           "they show",
                           err);
    return status;
}

static enum status put_radiance_preview(struct export *e, struct error *err) {
    struct image image;
    if (!e->input->radiance)
        return STATUS_OK;
    picture_radiance(e->input, &image);
    enum status status =
        put_image(e, EVENT_PREVIEW, "preview/radiance.png", &image, FORMAT_PNG,
                  "measured light: what the photographs show of each texel, its median at mid grey", err);
    image_release(&image);
    return status;
}

/* --- previews and textures ---------------------------------------------------------------- */

static enum status put_previews(struct export *e, struct error *err) {
    enum status status = make_folder(e, "preview", err);
    if (status == STATUS_OK)
        status = put_radiance_preview(e, err);
    for (size_t k = 0; e->input->has_materials && k < KIND_COUNT && status == STATUS_OK; k++) {
        struct image image;
        char name[64];
        if (kinds[k].kind == PICTURE_CONFIDENCE && !e->input->confidence_count)
            continue;
        snprintf(name, sizeof name, "preview/%s.png", kinds[k].stem);
        picture_preview(e->input, kinds[k].kind, &image);
        status = put_image(e, EVENT_PREVIEW, name, &image, FORMAT_PNG, kinds[k].about, err);
        image_release(&image);
    }
    return status == STATUS_OK ? put_environment_preview(e, err) : status;
}

/* Of rooms in which an emitter has a pattern. */
static enum status put_emission_png(struct export *e, const uint32_t *source, struct error *err) {
    float *scales = emission_texture_scales(e->input);
    struct image image;
    if (!scales)
        return STATUS_OK;
    emission_texture(e->input, source, scales, &image);
    enum status status =
        put_image(e, EVENT_OUTPUT, FORMATS_EMISSION, &image, FORMAT_PNG,
                  "what emitters show that are not equally bright all over, each over the brightest of "
                  "it, in 8 bits, sRGB",
                  err);
    image_release(&image);
    mem_free(scales);
    return status;
}

static enum status put_textures(struct export *e, struct error *err) {
    uint32_t *source = picture_margin(e->input->inverse);
    enum status status = STATUS_OK;
    for (size_t k = 0; k < KIND_COUNT && status == STATUS_OK; k++) {
        struct image image;
        char name[64];
        snprintf(name, sizeof name, "%s.exr", kinds[k].stem);
        picture_texture(e->input, kinds[k].kind, source, &image);
        status = put_image(e, EVENT_OUTPUT, name, &image,
                           kinds[k].type == IMAGE_HALF ? FORMAT_EXR_HALF : FORMAT_EXR_FLOAT, kinds[k].about, err);
        if (kinds[k].kind == PICTURE_BASE_COLOR && status == STATUS_OK)
            status =
                put_image(e, EVENT_OUTPUT, FORMATS_BASE_COLOR, &image, FORMAT_PNG, "the same in 8 bits, sRGB", err);
        image_release(&image);
    }
    if (status == STATUS_OK)
        status = put_emission_png(e, source, err);
    mem_free(source);
    return status;
}

static enum status put_mesh(struct export *e, struct error *err) {
    const struct export_input *in = e->input;
    char *path = file_join(e->dir, "scene.ply");
    enum status status = mesh_ply_write(path, in->mesh, in->segments, in->atlas, err);
    if (status == STATUS_OK)
        status = list_file(e, EVENT_OUTPUT, "scene.ply", MIME_PLY,
                           "the mesh with its atlas coordinates s, t and its segments", err);
    mem_free(path);
    return status;
}

/* --- for other programs --------------------------------------------------------------------- */

/* Records that a file exceeds a limit of its format; the other files are still written. */
static void skip_file(struct export *e, const char *name, const struct error *err) {
    cJSON *entry = cJSON_CreateObject();
    json_add_string(entry, "name", name);
    json_add_string(entry, "reason", err->message);
    cJSON_AddItemToArray(e->left_out, entry);
    char *path = file_join(e->dir, name);
    unlink(path); /* of an earlier attempt */
    mem_free(path);
}

static enum status put_format(struct export *e, const struct format *format, const struct parts *parts,
                              struct error *err) {
    struct error own = {0};
    enum status status = format->write(e->dir, e->input, parts, &own);
    if (status == STATUS_OK)
        return list_file(e, EVENT_OUTPUT, format->name, format->content_type, format->about, err);
    if (status == STATUS_LIMIT) {
        skip_file(e, format->name, &own);
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
            skip_file(e, formats[f].name, &own);
        return STATUS_OK;
    }
    for (size_t f = 0; f < FORMATS_COUNT && status == STATUS_OK; f++)
        status = put_format(e, &formats[f], &parts, err);
    parts_release(&parts);
    return status;
}

/* --- held-out views -------------------------------------------------------------------------- */

static enum status put_views(struct export *e, struct error *err) {
    cJSON *views = views_json(e->input->comparison, e->input->comparison_count, e->input->mesh->offset);
    char *text = json_page(views), *path = file_join(e->dir, "views.json");
    enum status status = replace_checked(path, text, strlen(text), err);
    if (status == STATUS_OK)
        status = list_file(e, EVENT_OUTPUT, "views.json", MIME_JSON,
                           "the cameras of the held-out views, as transforms.json has them", err);
    mem_free(path);
    mem_free(text);
    cJSON_Delete(views);
    return status;
}

static void comparison_file(char name[64], size_t i) { snprintf(name, 64, "compare/%03zu.png", i); }

static enum status put_comparisons(struct export *e, struct error *err) {
    size_t count = e->input->comparison_count;
    enum status status = count ? make_folder(e, "compare", err) : STATUS_OK;
    for (size_t i = 0; i < count && status == STATUS_OK; i++) {
        struct image image;
        char name[64];
        comparison_file(name, i);
        picture_comparison(&e->input->comparison[i], &image);
        status = put_image(e, EVENT_OUTPUT, name, &image, FORMAT_PNG,
                           "held-out photograph, its re-render, their difference", err);
        image_release(&image);
    }
    return count > 0 && status == STATUS_OK ? put_views(e, err) : status;
}

/* --- the report --------------------------------------------------------------------------- */

/* Fills color[segment_count], the mean base colour over observed texels (over all texels if none is observed), and
 * texels[segment_count], the number of a segment's texels. */
static void average_segments(const struct export_input *in, double (*color)[3], size_t *texels) {
    size_t *seen = mem_calloc(in->segments->count, sizeof *seen);
    double(*seen_color)[3] = mem_calloc(in->segments->count, sizeof *seen_color);
    for (size_t i = 0; i < in->inverse->valid_count; i++) {
        uint32_t texel = in->inverse->valid[i], s = in->segments->of_triangle[in->inverse->triangle[texel]];
        bool shown = in->confidence_count && in->confidence_count[texel] > 0.0f;
        texels[s]++;
        seen[s] += shown;
        for (int c = 0; c < 3; c++) {
            double value = (double)in->materials->base_color.texel[texel][c];
            color[s][c] += value;
            seen_color[s][c] += shown ? value : 0.0;
        }
    }
    for (size_t s = 0; s < in->segments->count; s++)
        for (int c = 0; c < 3 && texels[s] > 0; c++)
            color[s][c] = seen[s] > 0 ? seen_color[s][c] / (double)seen[s] : color[s][c] / (double)texels[s];
    mem_free(seen_color);
    mem_free(seen);
}

/* One entry per segment: parameters and area. */
static cJSON *describe_segments(const struct export_input *in) {
    size_t count = in->segments->count;
    double *area = mem_calloc(count, sizeof *area);
    double(*color)[3] = mem_calloc(count, sizeof *color);
    size_t *triangles = mem_calloc(count, sizeof *triangles);
    size_t *texels = mem_calloc(count, sizeof *texels);
    float *scales = emission_texture_scales(in);
    for (size_t t = 0; t < in->mesh->triangle_count; t++) {
        uint32_t s = in->segments->of_triangle[t];
        triangles[s]++;
        area[s] += 0.5 * (double)vec3_length(mesh_cross(in->mesh, t));
    }
    average_segments(in, color, texels);
    cJSON *list = cJSON_CreateArray();
    for (size_t s = 0; s < count; s++) {
        rgb e = in->materials->emission[s];
        cJSON *entry = cJSON_CreateObject();
        json_add_int(entry, "segment", (int64_t)s); /* the same number as in scene.ply */
        json_add_int(entry, "id", in->segments->id[s]);
        const char *name = segments_name(in->segments, in->mesh, s);
        if (name)
            json_add_string(entry, "name", name);
        json_add_int(entry, "triangles", (int64_t)triangles[s]);
        json_add_int(entry, "texels", (int64_t)texels[s]);
        json_add_number(entry, "area_m2", area[s]);
        json_add(entry, "mean_base_color", cJSON_CreateDoubleArray(color[s], 3));
        json_add_number(entry, "roughness", (double)in->materials->roughness[s]);
        json_add_number(entry, "specular", (double)in->materials->specular[s]);
        json_add_bool(entry, "emitter", in->is_emitter[s]);
        json_add(entry, "emission", cJSON_CreateDoubleArray((double[]){(double)e.r, (double)e.g, (double)e.b}, 3));
        json_add_bool(entry, "emission_varies", scales && scales[s] > 0.0f);
        cJSON_AddItemToArray(list, entry);
    }
    mem_free(scales);
    mem_free(texels);
    mem_free(triangles);
    mem_free(color);
    mem_free(area);
    return list;
}

static enum status put_page(struct export *e, const cJSON *report, struct error *err) {
    size_t shown = e->input->comparison_count;
    if (shown > PAGE_COMPARISONS)
        shown = PAGE_COMPARISONS;
    struct report_picture texture[KIND_COUNT + 1];
    size_t texture_count = KIND_COUNT + (e->input->environment ? 1 : 0);
    struct report_picture *comparison = mem_array(shown, sizeof *comparison);
    for (size_t k = 0; k < KIND_COUNT; k++)
        texture[k] = (struct report_picture){mem_printf("%s/preview/%s.png", e->dir, kinds[k].stem), kinds[k].title,
                                             kinds[k].about};
    texture[KIND_COUNT] =
        (struct report_picture){file_join(e->dir, "preview/environment.png"), ENVIRONMENT_TITLE, ENVIRONMENT_ABOUT};
    for (size_t i = 0; i < shown; i++) {
        char name[64];
        comparison_file(name, i);
        comparison[i] = (struct report_picture){file_join(e->dir, name), e->input->comparison[i].name, NULL};
    }
    struct report_page page = {e->input->title, report, texture_count, shown, texture, comparison};
    struct buf html;
    buf_init(&html, PAGE_LIMIT);
    enum status status = report_html(&page, &html, err);
    if (status == STATUS_OK)
        status = put_bytes(e, "report.html", MIME_HTML, html.data, html.length, err);
    buf_release(&html);
    for (size_t i = 0; i < shown; i++)
        mem_free((char *)comparison[i].path);
    mem_free(comparison);
    for (size_t k = 0; k <= KIND_COUNT; k++)
        mem_free((char *)texture[k].path);
    return status;
}

static enum status put_report(struct export *e, struct error *err) {
    cJSON *report = cJSON_Duplicate(e->input->report, true);
    json_add_string(report, "title", e->input->title);
    json_add(report, "offset", cJSON_CreateDoubleArray(e->input->mesh->offset, 3));
    json_add(report, "segments", describe_segments(e->input));
    json_add(report, "files", cJSON_Duplicate(e->files, true));
    if (e->left_out->child)
        json_add(report, "left_out", cJSON_Duplicate(e->left_out, true));
    char *text = json_page(report);
    enum status status = put_bytes(e, "report.json", MIME_JSON, text, strlen(text), err);
    mem_free(text);
    if (status == STATUS_OK)
        status = put_page(e, report, err);
    cJSON_Delete(report);
    return status;
}

/* --- entry points ------------------------------------------------------------------------- */

enum status export_preview(const char *dir, const struct export_input *input, export_announce *announce, void *user,
                           struct error *err) {
    struct export e = {dir, input, announce, user, NULL, NULL};
    return put_previews(&e, err);
}

enum status export_outputs(const char *dir, const struct export_input *input, export_announce *announce, void *user,
                           struct error *err) {
    struct export e = {dir, input, announce, user, cJSON_CreateArray(), cJSON_CreateArray()};
    enum status status = put_previews(&e, err);
    if (status == STATUS_OK)
        status = put_textures(&e, err);
    if (status == STATUS_OK)
        status = put_environment(&e, err);
    if (status == STATUS_OK)
        status = put_mesh(&e, err);
    if (status == STATUS_OK)
        status = put_formats(&e, err);
    if (status == STATUS_OK)
        status = put_comparisons(&e, err);
    if (status == STATUS_OK)
        status = put_report(&e, err);
    cJSON_Delete(e.left_out);
    cJSON_Delete(e.files);
    return status;
}
