/* page.c -- see page.h. */
#include "server/http/page.h"

#include <string.h>

#include "server/http/embedded.h"
#include "server/http/handlers.h"
#include "server/transport/problem.h"

/* It may only load from this origin and cannot be framed. Workers, styles in attributes and what comes as text
 * stay without a way to run. */
static struct response *page_part(const char *content_type, const void *text, size_t length) {
    struct response *reply = response_static(content_type, text, length);
    response_field(reply, "Content-Security-Policy",
                   "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' blob: data:;"
                   " connect-src 'self'; form-action 'self'; frame-ancestors 'none'; base-uri 'none'");
    response_field(reply, "Referrer-Policy", "no-referrer");
    response_field(reply, "Cache-Control", "no-cache");
    return reply;
}

struct response *page_index(void) {
    return page_part("text/html; charset=utf-8", embedded_index_html, embedded_index_html_size);
}

struct response *page_file(struct api *api, struct request *r) {
    (void)api;
    const char *name = r->target.segments[1];
    for (const struct embedded_file *file = embedded_page; file->name; file++) {
        if (strcmp(file->name, name) != 0)
            continue;
        size_t length = strlen(name);
        bool is_style = length > 4 && strcmp(name + length - 4, ".css") == 0;
        return page_part(is_style ? "text/css; charset=utf-8" : "text/javascript; charset=utf-8", file->bytes,
                         *file->size);
    }
    return problem(r, 404, "the page has no part %.100s", name);
}
