/* exposure_chart.c -- see exposure_chart.h. */
#include "server/check/exposure_chart.h"

#include <math.h>

#include "common/mem.h"
#include "common/quantile.h"

#define WIDTH 800 /* pixels, as the next two */
#define HEIGHT 240
#define MARGIN 20.0f
#define STOPS_MIN 2.0 /* shown above and below the middle */

static const rgb paper = {0.93f, 0.93f, 0.92f}, grid_color = {0.75f, 0.75f, 0.75f}, given_color = {0.85f, 0.12f, 0.03f},
                 dot_color = {0.01f, 0.10f, 0.75f};

/* Stops above the median; NAN where there is no value. Returns the distance from the smallest to the largest. */
static double to_stops(double *value, size_t count) {
    double *sorted = mem_array(count + 1, sizeof *sorted), range = 0.0;
    size_t kept = 0;
    for (size_t i = 0; i < count; i++) {
        value[i] = value[i] > 0.0 && isfinite(value[i]) ? log2(value[i]) : (double)NAN;
        if (isfinite(value[i]))
            sorted[kept++] = value[i];
    }
    double middle = quantile_double(sorted, kept, 0.5);
    if (kept > 0)
        range = sorted[kept - 1] - sorted[0];
    for (size_t i = 0; i < count; i++)
        value[i] -= middle;
    mem_free(sorted);
    return range;
}

static vec2 place(size_t frame, size_t count, double stops, double reach) {
    float x = MARGIN + (WIDTH - 2.0f * MARGIN) * ((float)frame + 0.5f) / (float)count;
    return vec2_make(x, 0.5f * HEIGHT - (0.5f * HEIGHT - MARGIN) * (float)(stops / reach));
}

struct exposure_range exposure_chart_draw(struct drawing *drawing, const struct scene *scene, const float *brightness) {
    size_t count = scene->photograph_count;
    double *dot = mem_array(count + 1, sizeof *dot), *given = mem_array(count + 1, sizeof *given), reach = STOPS_MIN;
    for (size_t i = 0; i < count; i++) {
        dot[i] = (double)brightness[i];
        given[i] = scene->photograph[i].exposure_known ? (double)scene->photograph[i].exposure : 0.0;
    }
    struct exposure_range range = {to_stops(dot, count), to_stops(given, count)};
    for (size_t i = 0; i < count; i++)
        reach = fmax(reach, fmax(isfinite(dot[i]) ? fabs(dot[i]) : 0.0, isfinite(given[i]) ? fabs(given[i]) : 0.0));
    drawing_init(drawing, WIDTH, HEIGHT, paper);
    for (int stop = -(int)reach; stop <= (int)reach; stop++) {
        float y = place(0, count, stop, reach).y;
        drawing_line(drawing, vec2_make(MARGIN, y), vec2_make(WIDTH - MARGIN, y), stop == 0 ? 2.0f : 1.0f, grid_color,
                     1.0f);
    }
    for (size_t i = 1; i < count; i++)
        if (isfinite(given[i]) && isfinite(given[i - 1]))
            drawing_line(drawing, place(i - 1, count, given[i - 1], reach), place(i, count, given[i], reach), 1.5f,
                         given_color, 0.9f);
    for (size_t i = 0; i < count; i++)
        if (isfinite(dot[i]))
            drawing_disc(drawing, place(i, count, dot[i], reach), 3.0f, dot_color, 0.9f);
    mem_free(given);
    mem_free(dot);
    return range;
}
