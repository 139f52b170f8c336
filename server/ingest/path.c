/* path.c -- see path.h. */
#include "server/ingest/path.h"

#include <ctype.h>
#include <stddef.h>
#include <string.h>
#include <strings.h>

#include "common/mem.h"
#include "common/utf8.h"

#define SHOWN_MAX 150 /* bytes of a name that messages show */

/* The name as utf8_show has it, cut. */
static void printable(const char *name, char out[SHOWN_MAX + UTF8_SHOWN_SIZE + 3]) {
    char shown[UTF8_SHOWN_SIZE];
    size_t left = strlen(name), used = 0;
    while (left > 0 && used < SHOWN_MAX) {
        size_t size = utf8_show(name, left, shown), length = strlen(shown);
        memcpy(out + used, shown, length);
        used += length;
        name += size;
        left -= size;
    }
    memcpy(out + used, left > 0 ? "..." : "", left > 0 ? 4 : 1);
}

#define ABSOLUTE "is an absolute path: names must be relative to the bundle"

/* What is wrong with the name as a whole, or NULL. */
static const char *whole_fault(const char *name, size_t length) {
    if (length > PATH_MAX_BYTES)
        return "is too long a name";
    if (!utf8_valid(name, length, NULL))
        return "is not a name in UTF-8";
    if (!utf8_is_name(name))
        return "is a name with a control character";
    if (strchr(name, '\\'))
        return "is a name with a backslash: folders are separated by \"/\"";
    return name[0] == '/' ? ABSOLUTE : NULL;
}

/* Whether clean[length], normalised from `name`, begins with a Windows drive, "C:/". A colon elsewhere is an ordinary
 * character: "a:b", "12:30/x.jpg". */
static bool has_drive(const char *clean, size_t length, const char *name) {
    return length > 1 && isalpha((unsigned char)clean[0]) && clean[1] == ':' &&
           (length > 2 ? clean[2] == '/' : name[strlen(name) - 1] == '/');
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
        else if (n > 255 || (!skip && ++depth > PATH_FOLDERS_MAX))
            fault = n > 255 ? "is too long a name" : "is nested too deep";
        if (!fault && !skip) {
            if (used > 0)
                out[used++] = '/';
            memcpy(out + used, part, n);
            used += n;
        }
        part += n + (part[n] == '/');
    }
    if (!fault && has_drive(out, used, name))
        fault = ABSOLUTE; /* also after "./" */
    if (fault) {
        char shown[SHOWN_MAX + UTF8_SHOWN_SIZE + 3];
        printable(name, shown);
        mem_free(out);
        return error_set(err, STATUS_INPUT, "\"%s\" %s", shown, fault);
    }
    out[used] = '\0';
    *clean = out;
    return STATUS_OK;
}

enum status path_clean_foreign(const char *name, char **clean, struct error *err) {
    char *copy = mem_strdup(name), *out = mem_alloc(strlen(name) + 1);
    size_t used = 0;
    *clean = NULL;
    for (char *p = copy; *p; p++)
        if (*p == '\\')
            *p = '/';
    const char *part = copy;
    if (isalpha((unsigned char)part[0]) && part[1] == ':' && part[2] == '/')
        part += 2;
    while (*part) {
        size_t length = strcspn(part, "/");
        if (length == 2 && part[0] == '.' && part[1] == '.') {
            while (used > 0 && out[--used] != '/')
                ;
        } else if (length > 0 && !(length == 1 && part[0] == '.')) {
            if (used > 0)
                out[used++] = '/';
            memcpy(out + used, part, length);
            used += length;
        }
        part += length + (part[length] == '/');
    }
    out[used] = '\0';
    enum status status = path_clean(out, clean, err);
    if (status == STATUS_OK && (*clean)[0] == '\0') {
        status = error_set(err, STATUS_INPUT, "\"%s\" is no name of a file", copy);
        mem_free(*clean);
        *clean = NULL;
    }
    mem_free(out);
    mem_free(copy);
    return status;
}

bool path_is_litter(const char *clean) {
    const char *base = path_base(clean);
    return strncmp(clean, "__MACOSX", 8) == 0 || strstr(clean, "/__MACOSX") || strncmp(base, "._", 2) == 0 ||
           strcmp(base, ".DS_Store") == 0 || strcasecmp(base, "Thumbs.db") == 0;
}

const char *path_base(const char *path) {
    const char *slash = strrchr(path, '/');
    return slash ? slash + 1 : path;
}

const char *path_extension(const char *path) {
    const char *base = path_base(path), *dot = strrchr(base, '.');
    return dot && dot != base ? dot + 1 : base + strlen(base);
}
