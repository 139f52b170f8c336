/* bake.h -- the pictures of a mesh's materials, resampled into an atlas of its own: what they tile, turn and share is
 * laid out one-to-one, as the textures of a room are. */
#ifndef UNBAKE_RELIGHT_BAKE_H
#define UNBAKE_RELIGHT_BAKE_H

#include "common/error.h"
#include "common/parallel.h"
#include "server/ingest/mesh/mesh_materials.h"
#include "server/scene/atlas.h"
#include "server/scene/mesh.h"

struct baked {
    struct atlas atlas;
    float (*base_color)[4]; /* [height][width] r g b valid; owned */
    float (*gloss)[2];      /* [height][width] roughness and share of metal; NULL: no picture says them; owned */
    float (*emission)[3];   /* [height][width] radiance; NULL: none has a picture; owned */
    uint32_t *part;         /* [height][width] number of the material, where valid; owned */
};

#define BAKE_MAX_SIZE 4096 /* texels a side */
/* Of a mesh whose object_id are numbers of `materials`. As fine as the pictures are on it, up to BAKE_MAX_SIZE a side;
 * STATUS_INPUT: the mesh is in more pieces than that holds. */
enum status bake_make(const struct mesh *mesh, const struct mesh_materials *materials, struct parallel *pool,
                      struct baked *baked, struct error *err);
void bake_release(struct baked *baked);

#endif
