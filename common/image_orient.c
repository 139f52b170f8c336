/* image_orient.c -- turns a picture as its EXIF orientation says (CIPA DC-008, 4.6.5.1). */
#include <string.h>

#include "common/image.h"
#include "common/mem.h"

/* Place in the stored picture, width x height, of pixel (x, y) of the upright one. */
static size_t stored_place(int orientation, size_t width, size_t height, size_t x, size_t y) {
    switch (orientation) {
    case 2: return y * width + (width - 1 - x);
    case 3: return (height - 1 - y) * width + (width - 1 - x);
    case 4: return (height - 1 - y) * width + x;
    case 5: return x * width + y;
    case 6: return (height - 1 - x) * width + y;
    case 7: return (height - 1 - x) * width + (width - 1 - y);
    case 8: return x * width + (width - 1 - y);
    default: return y * width + x;
    }
}

void image_orient(struct image *image, int orientation) {
    size_t width = image->width, height = image->height, stride = image->channel_count;
    if (orientation <= 1 || orientation > 8)
        return;
    struct image upright = *image;
    if (image_orientation_swaps(orientation)) {
        upright.width = image->height;
        upright.height = image->width;
    }
    image_allocate(&upright);
    upright.clipped = image->clipped ? mem_alloc(width * height) : NULL;
    for (size_t y = 0, i = 0; y < upright.height; y++)
        for (size_t x = 0; x < upright.width; x++, i++) {
            size_t from = stored_place(orientation, width, height, x, y);
            memcpy(upright.pixel + i * stride, image->pixel + from * stride, stride * sizeof *upright.pixel);
            if (upright.clipped)
                upright.clipped[i] = image->clipped[from];
        }
    mem_free(image->pixel);
    mem_free(image->clipped);
    *image = upright; /* the channels' names are the same */
}
