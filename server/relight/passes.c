/* passes.c -- see passes.h. */
#include "server/relight/passes.h"

#include <assert.h>
#include <stdio.h>
#include <string.h>

#include "common/vec.h"

static const struct render_pass table[] = {
    {"radiance", PASS_LIGHT, true, "R", 3, {"R", "G", "B"}},
    {"base_color", PASS_COLOR, false, "base_color.R", 3, {"R", "G", "B"}},
    {"roughness", PASS_SHARE, false, "roughness", 1, {"Y"}},
    {"specular", PASS_SHARE, false, "specular", 1, {"Y"}},
    {"emission", PASS_LIGHT, false, "emission.R", 3, {"R", "G", "B"}},
    {"normal", PASS_NORMAL, false, "normal.X", 3, {"X", "Y", "Z"}},
    {"depth", PASS_DATA, false, "depth", 1, {"Z"}},
    {"position", PASS_DATA, false, "position.X", 3, {"X", "Y", "Z"}},
    {"segment", PASS_DATA, false, "segment", 1, {"Y"}},
    {"direct", PASS_LIGHT, true, "direct.R", 3, {"R", "G", "B"}},
    {"indirect", PASS_LIGHT, true, "-", 3, {"R", "G", "B"}},
};

const struct render_pass *passes_table(size_t *count) {
    *count = sizeof table / sizeof *table;
    return table;
}

const struct render_pass *passes_radiance(void) { return &table[0]; }

void pass_take(const struct render_pass *pass, const struct image *light, const struct image *first,
               struct image *image) {
    const struct image *from = pass->is_light ? light : first;
    bool is_difference = pass->from[0] == '-';
    int column = image_channel(from, is_difference ? "R" : pass->from);
    int less = is_difference ? image_channel(from, "direct.R") : -1;
    assert(column >= 0 && (!is_difference || less >= 0));
    image_init(image, from->width, from->height, pass->count, pass->label);
    for (size_t i = 0; i < (size_t)from->width * from->height; i++) {
        const float *p = from->pixel + i * from->channel_count;
        float *to = image->pixel + i * pass->count;
        for (uint32_t c = 0; c < pass->count; c++)
            to[c] = p[(uint32_t)column + c] - (is_difference ? p[(uint32_t)less + c] : 0.0f);
    }
}

#define PASS_COUNT (sizeof table / sizeof *table)

void passes_layered(const bool *is_wanted, const struct view_look *look, const struct image *light,
                    const struct image *first, struct image *image) {
    char name[IMAGE_MAX_CHANNELS][64];
    const char *names[IMAGE_MAX_CHANNELS];
    const struct image *like = light ? light : first;
    uint32_t count = 0, column = 0;
    for (size_t i = 0; i < PASS_COUNT; i++)
        for (uint32_t c = 0; c < table[i].count && is_wanted[i]; c++, count++) {
            snprintf(name[count], sizeof *name, "%s%s%s", i ? table[i].name : "", i ? "." : "", table[i].label[c]);
            names[count] = name[count];
        }
    image_init(image, like->width, like->height, count, names);
    for (size_t i = 0; i < PASS_COUNT; i++) {
        struct image layer;
        if (!is_wanted[i])
            continue;
        pass_take(&table[i], light, first, &layer);
        pass_measure(&table[i], look, &layer);
        for (size_t p = 0; p < (size_t)like->width * like->height; p++)
            memcpy(image->pixel + p * count + column, layer.pixel + p * layer.channel_count,
                   layer.channel_count * sizeof *layer.pixel);
        column += layer.channel_count;
        image_release(&layer);
    }
}

/* A filmic curve from scene light to display light, both linear: Narkowicz, ACES Filmic Tone Mapping Curve (2015). */
static float filmic(float x) {
    x = x > 0.0f ? x : 0.0f;
    return clampf(x * (2.51f * x + 0.03f) / (x * (2.43f * x + 0.59f) + 0.14f), 0.0f, 1.0f);
}

void pass_show(const struct render_pass *pass, const struct view_look *look, struct image *image) {
    for (size_t i = 0; i < (size_t)image->width * image->height * image->channel_count; i++) {
        float *v = &image->pixel[i];
        if (pass->kind == PASS_LIGHT)
            *v = look->is_filmic ? filmic(*v * look->exposure) : *v * look->exposure;
        else if (pass->kind == PASS_SHARE)
            *v = image_srgb_to_linear(*v);
        else if (pass->kind == PASS_NORMAL)
            *v = image_srgb_to_linear(clampf(0.5f + 0.5f * *v, 0.0f, 1.0f));
    }
}

void pass_measure(const struct render_pass *pass, const struct view_look *look, struct image *image) {
    for (size_t i = 0; i < (size_t)image->width * image->height * image->channel_count; i++)
        image->pixel[i] *= pass->kind == PASS_LIGHT ? look->nits_per_unit : 1.0f;
}
