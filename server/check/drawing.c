/* drawing.c -- see drawing.h. A shape covers a pixel by its distance from the pixel's centre, over one pixel. */
#include "server/check/drawing.h"

#include <math.h>

void drawing_init(struct drawing *drawing, uint32_t width, uint32_t height, rgb background) {
    image_init_rgb(&drawing->image, width, height);
    for (size_t i = 0; i < (size_t)width * height; i++) {
        drawing->image.pixel[3 * i] = background.r;
        drawing->image.pixel[3 * i + 1] = background.g;
        drawing->image.pixel[3 * i + 2] = background.b;
    }
}

void drawing_release(struct drawing *drawing) { image_release(&drawing->image); }

void drawing_blend(struct drawing *drawing, long x, long y, rgb color, float alpha) {
    struct image *image = &drawing->image;
    if (x < 0 || y < 0 || x >= (long)image->width || y >= (long)image->height || !(alpha > 0.0f))
        return;
    float *pixel = image->pixel + 3 * ((size_t)y * image->width + (size_t)x);
    pixel[0] += alpha * (color.r - pixel[0]);
    pixel[1] += alpha * (color.g - pixel[1]);
    pixel[2] += alpha * (color.b - pixel[2]);
}

/* A disc is a line of no length. */
void drawing_line(struct drawing *drawing, vec2 from, vec2 to, float width, rgb color, float alpha) {
    const struct image *image = &drawing->image;
    float reach = 0.5f * width + 1.0f;
    vec2 along = vec2_sub(to, from);
    float squared = along.x * along.x + along.y * along.y;
    float x0 = clampf(fminf(from.x, to.x) - reach, 0.0f, (float)image->width);
    float x1 = clampf(fmaxf(from.x, to.x) + reach, 0.0f, (float)image->width);
    float y0 = clampf(fminf(from.y, to.y) - reach, 0.0f, (float)image->height);
    float y1 = clampf(fmaxf(from.y, to.y) + reach, 0.0f, (float)image->height);
    for (long y = (long)y0; y < (long)y1 + 1; y++)
        for (long x = (long)x0; x < (long)x1 + 1; x++) {
            float dx = (float)x + 0.5f - from.x, dy = (float)y + 0.5f - from.y;
            float t = squared > 0.0f ? clampf((dx * along.x + dy * along.y) / squared, 0.0f, 1.0f) : 0.0f;
            float distance = hypotf(dx - t * along.x, dy - t * along.y);
            drawing_blend(drawing, x, y, color, alpha * clampf(0.5f * width + 0.5f - distance, 0.0f, 1.0f));
        }
}

void drawing_disc(struct drawing *drawing, vec2 centre, float radius, rgb color, float alpha) {
    drawing_line(drawing, centre, centre, 2.0f * radius, color, alpha);
}

enum status drawing_write(const struct drawing *drawing, const char *path, struct error *err) {
    return image_write_png(path, &drawing->image, 1.0f, err);
}
