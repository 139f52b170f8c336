/* atlas_chart.c -- see atlas_chart.h.
 *
 * Regions grow from the largest triangle that is left, over edges, in order of how much a
 * triangle leans away from the region's mean normal. Growing is done three times:
 *   1. everywhere, with little lean;
 *   2. regions of a few texels are dissolved, and the others take of their triangles what they
 *      reach with more lean;
 *   3. what is left grows among itself with more lean.
 * After each growth, triangles that lie over an earlier one of the region, or that are cut off
 * from its first, are given back to grow elsewhere. */
#include "server/scene/atlas_chart.h"

#include <math.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#include "common/mem.h"
#include "server/scene/adjacency.h"
#include "server/scene/atlas_overlap.h"
#include "server/scene/atlas_rectangle.h"

#define NONE UINT32_MAX      /* no chart */
#define LITTLE_LEAN_DEG 45.0 /* that a triangle may lean away while charts grow first */
#define SMALL_TEXELS 100.0   /* area in texels below which a region is dissolved */
#define REFINE_ROUNDS 2      /* growths, each with the mean normal of the one before */
#define SAME_COSINE 0.9999f  /* between mean normals of two growths that would give the same region: 0.8 degrees */
#define LEAN_STEPS 16        /* quantisation of lean in the priority queue */
#define OVERLAP_TEXELS 0.01  /* depth of overlap that rounding produces between touching triangles */

struct builder {
    const struct mesh *mesh;
    const struct segments *segments;
    struct adjacency adjacency;
    vec3 *normal;       /* [triangle_count] unit */
    vec3 *smooth;       /* [triangle_count] unit, smoothed within creases */
    double *area;       /* [triangle_count] m^2 */
    uint32_t *by_area;  /* [triangle_count] largest first */
    uint32_t *chart_of; /* [triangle_count] or NONE */
    size_t chart_count;
    vec3 *chart_normal; /* [chart_count] unit; room for triangle_count */
    uint32_t *seen;     /* [triangle_count] number of the last flood that met it */
    uint32_t flood;     /* number of the present flood */
    uint64_t *heap;     /* priority queue: step of lean, order of discovery, triangle */
    size_t heap_count, heap_capacity;
    uint32_t *region; /* [triangle_count] the present region, in order of growth */
    size_t region_count;
    struct flat_triangle *flat; /* [triangle_count] scratch, as is the next */
    bool *dropped;
    double overlap_m;
    float max_lean_cos; /* cosine of CHART_MAX_LEAN_DEG */
};

static void heap_push(struct builder *b, uint64_t key) {
    if (b->heap_count == b->heap_capacity) {
        b->heap_capacity = b->heap_capacity ? 2 * b->heap_capacity : 256;
        b->heap = mem_realloc_array(b->heap, b->heap_capacity, sizeof *b->heap);
    }
    size_t i = b->heap_count++;
    for (; i > 0 && b->heap[(i - 1) / 2] > key; i = (i - 1) / 2)
        b->heap[i] = b->heap[(i - 1) / 2];
    b->heap[i] = key;
}

static uint64_t heap_pop(struct builder *b) {
    uint64_t top = b->heap[0], last = b->heap[--b->heap_count];
    size_t i = 0;
    for (size_t child = 1; child < b->heap_count; child = 2 * i + 1) {
        if (child + 1 < b->heap_count && b->heap[child + 1] < b->heap[child])
            child++;
        if (b->heap[child] >= last)
            break;
        b->heap[i] = b->heap[child];
        i = child;
    }
    b->heap[i] = last;
    return top;
}

/* Pushes the unassigned neighbours of a triangle in its segment whose lean is small enough; `order` counts them. */
static void offer_neighbours(struct builder *b, uint32_t t, vec3 normal, float min_cos, uint64_t *order) {
    for (uint32_t e = 0; e < 3; e++) {
        uint32_t half = 3 * t + e;
        for (uint32_t h = b->adjacency.next[half]; h != half; h = b->adjacency.next[h]) {
            uint32_t n = h / 3;
            if (b->seen[n] == b->flood || b->chart_of[n] != NONE ||
                b->segments->of_triangle[n] != b->segments->of_triangle[t])
                continue;
            float cosine = vec3_dot(b->smooth[n], normal);
            if (cosine < min_cos || vec3_dot(b->normal[n], normal) < b->max_lean_cos)
                continue;
            b->seen[n] = b->flood;
            float lean = clampf((1.0f - cosine) / (1.0f - min_cos), 0.0f, 1.0f);
            uint64_t step = (uint64_t)(lean * (LEAN_STEPS - 1));
            heap_push(b, step << 60 | (*order)++ << 30 | n); /* 30 bits: MESH_MAX_TRIANGLES */
        }
    }
}

/* Adds all unassigned triangles reachable from those in region[], least lean first. */
static void grow(struct builder *b, vec3 normal, float min_cos) {
    size_t given = b->region_count;
    uint64_t order = 0;
    b->flood++;
    b->heap_count = 0;
    for (size_t i = 0; i < given; i++)
        b->seen[b->region[i]] = b->flood;
    for (size_t i = 0; i < given; i++)
        offer_neighbours(b, b->region[i], normal, min_cos, &order);
    while (b->heap_count > 0) {
        uint32_t t = (uint32_t)(heap_pop(b) & ((UINT64_C(1) << 30) - 1));
        b->region[b->region_count++] = t;
        offer_neighbours(b, t, normal, min_cos, &order);
    }
}

static vec3 region_normal(const struct builder *b) {
    double sum[3] = {0.0, 0.0, 0.0};
    for (size_t i = 0; i < b->region_count; i++) {
        uint32_t t = b->region[i];
        sum[0] += b->area[t] * (double)b->normal[t].x;
        sum[1] += b->area[t] * (double)b->normal[t].y;
        sum[2] += b->area[t] * (double)b->normal[t].z;
    }
    double length = sqrt(sum[0] * sum[0] + sum[1] * sum[1] + sum[2] * sum[2]);
    return (vec3){(float)(sum[0] / length), (float)(sum[1] / length), (float)(sum[2] / length)};
}

static void project(const struct builder *b, uint32_t t, vec3 u, vec3 v, struct flat_triangle *flat) {
    for (int c = 0; c < 3; c++) {
        vec3 p = b->mesh->position[b->mesh->index[t][c]];
        flat->x[c] = (double)p.x * (double)u.x + (double)p.y * (double)u.y + (double)p.z * (double)u.z;
        flat->y[c] = (double)p.x * (double)v.x + (double)p.y * (double)v.y + (double)p.z * (double)v.z;
    }
}

/* Removes what is not connected to region[0]. */
static void keep_connected(struct builder *b) {
    uint32_t member = ++b->flood, reached = ++b->flood;
    for (size_t i = 0; i < b->region_count; i++)
        b->seen[b->region[i]] = member;
    size_t done = 0, count = 1;
    b->seen[b->region[0]] = reached;
    while (done < count) {
        uint32_t t = b->region[done++];
        for (uint32_t half = 3 * t; half < 3 * t + 3; half++)
            for (uint32_t h = b->adjacency.next[half]; h != half; h = b->adjacency.next[h])
                if (b->seen[h / 3] == member) {
                    b->seen[h / 3] = reached;
                    b->region[count++] = h / 3;
                }
    }
    b->region_count = count;
}

/* Makes region[] the chart `chart`, without triangles that overlap other parts of it. */
static void settle(struct builder *b, size_t chart, vec3 normal) {
    vec3 u, v;
    vec3_frame(normal, &u, &v);
    if (b->region_count > 1) {
        for (size_t i = 0; i < b->region_count; i++)
            project(b, b->region[i], u, v, &b->flat[i]);
        if (overlap_mark_dropped(b->flat, b->region_count, b->overlap_m, b->dropped) > 0) {
            size_t kept = 0;
            for (size_t i = 0; i < b->region_count; i++)
                if (!b->dropped[i])
                    b->region[kept++] = b->region[i];
            b->region_count = kept;
            keep_connected(b);
        }
    }
    for (size_t i = 0; i < b->region_count; i++)
        b->chart_of[b->region[i]] = (uint32_t)chart;
    b->chart_normal[chart] = normal;
}

/* Makes charts of all unassigned triangles. */
static void grow_all(struct builder *b, float min_cos) {
    for (bool found = true; found;) {
        found = false; /* triangles that were given back are tried again in the next round */
        for (size_t i = 0; i < b->mesh->triangle_count; i++) {
            uint32_t seed = b->by_area[i];
            if (b->chart_of[seed] != NONE)
                continue;
            found = true;
            vec3 normal =
                vec3_dot(b->smooth[seed], b->normal[seed]) < b->max_lean_cos ? b->normal[seed] : b->smooth[seed];
            for (int round = 0; round <= REFINE_ROUNDS; round++) {
                b->region[0] = seed;
                b->region_count = 1;
                grow(b, normal, min_cos);
                vec3 mean = region_normal(b);
                if (round == REFINE_ROUNDS || vec3_dot(mean, b->normal[seed]) < b->max_lean_cos ||
                    vec3_dot(mean, normal) > SAME_COSINE)
                    break;
                normal = mean;
            }
            settle(b, b->chart_count++, normal);
        }
    }
}

/* Members of all charts, in ascending order: start[chart_count + 1], triangle[]. */
static void list_members(const struct builder *b, size_t *start, uint32_t *triangle) {
    size_t n = b->mesh->triangle_count;
    memset(start, 0, (b->chart_count + 1) * sizeof *start);
    for (size_t t = 0; t < n; t++)
        if (b->chart_of[t] != NONE)
            start[b->chart_of[t]]++;
    size_t sum = 0;
    for (size_t c = 0; c <= b->chart_count; c++) {
        sum += c < b->chart_count ? start[c] : 0;
        start[c] = sum;
    }
    for (size_t t = n; t-- > 0;)
        if (b->chart_of[t] != NONE)
            triangle[--start[b->chart_of[t]]] = (uint32_t)t;
}

/* Frees the triangles of charts smaller than small_area, lets the others grow over them and renumbers the charts
 * left. */
static void dissolve_small(struct builder *b, double small_area, float min_cos) {
    size_t n = b->mesh->triangle_count, kept = 0;
    double *area = mem_calloc(b->chart_count, sizeof *area);
    uint32_t *number = mem_array(b->chart_count, sizeof *number);
    for (size_t t = 0; t < n; t++)
        area[b->chart_of[t]] += b->area[t];
    for (size_t c = 0; c < b->chart_count; c++) {
        number[c] = area[c] < small_area ? NONE : (uint32_t)kept;
        if (number[c] != NONE)
            b->chart_normal[kept++] = b->chart_normal[c];
    }
    for (size_t t = 0; t < n; t++)
        b->chart_of[t] = number[b->chart_of[t]];
    b->chart_count = kept;
    mem_free(number);
    mem_free(area);

    size_t *start = mem_array(kept + 1, sizeof *start);
    uint32_t *triangle = mem_array(n, sizeof *triangle);
    list_members(b, start, triangle);
    for (size_t c = 0; c < kept; c++) {
        b->region_count = start[c + 1] - start[c];
        memcpy(b->region, triangle + start[c], b->region_count * sizeof *b->region);
        size_t before = b->region_count;
        grow(b, b->chart_normal[c], min_cos);
        if (b->region_count > before)
            settle(b, c, b->chart_normal[c]);
    }
    mem_free(triangle);
    mem_free(start);
}

/* Fills corner[] and extent[] of one chart. point and hull are scratch. */
static void flatten(struct builder *b, struct charts *charts, size_t c, vec2 *point, vec2 *hull) {
    const uint32_t *triangle = charts->triangle + charts->start[c];
    size_t count = charts->start[c + 1] - charts->start[c];
    vec3 u, v;
    vec3_frame(b->chart_normal[c], &u, &v);
    for (size_t i = 0; i < count; i++) {
        project(b, triangle[i], u, v, &b->flat[i]);
        for (int k = 0; k < 3; k++)
            point[3 * i + (size_t)k] = (vec2){(float)b->flat[i].x[k], (float)b->flat[i].y[k]};
    }
    vec2 along = atlas_rectangle(point, 3 * count, hull);
    double low[2] = {INFINITY, INFINITY}, high[2] = {-INFINITY, -INFINITY};
    for (size_t i = 0; i < count; i++) {
        struct flat_triangle *f = &b->flat[i];
        for (int k = 0; k < 3; k++) {
            double x = f->x[k] * (double)along.x + f->y[k] * (double)along.y;
            double y = f->y[k] * (double)along.x - f->x[k] * (double)along.y;
            f->x[k] = x, f->y[k] = y;
            low[0] = fmin(low[0], x), high[0] = fmax(high[0], x);
            low[1] = fmin(low[1], y), high[1] = fmax(high[1], y);
        }
        charts->flat_area +=
            0.5 * fabs((f->x[1] - f->x[0]) * (f->y[2] - f->y[0]) - (f->y[1] - f->y[0]) * (f->x[2] - f->x[0]));
    }
    for (size_t i = 0; i < count; i++)
        for (int k = 0; k < 3; k++)
            charts->corner[triangle[i]][k] =
                (vec2){(float)(b->flat[i].x[k] - low[0]), (float)(b->flat[i].y[k] - low[1])};
    charts->extent[c] = (vec2){(float)(high[0] - low[0]), (float)(high[1] - low[1])};
}

struct by_area {
    double area;
    uint32_t triangle;
};

static int largest_first(const void *left, const void *right) {
    const struct by_area *a = left, *b = right;
    if (a->area != b->area)
        return a->area > b->area ? -1 : 1;
    return a->triangle < b->triangle ? -1 : 1;
}

static float cos_of_deg(double degrees) { return (float)cos(degrees * (3.14159265358979323846 / 180.0)); }

static void builder_init(struct builder *b, const struct mesh *mesh, const struct segments *segments, double texel_m) {
    size_t n = mesh->triangle_count;
    *b = (struct builder){.mesh = mesh, .segments = segments, .overlap_m = OVERLAP_TEXELS * texel_m};
    adjacency_make(&b->adjacency, mesh);
    b->smooth = adjacency_smooth_normals(&b->adjacency, mesh);
    b->max_lean_cos = cos_of_deg(CHART_MAX_LEAN_DEG);
    b->normal = mem_array(n, sizeof *b->normal);
    b->area = mem_array(n, sizeof *b->area);
    b->by_area = mem_array(n, sizeof *b->by_area);
    b->chart_of = mem_array(n, sizeof *b->chart_of);
    b->chart_normal = mem_array(n, sizeof *b->chart_normal);
    b->seen = mem_calloc(n, sizeof *b->seen);
    b->region = mem_array(n, sizeof *b->region);
    b->flat = mem_array(n, sizeof *b->flat);
    b->dropped = mem_array(n, sizeof *b->dropped);
    struct by_area *order = mem_array(n, sizeof *order);
    for (size_t t = 0; t < n; t++) {
        vec3 cross = mesh_cross(mesh, t);
        b->normal[t] = vec3_normalize(cross);
        b->area[t] = 0.5 * (double)vec3_length(cross);
        b->chart_of[t] = NONE;
        order[t] = (struct by_area){b->area[t], (uint32_t)t};
    }
    qsort(order, n, sizeof *order, largest_first);
    for (size_t i = 0; i < n; i++)
        b->by_area[i] = order[i].triangle;
    mem_free(order);
}

static void builder_release(struct builder *b) {
    adjacency_release(&b->adjacency);
    mem_free(b->normal);
    mem_free(b->smooth);
    mem_free(b->area);
    mem_free(b->by_area);
    mem_free(b->chart_of);
    mem_free(b->chart_normal);
    mem_free(b->seen);
    mem_free(b->heap);
    mem_free(b->region);
    mem_free(b->flat);
    mem_free(b->dropped);
}

void charts_make(struct charts *charts, const struct mesh *mesh, const struct segments *segments, float texel_m) {
    size_t n = mesh->triangle_count;
    struct builder b;
    builder_init(&b, mesh, segments, (double)texel_m);
    grow_all(&b, cos_of_deg(LITTLE_LEAN_DEG));
    dissolve_small(&b, SMALL_TEXELS * (double)texel_m * (double)texel_m, b.max_lean_cos);
    grow_all(&b, b.max_lean_cos);

    *charts = (struct charts){.count = b.chart_count};
    charts->start = mem_array(b.chart_count + 1, sizeof *charts->start);
    charts->triangle = mem_array(n, sizeof *charts->triangle);
    charts->corner = mem_array(n, sizeof *charts->corner);
    charts->extent = mem_array(b.chart_count, sizeof *charts->extent);
    list_members(&b, charts->start, charts->triangle);
    vec2 *point = mem_array(3 * n + 1, 2 * sizeof *point);
    for (size_t c = 0; c < charts->count; c++)
        flatten(&b, charts, c, point, point + 3 * n + 1);
    mem_free(point);
    charts->of_triangle = b.chart_of;
    b.chart_of = NULL;
    builder_release(&b);
}

void charts_release(struct charts *charts) {
    mem_free(charts->of_triangle);
    mem_free(charts->start);
    mem_free(charts->triangle);
    mem_free(charts->corner);
    mem_free(charts->extent);
    *charts = (struct charts){0};
}
