/* values.h -- numbers of small files: plain text and JSON. */
#ifndef UNBAKE_INGEST_SOURCE_VALUES_H
#define UNBAKE_INGEST_SOURCE_VALUES_H

#include <stdbool.h>

#include "common/json.h"
#include "server/ingest/listing.h"

#define VALUES_JSON_MAX_BYTES ((size_t)256 << 20) /* of a file of cameras; with the points of some tools */

/* Parses exactly `count` numbers of a NUL-terminated text, apart by blanks, line breaks or commas; false when it holds
 * anything else, or is NULL. NaN and infinities are numbers. */
bool numbers_parse(const char *text, size_t count, double *value);
/* Those of a small file: STATUS_INPUT with "expected the N numbers of WHAT". */
enum status numbers_read(const struct listing *l, const char *path, size_t count, const char *what, double *value,
                         struct error *err);

/* The next line of *text, which moves on, without its line break; the caller's. NULL at the end. */
char *line_take(const char **text);

/* Parses the JSON file at `path` (from the root); the caller's (cJSON_Delete), NULL on error. */
enum status json_file_read(const struct listing *l, const char *path, cJSON **tree, struct error *err);
/* A number, or a string that holds one (AliceVision writes those); NAN otherwise. NULL is fine. */
double json_value(const cJSON *item);
double json_member(const cJSON *object, const char *key);
/* The numbers of an array, nested or flat; false when there are not `count` of them. */
bool json_numbers(const cJSON *array, size_t count, double *value);
/* The element of the array whose member `key` is the same number or text as `id`; NULL: none. *hint, at first NULL, is
 * the one that was found before: files mostly keep one order. */
const cJSON *json_find(const cJSON *array, const char *key, const cJSON *id, const cJSON **hint);
/* A string member; NULL otherwise. */
const char *json_text_member(const cJSON *object, const char *key);

#endif
