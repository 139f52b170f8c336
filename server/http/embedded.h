/* embedded.h -- files of the source tree that the build puts into the binary as they are. */
#ifndef UNBAKE_HTTP_EMBEDDED_H
#define UNBAKE_HTTP_EMBEDDED_H

#include <stddef.h>

extern const unsigned char embedded_openapi_json[];
extern const size_t embedded_openapi_json_size; /* bytes; not NUL-terminated */

#endif
