/* html.h -- JSON values as HTML. Everything is escaped. */
#ifndef UNBAKE_EXPORT_HTML_H
#define UNBAKE_EXPORT_HTML_H

#include "common/buf.h"
#include "common/error.h"
#include "common/json.h"

void html_text(struct buf *out, const char *text);
/* A key in words: "mean_base_color" as "mean base color". */
void html_key(struct buf *out, const char *key);
void html_number(struct buf *out, double value);
/* Any value, for a table cell; objects and arrays of objects as nested tables. */
void html_value(struct buf *out, const cJSON *value);

/* Embeds the PNG file `path`. */
enum status html_picture(struct buf *out, const char *path, const char *title, struct error *err);

#endif
