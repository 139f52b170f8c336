/* photo_color.c -- see photo_color.h. */
#include "server/ingest/photo_color.h"

#include <string.h>

#include "common/buf.h"

/* Share of pixels outside of Rec. 709 above which there is a warning. */
#define OUTSIDE_SHARE 1e-3

#define FACT_MAX ((size_t)1000) /* bytes */

void photo_color_note(struct photo_color *color, const char *file, const struct image *image,
                      const struct image_info *info) {
    color->file = file;
    color->outside_count = info->outside_count;
    color->pixel_count = info->color_space[0] ? (size_t)image->width * image->height : 0;
    memcpy(color->warning, info->color_warning, sizeof color->warning);
}

/* Whether an earlier photograph has the same warning. */
static bool is_repeated(const struct photo_color *color, size_t i) {
    for (size_t k = 0; k < i; k++)
        if (strcmp(color[k].warning, color[i].warning) == 0)
            return true;
    return false;
}

static void warn_of_profiles(const struct photo_color *color, size_t count, struct findings *f) {
    for (size_t i = 0; i < count; i++) {
        if (color[i].warning[0] == '\0' || is_repeated(color, i))
            continue;
        size_t same = 0;
        for (size_t k = i + 1; k < count; k++)
            same += strcmp(color[k].warning, color[i].warning) == 0;
        if (same > 0)
            findings_warning(f, "%s: %s; its colours are taken for those of sRGB (so are those of %zu others)",
                             color[i].file, color[i].warning, same);
        else
            findings_warning(f, "%s: %s; its colours are taken for those of sRGB", color[i].file, color[i].warning);
    }
}

void photo_color_warn(const struct photo_color *color, size_t count, struct findings *f) {
    size_t outside = 0, pixels = 0, photographs = 0;
    warn_of_profiles(color, count, f);
    for (size_t i = 0; i < count; i++) {
        outside += color[i].outside_count;
        pixels += color[i].pixel_count;
        photographs += color[i].pixel_count > 0;
    }
    if ((double)outside > OUTSIDE_SHARE * (double)pixels)
        findings_warning(
            f,
            "%.1f %% of the pixels of %zu photographs have colours outside of Rec. 709: their channels below 0 "
            "count as 0",
            100.0 * (double)outside / (double)pixels, photographs);
}

static bool is_of(const struct photograph *photo, const char *space) {
    return photo->color_space && strcmp(photo->color_space, space) == 0;
}

char *photo_color_fact(const struct scene *scene) {
    struct buf text;
    buf_init(&text, FACT_MAX);
    for (size_t i = 0; i < scene->photograph_count; i++) {
        const char *space = scene->photograph[i].color_space;
        size_t first = 0, same = 0;
        while (space && !is_of(&scene->photograph[first], space))
            first++;
        if (!space || first < i)
            continue;
        for (size_t k = i; k < scene->photograph_count; k++)
            same += is_of(&scene->photograph[k], space);
        if (same > 0)
            buf_printf(&text, "%s%s, converted to Rec. 709 (%zu of %zu)", text.length ? "; " : "", space, same,
                       scene->photograph_count);
    }
    if (text.length == 0) {
        buf_release(&text);
        return NULL;
    }
    return buf_detach(&text);
}
