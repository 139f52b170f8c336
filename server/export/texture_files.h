/* texture_files.h -- the textures among a job's files: one EXR for each parameter, base colour and patterns of emission
 * as PNG, too, and their previews. */
#ifndef UNBAKE_EXPORT_TEXTURE_FILES_H
#define UNBAKE_EXPORT_TEXTURE_FILES_H

#include "server/export/input.h"
#include "server/export/output_files.h"
#include "server/export/report_html.h"

#define TEXTURE_FILES_MAX 5 /* one for each enum picture_kind */
#define RADIANCE_UNIT "radiance of which a photograph of exposure 1 shows 1 as pixel value 1"

/* Writes them at full size, in the layout of in->atlas; `prefix` begins their names. */
enum status texture_files_write(struct output_files *files, const struct export_input *in, const char *prefix,
                                struct error *err);

/* Writes preview/NAME.png of each; the folder exists. */
enum status texture_files_preview(struct output_files *files, const struct export_input *in, struct error *err);

/* The previews that texture_files_preview writes below `dir`; returns their number. Their paths are the caller's. */
size_t texture_files_list(const char *dir, const struct export_input *in,
                          struct report_picture texture[TEXTURE_FILES_MAX]);

#endif
