/* held_out_size.c -- see held_out_size.h. */
#include "server/state/held_out_size.h"

#include "server/scene/photograph_reduce.h"

static double pixels_of(const struct scene *scene, bool held_out_only) {
    double pixels = 0.0;
    for (size_t i = 0; i < scene->photograph_count; i++) {
        const struct photograph *photo = &scene->photograph[i];
        uint32_t step = camera_step(&photo->camera);
        if (photo->is_test || !held_out_only)
            pixels += (double)(photo->camera.width / step) * (double)(photo->camera.height / step);
    }
    return pixels;
}

double held_out_pixels(const struct scene *scene) { return pixels_of(scene, true); }

double held_out_pixels_of_all(const struct scene *scene) { return pixels_of(scene, false); }
