/* atlas_rectangle.c -- see atlas_rectangle.h. The smallest rectangle has a side along one of the
 * convex hull (Freeman and Shapira 1975); all are tried. */
#include "server/scene/atlas_rectangle.h"

#include <math.h>
#include <stdlib.h>

static double cross2(vec2 o, vec2 a, vec2 b) {
    return ((double)a.x - (double)o.x) * ((double)b.y - (double)o.y) -
           ((double)a.y - (double)o.y) * ((double)b.x - (double)o.x);
}

static int by_x_then_y(const void *left, const void *right) {
    const vec2 *a = left, *b = right;
    if (a->x != b->x)
        return a->x < b->x ? -1 : 1;
    return a->y < b->y ? -1 : a->y > b->y;
}

/* Convex hull (Andrew's monotone chain), sorts point[count]; hull has room for count + 1. */
static size_t convex_hull(vec2 *point, size_t count, vec2 *hull) {
    size_t k = 0;
    qsort(point, count, sizeof *point, by_x_then_y);
    for (size_t i = 0; i < count; i++) {
        while (k >= 2 && cross2(hull[k - 2], hull[k - 1], point[i]) <= 0.0)
            k--;
        hull[k++] = point[i];
    }
    for (size_t i = count - 1, lower = k + 1; i-- > 0;) {
        while (k >= lower && cross2(hull[k - 2], hull[k - 1], point[i]) <= 0.0)
            k--;
        hull[k++] = point[i];
    }
    return k > 1 ? k - 1 : k;
}

vec2 atlas_rectangle(vec2 *point, size_t point_count, vec2 *hull) {
    size_t count = convex_hull(point, point_count, hull);
    vec2 best = {1.0f, 0.0f};
    double least = INFINITY;
    for (size_t i = 0; i < count; i++) {
        double dx = (double)hull[(i + 1) % count].x - (double)hull[i].x;
        double dy = (double)hull[(i + 1) % count].y - (double)hull[i].y;
        double length = sqrt(dx * dx + dy * dy);
        if (!(length > 0.0))
            continue;
        double low[2] = {INFINITY, INFINITY}, high[2] = {-INFINITY, -INFINITY};
        for (size_t k = 0; k < count; k++) {
            double x = (dx * (double)hull[k].x + dy * (double)hull[k].y) / length;
            double y = (dx * (double)hull[k].y - dy * (double)hull[k].x) / length;
            low[0] = fmin(low[0], x), high[0] = fmax(high[0], x);
            low[1] = fmin(low[1], y), high[1] = fmax(high[1], y);
        }
        double area = (high[0] - low[0]) * (high[1] - low[1]);
        if (area < least) {
            least = area;
            best = (vec2){(float)(dx / length), (float)(dy / length)};
        }
    }
    return best;
}
