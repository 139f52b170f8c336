/* setting_values.c -- see setting_values.h. */
#include "common/setting_values.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

size_t setting_scan_numbers(const char *text, double *value, size_t most) {
    size_t count = 0;
    for (const char *at = text; *at;) {
        char *end;
        double number = strtod(at, &end);
        if (end == at || !isfinite(number) || count == most)
            return 0;
        value[count++] = number;
        at = end + strspn(end, " ");
        at += *at == ',';
        at += strspn(at, " ");
    }
    return count;
}

size_t setting_read_numbers(const cJSON *value, double *number, size_t most) {
    if (cJSON_IsNumber(value)) {
        *number = value->valuedouble;
        return isfinite(value->valuedouble) ? 1 : 0;
    }
    if (cJSON_IsString(value))
        return setting_scan_numbers(value->valuestring, number, most);
    size_t count = 0;
    for (const cJSON *item = cJSON_IsArray(value) ? value->child : NULL; item; item = item->next) {
        if (!cJSON_IsNumber(item) || !isfinite(item->valuedouble) || count == most)
            return 0;
        number[count++] = item->valuedouble;
    }
    return count;
}

bool setting_read_size(const char *text, double side[2]) {
    unsigned width, height;
    int used = 0;
    if (sscanf(text, "%5ux%5u%n", &width, &height, &used) != 2 || text[used] != '\0')
        return false;
    side[0] = width;
    side[1] = height;
    return true;
}

bool setting_parse_box(const char *text, double lower[3], double upper[3]) {
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

bool setting_parse_pixel(const char *text, double least, double most, struct pixel_setting *pixel) {
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
    if (length >= sizeof pixel->photograph || !(value[2] >= least && value[2] <= most))
        return false;
    *pixel = (struct pixel_setting){.x = (uint32_t)value[0], .y = (uint32_t)value[1], .value = value[2]};
    memcpy(pixel->photograph, text, length);
    return true;
}
