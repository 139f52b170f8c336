/* split.c -- see split.h.
 *
 * Segment by segment, at rising levels of radiance: connected sets of triangles of at least the level's observed
 * radiance are tested, until the level exceeds the Lambert radiance at albedo 1 there. So a part is as large as it can
 * be, and all of it is brighter than what it could reflect. */
#include "server/light/decision/split.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "common/mem.h"
#include "common/quantile.h"
#include "server/capture/triangle_light.h"
#include "server/light/decision/reflection.h"
#include "server/light/decision/rim.h"
#include "server/light/decision/shining.h"
#include "server/light/light_priors.h"
#include "server/scene/adjacency.h"
#include "server/scene/by_segment.h"

#define FIRST_LEVEL 1.5f /* over the photographs' median radiance; no part is dimmer */
#define LEVEL_STEP 1.25f /* from a level to the next; smaller steps find larger parts and take longer */
/* A set whose Lambert radiance was above its level is tested again from this part of it on, for time. */
#define NEAR 0.8f
/* Least size of a part and of the rest, in pixels of all photographs; that of the rest over the part's; least ratio of
 * their median radiances. */
#define MIN_PIXELS 100.0f
#define MIN_SHARE 0.05f
#define MIN_CONTRAST 2.0f
/* Triangles below this part of their part's radiance are mixed with their neighbours. */
#define PURE 0.3f
/* How far from a part's rim its step is measured: beyond mixed pixels, and before light has fallen off. */
#define RIM_PIXELS 2.0f
#define RIM_TRIANGLES 16 /* the same in triangles, at most */
/* Deviations of base colour within a segment by which the step must exceed none, as all in which a lamp is told from
 * what it lights (reflection.h). */
#define RIM_SURE 3.0

struct split_job {
    const struct reconstruction *r;
    struct shining shining;
    struct triangle_light light;
    struct adjacency adjacency;
    float first_level;
    struct triangles_by_segment triangles;
    uint32_t *parent; /* [triangle_count] connected sets at the present level, written by segment */
    uint32_t *part;   /* [triangle_count] number of the part among its segment's, from 1; 0: the rest */
    bool *settled;    /* [triangle_count] belongs to no further part */
    float *needed;    /* [triangle_count] no level below this is tested */
    uint32_t *count;  /* [segment_count] parts found */
    struct rim rim;
};

/* A segment at one level. */
struct split_level {
    const struct split_job *job;
    const uint32_t *triangle; /* [triangle_count] of the segment */
    size_t triangle_count;
    uint32_t segment;
    float radiance;          /* least observed radiance of a part at this level */
    uint32_t *part, *darker; /* [triangle_count] scratch: a possible part; what is darker than the level */
    uint32_t *beside;        /* [triangle_count] scratch */
    float *value;            /* [triangle_count] scratch, as below */
    struct member *member;
};

/* --- connected sets ------------------------------------------------------------------------------- */

static uint32_t root_of(uint32_t *parent, uint32_t t) {
    while (parent[t] != t)
        t = parent[t] = parent[parent[t]];
    return t;
}

static bool is_bright(const struct split_level *l, uint32_t t) {
    return !l->job->settled[t] && l->job->light.observed[t] >= l->radiance;
}

/* Joins neighbouring triangles of at least the level. */
static void connect(const struct split_level *l) {
    const struct split_job *job = l->job;
    for (size_t i = 0; i < l->triangle_count; i++)
        job->parent[l->triangle[i]] = l->triangle[i];
    for (size_t i = 0; i < l->triangle_count; i++) {
        uint32_t t = l->triangle[i];
        for (uint32_t h = 3 * t; is_bright(l, t) && h < 3 * t + 3; h++) {
            uint32_t other = job->adjacency.next[h] / 3;
            if (job->r->segments.of_triangle[other] != l->segment || !is_bright(l, other))
                continue;
            uint32_t a = root_of(job->parent, t), b = root_of(job->parent, other);
            job->parent[a > b ? a : b] = a > b ? b : a;
        }
    }
}

/* --- a part --------------------------------------------------------------------------------------- */

struct split_measure {
    float pixels, radiance; /* that they fill together; the median of their observed radiances */
    bool is_clipped;        /* most are, in all photographs and channels */
};

static struct split_measure measure(const struct split_level *l, const uint32_t *triangle, size_t count) {
    struct split_measure m = {0};
    size_t clipped = 0;
    for (size_t i = 0; i < count; i++) {
        m.pixels += l->job->light.pixels[triangle[i]];
        clipped += l->job->light.is_clipped[triangle[i]];
        l->value[i] = l->job->light.observed[triangle[i]];
    }
    m.radiance = quantile(l->value, count, 0.5);
    m.is_clipped = 2 * clipped > count;
    return m;
}

static size_t collect_darker(const struct split_level *l) {
    size_t count = 0;
    for (size_t i = 0; i < l->triangle_count; i++) {
        float observed = l->job->light.observed[l->triangle[i]];
        if (!l->job->settled[l->triangle[i]] && observed >= 0.0f && observed < l->radiance)
            l->darker[count++] = l->triangle[i];
    }
    return count;
}

/* Keeps those of the part's triangles that show it alone, of a clipped one those that are. All of them are settled. */
static size_t settle(const struct split_level *l, size_t part_size, const struct split_measure *part) {
    size_t kept = 0;
    for (size_t i = 0; i < part_size; i++) {
        uint32_t t = l->part[i];
        l->job->settled[t] = true;
        if (part->is_clipped ? l->job->light.is_clipped[t] : l->job->light.observed[t] >= PURE * part->radiance)
            l->part[kept++] = t;
    }
    return kept;
}

/* Whether a part ends more sharply than base colour may in a segment. */
static bool has_sharp_rim(const struct split_level *l, size_t part_size, float pixels) {
    float triangles = ceilf(RIM_PIXELS / sqrtf(pixels / (float)part_size));
    double step = rim_step(&l->job->rim, l->part, part_size, (int)fminf(triangles, RIM_TRIANGLES), l->beside);
    return step > RIM_SURE * M_SQRT2 * hypot(ALBEDO_POINT, ALBEDO_PATCH);
}

static void make_part(const struct split_level *l, size_t part_size) {
    uint32_t part = ++l->job->count[l->segment];
    for (size_t i = 0; i < part_size; i++)
        l->job->part[l->part[i]] = part;
}

/* Tests one connected set of triangles of at least the level's radiance. */
static void try_part(const struct split_level *l, size_t part_size, const struct split_measure *darker,
                     size_t darker_count) {
    const struct split_job *job = l->job;
    struct split_measure part = measure(l, l->part, part_size);
    if (part.pixels < MIN_PIXELS || l->radiance < job->needed[l->part[0]])
        return;
    float lambert = shining_lambert(&job->shining, l->part, part_size);
    float needed = lambert * reflection_limit(job->shining.unseen_share) / (part.is_clipped ? SHINING_SATURATED : 1.0f);
    if (l->radiance < needed) {
        for (size_t i = 0; i < part_size; i++)
            job->needed[l->part[i]] = NEAR * needed;
        return;
    }
    part_size = settle(l, part_size, &part);
    if (darker->pixels >= fmaxf(MIN_PIXELS, MIN_SHARE * part.pixels) &&
        part.radiance >= MIN_CONTRAST * darker->radiance && has_sharp_rim(l, part_size, part.pixels) &&
        !shining_is_sunlit(&job->shining, l->part, part_size, l->darker, darker_count))
        make_part(l, part_size);
}

struct member {
    uint32_t root, triangle;
};

static int by_root(const void *a, const void *b) {
    const struct member *x = a, *y = b;
    if (x->root != y->root)
        return x->root < y->root ? -1 : 1;
    return x->triangle < y->triangle ? -1 : x->triangle > y->triangle;
}

static void try_level(const struct split_level *l) {
    size_t darker_count = collect_darker(l), members = 0;
    struct split_measure darker = measure(l, l->darker, darker_count);
    connect(l);
    for (size_t i = 0; i < l->triangle_count; i++) {
        if (is_bright(l, l->triangle[i]))
            l->member[members++] = (struct member){root_of(l->job->parent, l->triangle[i]), l->triangle[i]};
    }
    qsort(l->member, members, sizeof *l->member, by_root);
    for (size_t i = 0, end; i < members; i = end) {
        size_t part_size = 0;
        for (end = i; end < members && l->member[end].root == l->member[i].root; end++)
            l->part[part_size++] = l->member[end].triangle;
        try_part(l, part_size, &darker, darker_count);
    }
}

/* --- all segments --------------------------------------------------------------------------------- */

static float brightest(const struct split_job *job, const uint32_t *triangle, size_t count) {
    float radiance = 0.0f;
    for (size_t i = 0; i < count; i++)
        radiance = fmaxf(radiance, job->light.observed[triangle[i]]);
    return radiance;
}

static void try_segment(void *user, size_t segment, int thread) {
    (void)thread;
    struct split_job *job = user;
    const uint32_t *first = job->triangles.first;
    size_t count = first[segment + 1] - first[segment];
    struct split_level l = {.job = job,
                            .triangle = job->triangles.triangle + first[segment],
                            .triangle_count = count,
                            .segment = (uint32_t)segment,
                            .radiance = job->first_level};
    float most = brightest(job, l.triangle, count);
    if (!(most >= l.radiance))
        return;
    l.part = mem_array(count, sizeof *l.part);
    l.darker = mem_array(count, sizeof *l.darker);
    l.beside = mem_array(count, sizeof *l.beside);
    l.value = mem_array(count, sizeof *l.value);
    l.member = mem_array(count, sizeof *l.member);
    for (; l.radiance <= most; l.radiance *= LEVEL_STEP)
        try_level(&l);
    mem_free(l.member);
    mem_free(l.value);
    mem_free(l.beside);
    mem_free(l.darker);
    mem_free(l.part);
}

/* Numbers the parts after the segments, in the order of these. */
static void number_parts(struct split *split, const struct split_job *job, struct segments *segments) {
    split->old_count = segments->count;
    for (size_t s = 0; s < split->old_count; s++)
        split->part_count += job->count[s];
    split->whole = mem_array(split->part_count + 1, sizeof *split->whole);
    segments->id = mem_realloc_array(segments->id, split->old_count + split->part_count, sizeof *segments->id);
    for (size_t s = 0; s < split->old_count; s++) {
        uint32_t first = (uint32_t)segments->count;
        for (uint32_t part = 1; part <= job->count[s]; part++) {
            split->whole[segments->count - split->old_count] = (uint32_t)s;
            segments->id[segments->count++] = segments->id[s];
        }
        for (size_t i = job->triangles.first[s]; i < job->triangles.first[s + 1]; i++) {
            uint32_t t = job->triangles.triangle[i];
            segments->of_triangle[t] = job->part[t] > 0 ? first + job->part[t] - 1 : (uint32_t)s;
        }
    }
}

void split_segments(struct split *split, struct reconstruction *r, const struct views *views) {
    size_t triangles = r->scene->mesh.triangle_count;
    struct split_job job = {.r = r, .first_level = FIRST_LEVEL * views->median_radiance};
    *split = (struct split){0};
    triangle_light_measure(&job.light, views, r->pool);
    shining_init(&job.shining, r, &job.light);
    adjacency_make(&job.adjacency, &r->scene->mesh);
    job.rim = (struct rim){&job.adjacency, r->segments.of_triangle, job.light.observed, mem_calloc(triangles, 1)};
    by_segment_sort_triangles(&job.triangles, &r->segments, triangles);
    job.parent = mem_array(triangles, sizeof *job.parent);
    job.part = mem_calloc(triangles, sizeof *job.part);
    job.settled = mem_calloc(triangles, sizeof *job.settled);
    job.needed = mem_calloc(triangles, sizeof *job.needed);
    job.count = mem_calloc(r->segments.count, sizeof *job.count);
    parallel_for(r->pool, r->segments.count, try_segment, &job);
    number_parts(split, &job, &r->segments);
    mem_free(job.rim.side);
    mem_free(job.count);
    mem_free(job.needed);
    mem_free(job.settled);
    mem_free(job.part);
    mem_free(job.parent);
    by_segment_release_triangles(&job.triangles);
    adjacency_release(&job.adjacency);
    shining_release(&job.shining);
    triangle_light_release(&job.light);
}

void split_release(struct split *split) {
    mem_free(split->whole);
    *split = (struct split){0};
}
