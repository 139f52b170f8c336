/* materials.h -- surface parameters: base colour per texel, the others per segment, and an emission pattern per texel
 * for emitters of uneven radiance. */
#ifndef UNBAKE_SCENE_MATERIALS_H
#define UNBAKE_SCENE_MATERIALS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "common/vec.h"
#include "server/scene/rgb_half.h"
#include "server/scene/texture.h"

/* Base colour of unknown surfaces, and of emitters, whose own light hides it. */
#define NEUTRAL_BASE_COLOR 0.5f

/* How the emission of a segment depends on the cosine c to its normal: times ((c - outer) / (inner - outer))^2, between
 * 0 and 1, over c: a spot light of KHR_lights_punctual, whose intensity is even within the inner cone. Outer -1:
 * none. */
struct emission_cone {
    float outer, inner;
};

#define MATERIALS_BY_TEXEL -1.0f /* in place of a segment's share of metal, see there */

/* Relative standard deviation of base colour along plain surface where none was measured: that of a room with even
 * walls (plain_spread.h measures .008 in den, .042 in gallery, .045 in the demo room). */
#define MATERIALS_SPREAD 0.01f

struct materials {
    struct texture base_color; /* linear reflectance in [0, 1] */
    size_t segment_count;
    float *roughness; /* [segment_count] in [0, 1]; alpha = roughness^2; owned */
    float *specular;  /* [segment_count] in [0, 1]; owned */
    rgb *emission;    /* [segment_count] radiance emitted from the front side, mean over the segment; 0: no
                                 * emitter; owned */
    uint16_t (*emission_pattern)[3]; /* [height][width] half precision: emission of a texel over the mean of its
                                      * segment, positive; 0 where unknown, which reads as 1. NULL: none. Owned */
    uint16_t *deviation; /* [height][width] half precision: standard deviation of base colour by measurement, over its
                          * channels; 0: unknown. NULL: none. Owned */
    float spread;        /* relative standard deviation of base colour along plain surface (plain_spread.h), and by the
                          * deviations that lamps' radiances have, and what held-out views are too bright or too dark
                          * by; MATERIALS_SPREAD until it is known */
    /* Of things that were added to a room; no derivative knows of metals. NULL: none. Owned. */
    float *metallic; /* [segment_count] share of the surface that is metal, which reflects in the base colour and not
                           * diffusely; MATERIALS_BY_TEXEL: that and roughness are in gloss */
    uint16_t (*gloss)[2];       /* [height][width] half precision: roughness and share of metal */
    struct emission_cone *cone; /* [segment_count] of lamps that were added to a room; no derivative knows it. NULL:
                                      * none. Owned */
};

void materials_init(struct materials *m, const struct inverse_uv *inverse, size_t segment_count, rgb base_color,
                    float roughness, float specular); /* no emission */
void materials_release(struct materials *m);

/* Whether a segment is close to a mirror. The specular lobe of rougher ones is so wide that photographs show it. */
bool materials_is_polished(const struct materials *m, uint32_t segment);

/* Allocates the deviations, all unknown. */
void materials_start_deviation(struct materials *m);

/* Standard deviation of a texel's base colour, by channel: that of its measurement, and no less than plain surface of
 * this room has, which contains the errors that no texel's own measurement tells. Black where it is unknown. */
rgb materials_deviation(const struct materials *m, size_t texel);

/* Allocates a pattern of unknown texels, or frees it. Untouched pages of the former take no memory. */
void materials_start_emission_pattern(struct materials *m);
void materials_drop_emission_pattern(struct materials *m);

/* Roughness and share of metal at a point of a segment, (x, y) in texels; for materials with metals. */
void materials_gloss(const struct materials *m, uint32_t segment, float x, float y, float *roughness, float *metallic);

/* Sets the pattern of a texel: its radiance over the mean of its segment, clamped to be positive. */
void materials_set_emission_pattern(struct materials *m, size_t texel, rgb radiance, rgb mean);

/* Bilinear lookup at (x, y), in texels, over the known ones of the four nearest texels; 1 where none is. */
rgb materials_emission_pattern(const struct materials *m, float x, float y);

static inline float materials_cone(const struct materials *m, uint32_t segment, float cosine) {
    struct emission_cone cone = m->cone[segment];
    float t = (cosine - cone.outer) / (cone.inner - cone.outer);
    t = t < 0.0f ? 0.0f : t < 1.0f ? t : 1.0f;
    return cone.outer > -1.0f ? t * t / (cosine > 1e-3f ? cosine : 1e-3f) : 1.0f;
}

/* Radiance emitted from the front side at a point of a segment, and at a texel of it. */
static inline rgb materials_emission(const struct materials *m, uint32_t segment, float x, float y) {
    rgb mean = m->emission[segment];
    return m->emission_pattern && !rgb_is_black(mean) ? rgb_mul(mean, materials_emission_pattern(m, x, y)) : mean;
}
rgb materials_emission_of_texel(const struct materials *m, uint32_t segment, size_t texel);

#endif
