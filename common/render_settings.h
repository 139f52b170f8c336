/* render_settings.h -- the settings of a render: one table, from which the daemon checks submissions, the client and
 * `unbaked relight` print help, and views.json lists what was used.
 *
 * Settings travel as one flat JSON object: {"view": "all", "lights": "off", "light.27": "2,1.8,1.2"}. A name of the
 * table may have a part `#`, which stands for a number: "light.#" is the name of "light.27". Lists of numbers are
 * strings ("1, 2, 3") or arrays. */
#ifndef UNBAKE_COMMON_RENDER_SETTINGS_H
#define UNBAKE_COMMON_RENDER_SETTINGS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "common/error.h"
#include "common/json.h"

enum render_type {
    RENDER_INT,
    RENDER_REAL,
    RENDER_BOOL,
    RENDER_CHOICE,
    RENDER_TEXT,
    RENDER_LIST,    /* words of `choices`, separated by commas */
    RENDER_NUMBERS, /* `count` numbers */
    RENDER_FACTOR,  /* on, off, a factor, or one for each of red, green and blue */
    RENDER_SIZE,    /* "640x480", pixels */
    RENDER_DATE,    /* "2024-06-21" */
    RENDER_CLOCK,   /* "14:30" */
    RENDER_FILE     /* the name of a file, or a word of `choices` */
};

struct render_setting {
    const char *name;
    enum render_type type;
    const char *unit;         /* "m", "pixels", ...; "" where there is none */
    double minimum, maximum;  /* inclusive, of numbers */
    size_t count;             /* of RENDER_NUMBERS */
    const char *choices;      /* "a|b|c"; NULL: none */
    const char *default_text; /* "": not there */
    const char *help;         /* one sentence */
};

#define RENDER_MAX_NUMBERS 3  /* of one setting: a point or a colour */
#define RENDER_LAMPS_MAX 1000 /* lamp.1 to lamp.1000, insert.1 to insert.1000 */
#define RENDER_MAX_SIDE 16384 /* pixels of a picture */

/* Where the files are that settings name. */
enum render_files {
    RENDER_FILES_ATTACHED, /* beside the job: plain names without a folder */
    RENDER_FILES_ANYWHERE  /* paths */
};

/* The table in alphabetical order; static storage. */
const struct render_setting *render_settings_table(size_t *count);
/* The entry of a name as settings have it ("light.27"), and the number in it (UINT32_MAX: none); NULL: there is none.
 * number may be NULL. */
const struct render_setting *render_settings_find(const char *name, uint32_t *number);
/* The name of the table nearest to `name`, or NULL. */
const char *render_settings_nearest(const char *name);
/* The table as a JSON array; the caller's. */
cJSON *render_settings_describe(void);

/* Checks an object of settings. All problems are collected: each appends {"name", "reason", "hint"?} to the array
 * `problems` (may be NULL); STATUS_INPUT if there is any. */
enum status render_settings_check(const cJSON *object, enum render_files files, cJSON *problems, struct error *err);

/* Checks settings that render_settings_check found good against the room that they are for: its report.json and the
 * array "frames" of the file that `cameras` means. Either may be NULL: what it would tell is not checked. Problems as
 * above. */
enum status render_settings_check_room(const cJSON *object, const cJSON *report, const cJSON *frames, cJSON *problems,
                                       struct error *err);
/* Whether a setting is checked against report.json. */
bool render_settings_need_report(const cJSON *object);
#define RENDER_UNIT_UNKNOWN "the report of the reconstruction does not say how bright radiance 1 is"
#define RENDER_UNIT_HINT "its photographs' camera settings are incomplete: tell it as luminance_per_unit"

/* Parses "name=value" of a command line into `object`, with the JSON type of the table (a string where the name is
 * unknown, so that render_settings_check says so). */
enum status render_settings_parse_assignment(const char *text, cJSON *object, struct error *err);

/* The names of files that the settings name, each once; an array of strings, the caller's. */
cJSON *render_settings_files(const cJSON *object);

/* --- values of an object that render_settings_check found good; defaults where they are not given ----------------- */

bool render_settings_has(const cJSON *object, const char *name);
double render_settings_number(const cJSON *object, const char *name);
bool render_settings_bool(const cJSON *object, const char *name);
const char *render_settings_text(const cJSON *object, const char *name); /* borrowed, of either */
bool render_settings_is(const cJSON *object, const char *name, const char *word);
/* Whether a RENDER_LIST has the word. */
bool render_settings_lists(const cJSON *object, const char *name, const char *word);
/* Of RENDER_NUMBERS; false where the setting is not there and has no default. */
bool render_settings_numbers(const cJSON *object, const char *name, double value[RENDER_MAX_NUMBERS]);
/* Of RENDER_FACTOR: {0, 0, 0} for off. */
void render_settings_factor(const cJSON *value, double factor[3]);
/* Of RENDER_SIZE; false where it is not there. */
bool render_settings_size(const cJSON *object, uint32_t *width, uint32_t *height);

/* The numbers N for which a setting that begins with `family` ("lamp.") is given, ascending; [*count], the caller's
 * (mem_free). */
uint32_t *render_settings_family(const cJSON *object, const char *family, size_t *count);

#endif
