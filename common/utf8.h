/* utf8.h -- validation of UTF-8, and which characters may be shown to people. */
#ifndef UNBAKE_COMMON_UTF8_H
#define UNBAKE_COMMON_UTF8_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/* Whether `length` bytes form UTF-8 without overlong forms or surrogates (RFC 3629). If not,
 * *bad (may be NULL) is the offset of the first sequence at fault. */
bool utf8_valid(const char *text, size_t length, size_t *bad);

/* The first character of `text` and its size in bytes; 0 when there is no complete, well-formed one (also at length
 * 0). */
size_t utf8_next(const char *text, size_t length, uint32_t *character);

/* Text in UTF-16 that begins with a byte order mark, as UTF-8 without it: NUL-terminated, *out_length bytes, the
 * caller's (mem_free). Lone surrogates become U+FFFD. NULL when data[size] has no such mark. */
char *utf8_from_utf16(const void *data, size_t size, size_t *out_length);

enum utf8_kind {
    UTF8_VISIBLE,
    /* Invisible, but used in text: soft hyphen, joiners, direction marks, tags. Names may contain them (messengers
     * put U+200E into names of photographs); output spells them out. */
    UTF8_HIDDEN,
    /* Control characters (Cc), line and paragraph separators, and the bidirectional embeddings, overrides and
     * isolates, which change how the text beside them reads ("Trojan Source", CVE-2021-42574). */
    UTF8_CONTROL
};
enum utf8_kind utf8_kind(uint32_t character); /* by Unicode 15.1's general category Cf */

/* True when `text` is UTF-8 without a UTF8_CONTROL character: fit for a name. */
bool utf8_is_name(const char *text);

#define UTF8_SHOWN_SIZE 12 /* "<U+10FFFF>" and the NUL, rounded up */
/* Printable form of the first character of text[length > 0], for terminals and logs: itself if visible, '?' for
 * invalid UTF-8, C0 and DEL, "<U+202E>" for the others, as in `less`. Returns the number of bytes consumed; shown[]
 * has at most 4 times as many. */
size_t utf8_show(const char *text, size_t length, char shown[UTF8_SHOWN_SIZE]);

#endif
