/* settings.h -- the settings of a job: one table, from which the daemon checks submissions,
 * the client prints help and the report lists what a run used.
 *
 * Values travel as JSON: {"texture_size": 2048, "method": "listing1"}. */
#ifndef UNBAKE_COMMON_SETTINGS_H
#define UNBAKE_COMMON_SETTINGS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "common/error.h"
#include "common/json.h"
#include "common/setting_values.h"

enum setting_type { SETTING_INT, SETTING_REAL, SETTING_BOOL, SETTING_CHOICE, SETTING_TEXT, SETTING_BOX, SETTING_PIXEL };

struct setting {
    const char *name;
    enum setting_type type;
    const char *unit;        /* "texels", "s", ...; "" where there is none */
    double minimum, maximum; /* inclusive, for numbers */
    const char *choices;     /* "a|b|c" for SETTING_CHOICE */
    /* of a SETTING_BOX: text of six numbers, the lower corner and the upper; of a SETTING_PIXEL:
     * "photograph,x,y,value"; "": none */
    const char *default_text;
    const char *method; /* the only one that uses it; NULL: every method does */
    const char *help;   /* one sentence */
};

/* The table in alphabetical order; *count entries; static storage. */
const struct setting *settings_table(size_t *count);
const struct setting *settings_find(const char *name);

/* What the user says of one segment: "emitters.27": "on". */
#define SETTING_SEGMENT_PREFIX "emitters."
struct segment_setting {
    uint32_t segment;
    bool is_emitter;
};

/* A job's settings: one value per table entry. Values that are not given come from the setting `quality` where it
 * sets an amount of work, else from the default. */
struct settings {
    bool *is_given; /* [table count] settings_apply was given a value; owned */
    double *number; /* [table count] numbers and booleans (0 or 1); choices by index; owned */
    char **text;    /* [table count] SETTING_TEXT, _BOX and _PIXEL values, NULL for the others; owned */
    struct segment_setting *segment; /* [segment_count] one of each segment at most; owned */
    size_t segment_count;
};

void settings_init(struct settings *s); /* all defaults */
void settings_release(struct settings *s);
double settings_number(const struct settings *s, const char *name); /* name must exist */
/* The value it would have if it were not given. Numbers only; name must exist. */
double settings_of_quality(const struct settings *s, const char *name);
bool settings_bool(const struct settings *s, const char *name);
/* Whether a SETTING_CHOICE has the value `word`. */
bool settings_is(const struct settings *s, const char *name, const char *word);
const char *settings_text(const struct settings *s, const char *name); /* borrowed */

/* The value of a SETTING_BOX; false where it is "". */
bool settings_box(const struct settings *s, const char *name, double lower[3], double upper[3]);

/* The value of a SETTING_PIXEL; false where it is "". */
bool settings_pixel(const struct settings *s, const char *name, struct pixel_setting *pixel);

/* Whether a segment emits: what the user says of it, else `decided`. */
bool settings_emitter(const struct settings *s, uint32_t segment, bool decided);

/* Checks a JSON object and applies it over *s. Collects all problems: each appends an object {"name", "reason",
 * "hint"?} to the array `problems` (may be NULL); STATUS_INPUT if any. A setting that the method does not use is a
 * problem unless its value is the default, so the output of settings_to_json is accepted. */
enum status settings_apply(struct settings *s, const cJSON *object, cJSON *problems, struct error *err);

/* Parses "key=value" from a command line into `object` with the JSON type that the table
 * gives the key (a string where the key is unknown, so that the daemon can say so). */
enum status settings_parse_assignment(const char *text, cJSON *object, struct error *err);

/* Every value as a JSON object; the caller's. */
cJSON *settings_to_json(const struct settings *s);
/* The table as JSON array, for GET /v1/settings; the caller's. */
cJSON *settings_describe(void);

#endif
