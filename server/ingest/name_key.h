/* name_key.h -- names of files as people take them for the same: without regard to case, and to how a letter with an
 * accent is spelt (macOS unpacks and packs names with "u" and a combining mark where other systems have one letter). */
#ifndef UNBAKE_INGEST_NAME_KEY_H
#define UNBAKE_INGEST_NAME_KEY_H

/* Case-folded and composed (Unicode Standard Annex 15, NFC) by libunistring; of what is not UTF-8 only ASCII letters
 * are lowered. The caller's (mem_free). */
char *name_key(const char *name);

#define NAME_KEY_VERSION_SIZE 24
void name_key_library_version(char text[NAME_KEY_VERSION_SIZE]); /* of libunistring: "1.0" */

#endif
