/* lanes.h -- vertices of paths in structure-of-arrays blocks, for loops that vectorise.
 *
 * A block holds LANES vertices of one depth, one per lane. Kernels (shade.c) are plain loops over
 * the lanes of a block with the vector functions of vec.h inlined; lanes past the block's count
 * compute on whatever is there and are never read. Everything here is internal to path.c,
 * path_backward.c and shade.c. */
#ifndef UNBAKE_RENDER_LANES_H
#define UNBAKE_RENDER_LANES_H

#include <stdint.h>

#include "common/vec.h"

#define LANES 64

struct lanes3 {
    float x[LANES], y[LANES], z[LANES];
};

static inline vec3 lanes3_get(const struct lanes3 *a, int lane) {
    return (vec3){a->x[lane], a->y[lane], a->z[lane]};
}
static inline void lanes3_set(struct lanes3 *a, int lane, vec3 v) {
    a->x[lane] = v.x;
    a->y[lane] = v.y;
    a->z[lane] = v.z;
}
/* Colours use the same storage. */
static inline rgb lanes3_rgb(const struct lanes3 *a, int lane) {
    return (rgb){a->x[lane], a->y[lane], a->z[lane]};
}
static inline void lanes3_set_rgb(struct lanes3 *a, int lane, rgb v) {
    a->x[lane] = v.r;
    a->y[lane] = v.g;
    a->z[lane] = v.b;
}

/* What is kept of a vertex for the backward walk; see path.c for the meaning of the terms. */
struct vertex_block {
    uint32_t path[LANES];
    uint32_t parent[LANES];          /* number of the vertex in the depth before */
    uint32_t segment[LANES];
    uint32_t light_segment[LANES];   /* of the light sample, LIGHT_ENVIRONMENT where none */
    float roughness[LANES], specular[LANES];
    struct lanes3 emission;
    struct lanes3 pattern;           /* emission = pattern * that of the segment; only where materials have one */
    struct lanes3 beta;              /* from the camera to here */
    float emission_weight[LANES];    /* 0 on the back */
    uint16_t x[LANES], y[LANES];     /* as in struct gradient_entry */
    float weight[4][LANES];
    struct lanes3 base_color;
    struct lanes3 wo, light, wi;     /* in the shading frame */
    struct lanes3 incident;          /* 0: no light sample */
    float light_factor[LANES];       /* incident = light_factor * light_pattern * emission of light_segment */
    struct lanes3 light_pattern;     /* only where materials have one */
    float scale[LANES];              /* 0: the path ends here */
    struct lanes3 next;              /* L_(k+1) */
};

/* What is needed of a vertex only while it is shaded. */
struct shade_block {
    /* The ray and its hit. */
    struct lanes3 origin, direction;
    float distance_m[LANES];
    float pdf[LANES];                /* of the direction by solid angle; 0: a camera ray */
    float brought[LANES];            /* greatest channel of what the path has brought so far */
    struct lanes3 worth;             /* beta as roulette takes it: of base colours at least `least_color` */
    float area_density[LANES];       /* of light samples here, as the vertex before takes them */
    /* The triangle. */
    struct lanes3 normal;            /* geometric */
    float plane[LANES];
    struct lanes3 shading;           /* interpolated normal, not normalised; 0: none */
    float place_x[LANES], place_y[LANES]; /* in the texture, texels */
    /* Derived. */
    struct lanes3 point;
    struct lanes3 frame_normal;      /* shading normal on the viewer's side */
    int32_t cell[LANES];             /* of the guide */
    uint32_t guide_row[LANES];
    uint32_t texel[LANES];           /* number of the first of the four around the place */
    float column[LANES], row[LANES]; /* place between the centres of the four */
    float filter[4][LANES];          /* weights of valid texels, not normalised */
    float filter_sum[LANES];
    /* Random numbers. */
    uint32_t key[LANES], sample[LANES];
    float pick[LANES], lobe[LANES];
    float light_u[LANES], light_v[LANES], way_u[LANES], way_v[LANES];
    float roulette[LANES], light_roulette[LANES];
    /* The light sample: a place on a triangle, or a direction already (distance INFINITY). */
    struct lanes3 light_corner, light_edge1, light_edge2, radiance;
    int32_t light[LANES];            /* number of the triangle */
    float density_factor[LANES];     /* how many times denser than by power */
    float light_density[LANES];      /* by area */
    struct lanes3 light_direction;   /* world */
    float light_pdf[LANES];
    /* Results: rays to trace. */
    struct lanes3 shadow_origin, shadow_direction;
    float shadow_far[LANES];
    uint32_t shadow_wanted[LANES];   /* 1: the shadow ray decides */
    struct lanes3 gain;              /* radiance that it would bring */
    struct lanes3 way_origin, way;
    struct lanes3 way_beta, way_worth;
    float way_pdf[LANES];
    uint32_t way_open[LANES];        /* 1: the path goes on */
};

/* Derivatives of one block, out of the backward kernel. */
struct shade_derivative {
    struct lanes3 d_radiance;        /* in: of the path */
    struct lanes3 out;               /* L_k */
    struct lanes3 d_base_color, d_emission, d_light_emission;
    float d_roughness[LANES], d_specular[LANES];
};

#endif
