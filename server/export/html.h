/* html.h -- JSON values as HTML. Everything is escaped. */
#ifndef UNBAKE_EXPORT_HTML_H
#define UNBAKE_EXPORT_HTML_H

#include <stdbool.h>

#include "common/buf.h"
#include "common/error.h"
#include "common/json.h"

void html_text(struct buf *out, const char *text);
/* A key in words, its unit after a comma: "pose_shift_px" as "pose shift, pixels". */
void html_key(struct buf *out, const char *key);
void html_number(struct buf *out, double value);
/* Whether there is anything to show: no empty text, list or object. */
bool html_has(const cJSON *value);
/* Any value, for a table cell; objects as tables of what they have, arrays of objects as tables with a head. */
void html_value(struct buf *out, const cJSON *value);

/* Begins a card, which scrolls where its table is too wide: by keyboard too, and so it has a name. </div> ends it. */
void html_card(struct buf *out, const char *classes, const char *name);

/* Embeds the PNG file `path`. */
enum status html_picture(struct buf *out, const char *path, const char *title, struct error *err);

#endif
