/* matrix.h -- settings that are tried in every combination: `--matrix key=a,b,c`, several times.
 *
 * A matrix without axes has one combination, of no settings. The last axis changes fastest. */
#ifndef UNBAKE_CLIENT_MATRIX_H
#define UNBAKE_CLIENT_MATRIX_H

#include "common/buf.h"
#include "common/json.h"
#include "common/options.h"

#define MATRIX_MAX 1024 /* combinations; more are probably a mistake */

struct matrix_axis {
    char *key;     /* owned */
    cJSON *values; /* array, as settings have them; owned */
    char **word;   /* [count] as they were written; owned */
    size_t count;
};

struct matrix {
    struct matrix_axis *axis; /* [axis_count]; owned */
    size_t axis_count, count; /* count: of combinations */
};

/* Reads all --matrix of the command line. A key may be on one axis only, and not in `settings`. */
enum status matrix_read(struct matrix *m, const struct options *o, const cJSON *settings, struct error *err);
void matrix_release(struct matrix *m);

/* Adds combination `index` to an object of settings. */
void matrix_apply(const struct matrix *m, size_t index, cJSON *settings);
/* Appends " key=value" for each axis. */
void matrix_describe(const struct matrix *m, size_t index, struct buf *out);

#endif
