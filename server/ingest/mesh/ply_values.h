/* ply_values.h -- the body of a PLY file as a sequence of numbers.
 *
 * An ASCII record begins on a line of its own. Extra values of its last line are ignored where the record is one line;
 * a record that goes on in further lines (some writers wrap them) must end where a line does, so that a missing value
 * is not taken from the next record. Where that fails and lines had extra values, lines may mean nothing, because a
 * writer has broken the numbers at a width: read as a stream, values follow each other, and none may be left over. */
#ifndef UNBAKE_INGEST_MESH_PLY_VALUES_H
#define UNBAKE_INGEST_MESH_PLY_VALUES_H

#include "server/ingest/mesh/ply_header.h"

struct ply_values {
    struct ply_cursor cursor;
    struct ply_header header;
    const char *element; /* element being read, for messages */
    uint64_t record;
    size_t first_line; /* of the record; ASCII, both */
    bool is_wrapped;   /* the record has gone on in a further line */
    bool is_stream;    /* lines mean nothing; set before the body is read */
    bool has_extra;    /* values behind a record on its line */
    struct error *err;
};

/* "FILE, line N: ELEMENT RECORD what" or, in binary files, "byte N"; STATUS_INPUT. */
enum status ply_value_error(struct ply_values *r, const char *what);

/* STATUS_INPUT for values behind the last record where lines mean nothing. */
enum status ply_end_body(struct ply_values *r);
/* Checks that the rest of the file is large enough for the element's records. */
enum status ply_begin_element(struct ply_values *r, const struct ply_element *e);
/* Moves to the first value of the next record; in ASCII, skips blank lines. */
enum status ply_begin_record(struct ply_values *r, uint64_t record);
enum status ply_read_value(struct ply_values *r, enum ply_type type, double *value);
enum status ply_read_list_count(struct ply_values *r, const struct ply_property *p, uint64_t *count);
enum status ply_skip_property(struct ply_values *r, const struct ply_property *p);
/* STATUS_INPUT for values behind the end of a wrapped record. */
enum status ply_end_record(struct ply_values *r);

#endif
