/* settings.c -- see settings.h. */
#include "common/settings.h"

#include <assert.h>
#include <limits.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "common/mem.h"
#include "common/nearest.h"
#include "common/setting_faults.h"

#define TEXT_MAX_LENGTH 255

static const struct setting table[] = {
    {"bake_uv", SETTING_CHOICE, "", 0, 0, "auto|off", "auto", NULL,
     "textures also in the mesh's own texture coordinates (uv_base_color.exr and so on), where it has some, of one picture, that do not overlap"},
    {"base_color_rate", SETTING_REAL, "", 1e-5, 1, NULL, "0.03", "listing1",
     "listing1: first step size of base colour; it falls over the run"},
    {"calibrate", SETTING_BOOL, "", 0, 0, NULL, "true", NULL,
     "look for faults of the capture (exposure, colour, vignette, poses, blur) and put them right"},
    {"cameras_per_texel", SETTING_INT, "", 1, 64, NULL, "2", NULL,
     "photographs that one visit of a texel is compared with"},
    {"choose", SETTING_CHOICE, "", 0, 0, "texels|pixels", "texels", NULL,
     "what an optimiser step looks at: texels evenly over the surface, or pixels evenly over the photographs"},
    {"coarse_levels", SETTING_INT, "", 0, 8, NULL, "5", "listing1",
     "listing1: base colour moves in blocks of 2^n texels a side at first, then smaller ones, at last single texels"},
    {"crop", SETTING_BOX, "m", 0, 0, NULL, "", NULL,
     "the part of the mesh to keep, as \"x0 y0 z0 x1 y1 z1\" in its coordinates; triangles whose centre lies outside are left out"},
    {"denoise", SETTING_BOOL, "", 0, 0, NULL, "true", "solve", "solve: take the photographs' noise out of base colour"},
    {"denoise_mesh", SETTING_BOOL, "", 0, 0, NULL, "true", NULL,
     "put the vertices of a rough mesh back to where its surfaces are; one that has normals stays as it is"},
    {"detail_steps", SETTING_INT, "steps", 0, 1000, NULL, "16", "solve",
     "solve: steps that find detail finer than a photograph's pixel, where every texel is measured; 0: none"},
    {"emission_rate", SETTING_REAL, "", 1e-5, 10, NULL, "0.002", NULL,
     "first step size of emission, in logarithms of radiance"},
    {"emitters", SETTING_CHOICE, "", 0, 0, "decide|any", "decide", "listing1",
     "which segments emit: decided from the evidence; or, of listing1, any may to the end; emitters.27=on or off says so of "
     "segment 27 of an earlier report"},
    {"estimates", SETTING_CHOICE, "", 0, 0, "two|one", "two", NULL,
     "of a look's radiance in the loss: two independent ones, or one, whose squared error is biased"},
    {"exclude", SETTING_TEXT, "", 0, 0, NULL, "", NULL,
     "photographs to leave out: names or patterns with * and ?, separated by commas"},
    {"executor", SETTING_TEXT, "", 0, 0, NULL, "", NULL,
     "where the job runs: the name of an executor that the daemon's administrator has set up; empty: where there is a place"},
    {"fit", SETTING_CHOICE, "", 0, 0, "check|ignore", "check", NULL,
     "a scene whose mesh and photographs do not fit, as its check found, is refused; or reconstructed all the same"},
    {"gather_samples", SETTING_INT, "rays", 16, 1048576, NULL, "512", "solve",
     "solve: directions from which light is gathered at each point where it is"},
    {"glb_lights", SETTING_CHOICE, "", 0, 0, "off|on", "off", NULL,
     "lamps and sun in scene.glb also as lights (KHR_lights_punctual), in candela and lux where luminance is known: for viewers that "
     "show a room black which its surfaces light"},
    {"glb_textures", SETTING_CHOICE, "", 0, 0, "atlas|input", "atlas", NULL,
     "textures of scene.glb: those of the atlas, or in the mesh's own texture coordinates where bake_uv could make them"},
    {"gloss_passes", SETTING_INT, "", 1, 2, NULL, "2", "solve",
     "solve: how many times roughness and specular are fitted, each in light that is better known"},
    {"grey_card", SETTING_PIXEL, "", 1e-3, 1, NULL, "", NULL,
     "a surface of known reflectance, which fixes the scale of light that no photograph shows: \"PHOTOGRAPH,x,y,reflectance\", "
     "with the column and row of a pixel that shows it, from 0 at the upper left, and the reflectance from 0 to 1 (.18 "
     "of a grey card); where all light is measured it is a check, in the report"},
    {"hold_out_every", SETTING_INT, "frames", 0, 1000000, NULL, "10", NULL,
     "where the capture holds out no frame, every how many-th is; 0: none"},
    {"holes", SETTING_CHOICE, "", 0, 0, "auto|fill|keep", "keep", NULL,
     "holes of the mesh that photographs look through: auto fills those where photographs show that a wall, floor or ceiling "
     "goes on; fill all that lie in one; keep none, so that they are windows"},
    {"iterations", SETTING_INT, "", 0, 1e9, NULL, "0", NULL,
     "optimiser steps; 0: as many as refine_looks or listing1_looks take"},
    {"listing1_looks", SETTING_INT, "looks", 1, 1000000000, NULL, "4000", "listing1",
     "listing1: ends when so many looks were taken at each part of the texture; with iterations: goes on to the end"},
    {"luminance_per_unit", SETTING_REAL, "cd/m2", 0, 1e9, NULL, "0", NULL,
     "luminance of radiance 1, by which scene.usda is in nits; 0: by the photographs' EXIF where it has exposure time, "
     "f-number and ISO, else unknown"},
    {"max_depth", SETTING_INT, "segments", 2, 32, NULL, "16", NULL,
     "longest path from the camera; light that takes more segments is missing from renders, most of all in white rooms"},
    {"measure_stride", SETTING_INT, "texels", 1, 8, NULL, "1", "solve",
     "solve: base colour is measured of one texel in so many squared"},
    {"method", SETTING_CHOICE, "", 0, 0, "solve|listing1", "solve", NULL,
     "how materials are found: solved from the measured light, then refined; or the published algorithm from a neutral start"},
    {"padding", SETTING_INT, "texels", 0, 40, NULL, "2", NULL,
     "free texels between two charts of the textures: 2 keep mip level 1 clean, 7 level 2, 16 level 3; 0: 7, or 2 where 7 would cost more "
     "than a tenth of texels_per_metre"},
    {"preview_interval_sec", SETTING_REAL, "s", 1, 86400, NULL, "15", NULL,
     "time between preview pictures while the job runs"},
    {"quality", SETTING_CHOICE, "", 0, 0, "draft|standard|fine", "standard", NULL,
     "how much work is done: it sets those of detail_steps, gather_samples, gloss_passes, listing1_looks, measure_stride, refine_looks "
     "and report_samples that are not given"},
    {"refine_looks", SETTING_INT, "looks", 0, 1000000000, NULL, "1000", "solve",
     "refine: ends when so many looks were taken at each part of the texture; with iterations, or 0 and a time_limit_sec: "
     "goes on to the end of that"},
    {"report_samples", SETTING_INT, "samples", 1, 65536, NULL, "64", NULL,
     "samples per pixel of the held-out re-renders; without a time limit up to four times as many where their noise leaves the mean "
     "error unknown by more than a tenth"},
    {"roughness_rate", SETTING_REAL, "", 1e-5, 1, NULL, "0.01", "listing1", "listing1: first step size of roughness"},
    {"roulette_depth", SETTING_INT, "segments", 2, 32, NULL, "4", NULL,
     "segment from which Russian roulette may end a path"},
    {"samples_per_camera", SETTING_INT, "paths", 2, 4096, NULL, "16", NULL,
     "paths for each texel and photograph, split into two independent halves"},
    {"seed", SETTING_INT, "", 0, 9007199254740991.0, NULL, "1", NULL,
     "names the random numbers: the same seed gives the same bytes"},
    {"segmentation", SETTING_CHOICE, "", 0, 0, "auto|given|automatic", "auto", NULL,
     "objects from the mesh's object_id, from its shape, or (auto) from whichever is there"},
    {"specular_rate", SETTING_REAL, "", 1e-5, 1, NULL, "0.01", "listing1", "listing1: first step size of specular"},
    {"texels_per_iteration", SETTING_INT, "texels", 64, 16777216, NULL, "4096", NULL,
     "texels chosen in one optimiser step"},
    {"texels_per_metre", SETTING_REAL, "texels/m", 0, 100000, NULL, "0", NULL,
     "density of the textures; 0: the greatest that texture_size holds"},
    {"texture_size", SETTING_INT, "texels", 64, 16384, NULL, "2048", NULL, "side of the square textures"},
    {"time_limit_sec", SETTING_REAL, "s", 0, 2592000, NULL, "0", NULL,
     "most working time of the whole job, not counting what other processes take; work is left out to keep it, "
     "first of refine, then samples of the report, detail, three texels of four, gather_samples; 0: no limit"},
    {"transforms", SETTING_TEXT, "", 0, 0, NULL, "transforms.json", NULL,
     "the file of the bundle that lists photographs and cameras"},
};

#define TABLE_COUNT (sizeof table / sizeof table[0])

/* The amounts of work that `quality` names, in the order of its choices; the middle ones are the defaults above. Of
 * staircase2 and bathroom at 2048 x 2048 the standard is what two cores did in 4.6 and 5.4 minutes when ten minutes
 * were the limit. */
enum { QUALITIES = 3 };
static const struct {
    const char *name;
    double amount[QUALITIES];
} by_quality[] = {
    /* clang-format off */
    {"detail_steps", {0, 16, 16}}, /* 16 bring it to rest */
    {"gather_samples", {128, 512, 2048}},
    {"gloss_passes", {1, 2, 2}},
    {"listing1_looks", {400, 4000, 16000}},
    {"measure_stride", {2, 1, 1}},
    {"refine_looks", {100, 1000, 4000}},
    {"report_samples", {16, 64, 256}},
    /* clang-format on */
};
#define BY_QUALITY_COUNT (sizeof by_quality / sizeof by_quality[0])

const struct setting *settings_table(size_t *count) {
    *count = TABLE_COUNT;
    return table;
}

static int index_of(const char *name) {
    for (size_t i = 0; i < TABLE_COUNT; i++) {
        if (strcmp(table[i].name, name) == 0)
            return (int)i;
    }
    return -1;
}

const struct setting *settings_find(const char *name) {
    int i = index_of(name);
    return i < 0 ? NULL : &table[i];
}

/* The valid name nearest to `name` by edit distance, or NULL when none is near. */
static const char *nearest_name(const char *name) {
    struct nearest nearest;
    nearest_init(&nearest, name);
    for (size_t i = 0; i < TABLE_COUNT; i++)
        nearest_offer(&nearest, table[i].name);
    return nearest.best;
}

/* Index of a word in "a|b|c"; -1 when it is not one of them. */
static int choice_index(const char *choices, const char *word) {
    size_t length = strlen(word);
    int index = 0;
    for (const char *at = choices; *at; index++) {
        size_t part = strcspn(at, "|");
        if (part == length && memcmp(at, word, part) == 0)
            return index;
        at += part + (at[part] == '|');
    }
    return -1;
}

/* Settings that are stored in `text`. */
static bool is_text(const struct setting *t) {
    return t->type == SETTING_TEXT || t->type == SETTING_BOX || t->type == SETTING_PIXEL;
}

/* Default of a setting that is stored in `number`. */
static double default_number(const struct setting *t) {
    switch (t->type) {
    case SETTING_BOOL: return strcmp(t->default_text, "true") == 0;
    case SETTING_CHOICE: return choice_index(t->choices, t->default_text);
    case SETTING_INT:
    case SETTING_REAL:
    case SETTING_TEXT:
    case SETTING_BOX:
    case SETTING_PIXEL: break;
    }
    return strtod(t->default_text, NULL);
}

/* Row of by_quality; NULL for settings that quality does not affect. */
static const double *amounts_of(const char *name) {
    for (size_t i = 0; i < BY_QUALITY_COUNT; i++) {
        if (strcmp(by_quality[i].name, name) == 0)
            return by_quality[i].amount;
    }
    return NULL;
}

/* Value of entry i when it is not given. */
static double usual_number(const struct settings *s, size_t i) {
    const double *amount = amounts_of(table[i].name);
    return amount ? amount[(int)settings_number(s, "quality")] : default_number(&table[i]);
}

double settings_of_quality(const struct settings *s, const char *name) {
    int i = index_of(name);
    assert(i >= 0);
    return usual_number(s, (size_t)i);
}

/* Sets values that were not given from the quality. */
static void follow_quality(struct settings *s) {
    for (size_t i = 0; i < TABLE_COUNT; i++) {
        if (!is_text(&table[i]) && !s->is_given[i])
            s->number[i] = usual_number(s, i);
    }
}

void settings_init(struct settings *s) {
    s->is_given = mem_calloc(TABLE_COUNT, sizeof *s->is_given);
    s->number = mem_calloc(TABLE_COUNT, sizeof *s->number);
    s->text = mem_calloc(TABLE_COUNT, sizeof *s->text);
    s->segment = NULL;
    s->segment_count = 0;
    for (size_t i = 0; i < TABLE_COUNT; i++) {
        if (is_text(&table[i]))
            s->text[i] = mem_strdup(table[i].default_text);
        else
            s->number[i] = default_number(&table[i]);
    }
}

void settings_release(struct settings *s) {
    for (size_t i = 0; s->text && i < TABLE_COUNT; i++)
        mem_free(s->text[i]);
    mem_free(s->text);
    mem_free(s->segment);
    mem_free(s->number);
    mem_free(s->is_given);
    *s = (struct settings){0};
}

double settings_number(const struct settings *s, const char *name) {
    int i = index_of(name);
    assert(i >= 0);
    return s->number[i];
}

bool settings_bool(const struct settings *s, const char *name) { return settings_number(s, name) != 0.0; }

static const char *choice_at(const char *choices, int index, char *word, size_t size) {
    while (index-- > 0)
        choices += strcspn(choices, "|") + 1;
    snprintf(word, size, "%.*s", (int)strcspn(choices, "|"), choices);
    return word;
}

bool settings_is(const struct settings *s, const char *name, const char *word) {
    int i = index_of(name);
    assert(i >= 0 && table[i].type == SETTING_CHOICE);
    return (int)s->number[i] == choice_index(table[i].choices, word);
}

const char *settings_text(const struct settings *s, const char *name) {
    int i = index_of(name);
    assert(i >= 0 && table[i].type == SETTING_TEXT);
    return s->text[i];
}

/* Six numbers with spaces or commas between them. */
static bool parse_box(const char *text, double lower[3], double upper[3]) {
    for (int i = 0; i < 6; i++) {
        char *end;
        text += strspn(text, " ,");
        double value = strtod(text, &end);
        if (end == text || !isfinite(value))
            return false;
        *(i < 3 ? &lower[i] : &upper[i - 3]) = value;
        text = end;
    }
    return text[strspn(text, " ")] == '\0' && lower[0] < upper[0] && lower[1] < upper[1] && lower[2] < upper[2];
}

bool settings_box(const struct settings *s, const char *name, double lower[3], double upper[3]) {
    int i = index_of(name);
    assert(i >= 0 && table[i].type == SETTING_BOX);
    return *s->text[i] && parse_box(s->text[i], lower, upper);
}

/* "NAME,x,y,value": the name may have commas in it. */
static bool parse_pixel(const struct setting *t, const char *text, struct pixel_setting *pixel) {
    const char *comma[3], *end = text + strlen(text);
    char *after;
    for (int i = 2; i >= 0; i--) {
        for (end--; end > text && *end != ',';)
            end--;
        if (end <= text)
            return false;
        comma[i] = end;
    }
    size_t length = (size_t)(comma[0] - text);
    double value[3];
    for (int i = 0; i < 3; i++) {
        value[i] = strtod(comma[i] + 1, &after);
        after += strspn(after, " ");
        if (after == comma[i] + 1 || after != (i < 2 ? comma[i + 1] : text + strlen(text)) || !isfinite(value[i]))
            return false;
    }
    for (int i = 0; i < 2; i++)
        if (value[i] < 0.0 || value[i] > UINT16_MAX || value[i] != floor(value[i]))
            return false;
    if (length >= sizeof pixel->photograph || !(value[2] >= t->minimum && value[2] <= t->maximum))
        return false;
    *pixel = (struct pixel_setting){.x = (uint32_t)value[0], .y = (uint32_t)value[1], .value = value[2]};
    memcpy(pixel->photograph, text, length);
    return true;
}

bool settings_pixel(const struct settings *s, const char *name, struct pixel_setting *pixel) {
    int i = index_of(name);
    assert(i >= 0 && table[i].type == SETTING_PIXEL);
    return *s->text[i] && parse_pixel(&table[i], s->text[i], pixel);
}

bool settings_emitter(const struct settings *s, uint32_t segment, bool decided) {
    for (size_t i = 0; i < s->segment_count; i++)
        if (s->segment[i].segment == segment)
            return s->segment[i].is_emitter;
    return decided;
}

static void set_text(struct settings *s, size_t i, const char *text) {
    mem_free(s->text[i]);
    s->text[i] = mem_strdup(text);
}

/* Applies one value; on a problem writes the reason and returns false. */
static bool apply_one(struct settings *s, size_t i, const cJSON *value, char *reason, size_t size) {
    const struct setting *t = &table[i];
    double number = value->valuedouble, lower[3], upper[3];
    struct pixel_setting pixel;
    int choice;
    switch (t->type) {
    case SETTING_INT:
    case SETTING_REAL:
        if (!cJSON_IsNumber(value) || !isfinite(number) || (t->type == SETTING_INT && number != floor(number))) {
            snprintf(reason, size, "must be %s number", t->type == SETTING_INT ? "a whole" : "a");
            return false;
        }
        if (number < t->minimum || number > t->maximum) {
            const char *gap = *t->unit ? " " : "";
            if (t->type == SETTING_INT)
                snprintf(reason, size, "must be between %.0f and %.0f%s%s, found %.15g", t->minimum, t->maximum, gap,
                         t->unit, number);
            else
                snprintf(reason, size, "must be between %.15g and %.15g%s%s, found %.15g", t->minimum, t->maximum, gap,
                         t->unit, number);
            return false;
        }
        s->number[i] = number;
        return true;
    case SETTING_BOOL:
        if (!cJSON_IsBool(value)) {
            snprintf(reason, size, "must be true or false");
            return false;
        }
        s->number[i] = cJSON_IsTrue(value);
        return true;
    case SETTING_CHOICE:
        choice = cJSON_IsString(value) ? choice_index(t->choices, value->valuestring) : -1;
        if (choice < 0) {
            snprintf(reason, size, "must be one of %s", t->choices);
            return false;
        }
        s->number[i] = choice;
        return true;
    case SETTING_TEXT:
        if (!cJSON_IsString(value) || (!*value->valuestring && *t->default_text) ||
            strlen(value->valuestring) > TEXT_MAX_LENGTH) {
            snprintf(reason, size, "must be a text of %d to %d bytes", *t->default_text ? 1 : 0, TEXT_MAX_LENGTH);
            return false;
        }
        set_text(s, i, value->valuestring);
        return true;
    case SETTING_BOX:
        if (!cJSON_IsString(value) || (*value->valuestring && !parse_box(value->valuestring, lower, upper))) {
            snprintf(reason, size, "must be six numbers, the lower corner and the upper, such as \"-1 -1 0 4 3 2.5\"");
            return false;
        }
        set_text(s, i, value->valuestring);
        return true;
    case SETTING_PIXEL:
        if (!cJSON_IsString(value) || (*value->valuestring && !parse_pixel(t, value->valuestring, &pixel))) {
            snprintf(reason, size,
                     "must be a photograph's name, the column and row of a pixel, and a value from %g to %g, such as "
                     "\"IMG_0012.jpg,812,604,0.18\"",
                     t->minimum, t->maximum);
            return false;
        }
        set_text(s, i, value->valuestring);
        return true;
    }
    return false;
}

#define SEGMENT_PREFIX "emitters."
#define SEGMENTS_MAX 1000

/* Applies "emitters.27": "on"; false with a reason when it is faulty. */
static bool apply_segment(struct settings *s, const cJSON *value, char *reason, size_t size) {
    const char *digits = value->string + strlen(SEGMENT_PREFIX), *word = cJSON_GetStringValue(value);
    bool is_number = *digits && strspn(digits, "0123456789") == strlen(digits) && strlen(digits) <= 9;
    if (!is_number || !word || (strcmp(word, "on") != 0 && strcmp(word, "off") != 0)) {
        snprintf(reason, size, is_number ? "must be on or off" : "must end in the number of a segment, as emitters.27");
        return false;
    }
    uint32_t segment = (uint32_t)strtoul(digits, NULL, 10);
    size_t at = 0;
    while (at < s->segment_count && s->segment[at].segment != segment)
        at++;
    if (at == SEGMENTS_MAX) {
        snprintf(reason, size, "is one of more than %d segments", SEGMENTS_MAX);
        return false;
    }
    if (at == s->segment_count)
        s->segment = mem_realloc_array(s->segment, ++s->segment_count, sizeof *s->segment);
    s->segment[at] = (struct segment_setting){segment, strcmp(word, "on") == 0};
    return true;
}

static void add_unknown(struct setting_faults *f, const char *name) {
    char hint[128] = "";
    const char *nearest = nearest_name(name);
    if (nearest)
        snprintf(hint, sizeof hint, "did you mean %s?", nearest);
    setting_faults_add(f, name, "there is no such setting", hint);
}

/* Resets settings that the method does not use; f: NULL when the method itself is invalid. */
static void check_method(struct settings *s, const cJSON *object, struct setting_faults *f) {
    char reason[256], hint[128], chosen[SETTING_NAME_MAX];
    int method = index_of("method");
    choice_at(table[method].choices, (int)s->number[method], chosen, sizeof chosen);
    for (const cJSON *value = object->child; value; value = value->next) {
        int i = index_of(value->string);
        const struct setting *t = i < 0 ? NULL : &table[i];
        if (!t || !t->method || strcmp(t->method, chosen) == 0 || s->number[i] == usual_number(s, (size_t)i))
            continue;
        s->number[i] = usual_number(s, (size_t)i);
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
        char reason[256] = "";
        int i = index_of(value->string);
        if (strncmp(value->string, SEGMENT_PREFIX, strlen(SEGMENT_PREFIX)) == 0) {
            if (!apply_segment(s, value, reason, sizeof reason))
                setting_faults_add(&faults, value->string, reason, "");
        } else if (i < 0) {
            add_unknown(&faults, value->string);
        } else if (!apply_one(s, (size_t)i, value, reason, sizeof reason)) {
            setting_faults_add(&faults, value->string, reason, table[i].help);
            method_is_good = method_is_good && strcmp(value->string, "method") != 0;
        } else {
            s->is_given[i] = true;
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

static void add_value(cJSON *object, const char *key, size_t i, const struct settings *s) {
    const struct setting *t = &table[i];
    char word[SETTING_NAME_MAX];
    if (t->type == SETTING_BOOL)
        json_add_bool(object, key, s->number[i] != 0.0);
    else if (t->type == SETTING_CHOICE)
        json_add_string(object, key, choice_at(t->choices, (int)s->number[i], word, sizeof word));
    else if (is_text(t))
        json_add_string(object, key, s->text[i]);
    else
        json_add_number(object, key, s->number[i]);
}

cJSON *settings_to_json(const struct settings *s) {
    cJSON *object = cJSON_CreateObject();
    for (size_t i = 0; i < TABLE_COUNT; i++)
        add_value(object, table[i].name, i, s);
    for (size_t i = 0; i < s->segment_count; i++) {
        char name[SETTING_NAME_MAX];
        snprintf(name, sizeof name, SEGMENT_PREFIX "%u", s->segment[i].segment);
        json_add_string(object, name, s->segment[i].is_emitter ? "on" : "off");
    }
    return object;
}

/* "by_quality": {"draft": 128, "standard": 512, "fine": 2048}; in words, too, after the help. */
static void add_help(cJSON *entry, const struct setting *t) {
    const double *amount = amounts_of(t->name);
    char word[SETTING_NAME_MAX], help[512];
    snprintf(help, sizeof help, "%s", t->help);
    cJSON *object = amount ? cJSON_AddObjectToObject(entry, "by_quality") : NULL;
    for (int q = 0; object && q < QUALITIES; q++) {
        size_t used = strlen(help);
        choice_at(settings_find("quality")->choices, q, word, sizeof word);
        json_add_number(object, word, amount[q]);
        snprintf(help + used, sizeof help - used, "%s%s %.0f%s", q ? ", " : " (", word, amount[q],
                 q + 1 < QUALITIES ? "" : ")");
    }
    json_add_string(entry, "help", help);
}

cJSON *settings_describe(void) {
    static const char *const type_names[] = {"int", "real", "bool", "choice", "text", "box", "pixel"};
    struct settings defaults;
    settings_init(&defaults);
    cJSON *list = cJSON_CreateArray();
    for (size_t i = 0; i < TABLE_COUNT; i++) {
        const struct setting *t = &table[i];
        cJSON *entry = cJSON_CreateObject();
        json_add_string(entry, "name", t->name);
        json_add_string(entry, "type", type_names[t->type]);
        json_add_string(entry, "unit", t->unit);
        if (t->type == SETTING_INT || t->type == SETTING_REAL) {
            json_add_number(entry, "minimum", t->minimum);
            json_add_number(entry, "maximum", t->maximum);
        }
        if (t->choices) {
            cJSON *choices = cJSON_AddArrayToObject(entry, "choices");
            char word[SETTING_NAME_MAX];
            for (const char *at = t->choices; *at; at += strcspn(at, "|"), at += *at == '|')
                cJSON_AddItemToArray(choices, cJSON_CreateString(choice_at(at, 0, word, sizeof word)));
        }
        add_value(entry, "default", i, &defaults);
        add_help(entry, t);
        if (t->method)
            json_add_string(entry, "method", t->method);
        cJSON_AddItemToArray(list, entry);
    }
    settings_release(&defaults);
    return list;
}
