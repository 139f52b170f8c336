/* color.h -- colour spaces of picture files and the conversion to linear Rec. 709 (white D65). A file specifies its
 * space by an ICC profile (color_icc.h) or by numbers: primaries, white and a transfer curve.
 *
 * White points are adapted by Bradford's matrix (as in ICC). Colours outside of Rec. 709 become negative or exceed 1;
 * callers decide what to do with them. Private to the picture codecs. */
#ifndef UNBAKE_COMMON_COLOR_H
#define UNBAKE_COMMON_COLOR_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define COLOR_NAME_SIZE 64     /* bytes with the NUL, as the next */
#define COLOR_WARNING_SIZE 160 /* bytes with the NUL: a short sentence */

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
extern const struct color_primaries color_rec709, color_display_p3, color_dci_p3, color_rec2020, color_rec601_525,
    color_rec601_625;

struct color {
    char name[COLOR_NAME_SIZE];       /* name for people: "Display P3"; "" if unspecified */
    char warning[COLOR_WARNING_SIZE]; /* why the file's colour information is not used; "" if it is */
    bool is_srgb;                     /* only sRGB's curve is to be applied; the rest is not set */
    uint32_t step_count;              /* of a curve: stored value 0 to 1 */
    float *curve;                     /* [3][step_count] linear light; NULL for a profile other than curves and
                                       * matrix; owned */
    float matrix[3][3];               /* to Rec. 709 from the file's primaries, row-major */
    void *profile;                    /* used when curve is NULL, see color_icc.c; owned */
    void (*profile_convert)(const void *profile, float (*pixel)[3], size_t count); /* stored values to linear light */
    void (*profile_free)(void *profile);
};

/* Initialises to sRGB. */
void color_init(struct color *color);
void color_release(struct color *color);

/* From numbers. `bits` per channel determines the steps of the curve. Impossible primaries give a warning. Values
 * equivalent to sRGB leave is_srgb set. */
void color_set(struct color *color, const char *name, const struct color_primaries *primaries,
               enum color_transfer transfer, double gamma, int bits);

/* Adobe RGB (1998), whose curve is the power 563 / 256. */
void color_set_adobe_rgb(struct color *color, int bits);

/* Matrix from these primaries to Rec. 709, row-major; false when they are degenerate. *is_same: it is the identity. */
bool color_matrix(const struct color_primaries *from, float matrix[3][3], bool *is_same);

/* The same from X, Y, Z of the three primaries (its columns) relative to D50, as in profiles. */
void color_matrix_d50(const double xyz[3][3], float matrix[3][3], bool *is_same);

/* Converts `count` pixels of `stride` values, the first three of which are stored values in [0, 1]. `outside` counts
 * pixels outside of Rec. 709. */
void color_convert(const struct color *color, float *pixel, size_t stride, size_t count, size_t *outside);
/* The same for linear values, by a matrix only. Values from `ceiling` on are lower bounds: where all three are they
 * stay as they are, since white is white in both; where some are the others cannot be told, and all become NaN. */
void color_multiply(const float matrix[3][3], float ceiling, float *pixel, size_t stride, size_t count,
                    size_t *outside);

#endif
