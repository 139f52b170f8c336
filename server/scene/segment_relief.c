/* segment_relief.c -- see segment_relief.h.
 *
 * The plane is fitted to a segment's triangles by iteratively reweighted least squares (Geman and McClure's function,
 * whose scale is the median absolute height of each round), so that what most of the area lies in decides. Curved
 * segments have no such plane: their heights spread so far that nothing is off by several deviations. A wall that bows
 * slowly ends nowhere in a step. */
#include "server/scene/segment_relief.h"

#include <math.h>
#include <stdbool.h>
#include <stdlib.h>

#include "common/cholesky.h"
#include "common/mem.h"
#include "common/quantile.h"
#include "common/spaced.h"

/* Triangles of a segment that its plane is fitted to, at most; evenly spaced. */
#define FIT_TRIANGLES 8192
#define MIN_TRIANGLES 16 /* of a segment, for a plane with a deviation */
#define MIN_ALIKE 0.5f   /* length of the mean normal; half of a ball has 0.5: it has no side that could be up */
#define ROUNDS 12        /* of fitting the plane; it moves by less than its deviation after 5 */
#define SCALE 2.0        /* of the robust weights, in deviations */
#define MIN_SIGMA 5.0f   /* height of a part, in deviations of the plane's surface */
/* The same in lengths of a triangle's side: what is lower is a few triangles' own slope. */
#define MIN_SIDES 0.5f
/* Mean slope along the border of a part. Steps have 1, but are rounded by the depth maps' resolution; walls that bow
 * have a hundredth. */
#define MIN_SLOPE 0.25f

struct facet {
    float area;
    vec3 at, normal; /* centre; unit */
};

/* A segment, and the plane that most of it lies in. */
struct relief {
    const uint32_t *triangle; /* [triangle_count] of the mesh; borrowed */
    size_t triangle_count;
    size_t count;        /* of those that the plane is fitted to */
    struct facet *facet; /* [count]; owned, as the next */
    float *height;       /* [count] over the plane, m */
    float sigma;         /* their robust deviation, m */
    float side_m;        /* mean side of a triangle */
    vec3 centre, u, v, normal;
};

static struct facet facet_of(const struct mesh *mesh, uint32_t t) {
    vec3 cross = mesh_cross(mesh, t);
    return (struct facet){0.5f * vec3_length(cross), mesh_point(mesh, t, 1.0f / 3.0f, 1.0f / 3.0f),
                          vec3_normalize(cross)};
}

struct weighted {
    float value, weight;
};

static int by_value(const void *a, const void *b) {
    const struct weighted *x = a, *y = b;
    return x->value < y->value ? -1 : x->value > y->value;
}

static float weighted_median(struct weighted *w, size_t count) {
    double total = 0.0, sum = 0.0;
    for (size_t i = 0; i < count; i++)
        total += (double)w[i].weight;
    qsort(w, count, sizeof *w, by_value);
    size_t i = 0;
    while (i + 1 < count && sum + (double)w[i].weight < 0.5 * total)
        sum += (double)w[i++].weight;
    return w[i].value;
}

static void find_heights(struct relief *r, struct weighted *scratch) {
    for (size_t i = 0; i < r->count; i++) {
        r->height[i] = vec3_dot(r->normal, vec3_sub(r->facet[i].at, r->centre));
        scratch[i] = (struct weighted){r->height[i], r->facet[i].area};
    }
    float middle = weighted_median(scratch, r->count);
    for (size_t i = 0; i < r->count; i++) {
        r->height[i] -= middle;
        scratch[i] = (struct weighted){fabsf(r->height[i]), r->facet[i].area};
    }
    r->centre = vec3_mad(r->centre, middle, r->normal);
    r->sigma = (float)QUANTILE_DEVIATIONS_PER_MAD * weighted_median(scratch, r->count);
}

/* One round of least squares of the heights; false where the triangles span no plane. */
static bool tilt(struct relief *r, double unit) {
    double a[3][3] = {{0.0}}, b[3] = {0.0};
    double scale = SCALE * fmax((double)r->sigma, 1e-6 * unit);
    for (size_t i = 0; i < r->count; i++) {
        vec3 from = vec3_sub(r->facet[i].at, r->centre);
        double term[3] = {1.0, (double)vec3_dot(r->u, from) / unit, (double)vec3_dot(r->v, from) / unit};
        double e = (double)r->height[i] / scale, influence = 1.0 / (1.0 + e * e);
        double weight = influence * influence * (double)r->facet[i].area;
        for (int k = 0; k < 3; k++) {
            b[k] += weight * term[k] * (double)r->height[i];
            for (int c = 0; c <= k; c++)
                a[k][c] += weight * term[k] * term[c];
        }
    }
    if (!cholesky_factor(3, 3, &a[0][0]))
        return false;
    cholesky_solve(3, 3, &a[0][0], b);
    r->centre = vec3_mad(r->centre, (float)b[0], r->normal);
    vec3 tilted = vec3_mad(r->normal, -(float)(b[1] / unit), r->u);
    r->normal = vec3_normalize(vec3_mad(tilted, -(float)(b[2] / unit), r->v));
    vec3_frame(r->normal, &r->u, &r->v);
    return true;
}

/* The plane that most of the segment lies in, and heights over it. */
static bool fit_plane(struct relief *r) {
    vec3 sum = {0.0f, 0.0f, 0.0f}, normal = sum;
    double area = 0.0, square = 0.0;
    for (size_t i = 0; i < r->count; i++) {
        const struct facet *f = &r->facet[i];
        sum = vec3_mad(sum, f->area, vec3_sub(f->at, r->facet[0].at));
        normal = vec3_mad(normal, f->area, f->normal);
        area += (double)f->area;
    }
    r->centre = vec3_mad(r->facet[0].at, (float)(1.0 / area), sum);
    for (size_t i = 0; i < r->count; i++) {
        vec3 from = vec3_sub(r->facet[i].at, r->centre);
        square += (double)r->facet[i].area * (double)vec3_dot(from, from);
    }
    r->side_m = (float)sqrt(4.0 / sqrt(3.0) * area / (double)r->count);
    if (r->count < MIN_TRIANGLES || !(square > 0.0) || !(vec3_length(normal) > MIN_ALIKE * (float)area))
        return false;
    r->normal = vec3_normalize(normal);
    vec3_frame(r->normal, &r->u, &r->v);
    struct weighted *scratch = mem_array(r->count, sizeof *scratch);
    bool is_plane = true;
    for (int round = 0; round < ROUNDS && is_plane; round++) {
        find_heights(r, scratch);
        is_plane = tilt(r, sqrt(square / area));
    }
    find_heights(r, scratch);
    mem_free(scratch);
    return is_plane;
}

/* --- parts -------------------------------------------------------------------------------------- */

#define NO_PART 0
#define REFUSED UINT32_MAX

struct relief_search {
    const struct mesh *mesh;
    const struct adjacency *adjacency;
    const uint32_t *of_triangle; /* [triangle_count] segments */
    float *height;   /* [triangle_count] over the plane of its segment; 0 where that has none; owned, as the next */
    float *slope;    /* [triangle_count] against the plane: the sine */
    uint32_t *part;  /* [triangle_count] number of the connected set, from 1 */
    uint32_t *queue; /* [triangle_count] */
};

/* A connected set of triangles on one side of a plane. */
struct relief_part {
    size_t count; /* in the queue */
    double area, border, border_slope;
};

static double edge_length(const struct mesh *mesh, uint32_t half_edge) {
    const uint32_t *v = mesh->index[half_edge / 3];
    return (double)vec3_length(vec3_sub(mesh->position[v[(half_edge + 1) % 3]], mesh->position[v[half_edge % 3]]));
}

static bool is_off(const struct relief_search *s, uint32_t t, float least, bool is_above) {
    return is_above ? s->height[t] > least : s->height[t] < -least;
}

/* Visits a neighbour of triangle t of the set over a half-edge. */
static void visit(struct relief_search *s, struct relief_part *p, uint32_t t, uint32_t half_edge, float least,
                  bool is_above) {
    uint32_t other = half_edge / 3;
    if (s->of_triangle[other] != s->of_triangle[t])
        return;
    if (!is_off(s, other, least, is_above)) {
        double length = edge_length(s->mesh, half_edge);
        p->border += length;
        p->border_slope += length * (double)fmaxf(s->slope[t], s->slope[other]);
    } else if (s->part[other] == NO_PART) {
        s->part[other] = REFUSED;
        s->queue[p->count++] = other;
    }
}

/* The set that holds triangle `first`, as refused at first. */
static struct relief_part grow(struct relief_search *s, uint32_t first, float least) {
    struct relief_part p = {.count = 1};
    bool is_above = s->height[first] > 0.0f;
    s->part[first] = REFUSED;
    s->queue[0] = first;
    for (size_t i = 0; i < p.count; i++) {
        uint32_t t = s->queue[i];
        p.area += (double)mesh_triangle_area(s->mesh, t);
        for (uint32_t half = 3 * t; half < 3 * t + 3; half++)
            for (uint32_t h = s->adjacency->next[half]; h != half; h = s->adjacency->next[h])
                visit(s, &p, t, h, least, is_above);
    }
    return p;
}

/* Heights and slopes of all of a segment's triangles. */
static void measure(struct relief_search *s, const struct relief *r) {
    for (size_t i = 0; i < r->triangle_count; i++) {
        uint32_t t = r->triangle[i];
        struct facet f = facet_of(s->mesh, t);
        float cosine = vec3_dot(f.normal, r->normal);
        s->height[t] = vec3_dot(r->normal, vec3_sub(f.at, r->centre));
        s->slope[t] = sqrtf(fmaxf(0.0f, 1.0f - cosine * cosine));
    }
}

/* Numbers the parts of one segment from *found + 1 on; other sets that are off its plane are REFUSED. */
static void find_parts(struct relief_search *s, const struct relief *r, double least_area, uint32_t *found) {
    float least = fmaxf(MIN_SIGMA * r->sigma, MIN_SIDES * r->side_m);
    measure(s, r);
    for (size_t i = 0; i < r->triangle_count; i++) {
        uint32_t t = r->triangle[i];
        if (s->part[t] != NO_PART || !(fabsf(s->height[t]) > least))
            continue;
        struct relief_part p = grow(s, t, least);
        bool is_part = p.area >= least_area && p.border_slope >= (double)MIN_SLOPE * p.border;
        *found += is_part;
        for (size_t k = 0; k < p.count && is_part; k++)
            s->part[s->queue[k]] = *found;
    }
}

static void relief_init(struct relief *r, const struct mesh *mesh, const uint32_t *triangle, size_t count) {
    *r = (struct relief){.triangle = triangle, .triangle_count = count};
    r->count = count < FIT_TRIANGLES ? count : FIT_TRIANGLES;
    r->facet = mem_array(r->count, sizeof *r->facet);
    r->height = mem_calloc(r->count, sizeof *r->height);
    for (size_t i = 0; i < r->count; i++)
        r->facet[i] = facet_of(mesh, triangle[spaced(i, count, r->count)]);
}

static void relief_release(struct relief *r) {
    mem_free(r->height);
    mem_free(r->facet);
}

/* Triangles grouped by segment, in the mesh's order: those of segment i from first[i] on to first[i + 1]. Both the
 * caller's. */
static uint32_t *group(const uint32_t *of_triangle, size_t triangle_count, size_t count, uint32_t *first) {
    uint32_t *grouped = mem_array(triangle_count + 1, sizeof *grouped);
    for (size_t t = 0; t < triangle_count; t++)
        first[of_triangle[t] + 1]++;
    for (size_t i = 0; i < count; i++)
        first[i + 1] += first[i];
    for (size_t t = triangle_count; t-- > 0;)
        grouped[--first[of_triangle[t] + 1]] = (uint32_t)t;
    for (size_t i = 0; i < count; i++)
        first[i] = first[i + 1];
    first[count] = (uint32_t)triangle_count;
    return grouped;
}

size_t segment_relief_split(uint32_t *of_triangle, size_t count, const struct mesh *mesh,
                            const struct adjacency *adjacency, double least_area) {
    size_t n = mesh->triangle_count;
    uint32_t found = 0, *first = mem_calloc(count + 1, sizeof *first);
    uint32_t *grouped = group(of_triangle, n, count, first);
    struct relief_search s = {.mesh = mesh, .adjacency = adjacency, .of_triangle = of_triangle};
    s.height = mem_calloc(n, sizeof *s.height);
    s.slope = mem_calloc(n, sizeof *s.slope);
    s.part = mem_calloc(n, sizeof *s.part);
    s.queue = mem_array(n, sizeof *s.queue);
    for (size_t i = 0; i < count; i++) {
        struct relief r;
        relief_init(&r, mesh, grouped + first[i], first[i + 1] - first[i]);
        if (fit_plane(&r))
            find_parts(&s, &r, least_area, &found);
        relief_release(&r);
    }
    for (size_t t = 0; t < n; t++)
        if (s.part[t] != NO_PART && s.part[t] != REFUSED)
            of_triangle[t] = (uint32_t)count + s.part[t] - 1;
    mem_free(s.queue);
    mem_free(s.part);
    mem_free(s.slope);
    mem_free(s.height);
    mem_free(grouped);
    mem_free(first);
    return count + found;
}
