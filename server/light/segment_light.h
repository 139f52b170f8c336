/* segment_light.h -- how a segment would light points if it emitted. */
#ifndef UNBAKE_LIGHT_SEGMENT_LIGHT_H
#define UNBAKE_LIGHT_SEGMENT_LIGHT_H

#include "server/light/light_point.h"
#include "server/scene/by_segment.h"

/* What is the same for all segments. */
struct segment_light {
    const struct reconstruction *r;        /* borrowed */
    struct triangles_by_segment triangles; /* owned */
    float *area_m2;                        /* [segment_count]; owned */
};

void segment_light_init(struct segment_light *l, const struct reconstruction *r);
void segment_light_release(struct segment_light *l);

/* A diffuse emitter that is small beside its distance to what it lights. */
struct segment_light_disc {
    struct surface_point at; /* position, normal */
    float area_m2, radiance;
};

/* Fills disc[wanted] with discs of radiance 1 that stand for equal parts of a segment's area; returns their number. */
size_t segment_light_spread(const struct segment_light *l, uint32_t segment, size_t wanted,
                            struct segment_light_disc *disc);

/* Adds to column[count] what a surface of albedo 1 at each point would send of the light of discs. */
void segment_light_add_discs(const struct segment_light *l, const struct light_point *point, size_t count,
                             const struct segment_light_disc *disc, size_t disc_count, float *column);

/* The same of a radiance of 1 from the front of the whole segment, by so many discs, SEGMENT_LIGHT_POINTS at most. */
#define SEGMENT_LIGHT_POINTS 32
void segment_light_add(const struct segment_light *l, const struct light_point *point, size_t count, uint32_t segment,
                       size_t points, float *column);

#endif
