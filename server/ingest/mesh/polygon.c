/* polygon.c -- see polygon.h. Ear clipping (Meisters, "Polygons have ears", 1975) in the plane of the polygon's
 * Newell normal, projected along its largest component. */
#include "server/ingest/mesh/polygon.h"

#include <assert.h>
#include <stdbool.h>

struct polygon_point {
    double x, y;
};

/* Twice the signed area of the triangle a, b, c. */
static double area2(struct polygon_point a, struct polygon_point b, struct polygon_point c) {
    return (b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x);
}

/* Projects to 2D so that the polygon is counter-clockwise. */
static void flatten(const vec3 *corner, size_t count, struct polygon_point *flat) {
    double n[3] = {0.0, 0.0, 0.0};
    for (size_t i = 0; i < count; i++) {
        vec3 a = corner[i], b = corner[(i + 1) % count];
        n[0] += ((double)a.y - (double)b.y) * ((double)a.z + (double)b.z);
        n[1] += ((double)a.z - (double)b.z) * ((double)a.x + (double)b.x);
        n[2] += ((double)a.x - (double)b.x) * ((double)a.y + (double)b.y);
    }
    int axis = 0;
    for (int i = 1; i < 3; i++)
        if (fabs(n[i]) > fabs(n[axis]))
            axis = i;
    for (size_t i = 0; i < count; i++) {
        double p[3] = {(double)corner[i].x, (double)corner[i].y, (double)corner[i].z};
        double u = p[(axis + 1) % 3], v = p[(axis + 2) % 3];
        flat[i] = n[axis] >= 0.0 ? (struct polygon_point){u, v} : (struct polygon_point){v, u};
    }
}

static bool is_convex(const struct polygon_point *flat, size_t count) {
    for (size_t i = 0; i < count; i++)
        if (area2(flat[i], flat[(i + 1) % count], flat[(i + 2) % count]) < 0.0)
            return false;
    return true;
}

/* Whether the corner at `at` of a ring of `left` corners is an ear: convex, with no other corner in its triangle.
 * Corners that coincide with one of the three are ignored (a bridge to a hole visits its ends twice). */
static bool is_ear(const struct polygon_point *flat, const uint32_t *ring, size_t left, size_t at) {
    struct polygon_point a = flat[ring[(at + left - 1) % left]], b = flat[ring[at]], c = flat[ring[(at + 1) % left]];
    if (!(area2(a, b, c) > 0.0))
        return false;
    for (size_t i = 0; i < left; i++) {
        struct polygon_point p = flat[ring[i]];
        if ((p.x == a.x && p.y == a.y) || (p.x == b.x && p.y == b.y) || (p.x == c.x && p.y == c.y))
            continue;
        if (area2(a, b, p) >= 0.0 && area2(b, c, p) >= 0.0 && area2(c, a, p) >= 0.0)
            return false;
    }
    return true;
}

void polygon_triangulate(const vec3 *corner, size_t count, uint32_t (*triangle)[3]) {
    assert(count >= 3 && count <= POLYGON_MAX_CORNERS);
    struct polygon_point flat[POLYGON_MAX_CORNERS];
    if (count > 3)
        flatten(corner, count, flat);
    if (count == 3 || is_convex(flat, count)) {
        for (uint32_t i = 0; i + 2 < count; i++) {
            triangle[i][0] = 0;
            triangle[i][1] = i + 1;
            triangle[i][2] = i + 2;
        }
        return;
    }
    uint32_t ring[POLYGON_MAX_CORNERS];
    for (uint32_t i = 0; i < count; i++)
        ring[i] = i;
    size_t made = 0;
    for (size_t left = count; left > 3; left--) {
        /* without an ear (self-intersecting polygon) any corner will do */
        size_t at = 1;
        for (size_t i = 0; i < left; i++) {
            if (is_ear(flat, ring, left, (i + 1) % left)) {
                at = (i + 1) % left;
                break;
            }
        }
        triangle[made][0] = ring[(at + left - 1) % left];
        triangle[made][1] = ring[at];
        triangle[made][2] = ring[(at + 1) % left];
        made++;
        for (size_t i = at; i + 1 < left; i++)
            ring[i] = ring[i + 1];
    }
    for (int i = 0; i < 3; i++)
        triangle[made][i] = ring[i];
}
