/* mtl_lines.c -- see mtl_lines.h. */
#include "server/ingest/mesh/mtl_lines.h"

#include <ctype.h>
#include <stddef.h>

#include "common/mem.h"

char *mtl_next_line(const char **text, const char *end) {
    const char *from = *text, *stop = from;
    if (from >= end)
        return NULL;
    while (stop < end && *stop != '\n' && *stop != '\r')
        stop++;
    const char *to = stop;
    while (from < to && isspace((unsigned char)*from))
        from++;
    while (to > from && isspace((unsigned char)to[-1]))
        to--;
    *text = stop < end ? stop + 1 : end;
    return mem_strndup(from, (size_t)(to - from));
}
