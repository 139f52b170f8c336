/* html.c -- see html.h. */
#include "server/export/html.h"

#include <math.h>
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

/* A word of a key as readers know it. */
static const char *word_of(const char *word, bool is_last) {
    static const char *const words[][2] = {{"msre", "mean squared relative error"},
                                           {"psnr", "PSNR"},
                                           {"ssim", "SSIM"},
                                           {"color", "colour"},
                                           {"hdr", "HDR"},
                                           {"uv", "UV"}};
    static const char *const units[][2] = {{"m", "metres"},    {"m2", "m²"},   {"px", "pixels"},      {"db", "dB"},
                                           {"sec", "seconds"}, {"mib", "MiB"}, {"degrees", "degrees"}};
    for (size_t i = 0; i < sizeof words / sizeof *words; i++)
        if (strcmp(words[i][0], word) == 0)
            return words[i][1];
    for (size_t i = 0; i < sizeof units / sizeof *units && is_last; i++)
        if (strcmp(units[i][0], word) == 0)
            return units[i][1];
    return NULL;
}

static bool is_unit(const char *word) { return word_of(word, true) && !word_of(word, false); }

void html_key(struct buf *out, const char *key) {
    char *words = mem_strdup(key), *rest = words;
    for (const char *word; (word = strsep(&rest, "_"));) {
        const char *known = word_of(word, !rest && word != words);
        if (word != words)
            buf_puts(out, !rest && is_unit(word) ? ", " : " ");
        html_text(out, known ? known : word);
    }
    mem_free(words);
}

void html_number(struct buf *out, double value) {
    if ((value == floor(value) || fabs(value) >= 1000.0) && fabs(value) < 1e15)
        buf_printf(out, "%.0f", value);
    else
        buf_printf(out, "%.4g", value);
}

bool html_has(const cJSON *value) {
    return cJSON_IsString(value)
               ? value->valuestring[0] != '\0'
               : value && !cJSON_IsNull(value) && (value->child || (!cJSON_IsObject(value) && !cJSON_IsArray(value)));
}

static void put_object(struct buf *out, const cJSON *object) {
    buf_puts(out, "<table>");
    for (const cJSON *member = object->child; member; member = member->next) {
        if (!html_has(member))
            continue;
        buf_puts(out, "<tr><th>");
        html_key(out, member->string);
        buf_puts(out, "</th><td>");
        html_value(out, member);
        buf_puts(out, "</td></tr>");
    }
    buf_puts(out, "</table>");
}

/* Objects of the same members, which the first has: a row each. */
static void put_rows(struct buf *out, const cJSON *list) {
    buf_puts(out, "<table><tr>");
    for (const cJSON *member = list->child->child; member; member = member->next) {
        buf_puts(out, "<th>");
        html_key(out, member->string);
        buf_puts(out, "</th>");
    }
    buf_puts(out, "</tr>");
    for (const cJSON *item = list->child; item; item = item->next) {
        buf_puts(out, "<tr>");
        for (const cJSON *member = list->child->child; member; member = member->next) {
            buf_puts(out, "<td>");
            html_value(out, cJSON_GetObjectItemCaseSensitive(item, member->string));
            buf_puts(out, "</td>");
        }
        buf_puts(out, "</tr>");
    }
    buf_puts(out, "</table>");
}

static bool are_alike(const cJSON *list) {
    for (const cJSON *item = list->child; item; item = item->next) {
        if (!cJSON_IsObject(item) || cJSON_GetArraySize(item) != cJSON_GetArraySize(list->child))
            return false;
        for (const cJSON *member = list->child->child; member; member = member->next)
            if (!cJSON_HasObjectItem(item, member->string))
                return false;
    }
    return true;
}

static void put_list(struct buf *out, const cJSON *list) {
    int items = cJSON_GetArraySize(list);
    if (items > LIST_ITEMS) {
        buf_printf(out, "%d entries, in report.json", items);
    } else if (are_alike(list)) {
        put_rows(out, list);
    } else {
        for (const cJSON *item = list->child; item; item = item->next) {
            html_value(out, item);
            if (item->next && !cJSON_IsObject(item))
                buf_puts(out, ", ");
        }
    }
}

void html_value(struct buf *out, const cJSON *value) {
    if (!html_has(value))
        buf_puts(out, "–");
    else if (cJSON_IsNumber(value))
        html_number(out, value->valuedouble);
    else if (cJSON_IsString(value))
        html_text(out, value->valuestring);
    else if (cJSON_IsBool(value))
        buf_puts(out, cJSON_IsTrue(value) ? "yes" : "no");
    else if (cJSON_IsObject(value))
        put_object(out, value);
    else
        put_list(out, value);
}

void html_card(struct buf *out, const char *classes, const char *name) {
    buf_printf(out, "<div class=\"card%s\" tabindex=0 role=region aria-label=\"", classes);
    html_key(out, name);
    buf_puts(out, "\">");
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
