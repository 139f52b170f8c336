/* base64.h -- base64 with its padding (RFC 4648, section 4). */
#ifndef UNBAKE_COMMON_BASE64_H
#define UNBAKE_COMMON_BASE64_H

#include <stdbool.h>
#include <stddef.h>

#include "common/buf.h"

/* Decodes text[length] to at most `room` bytes; *used of them are written. False when it is broken or longer. */
bool base64_decode(const char *text, size_t length, void *bytes, size_t room, size_t *used);

/* Appends the text of bytes[length]. */
void base64_append(struct buf *out, const void *bytes, size_t length);

#endif
