/* environment_gather.c -- see environment_gather.h.
 *
 * Gathers rather than scatters: each direction of the map asks every photograph that may show it, at several points of
 * the pixel where the photograph is finer than the map. Observations are combined for each channel: the median, with
 * saturated values as lower bounds (censored.h), then the mean of the inliers. A photograph weighs by its exposure, the
 * precision of a photon count; weights by the value itself would favour noise that is too bright. */
#include "server/capture/distant/environment_gather.h"

#include <math.h>

#include "common/image_ceiling.h"
#include "common/mem.h"
#include "common/quantile.h"
#include "server/capture/censored.h"
#include "server/capture/distant/environment_bounds.h"
#include "server/scene/latlong.h"

/* Metres: distance of a point that every camera of a room sees in the same direction; +25 %: no change. */
#define FAR_M 1e6f /* +25 %: no change */
/* Sample points along each side of a pixel of the map, at most. Photographs at most four times as fine as the map are
 * averaged whole; the map is finer than half the median photograph, so few are finer. */
#define MAX_GRID 4 /* +25 %: no change */
/* Weight of a look-up within a pixel of the opening's rim, where slightly wrong poses mix light and frame: one off the
 * rim outweighs ten on it. */
#define RIM_WEIGHT 0.1f /* +25 %: no change */
/* Outliers: standard deviations from the median. Normal errors are beyond in one of 370. */
#define OUTLIER_DEVIATIONS 3.0f /* +25 %: no change */
/* Least standard deviation, as a share of the median: when two photographs agree by chance, a third that differs by
 * less than .15 is no outlier. */
#define MIN_DEVIATION 0.05f /* +25 %: no change */

/* A photograph with open pixels. */
struct window {
    uint32_t train;
    size_t pixel_count; /* open pixels */
    vec3 axis;          /* a cone around their directions */
    float cosine;
    size_t rim_count; /* pixels beside open ones in a row that show surface, and the sum of their distances */
    double rim_m;
    int grid; /* sample points along each side of a pixel of the map */
};

struct environment_windows {
    const struct views *views;
    struct environment *e;
    size_t window_count;
    struct window *window;    /* [window_count] */
    struct censored *scratch; /* [threads][3][window_count] observations of one direction */
    struct environment_ceiling ceiling;
};

/* --- photographs with open pixels ------------------------------------------------------------ */

/* Whether it lies beside an open pixel of its row. */
static bool is_rim(const struct views *v, size_t train, uint32_t x, uint32_t y, uint32_t width) {
    const uint8_t *row = v->shows[train] + (size_t)y * width;
    return row[x] != VIEWS_OPEN && ((x > 0 && row[x - 1] == VIEWS_OPEN) || (x + 1 < width && row[x + 1] == VIEWS_OPEN));
}

static void add_rim(struct window *w, const struct views *v, const struct camera *camera, uint32_t x, uint32_t y) {
    struct accel_hit hit;
    vec3 direction;
    if (!camera_direction(camera, (float)x + 0.5f, (float)y + 0.5f, &direction) ||
        !accel_intersect(v->accel, camera_origin(camera), direction, 0.0f, INFINITY, &hit))
        return;
    w->rim_m += (double)hit.distance_m;
    w->rim_count++;
}

static void find_window(void *user, size_t train, int thread) {
    (void)thread;
    struct environment_windows *g = user;
    struct window *w = &g->window[train];
    const struct views *v = g->views;
    const struct camera *camera = &v->scene->photograph[v->train[train]].camera;
    *w = (struct window){.train = (uint32_t)train, .cosine = 1.0f};
    vec3 direction;
    for (int pass = 0; pass < 2; pass++) {
        for (uint32_t y = 0; y < camera->height; y++) {
            views_use(v, (uint32_t)train, (size_t)y * camera->width, camera->width);
            for (uint32_t x = 0; x < camera->width; x++) {
                if (pass == 0 && is_rim(v, train, x, y, camera->width))
                    add_rim(w, v, camera, x, y);
                if (v->shows[train][(size_t)y * camera->width + x] != VIEWS_OPEN ||
                    !camera_direction(camera, (float)x + 0.5f, (float)y + 0.5f, &direction))
                    continue;
                w->pixel_count += pass == 0;
                if (pass == 0)
                    w->axis = vec3_add(w->axis, direction);
                else
                    w->cosine = fminf(w->cosine, vec3_dot(w->axis, direction));
            }
        }
        w->axis = vec3_normalize(w->axis);
    }
    /* Plus two pixels: their own extent. */
    float angle = acosf(clampf(w->cosine, -1.0f, 1.0f)) + 2.0f / camera->fx;
    w->cosine = angle < (float)PI ? cosf(angle) : -1.0f;
}

static const struct camera *camera_of(const struct environment_windows *g, const struct window *w) {
    return &g->views->scene->photograph[g->views->train[w->train]].camera;
}

/* Angle under which a length at the rims of openings appears, at their mean distance. */
static float angle_at_rims(const struct environment_windows *g, float length_m) {
    double distance_m = 0.0, count = 0.0;
    for (size_t i = 0; i < g->window_count; i++) {
        distance_m += g->window[i].rim_m;
        count += (double)g->window[i].rim_count;
    }
    return distance_m > 0.0 ? length_m * (float)(count / distance_m) : 0.0f;
}

/* Keeps the photographs with open pixels and returns the width of the map; 0: there are none. */
static uint32_t find_windows(struct environment_windows *g, struct parallel *pool) {
    size_t train_count = g->views->train_count;
    g->window = mem_calloc(train_count + 1, sizeof *g->window);
    parallel_for(pool, train_count, find_window, g);
    float *focal = mem_array(train_count + 1, sizeof *focal);
    for (size_t t = 0; t < train_count; t++) {
        if (g->window[t].pixel_count == 0)
            continue;
        g->window[g->window_count] = g->window[t];
        focal[g->window_count] = camera_of(g, &g->window[g->window_count])->fx;
        g->window_count++;
    }
    float wanted = 2.0f * (float)PI * quantile(focal, g->window_count, 0.5);
    mem_free(focal);
    if (g->window_count == 0)
        return 0;
    uint32_t width = ENVIRONMENT_MIN_WIDTH;
    while (2 * width <= ENVIRONMENT_MAX_WIDTH && (float)(2 * width) <= wanted)
        width *= 2;
    for (size_t i = 0; i < g->window_count; i++) {
        float pixels = 2.0f * (float)PI * camera_of(g, &g->window[i])->fx / (float)width;
        g->window[i].grid = (int)clampf(ceilf(pixels - 0.5f), 1.0f, MAX_GRID);
    }
    return width;
}

/* --- combining observations ----------------------------------------------------------------------- */

/* The mean of the inliers about the median. Sorts the values. */
static float combine(struct censored *value, size_t count, bool *is_bound) {
    float median = censored_quantile(value, count, 0.5f, is_bound);
    if (*is_bound || count < 3)
        return median;
    /* Median absolute deviation: removes the farthest values until half of the weight is left. */
    size_t first = 0, end = count;
    float half = 0.0f, removed = 0.0f, deviation = 0.0f, weight = 0.0f, sum = 0.0f;
    for (size_t i = 0; i < count; i++)
        half += value[i].is_bound ? 0.0f : 0.5f * value[i].weight;
    while (first < end && removed < half) {
        bool take_low = median - value[first].value > value[end - 1].value - median;
        const struct censored *far = &value[take_low ? first++ : --end];
        removed += far->is_bound ? 0.0f : far->weight;
        deviation = fabsf(far->value - median);
    }
    float limit =
        OUTLIER_DEVIATIONS * fmaxf((float)QUANTILE_DEVIATIONS_PER_MAD * deviation, MIN_DEVIATION * fabsf(median));
    for (size_t i = 0; i < count; i++) {
        if (value[i].is_bound || fabsf(value[i].value - median) > limit)
            continue;
        weight += value[i].weight;
        sum += value[i].weight * value[i].value;
    }
    return weight > 0.0f ? sum / weight : median;
}

/* A pixel of the map: direction of its centre, and its extent along row and column. */
struct cell {
    vec3 centre, along, down;
};

static struct cell cell_at(const struct image *map, size_t column, size_t row) {
    uint32_t w = map->width, h = map->height;
    double x = (double)column, y = (double)row;
    return (struct cell){
        .centre = latlong_pixel(w, h, x, y),
        .along = vec3_sub(latlong_pixel(w, h, x + 0.5, y), latlong_pixel(w, h, x - 0.5, y)),
        .down = vec3_sub(latlong_pixel(w, h, x, y + 0.5), latlong_pixel(w, h, x, y - 0.5)),
    };
}

/* The radiance up to which a photograph measures. */
static float ceiling_of(const struct photograph *photo, const struct photograph_sample *sample) {
    float least = fminf(sample->clip_radiance.r, fminf(sample->clip_radiance.g, sample->clip_radiance.b));
    return fminf(least, IMAGE_HALF_LARGEST / photo->exposure);
}

/* A photograph's observation of a pixel, for each channel, and the radiance up to which it measures; false: none. */
static bool sample_window(const struct environment_windows *g, const struct window *w, const struct cell *cell,
                          struct censored value[3], float *ceiling) {
    const struct views *v = g->views;
    const struct photograph *photo = &v->scene->photograph[v->train[w->train]];
    vec3 origin = camera_origin(&photo->camera);
    float sum[3] = {0}, tap_weight_sum = 0.0f;
    bool saturated[3] = {false, false, false};
    for (int i = 0; i < w->grid * w->grid; i++) {
        float dx = ((float)(i % w->grid) + 0.5f) / (float)w->grid - 0.5f;
        float dy = ((float)(i / w->grid) + 0.5f) / (float)w->grid - 0.5f;
        vec3 direction = vec3_mad(vec3_mad(cell->centre, dx, cell->along), dy, cell->down);
        vec3 far = vec3_mad(origin, FAR_M, direction);
        float x, y, depth_m;
        struct photograph_sample sample;
        if (!camera_project(&photo->camera, far, &x, &y, &depth_m) || !views_open(v, w->train, x, y, 0) ||
            !photograph_sample(photo, x, y, &sample))
            continue;
        float tap_weight = views_open(v, w->train, x, y, 1) ? 1.0f : RIM_WEIGHT;
        *ceiling = ceiling_of(photo, &sample);
        const float radiance[3] = {sample.radiance.r, sample.radiance.g, sample.radiance.b};
        for (int c = 0; c < 3; c++) {
            sum[c] += tap_weight * radiance[c];
            saturated[c] |= sample.saturated[c];
        }
        tap_weight_sum += tap_weight;
    }
    float weight = photo->exposure * tap_weight_sum / (float)(w->grid * w->grid);
    for (int c = 0; c < 3 && tap_weight_sum > 0.0f; c++)
        value[c] = (struct censored){sum[c] / tap_weight_sum, weight, saturated[c]};
    return tap_weight_sum > 0.0f;
}

/* Running sums for the standard deviation of the logarithm of the channels' mean. */
struct environment_spread {
    double count, sum, square;
};

static void spread_add(struct environment_spread *s, const struct censored value[3]) {
    float mean = (value[0].value + value[1].value + value[2].value) / 3.0f;
    if (value[0].is_bound || value[1].is_bound || value[2].is_bound || !(mean > 0.0f))
        return;
    double x = log((double)mean);
    s->count += 1.0;
    s->sum += x;
    s->square += x * x;
}

static float spread_of(const struct environment_spread *s) {
    double squares = s->count > 1.0 ? s->square - s->sum * s->sum / s->count : 0.0;
    return squares > 0.0 ? (float)sqrt(squares / (s->count - 1.0)) : 0.0f;
}

static void gather_cell(struct environment_windows *g, size_t column, size_t row, struct censored *scratch) {
    struct environment *e = g->e;
    size_t count = 0, at = row * e->map.width + column;
    struct cell cell = cell_at(&e->map, column, row);
    struct environment_spread spread = {0};
    for (size_t i = 0; i < g->window_count; i++) {
        const struct window *w = &g->window[i];
        struct censored value[3];
        float ceiling = 0.0f;
        if (vec3_dot(cell.centre, w->axis) < w->cosine || !sample_window(g, w, &cell, value, &ceiling))
            continue;
        g->ceiling.radiance[at] = fmaxf(g->ceiling.radiance[at], ceiling);
        for (size_t c = 0; c < 3; c++)
            scratch[c * g->window_count + count] = value[c];
        spread_add(&spread, value);
        count++;
    }
    if (count == 0)
        return;
    for (size_t c = 0; c < 3; c++) {
        bool is_bound;
        e->map.pixel[3 * at + c] = fmaxf(combine(scratch + c * g->window_count, count, &is_bound), 0.0f);
        g->ceiling.bound_channels[at] |= (uint8_t)(is_bound << c);
    }
    e->confidence.pixel[2 * at] = (float)count;
    e->confidence.pixel[2 * at + 1] = spread_of(&spread);
    e->is_bound[at] = g->ceiling.bound_channels[at] != 0;
}

static void gather_row(void *user, size_t row, int thread) {
    struct environment_windows *g = user;
    for (size_t column = 0; column < g->e->map.width; column++)
        gather_cell(g, column, row, g->scratch + (size_t)thread * 3 * g->window_count);
}

/* A pole is one direction: all its columns get the mean of those seen. */
static void join_pole(struct environment *e, size_t row) {
    size_t width = e->map.width, seen = 0;
    float *pixel = e->map.pixel + 3 * row * width, *confidence = e->confidence.pixel + 2 * row * width;
    double sum[3] = {0}, count = 0.0;
    for (size_t x = 0; x < width; x++) {
        if (confidence[2 * x] == 0.0f)
            continue;
        seen++;
        count = fmax(count, (double)confidence[2 * x]);
        for (size_t c = 0; c < 3; c++)
            sum[c] += (double)pixel[3 * x + c];
    }
    for (size_t x = 0; x < width && seen > 0; x++) {
        confidence[2 * x] = (float)count;
        for (size_t c = 0; c < 3; c++)
            pixel[3 * x + c] = (float)(sum[c] / (double)seen);
    }
}

/* --- the whole ---------------------------------------------------------------------------------- */

bool environment_gather(struct environment *e, const struct views *views, float edge_m, struct parallel *pool) {
    struct environment_windows g = {.views = views, .e = e};
    bool any = false;
    *e = (struct environment){0};
    uint32_t width = find_windows(&g, pool);
    if (width > 0) {
        environment_make_empty(e, width);
        e->rim_angle = angle_at_rims(&g, edge_m);
        g.scratch = mem_array((size_t)parallel_thread_count(pool) * 3 * g.window_count, sizeof *g.scratch);
        g.ceiling.radiance = mem_calloc(environment_pixel_count(e), sizeof *g.ceiling.radiance);
        g.ceiling.bound_channels = mem_calloc(environment_pixel_count(e), sizeof *g.ceiling.bound_channels);
        parallel_for(pool, e->map.height, gather_row, &g);
        join_pole(e, 0);
        join_pole(e, e->map.height - 1);
        environment_tell_bounds(e, &g.ceiling);
        for (size_t i = 0; i < environment_pixel_count(e) && !any; i++)
            any = environment_pixel_is_seen(e, i); /* open pixels may all be masked */
    }
    if (any) {
        environment_fill(e);
        environment_update_figures(e);
        e->photograph_count = g.window_count;
    } else {
        environment_release(e);
    }
    mem_free(g.ceiling.radiance);
    mem_free(g.ceiling.bound_channels);
    mem_free(g.scratch);
    mem_free(g.window);
    return any;
}
