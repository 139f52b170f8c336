/* environment_bounds.c -- see environment_bounds.h. */
#include "server/capture/distant/environment_bounds.h"

#include <math.h>
#include <string.h>

#include "common/mem.h"
#include "common/quantile.h"
#include "server/capture/distant/fill.h"

/* A photograph tells what lies beyond a bound if it saturates at so many times that; photographs of one exposure
 * saturate within less, by their gains and vignettes; +25 %: no change. */
#define TELLS 1.5f

/* Bounds of like level, at least 2^octave and less than twice that, in a half of the sphere. */
struct bounds {
    struct environment *e;
    const struct environment_ceiling *ceiling;
    const bool *was_bound, *is_known; /* [height][width] before anything was told; is_known: environment_known */
    size_t half;
    int octave;
    bool *is_telling; /* [height][width] */
};

/* The greatest lower bound among the channels of a pixel; 0 where none is one. */
static float bound_level(const struct environment *e, const struct environment_ceiling *ceiling, size_t pixel) {
    float level = 0.0f;
    for (size_t c = 0; c < 3; c++) {
        if (ceiling->bound_channels[pixel] >> c & 1)
            level = fmaxf(level, e->map.pixel[3 * pixel + c]);
    }
    return level;
}

static bool in_half(const struct bounds *b, size_t pixel) {
    return environment_half(environment_pixel_direction(b->e, pixel)) == b->half;
}

static bool is_of(const struct bounds *b, size_t pixel) {
    float level = b->was_bound[pixel] && in_half(b, pixel) ? bound_level(b->e, b->ceiling, pixel) : 0.0f;
    return level > 0.0f && (int)floorf(log2f(level)) == b->octave;
}

/* Which directions of the half tell what lies beyond the bounds; false: none. */
static bool find_telling(struct bounds *b) {
    float needed = TELLS * ldexpf(2.0f, b->octave);
    bool any = false;
    for (size_t i = 0; i < environment_pixel_count(b->e); i++) {
        b->is_telling[i] = b->is_known[i] && !b->was_bound[i] && b->ceiling->radiance[i] >= needed && in_half(b, i);
        any = any || b->is_telling[i];
    }
    return any;
}

/* Median, by channel, of the telling directions that are brighter than the bounds are in the mean; false: there are
 * none. */
static bool find_typical(const struct bounds *b, rgb *typical) {
    const struct environment *e = b->e;
    size_t cells = environment_pixel_count(e), bounds = 0, count = 0;
    float *value = mem_array(cells, sizeof *value);
    double sum = 0.0;
    for (size_t i = 0; i < cells; i++) {
        if (is_of(b, i))
            sum += (double)bound_level(e, b->ceiling, i), bounds++;
    }
    for (size_t c = 0; c < 3; c++) {
        count = 0;
        for (size_t i = 0; i < cells; i++) {
            if (b->is_telling[i] && (double)rgb_mean(environment_pixel_radiance(e, i)) * (double)bounds > sum)
                value[count++] = e->map.pixel[3 * i + c];
        }
        (&typical->r)[c] = count > 0 ? quantile(value, count, 0.5) : 0.0f;
    }
    mem_free(value);
    return count > 0;
}

static bool exceeds(const struct bounds *b, const struct image *continued, size_t pixel) {
    bool all = true;
    for (size_t c = 0; c < 3; c++) {
        bool is_bound = b->ceiling->bound_channels[pixel] >> c & 1;
        all = all && (!is_bound || continued->pixel[3 * pixel + c] > b->e->map.pixel[3 * pixel + c]);
    }
    return all;
}

static void make_typical(const struct bounds *b, size_t pixel, rgb typical) {
    float *p = b->e->map.pixel + 3 * pixel;
    for (size_t c = 0; c < 3; c++) {
        if (b->ceiling->bound_channels[pixel] >> c & 1)
            p[c] = fmaxf(p[c], (&typical.r)[c]);
    }
    b->e->is_bound[pixel] = false;
}

static void make_unseen(struct environment *e, size_t pixel) {
    e->is_bound[pixel] = false;
    e->confidence.pixel[2 * pixel] = e->confidence.pixel[2 * pixel + 1] = 0.0f;
}

static void tell(struct bounds *b) {
    struct environment *e = b->e;
    struct image continued;
    rgb typical;
    if (!find_telling(b))
        return;
    image_init_rgb(&continued, e->map.width, e->map.height);
    memcpy(continued.pixel, e->map.pixel, 3 * environment_pixel_count(e) * sizeof *continued.pixel);
    fill_sphere(&continued, b->is_telling);
    bool is_typical = find_typical(b, &typical);
    for (size_t i = 0; i < environment_pixel_count(e); i++) {
        if (!is_of(b, i))
            continue;
        if (exceeds(b, &continued, i))
            make_unseen(e, i);
        else if (is_typical)
            make_typical(b, i, typical);
    }
    image_release(&continued);
}

/* Of the bounds of a half the least and the greatest octave; the first is greater where there are none. */
static void find_octaves(const struct bounds *b, int *least, int *most) {
    *least = INT16_MAX, *most = INT16_MIN;
    for (size_t i = 0; i < environment_pixel_count(b->e); i++) {
        float level = b->was_bound[i] && in_half(b, i) ? bound_level(b->e, b->ceiling, i) : 0.0f;
        if (!(level > 0.0f))
            continue;
        int octave = (int)floorf(log2f(level));
        *least = octave < *least ? octave : *least;
        *most = octave > *most ? octave : *most;
    }
}

void environment_tell_bounds(struct environment *e, const struct environment_ceiling *ceiling) {
    size_t cells = environment_pixel_count(e);
    int least, most;
    bool *was_bound = mem_array(cells, sizeof *was_bound), *is_telling = mem_array(cells, sizeof *is_telling);
    bool *is_known = environment_known(e);
    struct bounds b = {e, ceiling, was_bound, is_known, 0, 0, is_telling};
    memcpy(was_bound, e->is_bound, cells * sizeof *was_bound);
    for (b.half = 0; b.half < ENVIRONMENT_HALVES; b.half++) {
        find_octaves(&b, &least, &most);
        for (b.octave = least; b.octave <= most; b.octave++)
            tell(&b);
    }
    mem_free(is_known);
    mem_free(is_telling);
    mem_free(was_bound);
}
