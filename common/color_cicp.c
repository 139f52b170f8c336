/* color_cicp.c -- see color_cicp.h. */
#include "common/color_cicp.h"

#include <stdio.h>

static const struct color_primaries *find_primaries(uint8_t number, const char **name) {
    switch (number) {
    case 1: *name = "Rec. 709"; return &color_rec709;
    case 5: *name = "Rec. 601 (625 lines)"; return &color_rec601_625;
    case 6:
    case 7: *name = "Rec. 601 (525 lines)"; return &color_rec601_525;
    case 9: *name = "Rec. 2020"; return &color_rec2020;
    case 11: *name = "DCI-P3"; return &color_dci_p3;
    case 12: *name = "Display P3"; return &color_display_p3;
    default: return NULL;
    }
}

static bool find_transfer(uint8_t number, enum color_transfer *transfer, double *gamma) {
    *gamma = 1.0;
    switch (number) {
    case 1:
    case 6:
    case 14:
    case 15: *transfer = COLOR_REC709; return true;
    case 4: *transfer = COLOR_POWER, *gamma = 2.2; return true;
    case 5: *transfer = COLOR_POWER, *gamma = 2.8; return true;
    case 8: *transfer = COLOR_POWER; return true;
    case 13: *transfer = COLOR_SRGB; return true;
    case 16: *transfer = COLOR_PQ; return true;
    case 18: *transfer = COLOR_HLG; return true;
    default: return false;
    }
}

bool color_set_cicp(struct color *color, const char *place, const uint8_t number[4], int bits) {
    static const char *const curve[] = {[COLOR_SRGB] = "",
                                        [COLOR_POWER] = ", a power",
                                        [COLOR_REC709] = ", its curve",
                                        [COLOR_PQ] = ", PQ",
                                        [COLOR_HLG] = ", HLG"};
    const char *name = "";
    enum color_transfer transfer = COLOR_SRGB;
    double gamma = 1.0;
    const struct color_primaries *primaries = find_primaries(number[0], &name);
    if (!primaries || !find_transfer(number[1], &transfer, &gamma) || number[2] != 0 || number[3] != 1) {
        snprintf(color->warning, sizeof color->warning, "%s has the numbers %d, %d, %d, %d, which are not known here",
                 place, number[0], number[1], number[2], number[3]);
        return false;
    }
    char full[COLOR_NAME_SIZE];
    snprintf(full, sizeof full, "%s%s", name, transfer == COLOR_POWER && gamma == 1.0 ? ", linear" : curve[transfer]);
    color_set(color, full, primaries, transfer, gamma, bits);
    return color->warning[0] == '\0';
}
