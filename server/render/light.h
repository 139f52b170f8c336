/* light.h -- light sources (emitter triangles and the environment) and how they are sampled.
 *
 * A triangle of an emitter segment is chosen with probability proportional to its power, area times luminance (mean
 * of the segment, ignoring its emission pattern), and a point on it uniformly; it emits from its front side only. The
 * environment is a latitude-longitude map (latlong.h), sampled by luminance times solid angle times mean visibility
 * from the room's surfaces (visibility.h) where that was measured; constant within a cell of the map (for large maps
 * a block of cells, to keep the table in the cache). The choice between environment and emitters is by power:
 * emitted, or arriving from the environment. */
#ifndef UNBAKE_RENDER_LIGHT_H
#define UNBAKE_RENDER_LIGHT_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "common/image.h"
#include "common/vec.h"
#include "server/render/visibility.h"
#include "server/scene/atlas.h"
#include "server/scene/latlong.h"
#include "server/scene/materials.h"
#include "server/scene/mesh.h"
#include "server/scene/segment.h"

/* Triangles larger than this fraction of the total emitting area are split into four, repeatedly. */
#define LIGHT_PARTS 32
#define LIGHT_MAX_LEVEL 4

#define LIGHT_ENVIRONMENT UINT32_MAX /* instead of an emitter's segment */

/* One cache line. The front side is that of edge1 x edge2. */
struct light_triangle {
    vec3 corner, edge1, edge2;
    rgb radiance;  /* mean of the segment */
    float density; /* of sampling its points, by area */
    uint32_t segment;
    uint32_t level; /* one of 4^level parts of a triangle of the mesh */
    uint32_t whole; /* that triangle */
};

/* Cumulative sums end in this many infinite entries, since searches read several entries at once. */
#define LIGHT_TABLE_PAD 3

/* A discrete distribution over [0, count): inversion of the cumulative sum, which keeps the stratification of its
 * input. A table of starting points makes searches short. */
struct light_table {
    size_t count;
    double total;
    float *cumulative; /* [count + 1 + LIGHT_TABLE_PAD] 0 to 1; owned */
    size_t guide_count;
    uint32_t *guide; /* [guide_count] the entry whose range contains i / guide_count; owned */
};

struct lights {
    size_t triangle_count;
    struct light_triangle *triangle; /* owned */
    struct light_table triangles;
    const struct atlas *atlas; /* borrowed, both; NULL before lights_update */
    const struct materials *materials;
    uint32_t *first_of; /* [triangles of the mesh] index of the first part, for those that emit; owned */
    size_t segment_count;
    rgb *emission;            /* [segment_count] copy that the tables were made from; owned */
    float *area_density;      /* [segment_count] density by area of sampling a point on the front side; 0 for
                              * non-emitters; owned */
    float environment_chance; /* probability of sampling the environment */
    double environment_power; /* power that arrives from it; negative where visibility was not measured */
    uint32_t width, height;   /* of the environment; 0 when there is none */
    float (*environment)[3];  /* [height][width + 1], last column = first; owned */
    uint32_t grain;           /* cells along each side of a block; blocks at the border may be smaller */
    uint32_t block_columns;
    struct light_table blocks; /* of width x (height - 1) cells, which lie between pixel centres */
};

/* Number of entries from `entry` to the one whose range contains u: a linear search, four at a time without branches,
 * which would be mispredicted. */
static inline size_t light_table_steps(const float *cumulative, size_t entry, float u) {
    size_t steps = 0, passed;
    do {
        const float *end = cumulative + entry + steps + 1;
        passed = (size_t)(end[0] <= u) + (size_t)(end[1] <= u) + (size_t)(end[2] <= u) + (size_t)(end[3] <= u);
        steps += passed;
    } while (passed == LIGHT_TABLE_PAD + 1);
    return steps;
}

/* The entry whose range contains u in [0, 1). */
static inline uint32_t light_table_pick(const struct light_table *t, float u) {
    size_t at = (size_t)(u * (float)t->guide_count);
    at = at < t->guide_count ? at : t->guide_count - 1;
    uint32_t entry = t->guide[at];
    /* rounding of u * count may have passed a boundary */
    while (entry > 0 && t->cumulative[entry] > u)
        entry--;
    size_t found = entry + light_table_steps(t->cumulative, entry, u);
    return (uint32_t)(found < t->count ? found : t->count - 1); /* rounding may have made u 1 */
}

/* A sampled direction towards light. */
struct light_sample {
    vec3 point, normal; /* on the emitter; normal towards its front */
    vec3 direction;     /* unit, from the shaded point */
    float distance_m;   /* INFINITY for the environment */
    float pdf;          /* by solid angle; 0: no sample */
    uint32_t segment;   /* or LIGHT_ENVIRONMENT */
    rgb radiance;
};

struct lights *lights_new(const struct image *environment);
void lights_free(struct lights *lights);

/* Copies another environment (NULL: none). Without visibility all directions count as visible, and half of the
 * samples go to the environment. */
void lights_set_environment(struct lights *lights, const struct image *environment,
                            const struct visibility *visibility);

/* Takes over changed emission. Mesh, segments and atlas are those of the last call; materials stay borrowed. True
 * when the set of emitting segments changed, and with it the list of triangles. */
bool lights_update(struct lights *lights, const struct mesh *mesh, const struct segments *segments,
                   const struct atlas *atlas, const struct materials *materials);

/* Emission pattern at the point of a light triangle that (u, v) in [0, 1) select. */
rgb lights_pattern(const struct lights *lights, const struct light_triangle *triangle, float u, float v);

/* The part of an emitting mesh triangle that contains (b1, b2). Parts are in rows along the second edge, upright and
 * inverted ones alternating. */
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

/* Whether there is any light. */
static inline bool lights_any(const struct lights *lights) {
    return lights->triangles.total > 0.0 || lights->environment_chance > 0.0f;
}

/* Maps a number that did not choose the environment (>= environment_chance) back to [0, 1). */
static inline float lights_rescale(const struct lights *lights, float pick) {
    float at = (pick - lights->environment_chance) / (1.0f - lights->environment_chance);
    return at < 0x1.fffffep-1f ? at : 0x1.fffffep-1f;
}

/* The triangle for such a number, by power; there must be one. */
static inline const struct light_triangle *lights_pick(const struct lights *lights, float pick) {
    return &lights->triangle[light_table_pick(&lights->triangles, lights_rescale(lights, pick))];
}

/* Samples a direction towards light from `point`, for numbers in [0, 1). */
void lights_sample(const struct lights *lights, vec3 point, float pick, float u, float v, struct light_sample *sample);

/* Density by solid angle with which lights_sample samples a given emitter point, at this distance and |cosine| on its
 * front side. */
static inline float lights_pdf_segment(const struct lights *lights, uint32_t segment, float distance_m, float cosine) {
    return lights->area_density[segment] * distance_m * distance_m / fmaxf(cosine, 1e-6f);
}

/* The environment's radiance from a unit direction (bilinear), and its sampling density. */
rgb lights_environment(const struct lights *lights, vec3 direction);
float lights_pdf_environment(const struct lights *lights, vec3 direction);

#endif
