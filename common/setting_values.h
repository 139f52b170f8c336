/* setting_values.h -- how values of settings with several parts are written. */
#ifndef UNBAKE_COMMON_SETTING_VALUES_H
#define UNBAKE_COMMON_SETTING_VALUES_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "common/json.h"

/* Reads up to `most` finite numbers of "1, 2 3"; how many there are, or 0 for anything else. */
size_t setting_scan_numbers(const char *text, double *value, size_t most);
/* The numbers of a JSON number, array or string; 0: it is none of these, or has more than `most`. */
size_t setting_read_numbers(const cJSON *value, double *number, size_t most);
/* "640x480": width and height. */
bool setting_read_size(const char *text, double side[2]);

/* Six numbers with spaces or commas between them: the lower corner, then the upper, which is greater on each axis. */
bool setting_parse_box(const char *text, double lower[3], double upper[3]);
/* Something known of a pixel of a photograph. */
struct pixel_setting {
    char photograph[256]; /* its name */
    uint32_t x, y;        /* column and row, from 0 at the upper left */
    double value;
};
/* "NAME,x,y,value": the name may have commas in it. False also where the value is not from `least` to `most`. */
bool setting_parse_pixel(const char *text, double least, double most, struct pixel_setting *pixel);

#endif
