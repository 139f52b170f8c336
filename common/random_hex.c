/* random_hex.c -- see random_hex.h. */
#include "common/random_hex.h"

#include <assert.h>
#include <errno.h>
#include <stdio.h>
#include <sys/random.h>

enum status random_hex(char *hex, size_t digits, struct error *err) {
    unsigned char bytes[RANDOM_HEX_MAX / 2];
    assert(digits % 2 == 0 && digits <= RANDOM_HEX_MAX);
    hex[0] = '\0';
    if (getrandom(bytes, digits / 2, 0) != (ssize_t)(digits / 2)) { /* up to 256 bytes come whole */
        error_set_errno(err, errno, "the system gives no random bytes");
        return error_hint(err, "try again: it gives them once it has started");
    }
    for (size_t i = 0; i < digits / 2; i++)
        snprintf(hex + 2 * i, 3, "%02x", bytes[i]);
    return STATUS_OK;
}
