/* materials.h -- what surfaces are made of: base colour per texel, the rest per segment, and where an
 * emitter is not equally bright all over, how its texels differ. */
#ifndef UNBAKE_SCENE_MATERIALS_H
#define UNBAKE_SCENE_MATERIALS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "common/vec.h"
#include "server/scene/rgb_half.h"
#include "server/scene/texture.h"

struct materials {
    struct texture base_color;  /* linear reflectance in [0, 1] */
    size_t segment_count;
    float *roughness;           /* [segment_count] in [0, 1]; alpha = roughness^2; owned */
    float *specular;            /* [segment_count] in [0, 1]; owned */
    rgb *emission;              /* [segment_count] radiance from the front side, mean over its surface; 0: no
                                 * emitter; owned */
    uint16_t (*emission_pattern)[3]; /* [height][width] of the texture, half precision: radiance of a texel over
                                 * the mean of its segment, above 0 in all channels; 0 where it is the mean.
                                 * NULL: everywhere. Owned */
};

void materials_init(struct materials *m, const struct inverse_uv *inverse, size_t segment_count,
                    rgb base_color, float roughness, float specular); /* no emission */
void materials_release(struct materials *m);

/* Whether a segment mirrors mostly in one direction; what is rougher sends its gloss so widely that photographs show
 * it. */
bool materials_is_polished(const struct materials *m, uint32_t segment);

/* Gives the materials a pattern that is nowhere told yet, or takes theirs away. Pages of the former take no memory
 * until they are written. */
void materials_start_emission_pattern(struct materials *m);
void materials_drop_emission_pattern(struct materials *m);

/* Tells the pattern of a texel: its radiance over the mean of its segment, held above 0. */
void materials_set_emission_pattern(struct materials *m, size_t texel, rgb radiance, rgb mean);

/* The pattern at (x, y), in texels: bilinear over those of the four nearest texels that tell any; 1 where none
 * does. */
rgb materials_emission_pattern(const struct materials *m, float x, float y);

/* Radiance from the front side at a place of a segment, and of a texel of it. */
static inline rgb materials_emission(const struct materials *m, uint32_t segment, float x, float y) {
    rgb mean = m->emission[segment];
    return m->emission_pattern && !rgb_is_black(mean) ? rgb_mul(mean, materials_emission_pattern(m, x, y)) : mean;
}
rgb materials_emission_of_texel(const struct materials *m, uint32_t segment, size_t texel);

#endif
