/* sun.c -- see sun.h. */
#include "server/gather/sun.h"

#include <math.h>

#include "common/mem.h"
#include "server/render/bsdf.h"
#include "server/scene/latlong.h"

/* Shadow rays to the disc: the second set is traced only where the first is partly occluded (penumbra): a part
 * of the disc of less than a fifth may be missed, and is measured in steps of 5 % where it is not. */
#define PROBE_RAYS 5             /* to 6: no change */
#define PENUMBRA_RAYS 16         /* +25 %: no change */
#define GOLDEN_ANGLE 2.39996323f /* pi (3 - sqrt 5): Vogel's spiral covers the disc evenly */
/* Subpixels along each side of a pixel of the map, to rasterise the disc. Pixels are at most its radius wide
 * (sun_draw), so it covers 200 of them or more. */
#define SUBPIXELS 8 /* +25 %: no change */

/* Direction of a point in the disc; `part` is its distance from the middle over the radius. */
static vec3 disc_direction(const struct sun *sun, float angle, float part) {
    vec3 across, up;
    vec3_frame(sun->direction, &across, &up);
    float r = tanf(sun->radius_rad) * part;
    vec3 d = vec3_mad(sun->direction, r * cosf(angle), across);
    return vec3_normalize(vec3_mad(d, r * sinf(angle), up));
}

vec3 sun_sample(const struct sun *sun, vec2 u) { return disc_direction(sun, 2.0f * BSDF_PI * u.x, sqrtf(u.y)); }

/* Ray `i` of `rays`, on Vogel's spiral. */
static vec3 seed_direction(const struct sun *sun, int i, int rays) {
    return disc_direction(sun, GOLDEN_ANGLE * (float)i, rays == 1 ? 0.0f : sqrtf(((float)i + 0.5f) / (float)rays));
}

static int count_open(const struct sun *sun, const struct accel *accel, const struct surface_point *at, int rays) {
    int open = 0;
    for (int i = 0; i < rays; i++) {
        vec3 d = seed_direction(sun, i, rays);
        open += vec3_dot(d, at->normal) > 0.0f &&
                !accel_occluded(accel, accel_offset(at->position, at->normal, d), d, 0.0f, INFINITY);
    }
    return open;
}

float sun_visibility(const struct sun *sun, const struct accel *accel, const struct surface_point *at, int rays) {
    if (!(vec3_dot(sun->direction, at->shading) > 0.0f) || !(vec3_dot(sun->direction, at->normal) > 0.0f))
        return 0.0f;
    if (rays > 0)
        return (float)count_open(sun, accel, at, rays) / (float)rays;
    int open = count_open(sun, accel, at, PROBE_RAYS);
    if (open == 0 || open == PROBE_RAYS)
        return open > 0 ? 1.0f : 0.0f;
    return (float)count_open(sun, accel, at, PENUMBRA_RAYS) / PENUMBRA_RAYS;
}

void sun_add_light(const struct sun *sun, const struct accel *accel, const struct surface_point *at,
                   struct irradiance *irradiance) {
    float visible = sun->is_there ? sun_visibility(sun, accel, at, 0) : 0.0f;
    if (visible > 0.0f)
        irradiance_add(irradiance, at->shading, sun->direction, rgb_scale(sun->irradiance, visible));
}

/* --- the map -------------------------------------------------------------------------------------- */

/* Doubles the resolution, by bilinear interpolation or, with `nearest`, by the nearest pixel. */
static void refine_image(struct image *image, bool nearest) {
    struct image fine = {.width = 2 * image->width,
                         .height = 2 * image->height,
                         .channel_count = image->channel_count,
                         .channel = image->channel};
    size_t channels = image->channel_count, stride = image->width * channels;
    image_allocate(&fine);
    for (uint32_t row = 0; row < fine.height; row++) {
        for (uint32_t column = 0; column < fine.width; column++) {
            float x, y;
            latlong_place(image->width, image->height, latlong_pixel(fine.width, fine.height, column, row), &x, &y);
            float fx = x - floorf(x), fy = y - floorf(y);
            if (nearest)
                fx = roundf(fx), fy = roundf(fy);
            size_t left = (size_t)x, right = (left + 1) % image->width;
            const float *top = image->pixel + (size_t)y * stride, *low = top + stride;
            for (size_t c = 0; c < channels; c++) {
                float above = (1.0f - fx) * top[left * channels + c] + fx * top[right * channels + c];
                float below = (1.0f - fx) * low[left * channels + c] + fx * low[right * channels + c];
                fine.pixel[((size_t)row * fine.width + column) * channels + c] = (1.0f - fy) * above + fy * below;
            }
        }
    }
    image->channel = NULL; /* moved */
    image_release(image);
    *image = fine;
}

/* Coverage of a pixel of the map by a cone around `middle`. */
static float covered(const struct image *map, uint32_t column, uint32_t row, vec3 middle, float cosine) {
    int inside = 0;
    for (int i = 0; i < SUBPIXELS * SUBPIXELS; i++) {
        double x = column + (i % SUBPIXELS + 0.5) / SUBPIXELS - 0.5, y = row + (i / SUBPIXELS + 0.5) / SUBPIXELS - 0.5;
        inside += vec3_dot(latlong_pixel(map->width, map->height, x, y), middle) > cosine;
    }
    return (float)inside / (SUBPIXELS * SUBPIXELS);
}

/* Coverage of the pixels of a row by the disc; pixels of a pole are one direction and share their mean. */
static void cover_row(const struct image *map, uint32_t row, vec3 middle, float radius_rad, float *share) {
    uint32_t width = map->width, height = map->height;
    float cosine = cosf(radius_rad), reach = cosf(fminf(radius_rad + 3.0f * BSDF_PI / (float)height, BSDF_PI));
    double sum = 0.0;
    for (uint32_t x = 0; x < width; x++) {
        bool near = vec3_dot(latlong_pixel(width, height, x, row), middle) > reach;
        share[x] = near ? covered(map, x, row, middle, cosine) : 0.0f;
        sum += (double)share[x];
    }
    for (uint32_t x = 0; x < width && (row == 0 || row + 1 == height); x++)
        share[x] = (float)(sum / width);
}

/* Solid angle of the map that the disc covers; with `each`, adds coverage times `each` to every pixel. */
static double cover(struct image *map, vec3 middle, float radius_rad, const rgb *each) {
    double sum = 0.0;
    float *share = mem_array(map->width, sizeof *share);
    for (uint32_t row = 0; row < map->height; row++) {
        double angle = latlong_pixel_angle(map->width, map->height, row);
        cover_row(map, row, middle, radius_rad, share);
        for (uint32_t column = 0; column < map->width; column++) {
            float *pixel = &map->pixel[((size_t)row * map->width + column) * map->channel_count];
            sum += angle * (double)share[column];
            for (size_t c = 0; each && c < 3; c++)
                pixel[c] += share[column] * (&each->r)[c];
        }
    }
    mem_free(share);
    return sum;
}

void sun_draw(const struct sun *sun, struct environment *e) {
    if (!sun->is_there)
        return;
    while (e->map.width < ENVIRONMENT_MAX_WIDTH && BSDF_PI / (float)e->map.height > sun->radius_rad) {
        refine_image(&e->map, false);
        refine_image(&e->confidence, true);
        mem_free(e->is_bound);
        e->is_bound = NULL;
    }
    /* At least a pixel wide, so that no subpixel pattern misses it. */
    float radius = fmaxf(sun->radius_rad, BSDF_PI / (float)e->map.height);
    double angle = cover(&e->map, sun->direction, radius, NULL);
    rgb radiance = rgb_scale(sun->irradiance, 1.0f / (float)angle);
    cover(&e->map, sun->direction, radius, &radiance);
    environment_update_figures(e);
}
