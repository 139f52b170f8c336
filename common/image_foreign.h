/* image_foreign.h -- files that are recognised as pictures, films or camera raw and are not read: what they are, and
 * what to do. Private to the picture codecs. */
#ifndef UNBAKE_COMMON_IMAGE_FOREIGN_H
#define UNBAKE_COMMON_IMAGE_FOREIGN_H

#include <stdbool.h>
#include <stddef.h>

#include "common/error.h"

/* Sets *err and returns true when the file's first `length` bytes are of such a kind; `name` is for the message. */
bool image_is_foreign(const char *name, const char *start, size_t length, struct error *err);

/* STATUS_INPUT: camera raw is to be developed. */
enum status image_refuse_raw(const char *name, struct error *err);

#endif
