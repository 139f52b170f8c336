/* utf8.h -- whether bytes are text. */
#ifndef UNBAKE_COMMON_UTF8_H
#define UNBAKE_COMMON_UTF8_H

#include <stdbool.h>
#include <stddef.h>

/* Whether `length` bytes form UTF-8 without overlong forms or surrogates (RFC 3629). If not,
 * *bad (may be NULL) is the offset of the first sequence at fault. */
bool utf8_valid(const char *text, size_t length, size_t *bad);

#endif
