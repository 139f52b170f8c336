/* reading.c -- see reading.h. */
#include "common/reading.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "common/buf.h"
#include "common/mem.h"
#include "common/utf8.h"

#define MIN_SCALE 1e-6 /* from micrometres to metres, and back */
#define MAX_SCALE 1e6
#define MIN_LENS 0.01 /* a hundredth of the stated size of the picture, and a hundred times it */
#define MAX_LENS 100.0

static const char *const axes_name[] = {
    [AXES_OF_FORMAT] = "",
    [AXES_OPENCV] = "opencv",
    [AXES_OPENGL] = "opengl",
    [AXES_OPENCV_INVERSE] = "opencv-inverse",
    [AXES_OPENGL_INVERSE] = "opengl-inverse",
};
#define AXES_COUNT (sizeof axes_name / sizeof *axes_name)

const char *const reading_keys[] = {"transforms",  "mesh", "axes",       "mesh_axes", "scale", "shift",
                                    "coordinates", "lens", "distortion", "exposures", NULL};

struct reading reading_default(void) {
    return (struct reading){.mesh_axes = {.axis = {0, 1, 2}, .sign = {1.0f, 1.0f, 1.0f}}, .scale = 1.0, .lens = 1.0};
}

void reading_release(struct reading *reading) {
    mem_free(reading->transforms);
    mem_free(reading->mesh);
    mem_free(reading->coordinates);
    *reading = reading_default();
}

struct reading reading_copy(const struct reading *reading) {
    struct reading copy = *reading;
    copy.transforms = reading->transforms ? mem_strdup(reading->transforms) : NULL;
    copy.mesh = reading->mesh ? mem_strdup(reading->mesh) : NULL;
    copy.coordinates = reading->coordinates ? mem_strdup(reading->coordinates) : NULL;
    return copy;
}

/* --- JSON ----------------------------------------------------------------------------------- */

static enum status parse_path(const cJSON *value, char **path, struct error *err) {
    const char *text = cJSON_GetStringValue(value);
    if (!text || !*text || strlen(text) > READING_MAX_PATH || !utf8_is_name(text))
        return error_set(err, STATUS_INPUT, "%s must be the name of a file in the bundle, of at most %d bytes",
                         value->string, READING_MAX_PATH);
    *path = mem_strdup(text);
    return STATUS_OK;
}

static enum status parse_axes(const cJSON *value, enum matrix_axes *axes, struct error *err) {
    const char *text = cJSON_GetStringValue(value);
    for (size_t i = AXES_OPENCV; text && i < AXES_COUNT; i++)
        if (strcmp(text, axes_name[i]) == 0) {
            *axes = (enum matrix_axes)i;
            return STATUS_OK;
        }
    return error_set(err, STATUS_INPUT,
                     "axes must be \"opencv\", \"opengl\", \"opencv-inverse\" or \"opengl-inverse\"");
}

static enum status parse_mesh_axes(const cJSON *value, struct signed_axes *axes, struct error *err) {
    const char *text = cJSON_GetStringValue(value);
    int seen = 0, count = 0;
    while (text && count < 3) {
        text += strspn(text, " ,");
        float sign = *text == '-' ? -1.0f : 1.0f;
        text += *text == '-' || *text == '+';
        if (*text < 'x' || *text > 'z')
            break;
        axes->axis[count] = *text - 'x';
        axes->sign[count++] = sign;
        seen |= 1 << (*text++ - 'x');
    }
    if (text && count == 3 && seen == 7 && text[strspn(text, " ")] == '\0')
        return STATUS_OK;
    return error_set(err, STATUS_INPUT, "mesh_axes must name x, y and z once each, with signs, such as \"x -z y\"");
}

static enum status parse_coordinates(const cJSON *value, char **name, struct error *err) {
    static const char *const names[] = {"file", "capture", "chunk", "local", "projected"};
    const char *text = cJSON_GetStringValue(value);
    for (size_t i = 0; text && i < sizeof names / sizeof *names; i++)
        if (strcmp(text, names[i]) == 0) {
            *name = mem_strdup(text);
            return STATUS_OK;
        }
    return error_set(err, STATUS_INPUT,
                     "coordinates must be \"file\", \"capture\", \"chunk\", \"local\" or \"projected\"");
}

/* "told" or "ignored". */
static enum status parse_ignored(const cJSON *value, bool *ignored, struct error *err) {
    const char *text = cJSON_GetStringValue(value);
    *ignored = text && strcmp(text, "ignored") == 0;
    if (!*ignored && (!text || strcmp(text, "told") != 0))
        return error_set(err, STATUS_INPUT, "%s must be \"told\" or \"ignored\"", value->string);
    return STATUS_OK;
}

static enum status parse_member(const cJSON *member, struct reading *r, struct error *err) {
    const char *key = member->string;
    double value = member->valuedouble;
    if (strcmp(key, "transforms") == 0)
        return parse_path(member, &r->transforms, err);
    if (strcmp(key, "mesh") == 0)
        return parse_path(member, &r->mesh, err);
    if (strcmp(key, "axes") == 0)
        return parse_axes(member, &r->axes, err);
    if (strcmp(key, "mesh_axes") == 0)
        return parse_mesh_axes(member, &r->mesh_axes, err);
    if (strcmp(key, "exposures") == 0)
        return parse_ignored(member, &r->ignores_exposures, err);
    if (strcmp(key, "distortion") == 0)
        return parse_ignored(member, &r->ignores_distortion, err);
    if (strcmp(key, "coordinates") == 0)
        return parse_coordinates(member, &r->coordinates, err);
    if (strcmp(key, "lens") == 0) {
        if (!cJSON_IsNumber(member) || !(value >= MIN_LENS && value <= MAX_LENS))
            return error_set(err, STATUS_INPUT, "lens must be a number from %g to %g", MIN_LENS, MAX_LENS);
        r->lens = value;
        return STATUS_OK;
    }
    if (strcmp(key, "scale") == 0) {
        if (!cJSON_IsNumber(member) || !(value >= MIN_SCALE && value <= MAX_SCALE))
            return error_set(err, STATUS_INPUT, "scale must be a number from %g to %g", MIN_SCALE, MAX_SCALE);
        r->scale = value;
        return STATUS_OK;
    }
    if (strcmp(key, "shift") == 0) {
        if (!cJSON_IsNumber(member) || !(fabs(value) <= READING_MAX_SHIFT) || value != floor(value))
            return error_set(err, STATUS_INPUT, "shift must be a whole number from -%d to %d", READING_MAX_SHIFT,
                             READING_MAX_SHIFT);
        r->shift = (int)value;
        return STATUS_OK;
    }
    return error_set(err, STATUS_INPUT,
                     "unknown \"%.40s\"; known are transforms, mesh, axes, mesh_axes, scale, shift, "
                     "coordinates, lens, distortion and exposures",
                     key);
}

enum status reading_parse(const cJSON *json, struct reading *reading, struct error *err) {
    *reading = reading_default();
    if (json && !cJSON_IsObject(json))
        return error_set(err, STATUS_INPUT, "a reading must be an object");
    const cJSON *member;
    cJSON_ArrayForEach(member, json) {
        enum status status = parse_member(member, reading, err);
        if (status != STATUS_OK)
            return status;
    }
    return STATUS_OK;
}

enum status reading_parse_assignment(const char *text, cJSON *object, struct error *err) {
    const char *equals = strchr(text, '=');
    if (!equals || equals == text)
        return error_set(err, STATUS_INPUT, "\"%.100s\" is not of the form NAME=VALUE", text);
    char *key = mem_strndup(text, (size_t)(equals - text)), *end;
    double value = strtod(equals + 1, &end);
    bool is_number = (strcmp(key, "scale") == 0 || strcmp(key, "shift") == 0 || strcmp(key, "lens") == 0) &&
                     end != equals + 1 && *end == '\0';
    struct reading ignored;
    if (cJSON_HasObjectItem(object, key))
        cJSON_DeleteItemFromObjectCaseSensitive(object, key);
    if (is_number)
        json_add_number(object, key, value);
    else
        json_add_string(object, key, equals + 1);
    enum status status = reading_parse(object, &ignored, err);
    reading_release(&ignored);
    mem_free(key);
    return status;
}

cJSON *reading_json(const struct reading *r) {
    cJSON *json = cJSON_CreateObject();
    const struct signed_axes *m = &r->mesh_axes;
    bool is_turned = false;
    for (int i = 0; i < 3; i++)
        is_turned = is_turned || m->axis[i] != i || m->sign[i] < 0.0f;
    if (r->transforms)
        json_add_string(json, "transforms", r->transforms);
    if (r->mesh)
        json_add_string(json, "mesh", r->mesh);
    if (r->axes != AXES_OF_FORMAT)
        json_add_string(json, "axes", axes_name[r->axes]);
    if (is_turned) {
        char text[16];
        snprintf(text, sizeof text, "%s%c %s%c %s%c", m->sign[0] < 0.0f ? "-" : "", 'x' + m->axis[0],
                 m->sign[1] < 0.0f ? "-" : "", 'x' + m->axis[1], m->sign[2] < 0.0f ? "-" : "", 'x' + m->axis[2]);
        json_add_string(json, "mesh_axes", text);
    }
    if (r->scale != 1.0)
        json_add_number(json, "scale", r->scale);
    if (r->shift != 0)
        json_add_int(json, "shift", r->shift);
    if (r->coordinates)
        json_add_string(json, "coordinates", r->coordinates);
    if (r->lens != 1.0)
        json_add_number(json, "lens", r->lens);
    if (r->ignores_distortion)
        json_add_string(json, "distortion", "ignored");
    if (r->ignores_exposures)
        json_add_string(json, "exposures", "ignored");
    return json;
}

/* A word for a shell, in quotes where it needs them. */
static void put_word(struct buf *out, const char *text) {
    static const char plain[] = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_-+./:,";
    if (text[strspn(text, plain)] == '\0') {
        buf_puts(out, text);
        return;
    }
    buf_puts(out, "'");
    for (; *text; text++) {
        if (*text == '\'')
            buf_puts(out, "'\\''");
        else
            buf_append(out, text, 1);
    }
    buf_puts(out, "'");
}

char *reading_words(const cJSON *object) {
    struct buf words;
    const cJSON *member;
    buf_init(&words, 65536);
    cJSON_ArrayForEach(member, object) {
        char *value = cJSON_IsString(member) ? mem_strdup(member->valuestring) : json_text(member);
        buf_printf(&words, "%s%s=", words.length ? " " : "", member->string);
        put_word(&words, value);
        mem_free(value);
    }
    return buf_detach(&words);
}

/* --- axes ---------------------------------------------------------------------------------- */

vec3 signed_axes_apply(const struct signed_axes *axes, vec3 v) {
    const float c[3] = {v.x, v.y, v.z};
    return vec3_make(axes->sign[0] * c[axes->axis[0]], axes->sign[1] * c[axes->axis[1]],
                     axes->sign[2] * c[axes->axis[2]]);
}

bool signed_axes_is_mirror(const struct signed_axes *axes) {
    bool is_odd = (axes->axis[1] - axes->axis[0] + 3) % 3 == 2; /* x y z, y z x and z x y are even */
    return is_odd != (axes->sign[0] * axes->sign[1] * axes->sign[2] < 0.0f);
}
