/* uv_bake.h -- the room's textures resampled into the input's own texture coordinates, which programs that know the
 * input's mesh and its layout want.
 *
 * The layout is one square, as large as the larger side of the atlas. Each texel that a triangle covers has the mean of
 * the atlas over it (up to BAKE_SAMPLES_MAX samples a side where the layout is coarser than the atlas), base colour by
 * bilinear interpolation within the chart. It is done only where each texel belongs to one place of the room: with
 * several pictures, with coordinates outside of the unit square (tiles, UDIM) or on top of each other it is not, and
 * the report says why. */
#ifndef UNBAKE_EXPORT_UV_BAKE_H
#define UNBAKE_EXPORT_UV_BAKE_H

#include "server/export/input.h"

#define BAKE_SAMPLES_MAX 4 /* a side */

struct uv_bake {
    bool is_made;
    struct atlas atlas; /* the input's layout; width 0 unless made */
    struct inverse_uv inverse;
    struct materials materials;
    struct export_input input; /* what it was made of, but for these three: for pictures and formats */
    double uv_share;           /* of the mesh's area, that the layout gives an area */
    double overlap_share;      /* of the centres of covered texels, that more than one triangle covers */
    char reason[200];          /* why it is not made; else "" */
};

/* The mesh must have texture coordinates. *bake borrows from *input; the caller's (uv_bake_release). */
void uv_bake_make(struct uv_bake *bake, const struct export_input *input);
void uv_bake_release(struct uv_bake *bake);

#endif
