/* mesh_obj.h -- the mesh as Wavefront OBJ (scene.obj) with its materials (scene.mtl).
 *
 * One object, "segment_N" as the report numbers it, and one material of the same name for each
 * segment. Vertices and normals are the mesh's own, so what is connected there is connected here;
 * texture coordinates have their origin at the lower left. Metres, in the room's own axes.
 *
 * MTL has no specular as ours: Ks is specular, for readers that take Ks for the level of a
 * reflection whose half is that of an index of refraction of 1.5 (Ni), as Blender does. Ns is
 * 1000 (1 - roughness)^2, as Blender turns it back into roughness. Pr is roughness, Ke radiance, where an
 * emitter has a pattern that of what is white in map_Ke; map_Kd and map_Ke are the pictures beside it, in sRGB. */
#ifndef UNBAKE_EXPORT_MESH_OBJ_H
#define UNBAKE_EXPORT_MESH_OBJ_H

#include "server/export/input.h"
#include "server/export/parts.h"

/* The same input gives the same bytes. STATUS_LIMIT where they would be 4 GiB or more. */
enum status mesh_obj_write(const char *path, const struct export_input *input, const struct parts *parts,
                           struct error *err);

/* `base_color` and `emission` (emission_texture.h) are the pictures' names as the materials say them. */
enum status mesh_mtl_write(const char *path, const struct export_input *input, const struct parts *parts,
                           const char *base_color, const char *emission, struct error *err);

#endif
