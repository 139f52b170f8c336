/* formats.h -- exports of the whole room for other programs, with one object per segment. */
#ifndef UNBAKE_EXPORT_FORMATS_H
#define UNBAKE_EXPORT_FORMATS_H

#include "server/export/input.h"
#include "server/export/parts.h"

/* These files must be in the folder first: the second (emission_texture.h) only if an emitter has a pattern; besides,
 * OUTPUT_ENVIRONMENT where there is distant light, and OUTPUT_SKY (sky.h) where there is also a sun. */
#define FORMATS_BASE_COLOR "base_color.png"
#define FORMATS_EMISSION "emission.png"
#define FORMATS_BAKED "uv_" /* begins the names of both in the input's own layout (uv_bake.h) */

#define FORMATS_USD_LAYER "scene.usda"

struct format {
    const char *name, *content_type, *about;
    /* Writes the file into `dir`. STATUS_LIMIT when the format or its readers cannot hold it. */
    enum status (*write)(const char *dir, const struct export_input *input, const struct parts *parts,
                         struct error *err);
};

#define FORMATS_COUNT 7
extern const struct format formats[FORMATS_COUNT]; /* in the order in which they are written */

#endif
