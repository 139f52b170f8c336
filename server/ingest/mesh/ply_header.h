/* ply_header.h -- the header of a PLY file: elements, their properties and the encoding of the body. */
#ifndef UNBAKE_INGEST_MESH_PLY_HEADER_H
#define UNBAKE_INGEST_MESH_PLY_HEADER_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "common/error.h"

#define PLY_MAX_ELEMENTS 32    /* that a header may have */
#define PLY_MAX_PROPERTIES 256 /* of all elements together */
#define PLY_MAX_NAME 64        /* bytes with the NUL */

/* Integer types first, so that `type >= PLY_FLOAT32` means floating point. */
enum ply_type { PLY_INT8, PLY_UINT8, PLY_INT16, PLY_UINT16, PLY_INT32, PLY_UINT32, PLY_FLOAT32, PLY_FLOAT64 };

struct ply_property {
    char name[PLY_MAX_NAME];
    bool is_list;
    enum ply_type count_type; /* lists only */
    enum ply_type type;
};

struct ply_element {
    char name[PLY_MAX_NAME];
    uint64_t count;
    size_t first, property_count; /* its slice of ply_header.property */
};

enum ply_format { PLY_UNKNOWN, PLY_ASCII, PLY_LITTLE_ENDIAN, PLY_BIG_ENDIAN };

struct ply_header {
    enum ply_format format;
    double offset[3];     /* of the comment "unbake offset X Y Z", see positions.h; 0 without it */
    size_t picture_count; /* comments "TextureFile NAME" */
    size_t element_count;
    struct ply_element element[PLY_MAX_ELEMENTS];
    size_t property_count;
    struct ply_property property[PLY_MAX_PROPERTIES];
};

/* A position in a file in memory. */
struct ply_cursor {
    const char *name; /* of the file, for messages */
    const uint8_t *data;
    size_t size, at;       /* bytes */
    uint8_t newline;       /* '\n', or '\r' in files with old Macintosh lines */
    size_t line, line_end; /* number of the current line, and its end */
};

/* Parses the header at the start of c's data (set name, data and size) and moves c to the first byte of the body.
 * Messages name the line. */
enum status ply_header_parse(struct ply_cursor *c, struct ply_header *header, struct error *err);

/* Moves to the next line and returns it without its newline; false at the end of the file. */
bool ply_next_line(struct ply_cursor *c, const uint8_t **line, size_t *length);

/* The first element of that name, in capitals or not; NULL when there is none. */
const struct ply_element *ply_find_element(const struct ply_header *header, const char *name);
/* Number within the element of the property of that name, else of that name in other letters; SIZE_MAX: none. */
size_t ply_find_property(const struct ply_header *header, const struct ply_element *e, const char *name);
size_t ply_type_bytes(enum ply_type type);

#endif
