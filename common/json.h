/* json.h -- reading and writing JSON (RFC 8259) over cJSON.
 *
 * Values are cJSON trees. These wrappers add what the library leaves out: limits on size and
 * depth, refusal of trailing text, of duplicate keys and of NUL within strings, the line and column of a syntax
 * error, and look-ups that say what was expected and what was found. */
#ifndef UNBAKE_COMMON_JSON_H
#define UNBAKE_COMMON_JSON_H

#include <cjson/cJSON.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "common/error.h"

/* Parses `length` bytes of UTF-8. `what` names the source in messages ("transforms.json",
 * "the request body"). *value is the caller's (cJSON_Delete), NULL on error. */
enum status json_parse(const char *text, size_t length, const char *what, cJSON **value, struct error *err);

/* Reads and parses a file of at most `limit` bytes. */
enum status json_read(const char *path, size_t limit, cJSON **value, struct error *err);

/* Text of the tree: json_text is compact, without newlines, with invisible characters escaped (utf8_kind); json_page
 * has line breaks; the caller's (mem_free). Numbers read back as the same double; whole ones up to 2^53 are written
 * without an exponent. */
char *json_text(const cJSON *value);
char *json_page(const cJSON *value);

/* The member as a finite number / string / boolean, or `fallback` when the member is absent
 * or null. A member of another type is STATUS_INPUT and names `what` and the key. */
enum status json_number(const cJSON *object, const char *key, const char *what, double fallback, double *value,
                        struct error *err);
enum status json_string(const cJSON *object, const char *key, const char *what, const char *fallback,
                        const char **value, struct error *err);
enum status json_bool(const cJSON *object, const char *key, const char *what, bool fallback, bool *value,
                      struct error *err);

/* A string. Invalid UTF-8 (file names, truncated sentences) is replaced by '?', so that our output can always be
 * read. */
cJSON *json_new_string(const char *text);

/* Add a member to an object under construction. */
void json_add_string(cJSON *object, const char *key, const char *value); /* NULL: JSON null */
void json_add_number(cJSON *object, const char *key, double value);      /* non-finite: JSON null */
void json_add_int(cJSON *object, const char *key, int64_t value);
void json_add_bool(cJSON *object, const char *key, bool value);
void json_add(cJSON *object, const char *key, cJSON *value); /* takes value */

#endif
