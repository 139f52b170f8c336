/* setting_faults.h -- what the tables of settings (settings.h, render_settings.h) share: the list of all that is wrong
 * with given values, and assignments of a command line. */
#ifndef UNBAKE_COMMON_SETTING_FAULTS_H
#define UNBAKE_COMMON_SETTING_FAULTS_H

#include <stdbool.h>
#include <stddef.h>

#include "common/error.h"
#include "common/json.h"

#define SETTING_NAME_MAX 64   /* bytes */
#define SETTING_FAULTS_MAX 50 /* that are listed one by one; further ones are only counted */

/* Why one value is refused. */
struct setting_reason {
    char text[256];
};
/* Writes the reason; false, for the caller to return. */
bool setting_refuse(struct setting_reason *why, const char *format, ...) __attribute__((format(printf, 2, 3)));

struct setting_faults {
    cJSON *problems; /* array; borrowed; NULL: no list wanted */
    size_t count;
    char first[256];
};

/* Lists {"name", "reason", "hint"}; no hint where it is "". */
void setting_faults_add(struct setting_faults *f, const char *name, const char *reason, const char *hint);
/* Lists a name that is in no table, with the name that may be meant; nearest: NULL where there is none. */
void setting_faults_add_unknown(struct setting_faults *f, const char *name, const char *nearest);
/* STATUS_INPUT with the first fault and the number of others; STATUS_OK where there is none. */
enum status setting_faults_status(const struct setting_faults *f, struct error *err);

enum setting_form { SETTING_NUMBER, SETTING_TRUTH, SETTING_WORDS }; /* of a value in JSON */

/* Adds "name=value" to the object, as a number or truth where the setting has such and the value is one, else as a
 * string: whoever checks the object tells the fault. `form_of` tells the form of a setting, of unknown ones too. */
enum status setting_assign(const char *text, cJSON *object, enum setting_form (*form_of)(const char *name),
                           struct error *err);

#endif
