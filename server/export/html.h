/* html.h -- values as HTML, appended to a page. Whatever they hold, they close no tag and open none. */
#ifndef UNBAKE_EXPORT_HTML_H
#define UNBAKE_EXPORT_HTML_H

#include "common/buf.h"
#include "common/error.h"
#include "common/json.h"

void html_text(struct buf *out, const char *text);
/* A member's name in words: "mean_base_color" as "mean base color". */
void html_key(struct buf *out, const char *key);
void html_number(struct buf *out, double value);
/* Any value, for a table's cell; objects, and arrays of them, as nested tables. */
void html_value(struct buf *out, const cJSON *value);

/* The PNG file `path`, embedded. Fails where it cannot be read. */
enum status html_picture(struct buf *out, const char *path, const char *title, struct error *err);

#endif
