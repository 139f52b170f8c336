/* texture_files.c -- see texture_files.h. */
#include "server/export/texture_files.h"

#include <stdio.h>

#include "common/mem.h"
#include "common/protocol.h"
#include "server/export/emission_texture.h"
#include "server/export/formats.h"
#include "server/export/pictures.h"

struct output_kind {
    enum picture_kind kind;
    const char *stem;
    enum image_exr_type type;
    const char *title, *unit, *about; /* `about` is for report.json and the page */
};

static const struct output_kind kinds[] = {
    {PICTURE_BASE_COLOR, "base_color", IMAGE_HALF, "Base colour", "reflectance",
     "linear Rec. 709 reflectance by texel"},
    {PICTURE_EMISSION, "emission", IMAGE_HALF, "Emission", RADIANCE_UNIT,
     "radiance of each emitter's front side, exactly 0 elsewhere; compressed by 1 / (1 + maximum) "
     "in the preview"},
    {PICTURE_ROUGHNESS, "roughness", IMAGE_HALF, "Roughness", "1",
     "by segment, 0 to 1; the microfacet width is its square"},
    {PICTURE_SPECULAR, "specular", IMAGE_HALF, "Specular", "1",
     "by segment, 0 to 1; 0.5 is an index of refraction of 1.5"},
    {PICTURE_CONFIDENCE, "confidence", IMAGE_FLOAT, "Confidence",
     "standard deviation of base_color.exr, in reflectance",
     "standard deviation of base colour by texel; in the preview from yellow (.01 and less) to blue (.2 and more)"},
};
#define KIND_COUNT (sizeof kinds / sizeof *kinds)

_Static_assert(KIND_COUNT == TEXTURE_FILES_MAX, "texture_files.h");

/* Whether the deviation of base colour is known: not before it was measured, nor where a resumed job was measured by an
 * older version. */
static bool knows_deviation(const struct export_input *in) {
    for (size_t i = 0; i < in->inverse->valid_count; i++)
        if (!rgb_is_black(materials_deviation(in->materials, in->inverse->valid[i])))
            return true;
    return false;
}

struct previews {
    const struct export_input *input;
    enum picture_kind kind[KIND_COUNT];
};

static void make_preview(const void *user, size_t index, struct image *image) {
    const struct previews *previews = user;
    picture_preview(previews->input, previews->kind[index], image);
}

enum status texture_files_preview(struct output_files *files, const struct export_input *in, struct error *err) {
    struct previews previews = {.input = in};
    struct output_picture picture[KIND_COUNT];
    size_t count = 0;
    for (size_t k = 0; k < KIND_COUNT; k++) {
        if (kinds[k].kind == PICTURE_CONFIDENCE && !knows_deviation(in))
            continue;
        snprintf(picture[count].name, sizeof picture[count].name, "preview/%s.png", kinds[k].stem);
        picture[count].about = kinds[k].about;
        previews.kind[count++] = kinds[k].kind;
    }
    return output_files_pictures(files, EVENT_PREVIEW, count, picture,
                                 (size_t)EXPORT_PREVIEW_SIZE * EXPORT_PREVIEW_SIZE * 3 * sizeof(float), make_preview,
                                 &previews, err);
}

size_t texture_files_list(const char *dir, const struct export_input *in,
                          struct report_picture texture[TEXTURE_FILES_MAX]) {
    size_t count = 0;
    for (size_t k = 0; k < KIND_COUNT; k++) {
        if (kinds[k].kind == PICTURE_CONFIDENCE && !knows_deviation(in))
            continue;
        char *path = mem_printf("%s/preview/%s.png", dir, kinds[k].stem);
        texture[count++] = (struct report_picture){path, kinds[k].title, kinds[k].about};
    }
    return count;
}

/* Of rooms in which an emitter has a pattern. */
static enum status put_emission_png(struct output_files *files, const struct export_input *in, const char *prefix,
                                    const uint32_t *source, struct error *err) {
    float *scales = emission_texture_scales(in);
    char name[64];
    struct image image;
    if (!scales)
        return STATUS_OK;
    snprintf(name, sizeof name, "%s" FORMATS_EMISSION, prefix);
    emission_texture(in, source, scales, &image);
    enum status status =
        output_files_image(files, EVENT_OUTPUT, name, &image, OUTPUT_PNG, NULL,
                           "what emitters show that are not equally bright all over, each over the brightest of "
                           "it, in 8 bits, sRGB",
                           err);
    image_release(&image);
    mem_free(scales);
    return status;
}

enum status texture_files_write(struct output_files *files, const struct export_input *in, const char *prefix,
                                struct error *err) {
    uint32_t *source = picture_margin(in->inverse);
    enum status status = STATUS_OK;
    for (size_t k = 0; k < KIND_COUNT && status == STATUS_OK; k++) {
        struct image image;
        char name[64], png[64], about[256];
        if (kinds[k].kind == PICTURE_CONFIDENCE && !knows_deviation(in))
            continue;
        snprintf(name, sizeof name, "%s%s.exr", prefix, kinds[k].stem);
        snprintf(png, sizeof png, "%s" FORMATS_BASE_COLOR, prefix);
        snprintf(about, sizeof about, "%s%s", *prefix ? "in the input's own texture coordinates: " : "",
                 kinds[k].about);
        picture_texture(in, kinds[k].kind, source, &image);
        status = output_files_image(files, EVENT_OUTPUT, name, &image,
                                    kinds[k].type == IMAGE_HALF ? OUTPUT_EXR_HALF : OUTPUT_EXR_FLOAT, kinds[k].unit,
                                    about, err);
        if (kinds[k].kind == PICTURE_BASE_COLOR && status == STATUS_OK)
            status =
                output_files_image(files, EVENT_OUTPUT, png, &image, OUTPUT_PNG, NULL, "the same in 8 bits, sRGB", err);
        image_release(&image);
    }
    if (status == STATUS_OK)
        status = put_emission_png(files, in, prefix, source, err);
    mem_free(source);
    return status;
}
