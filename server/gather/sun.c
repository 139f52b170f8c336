/* sun.c -- see sun.h. */
#include "server/gather/sun.h"

#include <math.h>
#include <string.h>

#include "common/mem.h"
#include "server/render/bsdf.h"

/* Where the first rays agree no more are asked. */
#define FIRST_RAYS 5
#define ALL_RAYS 16
#define GOLDEN_ANGLE 2.39996323f
/* Places over a pixel of the map, along each side. */
#define GRID 8

/* In the disc, so far from its middle as a part of its radius. */
static vec3 disc_direction(const struct sun *sun, float angle, float part) {
    vec3 across, up;
    vec3_frame(sun->direction, &across, &up);
    float r = tanf(sun->radius_rad) * part;
    vec3 d = vec3_mad(sun->direction, r * cosf(angle), across);
    return vec3_normalize(vec3_mad(d, r * sinf(angle), up));
}

vec3 sun_toward(const struct sun *sun, vec2 u) {
    return disc_direction(sun, 2.0f * BSDF_PI * u.x, sqrtf(u.y));
}

/* Ray `i` of so many: a sunflower's seeds, evenly over the disc. */
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

float sun_visible(const struct sun *sun, const struct accel *accel, const struct surface_point *at, int rays) {
    if (!(vec3_dot(sun->direction, at->shading) > 0.0f) || !(vec3_dot(sun->direction, at->normal) > 0.0f))
        return 0.0f;
    if (rays > 0)
        return (float)count_open(sun, accel, at, rays) / (float)rays;
    int open = count_open(sun, accel, at, FIRST_RAYS);
    if (open == 0 || open == FIRST_RAYS)
        return open > 0 ? 1.0f : 0.0f;
    return (float)count_open(sun, accel, at, ALL_RAYS) / ALL_RAYS;
}

void sun_add_light(const struct sun *sun, const struct accel *accel, const struct surface_point *at,
                   struct irradiance *irradiance) {
    float visible = sun->is_there ? sun_visible(sun, accel, at, 0) : 0.0f;
    if (visible > 0.0f)
        irradiance_add(irradiance, at->shading, sun->direction, rgb_scale(sun->irradiance, visible));
}

/* --- the map -------------------------------------------------------------------------------------- */

/* Twice as many pixels along each side: each becomes four alike. */
static void refine_image(struct image *image) {
    struct image fine = {.width = 2 * image->width, .height = 2 * image->height,
                         .channel_count = image->channel_count, .channel = image->channel};
    size_t channels = image->channel_count;
    image_allocate(&fine);
    for (size_t y = 0; y < fine.height; y++) {
        for (size_t x = 0; x < fine.width; x++)
            memcpy(&fine.pixel[(y * fine.width + x) * channels],
                   &image->pixel[(y / 2 * image->width + x / 2) * channels], channels * sizeof *fine.pixel);
    }
    image->channel = NULL; /* moved */
    image_release(image);
    *image = fine;
}

/* The share of a pixel of the map that is within an angle of the sun's middle. */
static float covered(const struct image *map, size_t column, size_t row, vec3 middle, float cosine) {
    int inside = 0;
    for (int i = 0; i < GRID * GRID; i++) {
        float x = ((float)column + ((float)(i % GRID) + 0.5f) / GRID) / (float)map->width;
        float y = ((float)row + ((float)(i / GRID) + 0.5f) / GRID) / (float)map->height;
        float phi = 2.0f * BSDF_PI * x, theta = BSDF_PI * y;
        vec3 d = {sinf(theta) * sinf(phi), cosf(theta), -sinf(theta) * cosf(phi)};
        inside += vec3_dot(d, middle) > cosine;
    }
    return (float)inside / (GRID * GRID);
}

/* The sum over the map of what each pixel has of the disc, by solid angle; or, with `each`, that much of it is
 * added to every pixel. */
static double cover(struct image *map, vec3 middle, float radius_rad, const rgb *each) {
    double sum = 0.0;
    float cosine = cosf(radius_rad), reach = cosf(fminf(radius_rad + 3.0f * BSDF_PI / (float)map->height, BSDF_PI));
    for (size_t row = 0; row < map->height; row++) {
        double theta = (double)BSDF_PI * ((double)row + 0.5) / (double)map->height;
        double angle = sin(theta) * 2.0 * (double)(BSDF_PI * BSDF_PI) / (double)(map->width * map->height);
        for (size_t column = 0; column < map->width; column++) {
            float phi = 2.0f * BSDF_PI * ((float)column + 0.5f) / (float)map->width;
            vec3 d = {(float)sin(theta) * sinf(phi), (float)cos(theta), -(float)sin(theta) * cosf(phi)};
            float share = vec3_dot(d, middle) > reach ? covered(map, column, row, middle, cosine) : 0.0f;
            float *pixel = &map->pixel[(row * map->width + column) * map->channel_count];
            sum += angle * (double)share;
            for (size_t c = 0; each && c < 3; c++)
                pixel[c] += share * (&each->r)[c];
        }
    }
    return sum;
}

void sun_draw(const struct sun *sun, struct environment *e) {
    if (!sun->is_there)
        return;
    while (e->map.width < ENVIRONMENT_MAX_WIDTH && BSDF_PI / (float)e->map.height > sun->radius_rad) {
        refine_image(&e->map);
        refine_image(&e->confidence);
        mem_free(e->is_bound);
        e->is_bound = NULL;
    }
    /* Not narrower than a pixel, which it might slip through. */
    float radius = fmaxf(sun->radius_rad, BSDF_PI / (float)e->map.height);
    double angle = cover(&e->map, sun->direction, radius, NULL);
    rgb radiance = rgb_scale(sun->irradiance, 1.0f / (float)angle);
    cover(&e->map, sun->direction, radius, &radiance);
    environment_update_figures(e);
}
