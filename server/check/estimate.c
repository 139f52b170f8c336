/* estimate.c -- see estimate.h. */
#include "server/check/estimate.h"

#include <math.h>

#include "common/spill.h"
#include "server/scene/photograph_reduce.h"
#include "server/state/pace.h"

#define MIB 1048576.0           /* bytes */
#define BASE_BYTES (40.0 * MIB) /* program and libraries */
#define TRIANGLE_BYTES 200.0    /* mesh, acceleration structure, adjacency, charts */
#define UV_BYTES 24.0           /* of a triangle of a mesh with texture coordinates */
#define PIXEL_BYTES 25.0        /* 11 to 13 of a photograph with what is found of it, 14 while detail is solved */

/* Of which `most` may be kept, 0: all. */
static double pixels_of(const struct photograph *photo, double most) {
    struct camera camera = photograph_file_camera(photo);
    uint32_t step = camera_step_to(&camera, most);
    return (double)(camera.width / step) * (double)(camera.height / step);
}

double estimate_memory_bytes(const struct scene *scene, double kept, double side) {
    double pixels = 0.0;
    for (size_t i = 0; i < scene->photograph_count; i++)
        pixels += pixels_of(&scene->photograph[i], kept);
    double pixel_bytes = PIXEL_BYTES * pixels;
    if (scene->spill)
        pixel_bytes = fmin(pixel_bytes, (double)spill_memory_bytes(scene->spill));
    return BASE_BYTES + pixel_bytes +
           (TRIANGLE_BYTES + (scene->mesh.uv ? UV_BYTES : 0.0)) * (double)scene->mesh.triangle_count +
           ESTIMATE_TEXEL_BYTES * side * side;
}

double estimate_time_sec(const struct scene *scene, const struct settings *settings, struct parallel *pool) {
    double limit = settings_number(settings, "time_limit_sec"), sec = pace_forecast_sec(scene, settings, pool);
    return limit > 0.0 ? fmin(limit, sec) : sec;
}
