/* pyramid.h: pictures that are smaller than the coarsest level has pixels to halve. */
#include "server/capture/pyramid.h"

#include <math.h>

#include "common/mem.h"
#include "server/scene/rgb_half.h"
#include "tests/check.h"

/* Of a picture of one brightness every level that has pixels shows that, and the others nothing. */
static void test_small(uint32_t width, uint32_t height) {
    struct photograph photo = {.gain = {1, 1, 1}, .exposure = 1.0f, .clip = INFINITY};
    struct pyramid pyramid;
    photo.camera.width = width;
    photo.camera.height = height;
    photo.pixel = mem_array((size_t)width * height, sizeof *photo.pixel);
    for (size_t i = 0; i < (size_t)width * height; i++)
        rgb_to_half(photo.pixel[i], rgb_gray(0.5f));
    pyramid_make(&pyramid, &photo, NULL, (size_t)width * height, 0.1f);
    for (int level = 0; level < PYRAMID_LEVELS; level++) {
        bool any = width >> level > 0 && height >> level > 0;
        float value = pyramid_value(&pyramid, level, 0.5f * (float)width, 0.5f * (float)height);
        CHECK(pyramid.width[level] == width >> level && pyramid.height[level] == height >> level);
        CHECK_THAT(isnan(value) || (any && fabsf(value - logf(0.6f)) < 1e-3f), "%u x %u, level %d: %g", width, height,
                   level, (double)value);
    }
    pyramid_release(&pyramid);
    mem_free(photo.pixel);
}

int main(void) {
    for (uint32_t width = 1; width < 20; width++)
        for (uint32_t height = 1; height < 20; height++)
            test_small(width, height);
    return check_result();
}
