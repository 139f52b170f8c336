/* settings.c -- the table of settings.h, values and their JSON. settings_apply.c checks what is given. */
#include "common/settings.h"

#include <assert.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "common/choices.h"
#include "common/mem.h"
#include "common/setting_faults.h"

static const struct setting table[] = {
    {"bake_uv", SETTING_CHOICE, "", 0, 0, "auto|off", "auto", NULL,
     "textures also in the mesh's own texture coordinates (uv_base_color.exr and so on), where it has some, of one picture, that do not overlap"},
    {"base_color_rate", SETTING_REAL, "", 1e-5, 1, NULL, "0.03", "listing1",
     "listing1: first step size of base colour; it falls over the run"},
    {"calibrate", SETTING_BOOL, "", 0, 0, NULL, "true", NULL,
     "look for faults of the capture (exposure, colour, vignette, tones, poses, blur) and put them right"},
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
    {"holes", SETTING_CHOICE, "", 0, 0, "auto|fill|keep", "auto", NULL,
     "holes of the mesh: auto fills those where photographs show that a wall, floor or ceiling "
     "goes on, and where no objects are told apart, as on a scan, those that no photograph shows and a plane's surface is all "
     "around; fill all that lie in one; keep none, so that they are windows. Where some are filled and no bright sky is seen "
     "through the rest, light that comes in there is given a place: surfaces outside the mesh, each named opening"},
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
    {"padding", SETTING_INT, "texels", 0, 40, NULL, "0", NULL,
     "free texels between two charts of the textures: 2 keep mip level 1 clean, 7 level 2, 16 level 3; 0: 7, or 2 where 7 would cost more "
     "than a tenth of texels_per_metre"},
    {"photograph_megapixels", SETTING_REAL, "megapixels", 0, 100000, NULL, "3.2", NULL,
     "larger photographs are reduced to a half, a third ... of their sides, by means of their pixels; stated for a texture_size of 2048: "
     "larger ones keep as many times more pixels as they have more texels; 0: photographs are kept whole, which takes many times the "
     "memory and time"},
    {"preview_interval_sec", SETTING_REAL, "s", 1, 86400, NULL, "15", NULL,
     "time between preview pictures while the job runs"},
    {"quality", SETTING_CHOICE, "", 0, 0, "draft|standard|fine", "standard", NULL,
     "how much work is done: it sets those of detail_steps, gather_samples, gloss_passes, listing1_looks, measure_stride, "
     "photograph_megapixels, refine_looks and report_samples that are not given"},
    {"refine_looks", SETTING_INT, "looks", 0, 1000000000, NULL, "1000", "solve",
     "refine: ends when so many looks were taken at each part of the texture; with iterations, or 0 and a time_limit_sec: "
     "goes on to the end of that"},
    {"report_samples", SETTING_INT, "samples", 1, 65536, NULL, "64", NULL,
     "samples per pixel of the held-out re-renders; without a time limit up to four times as many where their noise leaves the mean "
     "error unknown by more than a tenth; of a few, what 8-bit photographs clip makes whole views seem too dark, and stated "
     "errors too large"},
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
    {"photograph_megapixels", {1.6, 3.2, 0}},
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

/* Settings that are stored in `text`. */
static bool is_text(const struct setting *t) {
    return t->type == SETTING_TEXT || t->type == SETTING_BOX || t->type == SETTING_PIXEL;
}

/* Default of a setting that is stored in `number`. */
static double default_number(const struct setting *t) {
    switch (t->type) {
    case SETTING_BOOL: return strcmp(t->default_text, "true") == 0;
    case SETTING_CHOICE: return choices_index(t->choices, t->default_text, strlen(t->default_text));
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

bool settings_is(const struct settings *s, const char *name, const char *word) {
    int i = index_of(name);
    assert(i >= 0 && table[i].type == SETTING_CHOICE);
    return (int)s->number[i] == choices_index(table[i].choices, word, strlen(word));
}

const char *settings_text(const struct settings *s, const char *name) {
    int i = index_of(name);
    assert(i >= 0 && table[i].type == SETTING_TEXT);
    return s->text[i];
}

bool settings_box(const struct settings *s, const char *name, double lower[3], double upper[3]) {
    int i = index_of(name);
    assert(i >= 0 && table[i].type == SETTING_BOX);
    return *s->text[i] && setting_parse_box(s->text[i], lower, upper);
}

bool settings_pixel(const struct settings *s, const char *name, struct pixel_setting *pixel) {
    int i = index_of(name);
    assert(i >= 0 && table[i].type == SETTING_PIXEL);
    return *s->text[i] && setting_parse_pixel(s->text[i], table[i].minimum, table[i].maximum, pixel);
}

bool settings_emitter(const struct settings *s, uint32_t segment, bool decided) {
    for (size_t i = 0; i < s->segment_count; i++)
        if (s->segment[i].segment == segment)
            return s->segment[i].is_emitter;
    return decided;
}

static void add_value(cJSON *object, const char *key, size_t i, const struct settings *s) {
    const struct setting *t = &table[i];
    char word[SETTING_NAME_MAX];
    if (t->type == SETTING_BOOL)
        json_add_bool(object, key, s->number[i] != 0.0);
    else if (t->type == SETTING_CHOICE)
        json_add_string(object, key, choices_word(t->choices, (int)s->number[i], word, sizeof word));
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
        snprintf(name, sizeof name, SETTING_SEGMENT_PREFIX "%u", s->segment[i].segment);
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
        choices_word(settings_find("quality")->choices, q, word, sizeof word);
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
        choices_to_json(t->choices, entry);
        add_value(entry, "default", i, &defaults);
        add_help(entry, t);
        if (t->method)
            json_add_string(entry, "method", t->method);
        cJSON_AddItemToArray(list, entry);
    }
    settings_release(&defaults);
    return list;
}
