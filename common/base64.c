/* base64.c -- see base64.h. */
#include "common/base64.h"

#include <stdint.h>
#include <string.h>

static const char digits[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";

bool base64_decode(const char *text, size_t length, void *bytes, size_t room, size_t *used) {
    uint32_t bits = 0;
    unsigned held = 0;
    size_t padding = 0;
    *used = 0;
    while (padding < 2 && padding < length && text[length - 1 - padding] == '=')
        padding++;
    if (length % 4 != 0)
        return false;
    for (size_t i = 0; i < length - padding; i++) {
        const char *digit = text[i] ? strchr(digits, text[i]) : NULL;
        if (!digit)
            return false;
        bits = bits << 6 | (uint32_t)(digit - digits);
        held += 6;
        if (held < 8)
            continue;
        held -= 8;
        if (*used == room)
            return false;
        ((uint8_t *)bytes)[(*used)++] = (uint8_t)(bits >> held & 0xff);
    }
    return true;
}

void base64_append(struct buf *out, const void *bytes, size_t length) {
    const uint8_t *data = bytes;
    for (size_t i = 0; i < length; i += 3) {
        uint32_t word = (uint32_t)data[i] << 16;
        if (i + 1 < length)
            word |= (uint32_t)data[i + 1] << 8;
        if (i + 2 < length)
            word |= data[i + 2];
        char four[4] = {digits[word >> 18], digits[word >> 12 & 63], i + 1 < length ? digits[word >> 6 & 63] : '=',
                        i + 2 < length ? digits[word & 63] : '='};
        buf_append(out, four, 4);
    }
}
