/* glb_material.h -- the materials of scene.glb, as glb.h describes them. */
#ifndef UNBAKE_EXPORT_GLB_MATERIAL_H
#define UNBAKE_EXPORT_GLB_MATERIAL_H

#include "common/json.h"
#include "server/scene/materials.h"

struct glb_look {
    const struct materials *materials;
    const float *scales; /* [segment_count] see emission_texture.h; NULL: no emission pattern */
    double unit;         /* of emission, see glb_lights.h */
    bool has_input_uv;   /* textures are looked up by TEXCOORD_1 */
};

/* Fills an empty object with the material of a segment, but for its name; returns it. Texture 0 is base colour, 1
 * emission. */
cJSON *glb_material(const struct glb_look *look, uint32_t segment, cJSON *material);

#endif
