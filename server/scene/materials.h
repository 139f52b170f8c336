/* materials.h -- what surfaces are made of: base colour per texel, the rest per segment. */
#ifndef UNBAKE_SCENE_MATERIALS_H
#define UNBAKE_SCENE_MATERIALS_H

#include <stddef.h>

#include "common/vec.h"
#include "server/scene/texture.h"

struct materials {
    struct texture base_color;  /* linear reflectance in [0, 1] */
    size_t segment_count;
    float *roughness;           /* [segment_count] in [0, 1]; alpha = roughness^2; owned */
    float *specular;            /* [segment_count] in [0, 1]; owned */
    rgb *emission;              /* [segment_count] radiance from the front side; 0: no emitter; owned */
};

void materials_init(struct materials *m, const struct inverse_uv *inverse, size_t segment_count,
                    rgb base_color, float roughness, float specular); /* no emission */
void materials_release(struct materials *m);

#endif
