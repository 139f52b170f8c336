/* color_steps.c -- see color_steps.h. */
#include "server/scene/color_steps.h"

#include <math.h>
#include <stdlib.h>

#include "common/mem.h"

/* Least step, in logarithms: of colour, and of brightness alone, which the edge of a shadow has as well. */
#define MIN_COLOR 0.15f
#define MIN_BRIGHTNESS 1.1f
#define MIN_DEVIATIONS 2.0f /* of what the sides vary by */

/* What a region shows some triangles from its border with another, or all of it. */
struct side {
    uint32_t region, other, triangle; /* the last while it is one triangle's */
    double weight, sum[3], square;    /* areas; of the values, by areas; mean over the channels */
};

/* The regions as they are at present. */
struct standing {
    size_t count;
    uint32_t *of_triangle; /* [triangle_count] numbers of regions; owned, as all */
    uint32_t *root;        /* [count] */
    struct side *all;      /* [count] */
    struct side *side;     /* [side_count] by region, then by the other */
    size_t side_count;
};

static int by_regions(const void *left, const void *right) {
    const struct side *a = left, *b = right;
    if (a->region != b->region)
        return a->region < b->region ? -1 : 1;
    return a->other < b->other ? -1 : a->other > b->other;
}

/* The same, and in the order of triangles, so that sums do not depend on how equals are sorted. */
static int by_regions_and_triangle(const void *left, const void *right) {
    const struct side *a = left, *b = right;
    int order = by_regions(left, right);
    return order != 0 ? order : a->triangle < b->triangle ? -1 : a->triangle > b->triangle;
}

static void add_triangle(const struct color_regions *s, uint32_t t, struct side *to) {
    double weight = (double)mesh_triangle_area(s->mesh, t);
    to->weight += weight;
    for (int k = 0; k < 3; k++) {
        double value = (double)(&s->value[t].r)[k];
        to->sum[k] += weight * value;
        to->square += weight * value * value / 3.0;
    }
}

static void add_side(const struct side *from, struct side *to) {
    to->weight += from->weight;
    to->square += from->square;
    for (int k = 0; k < 3; k++)
        to->sum[k] += from->sum[k];
}

static void number_regions(struct color_regions *s, struct standing *now) {
    uint32_t *root = color_roots(s);
    size_t n = s->mesh->triangle_count;
    now->of_triangle = mem_array(n, sizeof *now->of_triangle);
    now->root = mem_array(n, sizeof *now->root);
    now->count = 0;
    for (uint32_t t = 0; t < n; t++) {
        if (root[t] != t)
            continue;
        now->of_triangle[t] = (uint32_t)now->count;
        now->root[now->count++] = t;
    }
    for (uint32_t t = 0; t < n; t++)
        now->of_triangle[t] = now->of_triangle[root[t]];
    mem_free(root);
}

/* Sides of all regions, from triangles COLOR_NEAR_RINGS or more from their border. */
static void find_sides(const struct color_regions *s, struct standing *now) {
    size_t n = s->mesh->triangle_count, near = 0, used = 0;
    uint8_t *ring = mem_array(n, sizeof *ring);
    uint32_t *beyond = mem_array(n, sizeof *beyond);
    color_rings(s, now->of_triangle, ring, beyond);
    for (uint32_t t = 0; t < n; t++)
        near += ring[t] >= COLOR_NEAR_RINGS && color_is_known(s, t);
    struct side *side = mem_calloc(near + 1, sizeof *side);
    for (uint32_t t = 0; t < n; t++) {
        if (ring[t] < COLOR_NEAR_RINGS || !color_is_known(s, t))
            continue;
        side[used].region = now->of_triangle[t];
        side[used].other = beyond[t];
        side[used].triangle = t;
        add_triangle(s, t, &side[used++]);
    }
    qsort(side, used, sizeof *side, by_regions_and_triangle);
    now->side_count = 0;
    for (size_t i = 0; i < used; i++) {
        if (now->side_count > 0 && by_regions(&side[now->side_count - 1], &side[i]) == 0)
            add_side(&side[i], &side[now->side_count - 1]);
        else
            side[now->side_count++] = side[i];
    }
    now->side = side;
    mem_free(beyond);
    mem_free(ring);
}

static void stand(struct color_regions *s, struct standing *now) {
    number_regions(s, now);
    now->all = mem_calloc(now->count, sizeof *now->all);
    for (uint32_t t = 0; t < s->mesh->triangle_count; t++)
        if (color_is_known(s, t))
            add_triangle(s, t, &now->all[now->of_triangle[t]]);
    find_sides(s, now);
}

static void standing_release(struct standing *now) {
    mem_free(now->side);
    mem_free(now->all);
    mem_free(now->root);
    mem_free(now->of_triangle);
}

/* The side of a region towards another, or all of it where it is too narrow. */
static const struct side *find_side(const struct standing *now, uint32_t region, uint32_t other) {
    struct side wanted = {.region = region, .other = other};
    const struct side *found = bsearch(&wanted, now->side, now->side_count, sizeof wanted, by_regions);
    return found ? found : &now->all[region];
}

/* The step from a side to the opposite one, as a multiple of what parts two things. */
static float step_of(const struct side *a, const struct side *b) {
    double off[3], level = 0.0, color = 0.0, variance = a->square / a->weight + b->square / b->weight;
    for (int k = 0; k < 3; k++) {
        double mean[2] = {a->sum[k] / a->weight, b->sum[k] / b->weight};
        off[k] = mean[0] - mean[1];
        level += off[k] / 3.0;
        variance -= (mean[0] * mean[0] + mean[1] * mean[1]) / 3.0;
    }
    for (int k = 0; k < 3; k++)
        color = fmax(color, fabs(off[k] - level));
    double deviation = sqrt(fmax(0.5 * variance, 1e-12));
    double size = fmax(color / (double)MIN_COLOR, fabs(level) / (double)MIN_BRIGHTNESS);
    return (float)fmin(size, fmax(color, fabs(level)) / ((double)MIN_DEVIATIONS * deviation));
}

/* Two regions that meet. */
struct region_pair {
    uint32_t a, b; /* a < b */
    float step;
};

static int by_step(const void *left, const void *right) {
    const struct region_pair *a = left, *b = right;
    if (a->step != b->step)
        return a->step < b->step ? -1 : 1;
    if (a->a != b->a)
        return a->a < b->a ? -1 : 1;
    return a->b < b->b ? -1 : a->b > b->b;
}

/* The numbers of the two regions that meet over link i, the lesser first; false where they are one. */
static bool regions_of(const struct color_regions *s, const struct standing *now, size_t i, struct region_pair *pair) {
    uint32_t a = now->of_triangle[s->link[i].half_edge / 3];
    uint32_t b = now->of_triangle[region_link_end(s->adjacency, &s->link[i])];
    *pair = (struct region_pair){a < b ? a : b, a < b ? b : a, 0.0f};
    return a != b;
}

/* Pairs that can be compared, once for every link over which they meet; the caller's. */
static struct region_pair *find_pairs(const struct color_regions *s, const struct standing *now, size_t *count) {
    struct region_pair one, *pair;
    size_t borders = 0;
    for (size_t i = 0; i < s->link_count; i++)
        borders += regions_of(s, now, i, &one);
    pair = mem_array(borders + 1, sizeof *pair);
    *count = 0;
    for (size_t i = 0; i < s->link_count; i++) {
        if (!regions_of(s, now, i, &one))
            continue;
        const struct side *a = find_side(now, one.a, one.b), *b = find_side(now, one.b, one.a);
        one.step = step_of(a, b);
        if (a->weight > 0.0 && b->weight > 0.0)
            pair[(*count)++] = one;
    }
    return pair;
}

bool color_steps_join(struct color_regions *s) {
    size_t count;
    struct standing now;
    stand(s, &now);
    struct region_pair *pair = find_pairs(s, &now, &count);
    bool *has_changed = mem_calloc(now.count, sizeof *has_changed), any = false;
    qsort(pair, count, sizeof *pair, by_step);
    for (size_t i = 0; i < count && pair[i].step < 1.0f; i++) {
        if (has_changed[pair[i].a] || has_changed[pair[i].b])
            continue;
        has_changed[pair[i].a] = has_changed[pair[i].b] = any = true;
        regions_join(&s->regions, now.root[pair[i].a], now.root[pair[i].b], 0.0f);
    }
    mem_free(has_changed);
    mem_free(pair);
    standing_release(&now);
    return any;
}
