/* detail_pixels.h -- the photographs' pixels that detail.h uses: which show one surface, their residuals and
 * weights. */
#ifndef UNBAKE_MATERIAL_DETAIL_PIXELS_H
#define UNBAKE_MATERIAL_DETAIL_PIXELS_H

#include "server/material/detail_state.h"
#include "server/material/footprint.h"

#define DETAIL_PIXEL_BYTES 14 /* of triangle, weight and residual */

/* Makes triangle, weight and residual of all photographs. Needs chart_of_texel. */
void detail_pixels_make(struct detail *d);
void detail_pixels_release(struct detail *d);

/* The texels in the footprint of a pixel that shows a triangle; false where too few of them are known. */
bool detail_pixels_footprint(const struct detail *d, uint32_t train, uint32_t x, uint32_t y, uint32_t triangle,
                             struct footprint_texels *t);

/* One photograph being processed, by rows of pixels. */
struct detail_picture {
    struct detail *detail;
    uint32_t train, width;
    rgb *raw; /* [pixels] residual before the high-pass filter; while pixels are made */
};

/* Tells the scene's spill that a row's triangles, weights and residuals are looked at or written next. */
void detail_pixels_use(const struct detail *d, uint32_t train, size_t row);

/* Calls body for each row of a photograph; `user` is a detail_picture. */
void detail_pixels_rows(struct detail *d, uint32_t train, void (*body)(void *user, size_t row, int thread));

#endif
