/* color.h -- what the numbers of a picture's file mean, and the way from them to linear light of Rec. 709's primaries and
 * white (D65). A file says it by an ICC profile (color_icc.h) or by numbers: primaries, white and a curve.
 *
 * Whites are adapted by Bradford's matrix (as ICC profiles are). Colours outside of Rec. 709 come out below 0 or above 1:
 * what to do with them is the caller's affair. Private to the picture codecs. */
#ifndef UNBAKE_COMMON_COLOR_H
#define UNBAKE_COMMON_COLOR_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define COLOR_NAME_SIZE 64
#define COLOR_WARNING_SIZE 160

/* How linear light became the stored value. */
enum color_transfer {
    COLOR_SRGB,   /* IEC 61966-2-1 */
    COLOR_POWER,  /* stored = linear ^ (1 / gamma) */
    COLOR_REC709, /* ITU-R BT.709, the camera's curve; BT.601 and BT.2020 have it too */
    COLOR_PQ,     /* SMPTE ST 2084; 1 is 203 cd/m2, diffuse white by ITU-R BT.2408 */
    COLOR_HLG     /* ITU-R BT.2100, the camera's curve: linear light of the scene up to 1 */
};

/* Chromaticities x, y of red, green, blue and white. */
struct color_primaries {
    double red[2], green[2], blue[2], white[2];
};
extern const struct color_primaries color_rec709, color_display_p3, color_dci_p3, color_rec2020, color_adobe_rgb,
    color_rec601_525, color_rec601_625;

struct color {
    char name[COLOR_NAME_SIZE];       /* of the file's space, for people: "Display P3"; "" where it says nothing */
    char warning[COLOR_WARNING_SIZE]; /* why what the file says of its colours is not used; "" where it is */
    bool is_srgb;                     /* nothing is to be done but sRGB's curve; the rest is not set then */
    uint32_t step_count;              /* of a curve: stored value 0 to 1 */
    float *curve;                     /* [3][step_count] linear light; NULL with a profile that is no curve and matrix; owned */
    float matrix[3][3];               /* Rec. 709 from the file's primaries, by rows */
    void *profile;                    /* where curve is NULL, of color_icc.c; owned */
    void (*profile_convert)(const void *profile, float (*pixel)[3], size_t count); /* stored values to linear light */
    void (*profile_free)(void *profile);
};

/* A file that says nothing: sRGB. */
void color_init(struct color *color);
void color_release(struct color *color);

/* By numbers. `bits` is that of the file, for the steps of its curve. What cannot be (primaries on a line) is a warning.
 * Numbers that mean sRGB leave is_srgb. */
void color_set(struct color *color, const char *name, const struct color_primaries *primaries,
               enum color_transfer transfer, double gamma, int bits);

/* Adobe RGB (1998), whose curve is the power 563 / 256. */
void color_set_adobe_rgb(struct color *color, int bits);

/* The matrix from these primaries to Rec. 709's, by rows; false where there is none. `is_same`: whether nothing changes. */
bool color_matrix(const struct color_primaries *from, float matrix[3][3], bool *is_same);

/* The same from X, Y, Z of the three primaries (its columns) relative to white D50, as profiles have them. */
void color_matrix_d50(const double xyz[3][3], float matrix[3][3], bool *is_same);

/* Converts `count` pixels of `stride` values, of which the first three are stored values from 0 to 1. `outside` counts
 * pixels that Rec. 709 cannot show. */
void color_convert(const struct color *color, float *pixel, size_t stride, size_t count, size_t *outside);
/* The same of linear values, by a matrix alone. */
void color_turn(const float matrix[3][3], float *pixel, size_t stride, size_t count, size_t *outside);

#endif
