/* random_hex.h -- identifiers and secrets that nobody can guess, from the kernel's random numbers (getrandom(2)). */
#ifndef UNBAKE_COMMON_RANDOM_HEX_H
#define UNBAKE_COMMON_RANDOM_HEX_H

#include <stddef.h>

#include "common/error.h"

#define RANDOM_HEX_MAX 128 /* digits: 512 bits, more than any secret needs */

/* Writes that many lower-case hex digits (even, at most RANDOM_HEX_MAX) and a NUL. STATUS_IO, with `hex` empty, where
 * the system gives no random bytes. */
enum status random_hex(char *hex, size_t digits, struct error *err);

#endif
