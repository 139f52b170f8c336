/* html.c -- see html.h. */
#include "server/export/html.h"

#include <math.h>
#include <stdint.h>
#include <string.h>

#include "common/base64.h"
#include "common/file.h"
#include "common/mem.h"

#define PICTURE_LIMIT ((size_t)1 << 26) /* bytes of one embedded PNG */
#define LIST_ITEMS 16                   /* of a list; beyond these the page refers to report.json */

void html_text(struct buf *out, const char *text) {
    for (const char *c = text; *c; c++) {
        switch (*c) {
        case '<': buf_puts(out, "&lt;"); break;
        case '>': buf_puts(out, "&gt;"); break;
        case '&': buf_puts(out, "&amp;"); break;
        case '"': buf_puts(out, "&quot;"); break;
        default: buf_append(out, c, 1);
        }
    }
}

void html_key(struct buf *out, const char *key) {
    char *words = mem_strdup(key);
    for (char *c = words; *c; c++)
        if (*c == '_')
            *c = ' ';
    html_text(out, words);
    mem_free(words);
}

void html_number(struct buf *out, double value) {
    if ((value == floor(value) || fabs(value) >= 1000.0) && fabs(value) < 1e15)
        buf_printf(out, "%.0f", value);
    else
        buf_printf(out, "%.4g", value);
}

void html_value(struct buf *out, const cJSON *value) {
    if (cJSON_IsNumber(value)) {
        html_number(out, value->valuedouble);
    } else if (cJSON_IsString(value) && value->valuestring[0] != '\0') {
        html_text(out, value->valuestring);
    } else if (cJSON_IsBool(value)) {
        buf_puts(out, cJSON_IsTrue(value) ? "yes" : "no");
    } else if (cJSON_IsObject(value)) {
        buf_puts(out, "<table>");
        for (const cJSON *member = value->child; member; member = member->next) {
            buf_puts(out, "<tr><th>");
            html_key(out, member->string);
            buf_puts(out, "</th><td>");
            html_value(out, member);
            buf_puts(out, "</td></tr>");
        }
        buf_puts(out, "</table>");
    } else if (cJSON_IsArray(value)) {
        int items = cJSON_GetArraySize(value);
        if (items > LIST_ITEMS)
            buf_printf(out, " %d entries, in report.json", items);
        for (const cJSON *item = value->child; item && items <= LIST_ITEMS; item = item->next) {
            html_value(out, item);
            if (item->next && !cJSON_IsObject(item))
                buf_puts(out, ", ");
        }
    } else {
        buf_puts(out, "–");
    }
}

enum status html_picture(struct buf *out, const char *path, const char *title, struct error *err) {
    struct buf file;
    buf_init(&file, PICTURE_LIMIT);
    enum status status = file_read(path, &file, err);
    if (status == STATUS_OK) {
        buf_puts(out, "<img alt=\"");
        html_text(out, title);
        buf_puts(out, "\" src=\"data:image/png;base64,");
        base64_append(out, file.data, file.length);
        buf_puts(out, "\">");
    }
    buf_release(&file);
    return status;
}
