/* drawing.h -- simple drawing with smooth edges, on a picture in linear light. */
#ifndef UNBAKE_CHECK_DRAWING_H
#define UNBAKE_CHECK_DRAWING_H

#include "common/error.h"
#include "common/image.h"
#include "common/vec.h"

struct drawing {
    struct image image; /* R G B, linear; owned */
};

void drawing_init(struct drawing *drawing, uint32_t width, uint32_t height, rgb background);
void drawing_release(struct drawing *drawing);

/* Mixes `alpha` of the colour into a pixel; outside of the picture nothing happens. */
void drawing_blend(struct drawing *drawing, long x, long y, rgb color, float alpha);
/* Coordinates in pixels, centres at +.5. */
void drawing_line(struct drawing *drawing, vec2 from, vec2 to, float width, rgb color, float alpha);
void drawing_disc(struct drawing *drawing, vec2 centre, float radius, rgb color, float alpha);

/* As an 8-bit PNG. */
enum status drawing_write(const struct drawing *drawing, const char *path, struct error *err);

#endif
