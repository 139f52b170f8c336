/* path.c -- see path.h. */
#include "server/ingest/path.h"

#include <ctype.h>
#include <stddef.h>
#include <string.h>
#include <strings.h>

#include "common/mem.h"
#include "common/utf8.h"

/* The name with every byte that is not printable ASCII or whole UTF-8 replaced, and cut. */
static void printable(const char *name, char out[160]) {
    size_t length = strlen(name), used = 0;
    bool is_text = utf8_valid(name, length, NULL);
    for (size_t i = 0; i < length && used < 150; i++) {
        unsigned char c = (unsigned char)name[i];
        out[used++] = c < 0x20 || c == 0x7f || (c >= 0x80 && !is_text) ? '?' : name[i];
    }
    while (used > 0 && used >= 150 && ((unsigned char)out[used - 1] & 0xc0) == 0x80)
        used--; /* not within a character */
    if (used >= 149)
        memcpy(out + used, "...", 4);
    else
        out[used] = '\0';
}

#define ABSOLUTE "is an absolute path: names must be relative to the bundle"

/* What is wrong with the name as a whole; NULL when nothing is. */
static const char *whole_fault(const char *name, size_t length) {
    if (length > PATH_MAX_BYTES)
        return "is too long a name";
    if (!utf8_valid(name, length, NULL))
        return "is not a name in UTF-8";
    for (size_t i = 0; i < length; i++) {
        unsigned char c = (unsigned char)name[i];
        if (c < 0x20 || c == 0x7f)
            return "is a name with a control character";
        if (c == '\\')
            return "is a name with a backslash: folders are separated by \"/\"";
    }
    return name[0] == '/' ? ABSOLUTE : NULL;
}

enum status path_clean(const char *name, char **clean, struct error *err) {
    size_t length = strlen(name), used = 0, depth = 0;
    *clean = NULL;
    const char *fault = whole_fault(name, length);
    char *out = mem_alloc(length + 1);
    for (const char *part = name; !fault && *part != '\0';) {
        size_t n = strcspn(part, "/");
        bool skip = n == 0 || (n == 1 && part[0] == '.');
        if (n == 2 && part[0] == '.' && part[1] == '.')
            fault = "leads out of the bundle by \"..\"";
        else if (n > 255 || (!skip && ++depth > PATH_MAX_DEPTH))
            fault = n > 255 ? "is too long a name" : "is nested too deep";
        if (!fault && !skip) {
            if (used > 0)
                out[used++] = '/';
            memcpy(out + used, part, n);
            used += n;
        }
        part += n + (part[n] == '/');
    }
    if (!fault && used > 1 && isalpha((unsigned char)out[0]) && out[1] == ':')
        fault = ABSOLUTE; /* a drive, also behind "./" */
    if (fault) {
        char shown[160];
        printable(name, shown);
        mem_free(out);
        return error_set(err, STATUS_INPUT, "\"%s\" %s", shown, fault);
    }
    out[used] = '\0';
    *clean = out;
    return STATUS_OK;
}

bool path_is_litter(const char *clean) {
    const char *base = path_base(clean);
    return strncmp(clean, "__MACOSX", 8) == 0 || strstr(clean, "/__MACOSX") ||
           strncmp(base, "._", 2) == 0 || strcmp(base, ".DS_Store") == 0 ||
           strcasecmp(base, "Thumbs.db") == 0;
}

const char *path_base(const char *path) {
    const char *slash = strrchr(path, '/');
    return slash ? slash + 1 : path;
}

const char *path_extension(const char *path) {
    const char *base = path_base(path), *dot = strrchr(base, '.');
    return dot && dot != base ? dot + 1 : base + strlen(base);
}
