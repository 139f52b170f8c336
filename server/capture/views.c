/* views.c -- see views.h. */
#include "server/capture/views.h"

#include <math.h>

#include "common/image.h"
#include "common/mem.h"
#include "common/quantile.h"
#include "common/rng.h"
#include "server/capture/stratified.h"

/* Least cosine between normal and view at which a photograph is used: 84 degrees, where an error of the normal by 2
 * degrees, as scans have, changes the cosine by a third. */
#define MIN_COSINE 0.1f /* +25 %: 0 dB */
/* Light of other surfaces: pixels around a look-up that are searched for brighter ones, as far as the edge
 * distances of views_edge_weight reach; the ratio up to which these do not count, usual between two paints. */
#define MIXING_PIXELS 2.0f     /* +25 %: +0.02 dB */
#define MIXING_FREE_RATIO 2.0f /* +25 %: +0.02 dB */
/* bound of the relative variance: no more can have been added than is observed */
#define MAX_MIXING 1.0f /* +25 %: 0 dB */
/* Least observed radiance in ratios, as a share of the median: keeps them finite. */
#define DARK_SHARE 1e-3f /* +25 %: no change */

void views_use(const struct views *v, uint32_t train, size_t at, size_t count) {
    struct spill *spill = v->scene->spill;
    if (!spill_has_file(spill))
        return;
    spill_use(spill, v->shows[train] + at, count);
    spill_use(spill, v->edge[train] + at, count);
    spill_use(spill, v->owner[train] + at, count);
}

/* Those of the part of `rows` rows that lies in the picture. */
static void use_part(const struct views *v, uint32_t train, long column, long row, long columns, long rows) {
    const struct camera *camera = &v->scene->photograph[v->train[train]].camera;
    long left = column > 0 ? column : 0, right = column + columns;
    right = right < (long)camera->width ? right : (long)camera->width;
    for (long y = row > 0 ? row : 0; left < right && y < row + rows && y < (long)camera->height; y++)
        views_use(v, train, (size_t)(y * (long)camera->width + left), (size_t)(right - left));
}

void views_update_median(struct views *v) {
    const size_t per_photo = 4096; /* random pixels */
    float *value = mem_array(v->train_count * per_photo + 1, sizeof *value);
    size_t count = 0;
    for (size_t t = 0; t < v->train_count; t++) {
        const struct photograph *photo = &v->scene->photograph[v->train[t]];
        uint32_t w = photo->camera.width, h = photo->camera.height;
        for (size_t i = 0; i < per_photo; i++) {
            uint64_t bits = rng_key(t, i, 0);
            float x = (float)rng_below((uint32_t)bits, w) + 0.5f;
            float y = (float)rng_below((uint32_t)(bits >> 32), h) + 0.5f;
            struct photograph_sample sample;
            if (photograph_sample(photo, x, y, &sample))
                value[count++] = rgb_mean(sample.radiance);
        }
    }
    float median = quantile(value, count, 0.5);
    v->median_radiance = median > 0.0f ? median : 1.0f;
    mem_free(value);
}

void views_update_segments(struct views *v, const struct accel *accel, struct parallel *pool) {
    v->accel = accel;
    for (uint32_t t = 0; t < v->train_count; t++)
        views_update_edges(v, t, pool);
}

void views_init(struct views *v, const struct scene *scene, const struct segments *segments, const struct accel *accel,
                struct parallel *pool) {
    *v = (struct views){.scene = scene, .segments = segments, .accel = accel};
    v->train = mem_array(scene->photograph_count, sizeof *v->train);
    v->shows = mem_array(scene->photograph_count, sizeof *v->shows);
    v->edge = mem_array(scene->photograph_count, sizeof *v->edge);
    v->owner = mem_array(scene->photograph_count, sizeof *v->owner);
    for (size_t i = 0; i < scene->photograph_count; i++) {
        if (!scene->photograph[i].is_test)
            v->train[v->train_count++] = (uint32_t)i;
    }
    for (uint32_t t = 0; t < v->train_count; t++) {
        const struct camera *camera = &scene->photograph[v->train[t]].camera;
        v->shows[t] = spill_take(scene->spill, (size_t)camera->height * camera->width, 1);
        v->edge[t] = spill_take(scene->spill, (size_t)camera->height * camera->width, 1);
        v->owner[t] = spill_take(scene->spill, (size_t)camera->height * camera->width, 1);
        views_update_edges(v, t, pool);
    }
    views_update_median(v);
}

void views_release(struct views *v) {
    for (size_t t = 0; t < v->train_count; t++) {
        spill_give(v->scene->spill, v->shows[t]);
        spill_give(v->scene->spill, v->edge[t]);
        spill_give(v->scene->spill, v->owner[t]);
    }
    mem_free(v->shows);
    mem_free(v->edge);
    mem_free(v->owner);
    mem_free(v->train);
    *v = (struct views){0};
}

vec3 views_direction(const struct views *v, uint32_t train, vec3 point) {
    const struct camera *camera = &v->scene->photograph[v->train[train]].camera;
    return vec3_normalize(vec3_sub(camera_origin(camera), point));
}

bool views_faces(const struct views *v, uint32_t train, vec3 point, vec3 normal, struct view *view) {
    const struct photograph *photo = &v->scene->photograph[v->train[train]];
    const struct camera *camera = &photo->camera;
    vec3 to_camera = vec3_sub(camera_origin(camera), point);
    float squared = vec3_dot(to_camera, to_camera);
    float distance = sqrtf(squared);
    float cosine = vec3_dot(to_camera, normal);
    float depth_m;
    if (!(cosine > MIN_COSINE * distance) || !camera_project(camera, point, &view->x, &view->y, &depth_m))
        return false;
    view->train = train;
    view->weight = cosine / (squared * distance) * photograph_weight(photo);
    return true;
}

void views_weigh(const struct views *v, float texel_m2, struct view *view) {
    const struct camera *camera = &v->scene->photograph[v->train[view->train]].camera;
    view->weight /= 1.0f + view->weight * camera->fx * camera->fy * texel_m2;
}

bool views_unoccluded(const struct views *v, uint32_t train, vec3 point, vec3 normal) {
    vec3 to_camera = vec3_sub(camera_origin(&v->scene->photograph[v->train[train]].camera), point);
    float distance = vec3_length(to_camera);
    vec3 direction = vec3_scale(to_camera, 1.0f / distance);
    return !accel_occluded(v->accel, accel_offset(point, normal, direction), direction, 0.0f, distance);
}

bool views_sees(const struct views *v, uint32_t train, vec3 point, vec3 normal, struct view *view) {
    return views_faces(v, train, point, normal, view) && views_unoccluded(v, train, point, normal);
}

int views_edge(const struct views *v, const struct view *view, uint32_t triangle) {
    const struct camera *camera = &v->scene->photograph[v->train[view->train]].camera;
    const uint8_t *edge = v->edge[view->train], *owner = v->owner[view->train];
    uint8_t own = views_owner_mark(v->segments->of_triangle[triangle]);
    long x0 = (long)floorf(view->x - 0.5f), y0 = (long)floorf(view->y - 0.5f);
    int nearest = 0;
    if (spill_has_file(v->scene->spill))
        use_part(v, view->train, x0, y0, 2, 2);
    for (long y = y0; y < y0 + 2; y++) {
        for (long x = x0; x < x0 + 2; x++) {
            if (x < 0 || y < 0 || x >= (long)camera->width || y >= (long)camera->height)
                continue;
            size_t at = (size_t)(y * (long)camera->width + x);
            int here = owner[at] == own ? edge[at] : VIEWS_EDGE;
            nearest = here > nearest ? here : nearest;
        }
    }
    return nearest;
}

float views_edge_weight(const struct views *v, const struct view *view, uint32_t triangle) {
    /* By distance to the edge, 3 pixels and more first. From there on about as the inverse of the variances of
     * views_mixing, and less on the edge itself: such a look-up counts only where there are no others. */
    static const float trust[VIEWS_EDGE + 1] = {1.0f, 0.5f, 0.05f, 0.001f};
    return trust[views_edge(v, view, triangle)];
}

float views_mixing(const struct views *v, const struct view *view, uint32_t triangle, rgb observed) {
    /* By the same distances, squares of the share of light from beyond the edge: .03, .1, .5. The Gaussian of .9 pixels
     * of a sharp lens (calibrate_blur.c) has .01, .13, .5; scattered light adds to the first. */
    static const float variance[VIEWS_EDGE + 1] = {0.0f, 0.001f, 0.01f, 0.25f};
    int edge = views_edge(v, view, triangle);
    if (edge == 0)
        return 0.0f;
    float own = fmaxf(rgb_mean(observed), DARK_SHARE * v->median_radiance);
    struct photograph_ring ring =
        photograph_ring(&v->scene->photograph[v->train[view->train]], view->x, view->y, MIXING_PIXELS);
    float times = fmaxf(fmaxf(ring.brightest, own) / own * (1.0f / MIXING_FREE_RATIO), 1.0f);
    return fminf(variance[edge] * times * times, MAX_MIXING);
}

/* Whether all pixels of a look-up at (x, y), and those within `margin` of them, have class `wanted`. */
static bool all_show(const struct views *v, uint32_t train, float x, float y, int margin, uint8_t wanted) {
    const struct camera *camera = &v->scene->photograph[v->train[train]].camera;
    const uint8_t *shows = v->shows[train];
    long x0 = (long)floorf(x - 0.5f), y0 = (long)floorf(y - 0.5f);
    if (spill_has_file(v->scene->spill))
        use_part(v, train, x0 - margin, y0 - margin, 2 + 2 * margin, 2 + 2 * margin);
    for (long row = y0 - margin; row <= y0 + 1 + margin; row++) {
        for (long column = x0 - margin; column <= x0 + 1 + margin; column++) {
            if (column >= 0 && row >= 0 && column < (long)camera->width && row < (long)camera->height &&
                shows[row * (long)camera->width + column] != wanted)
                return false;
        }
    }
    return true;
}

bool views_clean(const struct views *v, const struct view *view) {
    return all_show(v, view->train, view->x, view->y, 0, VIEWS_SURFACE);
}

bool views_open(const struct views *v, uint32_t train, float x, float y, int margin) {
    return all_show(v, train, x, y, margin, VIEWS_OPEN);
}

size_t views_pick(const struct views *v, vec3 point, vec3 normal, uint32_t key, size_t max, struct view *view) {
    struct view unclean[VIEWS_PICK_MAX];
    size_t count = 0, unclean_count = 0;
    uint32_t cameras = (uint32_t)v->train_count;
    for (uint32_t i = 0; i < cameras && count < max; i++) {
        struct view seen;
        if (!views_sees(v, stratified_permute(i, cameras, key), point, normal, &seen))
            continue;
        if (views_clean(v, &seen))
            view[count++] = seen;
        else if (unclean_count < max)
            unclean[unclean_count++] = seen;
    }
    if (count > 0)
        return count;
    for (size_t i = 0; i < unclean_count; i++)
        view[i] = unclean[i];
    return unclean_count;
}
