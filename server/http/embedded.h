/* embedded.h -- files of the source tree that the build embeds in the binary. */
#ifndef UNBAKE_HTTP_EMBEDDED_H
#define UNBAKE_HTTP_EMBEDDED_H

#include <stddef.h>

extern const unsigned char embedded_openapi_json[];
extern const size_t embedded_openapi_json_size; /* bytes; not NUL-terminated */

/* The web page: index.html, and the files that it loads, by name; the last has the name NULL. */
extern const unsigned char embedded_index_html[];
extern const size_t embedded_index_html_size;
struct embedded_file {
    const char *name;
    const unsigned char *bytes;
    const size_t *size;
};
extern const struct embedded_file embedded_page[];

#endif
