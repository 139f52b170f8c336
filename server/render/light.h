/* light.h -- what light comes from: emitter triangles and the environment, and how to pick one.
 *
 * A triangle of an emitter segment is picked with probability proportional to its power, area
 * times luminance (that of the segment's mean, whatever pattern its emission has), and a point on it
 * uniformly; it emits from its front side only. The
 * environment is a latitude-longitude map (latlong.h), picked by luminance times solid angle and, where that
 * was measured, by how much of the direction's light finds a way in (reach.h), constant within a
 * cell of the map (of a large map: a block of cells, so that the table stays in the cache). With
 * both present samples are shared out by power: what emitters send out, and what of the environment
 * arrives. */
#ifndef UNBAKE_RENDER_LIGHT_H
#define UNBAKE_RENDER_LIGHT_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "common/image.h"
#include "common/vec.h"
#include "server/render/reach.h"
#include "server/scene/atlas.h"
#include "server/scene/latlong.h"
#include "server/scene/materials.h"
#include "server/scene/mesh.h"
#include "server/scene/segment.h"

/* Triangles larger than this part of all that emits are cut into quarters until they are not. */
#define LIGHT_PARTS 32
#define LIGHT_MAX_LEVEL 4

#define LIGHT_ENVIRONMENT UINT32_MAX /* in the place of an emitter's segment */

/* One cache line. The front side is that of edge1 x edge2. */
struct light_triangle {
    vec3 corner, edge1, edge2;
    rgb radiance;  /* mean of the segment */
    float density; /* by area, with which its points are picked */
    uint32_t segment;
    uint32_t level;   /* cut out of a triangle of the mesh into 4^level parts */
    uint32_t whole;   /* that triangle */
};

/* Cumulative sums end in this many infinite entries: searches take several entries at once. */
#define LIGHT_TABLE_PAD 3

/* A distribution over [0, count): monotone inversion of the cumulative sum, by a table that
 * starts each search near its end, so that stratified numbers give stratified choices. */
struct light_table {
    size_t count;
    double total;
    float *cumulative; /* [count + 1 + LIGHT_TABLE_PAD] 0 to 1; owned */
    size_t guide_count;
    uint32_t *guide;   /* [guide_count]: entry whose range holds i / guide_count; owned */
};

struct lights {
    size_t triangle_count;
    struct light_triangle *triangle; /* owned */
    struct light_table triangles;
    const struct atlas *atlas;         /* borrowed, both; NULL before lights_update */
    const struct materials *materials;
    uint32_t *first_of;      /* [triangles of the mesh] the first part of those that emit; owned */
    size_t segment_count;
    rgb *emission;           /* [segment_count] owned copy: what the tables were made from */
    float *area_density;     /* [segment_count] density by area with which a point on a front face
                              * is picked; 0 for what does not emit; owned */
    float environment_chance; /* with which a sample goes to the environment */
    double environment_power; /* what arrives of it; negative where that was not measured */
    uint32_t width, height;  /* of the environment; 0 when there is none */
    float (*environment)[3]; /* [height][width + 1], last column = first; owned */
    uint32_t grain;          /* cells along each side of a block; the last ones may be smaller */
    uint32_t block_columns;
    struct light_table blocks; /* of width x (height - 1) cells, which lie between pixel centres */
};

/* How many entries to go on from `entry` to the one whose range holds u: a linear search, by four at
 * once, since how many of the first few are passed is too random to branch on. */
static inline size_t light_table_steps(const float *cumulative, size_t entry, float u) {
    size_t steps = 0, passed;
    do {
        const float *end = cumulative + entry + steps + 1;
        passed = (size_t)(end[0] <= u) + (size_t)(end[1] <= u) + (size_t)(end[2] <= u) + (size_t)(end[3] <= u);
        steps += passed;
    } while (passed == LIGHT_TABLE_PAD + 1);
    return steps;
}

/* The entry whose range holds u in [0, 1), searched from the guide's entry. */
static inline uint32_t light_table_pick(const struct light_table *t, float u) {
    size_t at = (size_t)(u * (float)t->guide_count);
    at = at < t->guide_count ? at : t->guide_count - 1;
    uint32_t entry = t->guide[at];
    /* Rounding of u * count may have passed a boundary. */
    while (entry > 0 && t->cumulative[entry] > u)
        entry--;
    size_t found = entry + light_table_steps(t->cumulative, entry, u);
    return (uint32_t)(found < t->count ? found : t->count - 1); /* where rounding made u 1 */
}

/* A sampled direction towards light. */
struct light_sample {
    vec3 point, normal; /* on the emitter; normal towards its front */
    vec3 direction;     /* unit, from the shaded point */
    float distance_m;   /* INFINITY for the environment */
    float pdf;          /* by solid angle; 0: nothing to be had */
    uint32_t segment;   /* or LIGHT_ENVIRONMENT */
    rgb radiance;
};

struct lights *lights_new(const struct image *environment);
void lights_free(struct lights *lights);

/* Puts a copy of another environment in the place of the present one (NULL: none). Without a reach
 * every direction is thought to be open, and half of all samples go to the environment. */
void lights_set_environment(struct lights *lights, const struct image *environment,
                            const struct reach *reach);

/* Takes over changed emission. The mesh, its segments and its atlas are those of the last call; the materials stay
 * borrowed. True when other segments emit than before, and the list of triangles is a new one. */
bool lights_update(struct lights *lights, const struct mesh *mesh, const struct segments *segments,
                   const struct atlas *atlas, const struct materials *materials);

/* The radiance of a light triangle at the point that u, v in [0, 1) pick, over the mean of its segment. */
rgb lights_pattern(const struct lights *lights, const struct light_triangle *triangle, float u, float v);

/* The part of a triangle of the mesh, which must emit, in which (b1, b2) lie. Parts are in rows
 * along the second edge, those that stand on their heads between the others. */
static inline uint32_t lights_part(const struct lights *lights, uint32_t mesh_triangle, float b1, float b2) {
    uint32_t first = lights->first_of[mesh_triangle], n = UINT32_C(1) << lights->triangle[first].level;
    if (n == 1)
        return first;
    float x = b1 * (float)n, y = b2 * (float)n;
    uint32_t i = (uint32_t)x, j = (uint32_t)y;
    i = i < n ? i : n - 1;
    j = j < n - i ? j : n - i - 1;
    uint32_t turned = x - (float)i + y - (float)j > 1.0f && i + j + 1 < n ? 1 : 0;
    return first + i * (2 * n - i) + 2 * j + turned;
}

/* True when anything shines. */
static inline bool lights_any(const struct lights *lights) {
    return lights->triangles.total > 0.0 || lights->environment_chance > 0.0f;
}

/* Of a number in [0, 1) that did not choose the environment (at or above environment_chance): where
 * in what is left, in [0, 1). */
static inline float lights_rescale(const struct lights *lights, float pick) {
    float at = (pick - lights->environment_chance) / (1.0f - lights->environment_chance);
    return at < 0x1.fffffep-1f ? at : 0x1.fffffep-1f;
}

/* The triangle for such a number, by power; there must be one. */
static inline const struct light_triangle *lights_pick(const struct lights *lights, float pick) {
    return &lights->triangle[light_table_pick(&lights->triangles, lights_rescale(lights, pick))];
}

/* Picks a direction as seen from `point` for numbers in [0, 1). */
void lights_sample(const struct lights *lights, vec3 point, float pick, float u, float v,
                   struct light_sample *sample);

/* Density by solid angle with which lights_sample would have picked the emitter point met by a
 * ray: at this distance, |cosine| on its front side. */
static inline float lights_pdf_segment(const struct lights *lights, uint32_t segment,
                                       float distance_m, float cosine) {
    return lights->area_density[segment] * distance_m * distance_m / fmaxf(cosine, 1e-6f);
}

/* The environment's radiance from a unit direction (bilinear), and its density. */
rgb lights_environment(const struct lights *lights, vec3 direction);
float lights_pdf_environment(const struct lights *lights, vec3 direction);

#endif
