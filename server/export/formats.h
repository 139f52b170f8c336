/* formats.h -- the whole room as files for other programs, which hold one object for each segment. */
#ifndef UNBAKE_EXPORT_FORMATS_H
#define UNBAKE_EXPORT_FORMATS_H

#include "server/export/input.h"
#include "server/export/parts.h"

/* These must be in the folder before the others are written; the latter (emission_texture.h) where an emitter has a
 * pattern. */
#define FORMATS_BASE_COLOR "base_color.png"
#define FORMATS_EMISSION "emission.png"

struct format {
    const char *name, *content_type, *about;
    /* Puts the file into `dir`. STATUS_LIMIT where its format or another program could not hold it. */
    enum status (*write)(const char *dir, const struct export_input *input, const struct parts *parts,
                         struct error *err);
};

#define FORMATS_COUNT 5
extern const struct format formats[FORMATS_COUNT]; /* in the order in which they are written */

#endif
