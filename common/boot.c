/* boot.c -- see boot.h. */
#include "common/boot.h"

#include <ctype.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#include "common/buf.h"
#include "common/file.h"

#define DIGITS 32 /* hex digits of a boot id, without hyphens */

void boot_id_normalise(const char *text, char id[BOOT_ID_SIZE]) {
    size_t digits = 0, length = 0;
    for (; *text && *text != '\n'; text++) {
        bool is_digit = isxdigit((unsigned char)*text) != 0;
        if (*text == '-')
            continue;
        if (!is_digit || digits == DIGITS) {
            digits = 0;
            break;
        }
        if (digits == 8 || digits == 12 || digits == 16 || digits == 20)
            id[length++] = '-';
        id[length++] = (char)tolower((unsigned char)*text);
        digits++;
    }
    id[digits == DIGITS ? length : 0] = '\0';
}

void boot_id(char id[BOOT_ID_SIZE]) {
    struct buf text;
    const char *given = getenv("UNBAKED_BOOT_ID");
    buf_init(&text, 256);
    id[0] = '\0';
    if (file_read("/proc/sys/kernel/random/boot_id", &text, NULL) == STATUS_OK)
        boot_id_normalise(buf_text(&text), id);
    if (!*id && given)
        boot_id_normalise(given, id);
    buf_release(&text);
}
