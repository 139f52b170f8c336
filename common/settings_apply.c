/* settings_apply.c -- given values: each is checked by its type, then what they say of one another (settings.h). */
#include <assert.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "common/choices.h"
#include "common/mem.h"
#include "common/nearest.h"
#include "common/setting_faults.h"
#include "common/settings.h"

#define TEXT_MAX_LENGTH 255 /* bytes */
#define SEGMENTS_MAX 1000   /* of which one job may say whether they emit */

/* The valid name nearest to `name` by edit distance, or NULL when none is near. */
static const char *nearest_name(const char *name) {
    size_t count;
    const struct setting *table = settings_table(&count);
    struct nearest nearest;
    nearest_init(&nearest, name);
    for (size_t i = 0; i < count; i++)
        nearest_offer(&nearest, table[i].name);
    return nearest.best;
}

/* Where the values of a setting are in struct settings. */
static size_t index_of(const struct setting *t) {
    size_t count;
    return (size_t)(t - settings_table(&count));
}

static bool check_number(const struct setting *t, const cJSON *value, struct setting_reason *why) {
    double number = value->valuedouble;
    bool is_whole = t->type == SETTING_INT;
    const char *gap = *t->unit ? " " : "";
    if (!cJSON_IsNumber(value) || !isfinite(number) || (is_whole && number != floor(number)))
        return setting_refuse(why, "must be %s number", is_whole ? "a whole" : "a");
    if (number >= t->minimum && number <= t->maximum)
        return true;
    return is_whole ? setting_refuse(why, "must be between %.0f and %.0f%s%s, found %.15g", t->minimum, t->maximum, gap,
                                     t->unit, number)
                    : setting_refuse(why, "must be between %.15g and %.15g%s%s, found %.15g", t->minimum, t->maximum,
                                     gap, t->unit, number);
}

/* Checks a setting that is given as a string; text: NULL where it is none. */
static bool check_words(const struct setting *t, const char *text, struct setting_reason *why) {
    double lower[3], upper[3];
    struct pixel_setting pixel;
    switch (t->type) {
    case SETTING_CHOICE:
        return (text && choices_index(t->choices, text, strlen(text)) >= 0) ||
               setting_refuse(why, "must be one of %s", t->choices);
    case SETTING_TEXT:
        return (text && (*text || !*t->default_text) && strlen(text) <= TEXT_MAX_LENGTH) ||
               setting_refuse(why, "must be a text of %d to %d bytes", *t->default_text ? 1 : 0, TEXT_MAX_LENGTH);
    case SETTING_BOX:
        return (text && (!*text || setting_parse_box(text, lower, upper))) ||
               setting_refuse(why, "must be six numbers, the lower corner and the upper, such as \"-1 -1 0 4 3 2.5\"");
    case SETTING_PIXEL:
        return (text && (!*text || setting_parse_pixel(text, t->minimum, t->maximum, &pixel))) ||
               setting_refuse(
                   why,
                   "must be a photograph's name, the column and row of a pixel, and a value from %g to %g, such "
                   "as \"IMG_0012.jpg,812,604,0.18\"",
                   t->minimum, t->maximum);
    case SETTING_INT:
    case SETTING_REAL:
    case SETTING_BOOL: break;
    }
    assert(false && "a setting that is given as a string");
    return false;
}

/* Applies one value; on a problem gives the reason and returns false. */
static bool apply_one(struct settings *s, const struct setting *t, const cJSON *value, struct setting_reason *why) {
    const char *text = cJSON_GetStringValue(value);
    size_t i = index_of(t);
    switch (t->type) {
    case SETTING_INT:
    case SETTING_REAL:
        if (!check_number(t, value, why))
            return false;
        s->number[i] = value->valuedouble;
        return true;
    case SETTING_BOOL:
        if (!cJSON_IsBool(value))
            return setting_refuse(why, "must be true or false");
        s->number[i] = cJSON_IsTrue(value);
        return true;
    case SETTING_CHOICE:
        if (!check_words(t, text, why))
            return false;
        s->number[i] = choices_index(t->choices, text, strlen(text));
        return true;
    case SETTING_TEXT:
    case SETTING_BOX:
    case SETTING_PIXEL: break;
    }
    if (!check_words(t, text, why))
        return false;
    mem_free(s->text[i]);
    s->text[i] = mem_strdup(text);
    return true;
}

/* Applies "emitters.27": "on"; false with a reason when it is faulty. */
static bool apply_segment(struct settings *s, const cJSON *value, struct setting_reason *why) {
    const char *digits = value->string + strlen(SETTING_SEGMENT_PREFIX), *word = cJSON_GetStringValue(value);
    if (!*digits || strspn(digits, "0123456789") != strlen(digits) || strlen(digits) > 9)
        return setting_refuse(why, "must end in the number of a segment, as emitters.27");
    if (!word || (strcmp(word, "on") != 0 && strcmp(word, "off") != 0))
        return setting_refuse(why, "must be on or off");
    uint32_t segment = (uint32_t)strtoul(digits, NULL, 10);
    size_t at = 0;
    while (at < s->segment_count && s->segment[at].segment != segment)
        at++;
    if (at == SEGMENTS_MAX)
        return setting_refuse(why, "is one of more than %d segments", SEGMENTS_MAX);
    if (at == s->segment_count)
        s->segment = mem_realloc_array(s->segment, ++s->segment_count, sizeof *s->segment);
    s->segment[at] = (struct segment_setting){segment, strcmp(word, "on") == 0};
    return true;
}

/* Sets values that were not given from the quality. */
static void follow_quality(struct settings *s) {
    size_t count;
    const struct setting *table = settings_table(&count);
    for (size_t i = 0; i < count; i++) {
        if (!s->text[i] && !s->is_given[i])
            s->number[i] = settings_of_quality(s, table[i].name);
    }
}

/* Resets settings that the method does not use; f: NULL when the method itself is invalid. */
static void check_method(struct settings *s, const cJSON *object, struct setting_faults *f) {
    char reason[256], hint[128], chosen[SETTING_NAME_MAX];
    choices_word(settings_find("method")->choices, (int)settings_number(s, "method"), chosen, sizeof chosen);
    for (const cJSON *value = object->child; value; value = value->next) {
        const struct setting *t = settings_find(value->string);
        if (!t || !t->method || strcmp(t->method, chosen) == 0 ||
            s->number[index_of(t)] == settings_of_quality(s, t->name))
            continue;
        s->number[index_of(t)] = settings_of_quality(s, t->name);
        if (!f)
            continue;
        snprintf(reason, sizeof reason, "only method=%s uses it, and the method is %s", t->method, chosen);
        snprintf(hint, sizeof hint, "leave it out, or set method=%s", t->method);
        setting_faults_add(f, t->name, reason, hint);
    }
}

enum status settings_apply(struct settings *s, const cJSON *object, cJSON *problems, struct error *err) {
    struct setting_faults faults = {.problems = problems};
    bool method_is_good = true;
    if (!cJSON_IsObject(object)) {
        setting_faults_add(&faults, "settings", "must be an object of names and values", "");
        return error_set(err, STATUS_INPUT, "settings must be a JSON object");
    }
    for (const cJSON *value = object->child; value; value = value->next) {
        struct setting_reason why = {""};
        const struct setting *t = settings_find(value->string);
        if (strncmp(value->string, SETTING_SEGMENT_PREFIX, strlen(SETTING_SEGMENT_PREFIX)) == 0) {
            if (!apply_segment(s, value, &why))
                setting_faults_add(&faults, value->string, why.text, "");
        } else if (!t) {
            setting_faults_add_unknown(&faults, value->string, nearest_name(value->string));
        } else if (!apply_one(s, t, value, &why)) {
            setting_faults_add(&faults, value->string, why.text, t->help);
            method_is_good = method_is_good && strcmp(value->string, "method") != 0;
        } else {
            s->is_given[index_of(t)] = true;
        }
    }
    follow_quality(s);
    if (s->segment_count > 0 && settings_is(s, "emitters", "any"))
        setting_faults_add(&faults, "emitters", "with emitters=any nothing is decided of single segments",
                           "leave one out");
    check_method(s, object, method_is_good ? &faults : NULL);
    return setting_faults_status(&faults, err);
}

static enum setting_form form_of(const char *name) {
    const struct setting *t = settings_find(name);
    if (t && (t->type == SETTING_INT || t->type == SETTING_REAL))
        return SETTING_NUMBER;
    return t && t->type == SETTING_BOOL ? SETTING_TRUTH : SETTING_WORDS;
}

enum status settings_parse_assignment(const char *text, cJSON *object, struct error *err) {
    return setting_assign(text, object, form_of, err);
}
