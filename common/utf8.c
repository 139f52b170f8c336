/* utf8.c -- see utf8.h. */
#include "common/utf8.h"

#include <stdio.h>
#include <string.h>

bool utf8_valid(const char *text, size_t length, size_t *bad) {
    const unsigned char *s = (const unsigned char *)text;
    size_t i = 0;
    while (i < length) {
        unsigned char c = s[i];
        size_t extra = c < 0x80                ? 0
                       : c >= 0xc2 && c < 0xe0 ? 1
                       : c >= 0xe0 && c < 0xf0 ? 2
                       : c >= 0xf0 && c < 0xf5 ? 3
                                               : 4;
        if (bad)
            *bad = i;
        if (extra == 4 || i + extra >= length)
            return false;
        for (size_t k = 1; k <= extra; k++) {
            if ((s[i + k] & 0xc0) != 0x80)
                return false;
        }
        if ((c == 0xe0 && s[i + 1] < 0xa0) || (c == 0xed && s[i + 1] > 0x9f) || (c == 0xf0 && s[i + 1] < 0x90) ||
            (c == 0xf4 && s[i + 1] > 0x8f))
            return false;
        i += extra + 1;
    }
    return true;
}

size_t utf8_next(const char *text, size_t length, uint32_t *character) {
    unsigned char first = length > 0 ? (unsigned char)text[0] : 0xff;
    size_t size = first < 0x80 ? 1 : first < 0xe0 ? 2 : first < 0xf0 ? 3 : 4;
    if (size > length || !utf8_valid(text, size, NULL))
        return 0;
    *character = size == 1 ? first : first & (0x7fU >> size);
    for (size_t i = 1; i < size; i++)
        *character = *character << 6 | ((unsigned char)text[i] & 0x3fU);
    return size;
}

struct span {
    uint32_t first, last;
};

static bool is_in(const struct span *spans, size_t count, uint32_t c) {
    for (size_t i = 0; i < count; i++)
        if (c >= spans[i].first && c <= spans[i].last)
            return true;
    return false;
}

enum utf8_kind utf8_kind(uint32_t c) {
    static const struct span control[] = {{0x00, 0x1f}, {0x7f, 0x9f}, {0x2028, 0x202e}, {0x2066, 0x2069}};
    static const struct span hidden[] = {
        {0xad, 0xad},       {0x600, 0x605},     {0x61c, 0x61c},     {0x6dd, 0x6dd},     {0x70f, 0x70f},
        {0x890, 0x891},     {0x8e2, 0x8e2},     {0x180e, 0x180e},   {0x200b, 0x200f},   {0x2060, 0x2065},
        {0x206a, 0x206f},   {0xfeff, 0xfeff},   {0xfff0, 0xfffb},   {0xfffe, 0xffff},   {0x110bd, 0x110bd},
        {0x110cd, 0x110cd}, {0x13430, 0x1343f}, {0x1bca0, 0x1bca3}, {0x1d173, 0x1d17a}, {0xe0000, 0xe0fff}};
    if (c >= 0x20 && c < 0x7f)
        return UTF8_VISIBLE;
    if (is_in(control, sizeof control / sizeof *control, c))
        return UTF8_CONTROL;
    return is_in(hidden, sizeof hidden / sizeof *hidden, c) ? UTF8_HIDDEN : UTF8_VISIBLE;
}

bool utf8_is_name(const char *text) {
    uint32_t character;
    for (size_t left = strlen(text), size; left > 0; text += size, left -= size) {
        size = utf8_next(text, left, &character);
        if (size == 0 || utf8_kind(character) == UTF8_CONTROL)
            return false;
    }
    return true;
}

size_t utf8_show(const char *text, size_t length, char shown[UTF8_SHOWN_SIZE]) {
    uint32_t character;
    size_t size = utf8_next(text, length, &character);
    if (size == 0 || character < 0x20 || character == 0x7f) {
        memcpy(shown, "?", 2);
        return 1;
    }
    if (utf8_kind(character) == UTF8_VISIBLE) {
        memcpy(shown, text, size);
        shown[size] = '\0';
    } else {
        snprintf(shown, UTF8_SHOWN_SIZE, "<U+%04X>", (unsigned)(character & 0x1fffff));
    }
    return size;
}
