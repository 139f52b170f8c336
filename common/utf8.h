/* utf8.h -- whether bytes are text, and which characters may be shown to people as they are. */
#ifndef UNBAKE_COMMON_UTF8_H
#define UNBAKE_COMMON_UTF8_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/* Whether `length` bytes form UTF-8 without overlong forms or surrogates (RFC 3629). If not,
 * *bad (may be NULL) is the offset of the first sequence at fault. */
bool utf8_valid(const char *text, size_t length, size_t *bad);

/* The character that `text` begins with and how many bytes it has; 0 where there is no whole,
 * well-formed one (also at length 0). */
size_t utf8_next(const char *text, size_t length, uint32_t *character);

enum utf8_kind {
    UTF8_VISIBLE,
    /* Invisible, but with a use in text: soft hyphen, joiners, direction marks, tags. Names may have them
     * (messengers put U+200E into the names of photographs); what is shown to people spells them out. */
    UTF8_HIDDEN,
    /* Control characters (Cc), line and paragraph separators, and the bidirectional embeddings, overrides and
     * isolates, which change how the text beside them reads ("Trojan Source", CVE-2021-42574). */
    UTF8_CONTROL
};
enum utf8_kind utf8_kind(uint32_t character); /* by Unicode 15.1's general category Cf */

/* True when `text` is UTF-8 without a UTF8_CONTROL character: fit for a name. */
bool utf8_is_name(const char *text);

#define UTF8_SHOWN_SIZE 12
/* What stands for the first character of text[length > 0] before people, on terminals and in logs: itself where it
 * is visible, '?' for a byte that is no UTF-8 and for C0 and DEL, "<U+202E>" for the others, as `less` has it.
 * Returns how many bytes of `text` that was; shown[] has at most 4 times as many. */
size_t utf8_show(const char *text, size_t length, char shown[UTF8_SHOWN_SIZE]);

#endif
