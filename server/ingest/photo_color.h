/* photo_color.h -- reports the colour spaces of photographs: conversions, and profiles that could not be used. */
#ifndef UNBAKE_INGEST_PHOTO_COLOR_H
#define UNBAKE_INGEST_PHOTO_COLOR_H

#include "common/image.h"
#include "server/ingest/findings.h"
#include "server/scene/scene.h"

/* Of one photograph, from its reader. */
struct photo_color {
    const char *file; /* borrowed */
    char warning[sizeof((struct image_info *)NULL)->color_warning];
    size_t outside_count, pixel_count;
};

void photo_color_note(struct photo_color *color, const char *file, const struct image *image,
                      const struct image_info *info);

/* Warns of damaged or unsupported profiles, grouped by reason, and of colours outside of Rec. 709. */
void photo_color_warn(const struct photo_color *color, size_t count, struct findings *f);

/* "Display P3, converted to Rec. 709 (6 of 6)"; NULL when nothing was converted. The caller's. */
char *photo_color_fact(const struct scene *scene);

#endif
