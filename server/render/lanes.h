/* lanes.h -- path vertices in structure-of-arrays blocks, for loops that vectorise.
 *
 * A block holds LANES vertices of one depth, one per lane. Kernels (shade.c) are plain loops over the lanes of a
 * block with the vector functions of vec.h inlined; lanes past the block's count compute garbage that is never read.
 * Internal to path.c, path_backward.c and shade.c. */
#ifndef UNBAKE_RENDER_LANES_H
#define UNBAKE_RENDER_LANES_H

#include <stdint.h>

#include "common/vec.h"

#define LANES 64 /* vertices of a block: a few vectors of any instruction set */

struct lanes3 {
    float x[LANES], y[LANES], z[LANES];
};

static inline vec3 lanes3_get(const struct lanes3 *a, int lane) { return (vec3){a->x[lane], a->y[lane], a->z[lane]}; }
static inline void lanes3_set(struct lanes3 *a, int lane, vec3 v) {
    a->x[lane] = v.x;
    a->y[lane] = v.y;
    a->z[lane] = v.z;
}
/* Colours use the same storage. */
static inline rgb lanes3_rgb(const struct lanes3 *a, int lane) { return (rgb){a->x[lane], a->y[lane], a->z[lane]}; }
static inline void lanes3_set_rgb(struct lanes3 *a, int lane, rgb v) {
    a->x[lane] = v.r;
    a->y[lane] = v.g;
    a->z[lane] = v.b;
}

/* What the backward pass needs of a vertex; see path.c for the terms. */
struct vertex_block {
    uint32_t path[LANES];
    uint32_t parent[LANES]; /* index of the vertex at the previous depth */
    uint32_t segment[LANES];
    uint32_t light_segment[LANES]; /* of the light sample, LIGHT_ENVIRONMENT where none */
    float roughness[LANES], specular[LANES];
    float metallic[LANES]; /* only where materials have metals, which the backward pass does not know */
    struct lanes3 emission;
    struct lanes3 pattern;        /* emission = pattern * emission of the segment; only where materials have a
                                      * pattern */
    struct lanes3 beta;           /* throughput from the camera to here */
    float emission_weight[LANES]; /* MIS weight; 0 on the back side */
    uint16_t x[LANES], y[LANES];  /* as in struct gradient_entry */
    float weight[4][LANES];
    struct lanes3 base_color;
    struct lanes3 wo, light, wi; /* in the shading frame */
    struct lanes3 incident;      /* radiance of the light sample times its MIS weight over its pdf; 0: no sample,
                                      * or occluded */
    float light_factor[LANES];   /* incident = light_factor * light_pattern * emission of light_segment */
    struct lanes3 light_pattern; /* only where materials have a pattern */
    float scale[LANES];          /* 0: the path ends here */
    struct lanes3 next;          /* radiance from the next vertex, L_(k+1) */
};

/* What is needed of a vertex only while it is shaded. */
struct shade_block {
    /* The ray and its hit. */
    struct lanes3 origin, direction;
    float distance_m[LANES];
    float pdf[LANES];           /* of the direction, by solid angle; 0: a camera ray */
    float path_radiance[LANES]; /* greatest channel of the radiance that the path has gathered so far */
    struct lanes3 rr_beta;      /* throughput for Russian roulette: base colours are clamped from below to
                                        * min_color */
    float area_density[LANES];  /* by area, of the previous vertex's light sample at this point */
    /* The triangle. */
    struct lanes3 normal; /* geometric */
    float plane[LANES];
    struct lanes3 shading;                /* interpolated normal, not normalised; 0: none */
    float place_x[LANES], place_y[LANES]; /* texture coordinates, texels */
    /* Derived. */
    struct lanes3 point;
    struct lanes3 frame_normal; /* shading normal on the viewer's side */
    int32_t cell[LANES];        /* of the guide */
    uint32_t guide_row[LANES];
    uint32_t texel[LANES];           /* index of the first of the four texels of the lookup */
    float column[LANES], row[LANES]; /* weights of the lookup: fractions between texel centres */
    float filter[4][LANES];          /* weights of the four texels, 0 for invalid ones, not normalised */
    float filter_sum[LANES];
    /* Random numbers. */
    uint32_t key[LANES], sample[LANES];
    float pick[LANES], lobe[LANES];
    float light_u[LANES], light_v[LANES], bounce_u[LANES], bounce_v[LANES];
    float roulette[LANES], light_roulette[LANES];
    /* The light sample: a point on a triangle, or a direction (distance INFINITY). */
    struct lanes3 light_corner, light_edge1, light_edge2, radiance;
    int32_t light[LANES];          /* index of the triangle */
    float density_factor[LANES];   /* density relative to sampling by power */
    float light_density[LANES];    /* by area */
    struct lanes3 light_direction; /* world */
    float light_pdf[LANES];
    /* Results: rays to trace. */
    struct lanes3 shadow_origin, shadow_direction;
    float shadow_far[LANES];
    uint32_t has_shadow_ray[LANES]; /* 1: the contribution depends on the shadow ray */
    struct lanes3 contribution;     /* radiance along the path if the light is visible */
    struct lanes3 bounce_origin, bounce;
    struct lanes3 bounce_beta, bounce_rr_beta;
    float bounce_pdf[LANES];
    uint32_t bounce_continues[LANES]; /* 1: the path continues */
};

/* Derivatives of one block, output of shade_backward. */
struct shade_derivative {
    struct lanes3 d_radiance; /* in: by the radiance of the path */
    struct lanes3 out;        /* L_k */
    struct lanes3 d_base_color, d_emission, d_light_emission;
    float d_roughness[LANES], d_specular[LANES];
};

#endif
