/* mesh_obj.h -- the mesh as Wavefront OBJ (scene.obj) with its materials (scene.mtl).
 *
 * One object and one material of the same name, "segment_N" as in the report and the input's
 * name for it (parts_label), per segment. Vertices and normals are
 * those of the mesh, so connectivity is preserved; texture coordinates have their origin at the lower left. Metres,
 * in the room's axes.
 *
 * The format has one set of texture coordinates: those of the input are in the other files.
 *
 * MTL cannot express our specular lobe exactly. Ks is `specular`, which readers such as Blender take for a level with
 * 0.5 = an index of refraction of 1.5 (Ni). Ns is 1000 (1 - roughness)^2, which Blender inverts. Pr is roughness, Ke
 * radiance (for emitters with a pattern the scale of map_Ke); map_Kd and map_Ke are the pictures beside it, in sRGB. */
#ifndef UNBAKE_EXPORT_MESH_OBJ_H
#define UNBAKE_EXPORT_MESH_OBJ_H

#include "server/export/input.h"
#include "server/export/parts.h"

/* The same input gives the same bytes. STATUS_LIMIT for 4 GiB or more. */
enum status mesh_obj_write(const char *path, const struct export_input *input, const struct parts *parts,
                           struct error *err);

/* `base_color` and `emission` (emission_texture.h) are the file names written into the materials. */
enum status mesh_mtl_write(const char *path, const struct export_input *input, const struct parts *parts,
                           const char *base_color, const char *emission, struct error *err);

#endif
