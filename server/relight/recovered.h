/* recovered.h -- a finished job's outputs, read back for rendering.
 *
 * Reads only files that a user gets: scene.ply for atlas coordinates and segments, the EXR textures, and
 * environment.exr if it exists. Geometry comes from the room itself: scene.ply must list the same triangles. */
#ifndef UNBAKE_RELIGHT_RECOVERED_H
#define UNBAKE_RELIGHT_RECOVERED_H

#include "common/error.h"
#include "common/parallel.h"
#include "server/render/world.h"
#include "server/scene/atlas.h"
#include "server/scene/inverse_uv.h"
#include "server/scene/materials.h"
#include "server/scene/mesh.h"
#include "server/scene/segment.h"

struct recovered {
    struct segments segments;
    struct atlas atlas; /* no charts: corners only */
    struct inverse_uv inverse;
    struct materials materials;
    struct world world;
};

/* All but the world. `mesh` is borrowed until recovered_release. Roughness and specular are constant per segment and
 * read at one of its texels. Emission is the mean over a segment's texels, with a pattern where they differ. */
enum status recovered_read(const char *dir, const struct mesh *mesh, struct parallel *pool, struct recovered *recovered,
                           struct error *err);
/* With the world. */
enum status recovered_load(const char *dir, const struct mesh *mesh, struct parallel *pool, struct recovered *recovered,
                           struct error *err);
void recovered_release(struct recovered *recovered);

#endif
