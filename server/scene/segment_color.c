/* segment_color.c -- see segment_color.h.
 *
 * 1. Radiances are smoothed over neighbours that show nearly the same, in logarithms.
 * 2. Triangles are joined by what they show (regions.h). Of the regions those are cores that have some area away from
 *    their borders. Bands of triangles that show two things at once, patterns and noise have none: they are taken
 *    apart, and their triangles join the core that is reached over the lightest links, as a watershed.
 * 3. Cores that meet are compared there, and join unless the step between them is that of two things. */
#include "server/scene/segment_color.h"

#include <float.h>
#include <math.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#include "common/mem.h"
#include "server/scene/regions.h"

#define SMOOTH_SCALE 0.1f /* logarithms this far apart weigh half in a triangle's mean */
#define SMOOTH_ROUNDS 4
#define FLOOR 0.02f /* radiance added before the logarithm, of the mean of all */
/* Triangles from a border, from which and up to which sides are compared: nearer ones show both. */
#define NEAR_RINGS 3
#define FAR_RINGS 7
/* Least step, in logarithms: of colour, and of brightness alone, which the edge of a shadow has as well. */
#define MIN_COLOR 0.15f
#define MIN_BRIGHTNESS 1.1f
#define MIN_DEVIATIONS 2.0f /* of what the sides vary by */
/* Part of the least area that a core has away from its borders. */
#define MIN_WITHIN 0.1

#define NONE UINT32_MAX

struct color_split {
    const struct mesh *mesh;
    const struct adjacency *adjacency;
    const uint32_t *of_triangle; /* [triangle_count] segments */
    rgb *value;                  /* [triangle_count] logarithms; NAN: not known; owned, as the next two */
    struct regions regions;
    struct region_link *link; /* [link_count] within segments, the lightest first */
    size_t link_count;
};

static bool is_known(const struct color_split *s, uint32_t t) { return !isnan(s->value[t].r); }

static float distance(rgb a, rgb b) { return fmaxf(fabsf(a.r - b.r), fmaxf(fabsf(a.g - b.g), fabsf(a.b - b.b))); }

/* --- what triangles show ------------------------------------------------------------------------- */

static void take_logarithms(struct color_split *s, const rgb *shown) {
    double sum = 0.0, known = 0.0;
    for (size_t t = 0; t < s->mesh->triangle_count; t++) {
        if (shown[t].r < 0.0f)
            continue;
        sum += (double)rgb_mean(shown[t]);
        known += 1.0;
    }
    float floor = fmaxf(FLOOR * (float)(known > 0.0 ? sum / known : 1.0), FLT_MIN);
    for (size_t t = 0; t < s->mesh->triangle_count; t++)
        s->value[t] = shown[t].r < 0.0f
                          ? rgb_gray(NAN)
                          : rgb_make(logf(shown[t].r + floor), logf(shown[t].g + floor), logf(shown[t].b + floor));
}

/* The mean over a triangle and its neighbours, by how alike they are; of one that is not known over its neighbours. */
static rgb smoothed(const struct color_split *s, uint32_t t) {
    rgb own = s->value[t], sum = is_known(s, t) ? own : rgb_gray(0.0f);
    float total = is_known(s, t) ? 1.0f : 0.0f;
    for (uint32_t half = 3 * t; half < 3 * t + 3; half++) {
        uint32_t other = s->adjacency->next[half] / 3;
        if (other == t || s->of_triangle[other] != s->of_triangle[t] || !is_known(s, other))
            continue;
        float off = is_known(s, t) ? distance(own, s->value[other]) / SMOOTH_SCALE : 0.0f;
        float weight = 1.0f / (1.0f + off * off);
        sum = rgb_mad(sum, weight, s->value[other]);
        total += weight;
    }
    return total > 0.0f ? rgb_scale(sum, 1.0f / total) : rgb_gray(NAN);
}

static void smooth(struct color_split *s) {
    size_t n = s->mesh->triangle_count;
    rgb *next = mem_array(n, sizeof *next);
    for (int round = 0; round < SMOOTH_ROUNDS; round++) {
        for (uint32_t t = 0; t < n; t++)
            next[t] = smoothed(s, t);
        rgb *former = s->value;
        s->value = next;
        next = former;
    }
    mem_free(next);
}

static void make_links(struct color_split *s) {
    s->link = mem_array(3 * s->mesh->triangle_count + 1, sizeof *s->link);
    for (uint32_t h = 0; h < 3 * s->mesh->triangle_count; h++) {
        uint32_t next = s->adjacency->next[h], a = h / 3, b = next / 3;
        if (next <= h || s->of_triangle[a] != s->of_triangle[b])
            continue;
        float weight = is_known(s, a) && is_known(s, b) ? distance(s->value[a], s->value[b]) : INFINITY;
        s->link[s->link_count++] = (struct region_link){weight, h};
    }
    regions_sort_links(s->link, s->link_count);
}

/* --- cores --------------------------------------------------------------------------------------- */

/* Roots of the two triangles of link i. */
static void roots_of(struct color_split *s, size_t i, uint32_t root[2]) {
    root[0] = regions_root(&s->regions, s->link[i].half_edge / 3);
    root[1] = regions_root(&s->regions, region_link_end(s->adjacency, &s->link[i]));
}

/* The root of each triangle; [triangle_count], the caller's. */
static uint32_t *all_roots(struct color_split *s) {
    uint32_t *root = mem_array(s->mesh->triangle_count, sizeof *root);
    for (uint32_t t = 0; t < s->mesh->triangle_count; t++)
        root[t] = regions_root(&s->regions, t);
    return root;
}

/* region[triangle_count]: equal within a region. ring[triangle_count]: how many triangles it is from the border of its
 * region with another of its segment, up to FAR_RINGS; 0: farther. beyond[triangle_count]: where ring is not 0, the
 * region beyond the nearest border. */
static void find_rings(const struct color_split *s, const uint32_t *region, uint8_t *ring, uint32_t *beyond) {
    size_t n = s->mesh->triangle_count, first = 0, last = 0;
    uint32_t *queue = mem_array(n, sizeof *queue);
    memset(ring, 0, n);
    for (uint32_t t = 0; t < n; t++) {
        for (uint32_t half = 3 * t; half < 3 * t + 3 && ring[t] == 0; half++) {
            uint32_t other = s->adjacency->next[half] / 3;
            if (s->of_triangle[other] != s->of_triangle[t] || region[other] == region[t])
                continue;
            ring[t] = 1;
            beyond[t] = region[other];
            queue[last++] = t;
        }
    }
    for (; first < last; first++) {
        uint32_t t = queue[first];
        for (uint32_t half = 3 * t; half < 3 * t + 3 && ring[t] < FAR_RINGS; half++) {
            uint32_t other = s->adjacency->next[half] / 3;
            if (ring[other] != 0 || region[other] != region[t])
                continue;
            ring[other] = (uint8_t)(ring[t] + 1);
            beyond[other] = beyond[t];
            queue[last++] = other;
        }
    }
    mem_free(queue);
}

/* Takes apart the regions that are smaller than least_area or have next to nothing away from their borders. Sets
 * is_core[triangle_count], of roots. */
static void keep_cores(struct color_split *s, double least_area, bool *is_core) {
    size_t n = s->mesh->triangle_count;
    uint8_t *ring = mem_array(n, sizeof *ring);
    uint32_t *beyond = mem_array(n, sizeof *beyond), *root = all_roots(s);
    double *within = mem_calloc(n, sizeof *within);
    struct regions kept;
    find_rings(s, root, ring, beyond);
    for (uint32_t t = 0; t < n; t++)
        if (ring[t] == 0 || ring[t] >= NEAR_RINGS)
            within[root[t]] += (double)mesh_triangle_area(s->mesh, t);
    regions_init(&kept, s->mesh);
    memset(is_core, 0, n);
    for (uint32_t t = 0; t < n; t++) {
        bool stays = s->regions.area[root[t]] >= least_area && within[root[t]] >= MIN_WITHIN * least_area;
        if (stays && t != root[t])
            regions_join(&kept, regions_root(&kept, root[t]), t, 0.0f);
        else if (stays)
            is_core[t] = true;
    }
    for (uint32_t t = 0; t < n; t++) /* of the roots that joining chose */
        if (is_core[t])
            is_core[regions_root(&kept, t)] = true;
    regions_release(&s->regions);
    s->regions = kept;
    mem_free(within);
    mem_free(root);
    mem_free(beyond);
    mem_free(ring);
}

/* Gives all triangles to cores, round by round over the links that are left, the lightest first; where a connected part
 * of a segment has none it is one region. */
static void grow_cores(struct color_split *s, bool *is_core) {
    size_t *left = mem_array(s->link_count + 1, sizeof *left), count = s->link_count, before;
    uint32_t root[2];
    for (size_t i = 0; i < count; i++)
        left[i] = i;
    do {
        before = count;
        count = 0;
        for (size_t i = 0; i < before; i++) {
            roots_of(s, left[i], root);
            if (!is_core[root[0]] && !is_core[root[1]]) {
                left[count++] = left[i];
            } else if (!is_core[root[0]] || !is_core[root[1]]) {
                regions_join(&s->regions, root[0], root[1], 0.0f);
                is_core[regions_root(&s->regions, root[0])] = true;
            }
        }
    } while (count < before);
    for (size_t i = 0; i < count; i++) {
        roots_of(s, left[i], root);
        if (root[0] != root[1])
            regions_join(&s->regions, root[0], root[1], 0.0f);
    }
    mem_free(left);
}

/* --- borders ------------------------------------------------------------------------------------- */

/* What a region shows some triangles from its border with another, or all of it. */
struct side {
    uint32_t region, other;
    double weight, sum[3], square; /* areas; of the values, by areas; mean over the channels */
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

static void add_triangle(const struct color_split *s, uint32_t t, struct side *to) {
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

static void number_regions(struct color_split *s, struct standing *now) {
    uint32_t *root = all_roots(s);
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

/* Sides of all regions, from triangles NEAR_RINGS or more from their border. */
static void find_sides(const struct color_split *s, struct standing *now) {
    size_t n = s->mesh->triangle_count, near = 0, used = 0;
    uint8_t *ring = mem_array(n, sizeof *ring);
    uint32_t *beyond = mem_array(n, sizeof *beyond);
    find_rings(s, now->of_triangle, ring, beyond);
    for (uint32_t t = 0; t < n; t++)
        near += ring[t] >= NEAR_RINGS && is_known(s, t);
    struct side *side = mem_calloc(near + 1, sizeof *side);
    for (uint32_t t = 0; t < n; t++) {
        if (ring[t] < NEAR_RINGS || !is_known(s, t))
            continue;
        side[used].region = now->of_triangle[t];
        side[used].other = beyond[t];
        add_triangle(s, t, &side[used++]);
    }
    qsort(side, used, sizeof *side, by_regions);
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

static void stand(struct color_split *s, struct standing *now) {
    number_regions(s, now);
    now->all = mem_calloc(now->count, sizeof *now->all);
    for (uint32_t t = 0; t < s->mesh->triangle_count; t++)
        if (is_known(s, t))
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
static bool regions_of(const struct color_split *s, const struct standing *now, size_t i, struct region_pair *pair) {
    uint32_t a = now->of_triangle[s->link[i].half_edge / 3];
    uint32_t b = now->of_triangle[region_link_end(s->adjacency, &s->link[i])];
    *pair = (struct region_pair){a < b ? a : b, a < b ? b : a, 0.0f};
    return a != b;
}

/* Pairs that can be compared, once for every link over which they meet; the caller's. */
static struct region_pair *find_pairs(const struct color_split *s, const struct standing *now, size_t *count) {
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

/* Joins pairs without a step, the most alike first, each region once; returns whether there was one. */
static bool join_alike(struct color_split *s) {
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

/* --- the whole ----------------------------------------------------------------------------------- */

/* Numbers the regions: the largest of each piece of a segment that hangs together as before, the others from `count`
 * on. */
static size_t number_parts(struct color_split *s, uint32_t *of_triangle, size_t count) {
    size_t n = s->mesh->triangle_count, found = count;
    uint32_t *largest = mem_array(n, sizeof *largest), *number = mem_array(n, sizeof *number), *root = all_roots(s);
    struct regions piece;
    regions_init(&piece, s->mesh);
    for (size_t i = 0; i < s->link_count; i++) {
        uint32_t a = regions_root(&piece, s->link[i].half_edge / 3);
        uint32_t b = regions_root(&piece, region_link_end(s->adjacency, &s->link[i]));
        if (a != b)
            regions_join(&piece, a, b, 0.0f);
    }
    for (uint32_t t = 0; t < n; t++)
        largest[t] = number[t] = NONE;
    for (uint32_t t = 0; t < n; t++) {
        uint32_t *best = &largest[regions_root(&piece, t)];
        if (*best == NONE || s->regions.area[root[t]] > s->regions.area[*best])
            *best = root[t];
    }
    for (uint32_t t = 0; t < n; t++) {
        if (root[t] == largest[regions_root(&piece, t)])
            continue;
        if (number[root[t]] == NONE)
            number[root[t]] = (uint32_t)found++;
        of_triangle[t] = number[root[t]];
    }
    regions_release(&piece);
    mem_free(root);
    mem_free(number);
    mem_free(largest);
    return found;
}

size_t segment_color_split(uint32_t *of_triangle, size_t count, const struct mesh *mesh,
                           const struct adjacency *adjacency, const rgb *shown, double least_area) {
    size_t n = mesh->triangle_count;
    struct color_split s = {.mesh = mesh, .adjacency = adjacency, .of_triangle = of_triangle};
    bool *is_core = mem_array(n, sizeof *is_core);
    s.value = mem_array(n, sizeof *s.value);
    regions_init(&s.regions, mesh);
    take_logarithms(&s, shown);
    smooth(&s);
    make_links(&s);
    regions_join_by_weight(&s.regions, adjacency, s.link, s.link_count, mesh_area(mesh));
    keep_cores(&s, least_area, is_core);
    grow_cores(&s, is_core);
    while (join_alike(&s)) {
    }
    size_t found = number_parts(&s, of_triangle, count);
    mem_free(s.link);
    regions_release(&s.regions);
    mem_free(s.value);
    mem_free(is_core);
    return found;
}
