/* mtl.h -- materials of OBJ files (MTL, Alias|Wavefront; Pr, Pm and Ke as programs for physically based rendering add
 * them). Kd times map_Kd is base colour (beside a picture no Kd and black Kd count as white, as exporters leave it), Ke
 * times map_Ke radiance, Ks the specular of Disney's model, Pr roughness or, without it, that of Ns: a Blinn-Phong lobe
 * of exponent n is as wide as one of alpha^2 = 2 / (n + 2) (Walter et al. 2007). illum 0 and 1 have no highlight. */
#ifndef UNBAKE_INGEST_MESH_MTL_H
#define UNBAKE_INGEST_MESH_MTL_H

#include "server/ingest/mesh/mesh_materials.h"

/* Reads text[length], any bytes, into the materials of `materials` that have the names; found[material_count] says
 * which. Pictures are below `folder`. `name` is the file's, for messages. */
enum status mtl_read(const char *name, const char *text, size_t length, const char *folder,
                     struct mesh_materials *materials, bool *found, struct error *err);

#endif
