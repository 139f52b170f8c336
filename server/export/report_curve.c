/* report_curve.c -- see report_curve.h. */
#include "server/export/report_curve.h"

#include <math.h>
#include <string.h>

#include "common/mem.h"
#include "server/export/html.h"

#define CURVE_POINTS 480 /* more are subsampled: one a pixel of the width */

struct curve_point {
    double step, value;
};

/* The finite points of [[step, value], ...]; the caller's. */
static struct curve_point *read_series(const cJSON *series, size_t *count) {
    struct curve_point *point = mem_array((size_t)cJSON_GetArraySize(series) + 1, sizeof *point);
    *count = 0;
    for (const cJSON *item = series->child; item; item = item->next) {
        const cJSON *step = item->child, *value = step ? step->next : NULL;
        if (!cJSON_IsNumber(step) || !cJSON_IsNumber(value) || !isfinite(value->valuedouble))
            continue;
        point[(*count)++] = (struct curve_point){step->valuedouble, value->valuedouble};
    }
    return point;
}

/* Pixels: margins, and the whole. */
#define LEFT 56
#define RIGHT 8
#define TOP 8
#define BOTTOM 36 /* with the title of the axis */
#define WIDTH 480
#define HEIGHT 214

/* The y axis is logarithmic if all values are positive and span a factor of 8. */
struct curve {
    size_t count;
    struct curve_point *point; /* [count] owned */
    bool logarithmic;
    double top, range; /* of values, or of their logarithms */
    double steps;      /* from the first to the last */
};

static void curve_init(struct curve *c, const cJSON *series) {
    double low = INFINITY, high = -INFINITY;
    c->point = read_series(series, &c->count);
    for (size_t i = 0; i < c->count; i++) {
        low = fmin(low, c->point[i].value);
        high = fmax(high, c->point[i].value);
    }
    c->logarithmic = c->count && low > 0.0 && high > 8.0 * low;
    double from = c->logarithmic ? log(low) : low;
    c->top = c->logarithmic ? log(high) : high;
    c->range = c->top > from ? c->top - from : 1.0;
    c->steps = c->count ? c->point[c->count - 1].step - c->point[0].step : 0.0;
}

static void put_axes(struct buf *out, const struct curve *c) {
    for (int i = 0; i <= 4; i++) {
        double y = TOP + (HEIGHT - TOP - BOTTOM) * i / 4.0;
        double value = c->top - c->range * i / 4.0;
        buf_printf(out,
                   "<line x1=\"%d\" x2=\"%d\" y1=\"%.1f\" y2=\"%.1f\"/>"
                   "<text x=\"%d\" y=\"%.1f\" text-anchor=\"end\">%.3g</text>",
                   LEFT, WIDTH - RIGHT, y, y, LEFT - 6, y + 4.0, c->logarithmic ? exp(value) : value);
    }
    buf_printf(out,
               "<text x=\"%d\" y=\"%d\">%.4g</text>"
               "<text x=\"%d\" y=\"%d\" text-anchor=\"end\">%.4g</text>",
               LEFT, HEIGHT - 20, c->point[0].step, WIDTH - RIGHT, HEIGHT - 20, c->point[c->count - 1].step);
}

/* What the values of a series are, and their unit; "" of one that is not known here. */
static const char *value_title(const char *name) {
    static const char *const titles[][2] = {
        {"loss", "squared relative error, 1"}, {"msre", "squared relative error, 1"}, {"rays", "rays of this attempt"}};
    for (size_t i = 0; i < sizeof titles / sizeof *titles; i++)
        if (strcmp(titles[i][0], name) == 0)
            return titles[i][1];
    return "";
}

static void put_titles(struct buf *out, const struct curve *c, const char *name) {
    buf_printf(out, "<text x=\"%d\" y=\"%d\" text-anchor=\"middle\">share of the optimiser's steps</text>",
               (LEFT + WIDTH - RIGHT) / 2, HEIGHT - 4);
    buf_printf(out, "<text x=\"%d\" y=\"%d\">%s%s</text>", LEFT + 6, TOP + 12, value_title(name),
               c->logarithmic ? ", logarithmic" : "");
}

static void put_path(struct buf *out, const struct curve *c) {
    size_t stride = (c->count + CURVE_POINTS - 1) / CURVE_POINTS;
    buf_puts(out, "<path d=\"");
    for (size_t i = 0; i < c->count;) {
        const struct curve_point *p = &c->point[i];
        double value = c->logarithmic ? log(p->value) : p->value;
        buf_printf(out, "%c%.1f %.1f", i ? 'L' : 'M',
                   LEFT + (WIDTH - LEFT - RIGHT) * (p->step - c->point[0].step) / c->steps,
                   TOP + (HEIGHT - TOP - BOTTOM) * (c->top - value) / c->range);
        bool is_last = i + 1 == c->count;
        i = is_last || i + stride < c->count ? i + stride : c->count - 1; /* the last point is always drawn */
    }
    buf_puts(out, "\"/>");
}

bool report_curve_has(const cJSON *series) {
    size_t count;
    struct curve_point *point = read_series(series, &count);
    bool has = count >= 2 && point[count - 1].step > point[0].step;
    mem_free(point);
    return has;
}

void report_curve(struct buf *out, const char *name, const cJSON *series) {
    struct curve c;
    curve_init(&c, series);
    buf_printf(out, "<figure><svg viewBox=\"0 0 %d %d\" role=\"img\" aria-label=\"", WIDTH, HEIGHT);
    html_key(out, name);
    buf_printf(out, ", from %.3g at step %.4g to %.3g at step %.4g\">", c.point[0].value, c.point[0].step,
               c.point[c.count - 1].value, c.point[c.count - 1].step);
    put_axes(out, &c);
    put_titles(out, &c, name);
    put_path(out, &c);
    buf_puts(out, "</svg><figcaption>");
    html_key(out, name);
    buf_puts(out, "<span>last: ");
    html_number(out, c.point[c.count - 1].value);
    buf_puts(out, "</span></figcaption></figure>");
    mem_free(c.point);
}
