/* name_key.c -- see name_key.h. The only include of libunistring. */
#include "server/ingest/name_key.h"

#include <errno.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unicase.h>
#include <uninorm.h>
#include <unistring/version.h>

#include "common/mem.h"

char *name_key(const char *name) {
    size_t length = 0;
    uint8_t *folded = u8_casefold((const uint8_t *)name, strlen(name), NULL, UNINORM_NFC, NULL, &length);
    if (!folded && errno == ENOMEM)
        mem_exhausted("libunistring");
    char *key = folded ? mem_strndup((const char *)folded, length) : mem_strdup(name);
    for (char *p = key; *p && !folded; p++)
        *p = (char)(*p >= 'A' && *p <= 'Z' ? *p + ('a' - 'A') : *p);
    free(folded);
    return key;
}

void name_key_library_version(char text[NAME_KEY_VERSION_SIZE]) {
    snprintf(text, NAME_KEY_VERSION_SIZE, "%d.%d", _libunistring_version >> 16, _libunistring_version >> 8 & 0xff);
}
