/* utf8.c -- see utf8.h. */
#include "common/utf8.h"

#include <stdio.h>
#include <string.h>

#include "common/mem.h"

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

/* Appends a character; returns the bytes. */
static size_t put_character(char *out, uint32_t c) {
    if (c < 0x80) {
        out[0] = (char)c;
        return 1;
    }
    size_t length = c < 0x800 ? 2 : c < 0x10000 ? 3 : 4;
    static const unsigned char mark[5] = {0, 0, 0xc0, 0xe0, 0xf0};
    for (size_t i = length; i-- > 1; c >>= 6)
        out[i] = (char)(0x80 | (c & 0x3f));
    out[0] = (char)(mark[length] | c);
    return length;
}

char *utf8_from_utf16(const void *data, size_t size, size_t *out_length) {
    const unsigned char *s = data;
    bool big = size >= 2 && s[0] == 0xfe && s[1] == 0xff;
    *out_length = 0;
    if (!big && !(size >= 2 && s[0] == 0xff && s[1] == 0xfe))
        return NULL;
    size_t units = size / 2;
    char *out = mem_array(units, 3);
    for (size_t i = 1; i < units; i++) {
        uint32_t c = big ? (uint32_t)s[2 * i] << 8 | s[2 * i + 1] : (uint32_t)s[2 * i + 1] << 8 | s[2 * i];
        if (c >= 0xd800 && c < 0xe000) {
            const unsigned char *next = s + 2 * i + 2;
            uint32_t low = i + 1 == units ? 0
                           : big          ? (uint32_t)next[0] << 8 | next[1]
                                          : (uint32_t)next[1] << 8 | next[0];
            bool is_pair = c < 0xdc00 && low >= 0xdc00 && low < 0xe000;
            c = is_pair ? 0x10000 + ((c & 0x3ff) << 10) + (low & 0x3ff) : 0xfffd;
            i += is_pair;
        }
        *out_length += put_character(out + *out_length, c);
    }
    out[*out_length] = '\0';
    return out;
}
