/* report_html.h -- the report as one HTML page without external files, scripts or network access. */
#ifndef UNBAKE_EXPORT_REPORT_HTML_H
#define UNBAKE_EXPORT_REPORT_HTML_H

#include "common/buf.h"
#include "common/error.h"
#include "common/json.h"

struct report_picture {
    const char *path; /* of a PNG to embed */
    const char *title;
    const char *caption; /* may be NULL */
};

struct report_page {
    const char *title;
    const cJSON *report; /* as report.json; see input.h for the members that are drawn */
    size_t texture_count, comparison_count;
    const struct report_picture *texture, *comparison;
};

/* Appends the page to `out`; fails when a picture cannot be read or out's limit is exceeded. */
enum status report_html(const struct report_page *page, struct buf *out, struct error *err);

#endif
