/* specular_points.c -- see specular_points.h. */
#include "server/material/specular_points.h"

#include <math.h>
#include <string.h>

#include "common/mem.h"

/* A segment is sampled well enough with this many points, or with one in PART_ENOUGH of those wanted if that is more.
 * With fewer, pixels nearer to edges are used too, then smaller patches. 32 points of 3 views decide between
 * candidates whose misfits differ by a fifth (1 / sqrt(32)) of a point's. */
#define POINTS_ENOUGH 32 /* +25 %: no change */
#define PART_ENOUGH 8    /* +25 %: 0 dB, roughness -0.14, specular -0.20 */
#define MIN_VIEWS 3      /* observations of a point; to 4: +0.06 dB, roughness +1.45, specular +1.60 */
/* Standard error, as a part of the misfit, from errors that all texels of a segment share: incident light, base colour
 * and, where every pixel is near an edge, light of other surfaces. Near window bars and door frames the true material's
 * misfit is up to a tenth above that of a diffuse one. */
#define MISFIT_FLOOR 0.01      /* +25 %: -0.11 dB, roughness -1.35, specular +0.33 */
#define MISFIT_FLOOR_EDGE 0.03 /* +25 %: 0 dB */

/* What a segment tries next. */
struct point_search {
    struct specular_criteria criteria;
    bool is_over, is_last; /* last: without clean observations mixed pixels and single photographs have to do */
    size_t tried;          /* texels, by the present criteria */
    size_t first, count;   /* of the round's tries */
};

/* A try of a round. */
struct point_attempt {
    uint32_t segment;
    bool is_observed;
    struct specular_sample sample;
};

struct point_round {
    const struct specular_observer *observer;
    struct point_search *search;   /* [segment_count]; owned, as the next */
    struct point_attempt *attempt; /* [sum of points wanted] */
};

static void observe(void *user, size_t index, int thread) {
    const struct point_round *r = user;
    struct point_attempt *a = &r->attempt[index];
    const struct point_search *s = &r->search[a->segment];
    (void)thread;
    a->is_observed = specular_observe(r->observer, a->segment, s->tried + index - s->first, s->criteria, &a->sample);
}

/* Begins to try by other criteria. */
static void begin(struct point_search *s, struct specular_points *e, struct specular_criteria criteria) {
    s->criteria = criteria;
    s->tried = 0;
    e->count = 0;
    e->floor = criteria.edge == 0 ? MISFIT_FLOOR : MISFIT_FLOOR_EDGE;
}

/* Relaxes the criteria of a segment whose texels are all tried, unless it has enough points. */
static void relax(const struct point_round *r, size_t segment, struct segment_points *p) {
    struct point_search *s = &r->search[segment];
    struct specular_criteria c = s->criteria;
    size_t enough = specular_points_wanted(r->observer, segment) / PART_ENOUGH;
    bool is_smallest = c.patch <= SPECULAR_MIN_PATCH, few = p->points.count < 2;
    enough = enough < POINTS_ENOUGH ? POINTS_ENOUGH : enough;
    if (s->is_last) {
        s->is_over = true;
        p->points.count = few ? 0 : p->points.count;
    } else if (p->points.count >= enough || (is_smallest && c.edge + 1 == VIEWS_EDGE && !few)) {
        s->is_over = p->is_observed = true;
    } else if (c.edge + 1 < VIEWS_EDGE) {
        begin(s, &p->points, (struct specular_criteria){c.patch, c.edge + 1, MIN_VIEWS});
    } else if (!is_smallest) {
        begin(s, &p->points, (struct specular_criteria){fmaxf(0.5f * c.patch, SPECULAR_MIN_PATCH), 0, MIN_VIEWS});
    } else {
        s->is_last = true;
        begin(s, &p->points, (struct specular_criteria){SPECULAR_MIN_PATCH, VIEWS_EDGE, 1});
    }
}

/* Lists the tries of a segment's next round; none where its search is over. */
static size_t list_tries(const struct point_round *r, size_t segment, struct segment_points *p, size_t first) {
    struct point_search *s = &r->search[segment];
    size_t wanted = specular_points_wanted(r->observer, segment), tries = specular_tries(r->observer, segment);
    while (!s->is_over && (p->points.count == wanted || s->tried == tries))
        relax(r, segment, p);
    s->first = first;
    s->count = s->is_over ? 0 : wanted - p->points.count;
    s->count = s->count < tries - s->tried ? s->count : tries - s->tried;
    for (size_t i = 0; i < s->count; i++)
        r->attempt[first + i].segment = (uint32_t)segment;
    return s->count;
}

static void take_tries(const struct point_round *r, size_t segment, struct specular_points *e) {
    struct point_search *s = &r->search[segment];
    for (size_t i = s->first; i < s->first + s->count; i++)
        if (r->attempt[i].is_observed)
            e->sample[e->count++] = r->attempt[i].sample;
    s->tried += s->count;
}

void specular_points_find(const struct specular_observer *observer, const bool *is_emitter,
                          struct segment_points *points, struct parallel *pool) {
    size_t segments = observer->in.surface.segments->count, room = 0, count;
    struct point_round r = {observer, mem_calloc(segments + 1, sizeof *r.search), NULL};
    for (size_t i = 0; i < segments; i++) {
        room += specular_points_wanted(observer, i);
        r.search[i].is_over = is_emitter[i];
        begin(&r.search[i], &points[i].points,
              (struct specular_criteria){specular_widest_patch(observer, i), 0, MIN_VIEWS});
    }
    r.attempt = mem_array(room + 1, sizeof *r.attempt);
    do {
        count = 0;
        for (size_t i = 0; i < segments; i++)
            count += list_tries(&r, i, &points[i], count);
        parallel_for(pool, count, observe, &r);
        for (size_t i = 0; i < segments; i++)
            take_tries(&r, i, &points[i].points);
    } while (count > 0);
    mem_free(r.attempt);
    mem_free(r.search);
}
