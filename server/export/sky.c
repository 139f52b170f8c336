/* sky.c -- see sky.h. */
#include "server/export/sky.h"

#include <math.h>
#include <string.h>

#include "server/scene/latlong.h"

#define RING_PIXELS 2.0 /* width of what is taken for the sky around the sun; rows of the map */

void sky_without_sun(const struct export_input *in, struct image *sky) {
    const struct image *map = in->environment;
    /* The sun is drawn a pixel wide at least, and reaches into every pixel that it touches (sun_draw). */
    double row = PI / (double)(map->height - 1);
    double inner = fmax((double)in->sun.radius_rad, row) + 1.5 * row, outer = inner + RING_PIXELS * row;
    float inside = (float)cos(inner), around = (float)cos(outer);
    double sum[3] = {0.0, 0.0, 0.0}, weight = 0.0;
    image_init_rgb(sky, map->width, map->height);
    memcpy(sky->pixel, map->pixel, (size_t)map->width * map->height * 3 * sizeof *map->pixel);
    for (int pass = 0; pass < 2; pass++) {
        for (size_t i = 0; i < (size_t)map->width * map->height; i++) {
            uint32_t x = (uint32_t)(i % map->width), y = (uint32_t)(i / map->width);
            float cosine = vec3_dot(latlong_pixel(map->width, map->height, x, y), in->sun.direction);
            bool is_ring = pass == 0 && cosine >= around && cosine < inside;
            double angle = is_ring ? latlong_pixel_angle(map->width, map->height, y) : 0.0;
            weight += angle;
            for (int c = 0; c < 3; c++) {
                sum[c] += angle * (double)map->pixel[3 * i + (size_t)c];
                if (pass == 1 && cosine >= inside)
                    sky->pixel[3 * i + (size_t)c] = weight > 0.0 ? (float)(sum[c] / weight) : 0.0f;
            }
        }
    }
}
