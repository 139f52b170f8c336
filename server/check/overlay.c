/* overlay.c -- see overlay.h. */
#include "server/check/overlay.h"

#include <math.h>

#include "common/mem.h"
#include "common/quantile.h"
#include "server/scene/rgb_half.h"

#define RAYS_EVERY 2   /* pixels of the picture */
#define CREASE_REACH 3 /* rays on either side by which a crease is measured */
/* Relative bends of the inverse depth: of a step between neighbouring rays; of a crease over CREASE_REACH (a right
 * angle at two metres bends by some .03). They move drawings only. */
#define STEP_MIN 0.02f
#define CREASE_MIN 0.012f
#define BEND_OF_NOISE 6.0f /* and this many times the picture's median bend, which is the mesh's noise */
/* A mark belongs to a line where so many lie within so many rays, itself included. */
#define LINE_REACH 3
#define LINE_MIN 5

static const rgb edge_color = {0.0f, 0.9f, 0.35f}, miss_color = {1.0f, 0.02f, 0.1f};

struct depth_map {
    int width, height;
    float *inverse; /* [height][width] 1 / depth along the axis; 0: no surface; owned */
    float *edge;    /* [height][width] 1: an edge; owned */
};

static void trace_row(struct depth_map *map, int y, const struct camera *camera, const struct accel *accel,
                      struct accel_ray *ray, struct accel_hit *hit) {
    vec3 axis = {camera->world_from_camera.rotation[0][2], camera->world_from_camera.rotation[1][2],
                 camera->world_from_camera.rotation[2][2]};
    float v = ((float)y + 0.5f) / (float)map->height * (float)camera->height;
    for (int x = 0; x < map->width; x++) {
        float u = ((float)x + 0.5f) / (float)map->width * (float)camera->width;
        ray[x] = (struct accel_ray){camera_origin(camera), 0.0f, axis, INFINITY};
        if (!camera_direction(camera, u, v, &ray[x].direction))
            ray[x].far_m = 0.0f; /* meets nothing */
    }
    accel_intersect_many(accel, (size_t)map->width, ray, hit);
    for (int x = 0; x < map->width; x++) {
        float depth = hit[x].distance_m * fabsf(vec3_dot(axis, ray[x].direction));
        map->inverse[(size_t)y * (size_t)map->width + (size_t)x] =
            hit[x].triangle == ACCEL_NONE ? 0.0f : 1.0f / fmaxf(depth, 1e-12f);
    }
}

static void trace(struct depth_map *map, const struct camera *camera, const struct accel *accel) {
    struct accel_ray *ray = mem_array((size_t)map->width, sizeof *ray);
    struct accel_hit *hit = mem_array((size_t)map->width, sizeof *hit);
    for (int y = 0; y < map->height; y++)
        trace_row(map, y, camera, accel, ray, hit);
    mem_free(hit);
    mem_free(ray);
}

/* Relative bend of the inverse depth over `reach` rays on either side, along x or y; infinite where a surface ends. */
static float bend_at(const struct depth_map *map, int x, int y, bool along_x, int reach) {
    int dx = along_x ? reach : 0, dy = along_x ? 0 : reach;
    if (x < dx || y < dy || x + dx >= map->width || y + dy >= map->height)
        return 0.0f;
    const float *at = map->inverse + (ptrdiff_t)y * map->width + x;
    ptrdiff_t step = (ptrdiff_t)dy * map->width + dx;
    if (at[0] == 0.0f || at[-step] == 0.0f || at[step] == 0.0f)
        return at[0] == 0.0f && at[-step] == 0.0f && at[step] == 0.0f ? 0.0f : INFINITY;
    return fabsf(at[-step] - 2.0f * at[0] + at[step]) / at[0];
}

/* Of the finite bends. */
static float median_bend(const float *bend, size_t count) {
    float *sorted = mem_array(count / 7 + 2, sizeof *sorted);
    size_t kept = 0;
    for (size_t i = 0; i < count; i += 7)
        if (isfinite(bend[i]))
            sorted[kept++] = bend[i];
    float median = quantile(sorted, kept, 0.5);
    mem_free(sorted);
    return median;
}

/* Whether a bend is the strongest within `reach` rays along the axis; of equal ones the last. */
static bool is_strongest(const struct depth_map *map, const float *bend, size_t at, bool along_x, int reach) {
    int place = along_x ? (int)(at % (size_t)map->width) : (int)(at / (size_t)map->width);
    int side = along_x ? map->width : map->height, step = along_x ? 1 : map->width;
    for (int k = -reach; k <= reach; k++) {
        if (k == 0 || place + k < 0 || place + k >= side)
            continue;
        float other = bend[(ptrdiff_t)at + k * step];
        if (k < 0 ? bend[at] < other : bend[at] <= other)
            return false;
    }
    return true;
}

/* Marks the strongest bends over `reach` rays along an axis. `taken` [height][width]: marks of the other kind, near
 * which there are none. */
static void mark(struct depth_map *map, bool along_x, int reach, float least, const uint8_t *taken, float *bend,
                 uint8_t *marks) {
    size_t count = (size_t)map->width * (size_t)map->height;
    for (int y = 0; y < map->height; y++)
        for (int x = 0; x < map->width; x++)
            bend[(size_t)y * (size_t)map->width + (size_t)x] = bend_at(map, x, y, along_x, reach);
    least = fmaxf(least, BEND_OF_NOISE * median_bend(bend, count));
    int step = along_x ? 1 : map->width;
    for (size_t i = 0; i < count; i++) {
        bool is_free = bend[i] > least;
        for (int k = -reach; k <= reach && is_free && taken; k++) {
            ptrdiff_t near = (ptrdiff_t)i + k * step;
            is_free = near < 0 || near >= (ptrdiff_t)count || !taken[near];
        }
        marks[i] = is_free && is_strongest(map, bend, i, along_x, reach);
    }
}

/* Leaves out marks that stand alone, which are the mesh's noise. */
static void keep_lines(struct depth_map *map, const uint8_t *marks) {
    for (int y = LINE_REACH; y < map->height - LINE_REACH; y++)
        for (int x = LINE_REACH; x < map->width - LINE_REACH; x++) {
            size_t at = (size_t)y * (size_t)map->width + (size_t)x;
            int near = 0;
            for (int dy = -LINE_REACH; dy <= LINE_REACH && marks[at]; dy++)
                for (int dx = -LINE_REACH; dx <= LINE_REACH; dx++)
                    near += marks[(ptrdiff_t)at + (ptrdiff_t)dy * map->width + dx];
            if (near >= LINE_MIN)
                map->edge[at] = 1.0f;
        }
}

static void find_edges(struct depth_map *map) {
    size_t count = (size_t)map->width * (size_t)map->height;
    uint8_t *steps = mem_array(count, 1), *creases = mem_array(count, 1), *all = mem_calloc(count, 1);
    float *bend = mem_array(count, sizeof *bend);
    for (int axis = 0; axis < 2; axis++) {
        mark(map, axis == 0, 1, STEP_MIN, NULL, bend, steps);
        mark(map, axis == 0, CREASE_REACH, CREASE_MIN, steps, bend, creases);
        for (size_t i = 0; i < count; i++)
            all[i] |= steps[i] | creases[i];
    }
    keep_lines(map, all);
    mem_free(bend);
    mem_free(all);
    mem_free(creases);
    mem_free(steps);
}

/* Bilinear, smoothed over a ray's neighbours. */
static float smooth_edge(const struct depth_map *map, float x, float y) {
    int x0 = (int)floorf(x), y0 = (int)floorf(y);
    float sum = 0.0f;
    for (int at_y = y0 - 1; at_y <= y0 + 2; at_y++)
        for (int at_x = x0 - 1; at_x <= x0 + 2; at_x++) {
            if (at_x < 0 || at_y < 0 || at_x >= map->width || at_y >= map->height)
                continue;
            float edge = map->edge[(size_t)at_y * (size_t)map->width + (size_t)at_x];
            sum += edge * fmaxf(0.0f, 1.5f - fabsf(x - (float)at_x)) * fmaxf(0.0f, 1.5f - fabsf(y - (float)at_y));
        }
    return clampf(0.9f * sum - 0.35f, 0.0f, 1.0f);
}

/* --- the photograph ------------------------------------------------------------------------------------ */

static rgb photograph_pixel(const struct photograph *photo, float u, float v) {
    const struct camera *c = &photo->camera;
    float x = clampf(u * (float)c->width - 0.5f, 0.0f, (float)(c->width - 1));
    float y = clampf(v * (float)c->height - 0.5f, 0.0f, (float)(c->height - 1));
    uint32_t x0 = (uint32_t)x, y0 = (uint32_t)y, x1 = x0 + (x0 + 1 < c->width), y1 = y0 + (y0 + 1 < c->height);
    float fx = x - (float)x0, fy = y - (float)y0;
    photograph_use(photo, (size_t)y0 * c->width + x0, x1 - x0 + 1);
    photograph_use(photo, (size_t)y1 * c->width + x0, x1 - x0 + 1);
    rgb top = rgb_scale(rgb_from_half(photo->pixel[(size_t)y0 * c->width + x0]), 1.0f - fx);
    rgb bottom = rgb_scale(rgb_from_half(photo->pixel[(size_t)y1 * c->width + x0]), 1.0f - fx);
    top = rgb_mad(top, fx, rgb_from_half(photo->pixel[(size_t)y0 * c->width + x1]));
    bottom = rgb_mad(bottom, fx, rgb_from_half(photo->pixel[(size_t)y1 * c->width + x1]));
    return rgb_mad(rgb_scale(top, 1.0f - fy), fy, bottom);
}

/* Mean over a pixel of the drawing, of up to 2 x 2 places. */
static rgb mean_pixel(const struct photograph *photo, uint32_t x, uint32_t y, uint32_t width, uint32_t height) {
    int taps = photo->camera.width > width ? 2 : 1;
    rgb sum = {0};
    for (int i = 0; i < taps * taps; i++) {
        float u = ((float)x + ((float)(i % taps) + 0.5f) / (float)taps) / (float)width;
        float v = ((float)y + ((float)(i / taps) + 0.5f) / (float)taps) / (float)height;
        sum = rgb_add(sum, photograph_pixel(photo, u, v));
    }
    sum = rgb_scale(sum, 1.0f / (float)(taps * taps));
    return rgb_is_finite(sum) ? sum : rgb_gray(0.0f);
}

/* Brightens or darkens to a median of .18, which is middle grey. */
static void expose(struct image *image) {
    size_t count = (size_t)image->width * image->height;
    float *sorted = mem_array(count / 16 + 2, sizeof *sorted);
    size_t kept = 0;
    for (size_t i = 0; i < count; i += 16)
        sorted[kept++] = image->pixel[3 * i + 1];
    float median = quantile(sorted, kept, 0.5), factor = 0.18f / fmaxf(median, 1e-6f);
    for (size_t i = 0; i < 3 * count; i++)
        image->pixel[i] *= factor;
    mem_free(sorted);
}

/* In grey: the edges' colours stand out, and the file has half the size. */
static void draw_photograph(struct drawing *drawing, const struct photograph *photo) {
    struct image *image = &drawing->image;
    for (uint32_t y = 0; y < image->height; y++)
        for (uint32_t x = 0; x < image->width; x++) {
            rgb value = mean_pixel(photo, x, y, image->width, image->height);
            float *out = image->pixel + 3 * ((size_t)y * image->width + x);
            out[0] = out[1] = out[2] = rgb_luminance(value);
        }
    expose(image);
    for (size_t i = 0; i < 3 * (size_t)image->width * image->height; i++) /* colours over it stay visible */
        image->pixel[i] = fminf(image->pixel[i], 1.0f);
}

/* --- all of it -------------------------------------------------------------------------------------------- */

void overlay_draw(struct drawing *drawing, const struct photograph *photo, const struct camera *camera,
                  const struct accel *accel) {
    float side = (float)(camera->width > camera->height ? camera->width : camera->height);
    float size = fminf(OVERLAY_SIZE, OVERLAY_ENLARGED * side);
    uint32_t width = (uint32_t)fmaxf(1.0f, roundf(size * (float)camera->width / side));
    uint32_t height = (uint32_t)fmaxf(1.0f, roundf(size * (float)camera->height / side));
    struct depth_map map = {.width = (int)(width + 1) / RAYS_EVERY, .height = (int)(height + 1) / RAYS_EVERY};
    size_t count = (size_t)map.width * (size_t)map.height;
    map.inverse = mem_array(count, sizeof *map.inverse);
    map.edge = mem_calloc(count, sizeof *map.edge);
    trace(&map, camera, accel);
    find_edges(&map);
    drawing_init(drawing, width, height, rgb_gray(0.0f));
    draw_photograph(drawing, photo);
    for (uint32_t y = 0; y < height; y++)
        for (uint32_t x = 0; x < width; x++) {
            float at_x = ((float)x + 0.5f) / RAYS_EVERY - 0.5f, at_y = ((float)y + 0.5f) / RAYS_EVERY - 0.5f;
            int column = (int)clampf(at_x + 0.5f, 0.0f, (float)(map.width - 1));
            int row = (int)clampf(at_y + 0.5f, 0.0f, (float)(map.height - 1));
            if (map.inverse[(size_t)row * (size_t)map.width + (size_t)column] == 0.0f)
                drawing_blend(drawing, (long)x, (long)y, miss_color, 0.35f);
            drawing_blend(drawing, (long)x, (long)y, edge_color, smooth_edge(&map, at_x, at_y));
        }
    mem_free(map.edge);
    mem_free(map.inverse);
}
