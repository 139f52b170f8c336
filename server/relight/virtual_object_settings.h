/* virtual_object_settings.h -- the settings of one virtual object: "lamp.3.position" of family "lamp", number 3. */
#ifndef UNBAKE_RELIGHT_VIRTUAL_OBJECT_SETTINGS_H
#define UNBAKE_RELIGHT_VIRTUAL_OBJECT_SETTINGS_H

#include <stdio.h>

#include "common/render_settings.h"
#include "common/vec.h"

struct virtual_object_key_text {
    char text[64];
};

static inline struct virtual_object_key_text virtual_object_key(const char *family, uint32_t number, const char *name) {
    struct virtual_object_key_text key;
    snprintf(key.text, sizeof key.text, "%s.%u.%s", family, number, name);
    return key;
}

static inline double virtual_object_number(const cJSON *s, const char *family, uint32_t n, const char *name) {
    return render_settings_number(s, virtual_object_key(family, n, name).text);
}

static inline rgb virtual_object_color(const cJSON *s, const char *family, uint32_t n, const char *name) {
    double v[RENDER_MAX_NUMBERS] = {0.0, 0.0, 0.0};
    render_settings_numbers(s, virtual_object_key(family, n, name).text, v);
    return rgb_make((float)v[0], (float)v[1], (float)v[2]);
}

/* "position", in coordinates whose origin lies at `offset`. */
static inline vec3 virtual_object_position(const cJSON *s, const char *family, uint32_t n, const double offset[3]) {
    double v[RENDER_MAX_NUMBERS] = {0.0, 0.0, 0.0};
    render_settings_numbers(s, virtual_object_key(family, n, "position").text, v);
    return vec3_make((float)(v[0] - offset[0]), (float)(v[1] - offset[1]), (float)(v[2] - offset[2]));
}

#endif
