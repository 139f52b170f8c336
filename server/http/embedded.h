/* embedded.h -- files of the source tree that the build embeds in the binary. */
#ifndef UNBAKE_HTTP_EMBEDDED_H
#define UNBAKE_HTTP_EMBEDDED_H

#include <stddef.h>

extern const unsigned char embedded_openapi_json[];
extern const size_t embedded_openapi_json_size; /* bytes; not NUL-terminated */

/* The web page: server/web/. */
extern const unsigned char embedded_index_html[], embedded_page_css[], embedded_page_js[];
extern const size_t embedded_index_html_size, embedded_page_css_size, embedded_page_js_size;

#endif
