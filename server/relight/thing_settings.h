/* thing_settings.h -- the settings of one thing that is put into a room: "lamp.3.position" of family "lamp", number
 * 3. */
#ifndef UNBAKE_RELIGHT_THING_SETTINGS_H
#define UNBAKE_RELIGHT_THING_SETTINGS_H

#include <stdio.h>

#include "common/render_settings.h"
#include "common/vec.h"

struct thing_name {
    char text[64];
};

static inline struct thing_name thing_key(const char *family, uint32_t number, const char *name) {
    struct thing_name key;
    snprintf(key.text, sizeof key.text, "%s.%u.%s", family, number, name);
    return key;
}

static inline double thing_number(const cJSON *s, const char *family, uint32_t n, const char *name) {
    return render_settings_number(s, thing_key(family, n, name).text);
}

static inline rgb thing_color(const cJSON *s, const char *family, uint32_t n, const char *name) {
    double v[RENDER_MAX_NUMBERS] = {0.0, 0.0, 0.0};
    render_settings_numbers(s, thing_key(family, n, name).text, v);
    return rgb_make((float)v[0], (float)v[1], (float)v[2]);
}

/* "position", in coordinates whose origin lies at `offset`. */
static inline vec3 thing_place(const cJSON *s, const char *family, uint32_t n, const double offset[3]) {
    double v[RENDER_MAX_NUMBERS] = {0.0, 0.0, 0.0};
    render_settings_numbers(s, thing_key(family, n, "position").text, v);
    return vec3_make((float)(v[0] - offset[0]), (float)(v[1] - offset[1]), (float)(v[2] - offset[2]));
}

#endif
