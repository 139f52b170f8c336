/* glb.h -- scene.glb: the room as binary glTF 2.0, for Blender and other readers of glTF.
 *
 * A node "room" turns the room's upward axis to glTF's +y and, where the mesh has an offset, moves it there. Below it
 * are one node, mesh and material per segment, named "segment N" as in the report or as the input calls them
 * (extras.segment has the number then, too), and the cameras of the held-out views (without lens distortion and
 * principal point offset, which glTF does not have). Metres; texture coordinates from the top left corner, as in glTF.
 *
 * The material model is metallic-roughness (glTF 2.0 specification, appendix B) with metallic 0:
 *
 *   base colour   the texture, 8-bit sRGB
 *   roughness     unchanged: alpha = roughness^2 in both
 *   specular      KHR_materials_ior: ior = (1 + r) / (1 - r), r^2 = 0.08 specular, which gives the same reflectance
 *                 at normal incidence. Specular 0 is KHR_materials_specular with specularFactor 0: no reflection
 *   emission      emissiveFactor times KHR_materials_emissive_strength = radiance; times an 8-bit sRGB texture for
 *                 emitters with a pattern (emission_texture.h)
 *
 * Except for base colour and patterns, parameters are constant per segment and stored as factors: exact, unlike 8-bit
 * textures, and without bleeding at seams. Known difference: glTF scales the diffuse lobe, which is Lambertian, by 1
 * - F (Schlick), ours does not. Glossy surfaces are a few percent darker in glTF, and rooms of them more. Emitters
 * are single-sided, since ours emit from the front; everything else is double-sided.
 *
 * TEXCOORD_0 are the atlas's coordinates, TEXCOORD_1 those of the input, where it has some. Textures are those of the
 * atlas, or on request those in the input's own layout, looked up by TEXCOORD_1 (glb_shown).
 *
 * On request lamps and sun have stand-ins (glb_lights.h).
 *
 * glTF has no ratified environment light: the extras of node "room" name environment.exr, with the layout of
 * outputs.h in the room's axes. */
#ifndef UNBAKE_EXPORT_GLB_H
#define UNBAKE_EXPORT_GLB_H

#include "server/export/input.h"
#include "server/export/parts.h"

/* Whose textures the file shows: the input, or its `baked`. */
const struct export_input *glb_shown(const struct export_input *input);

/* `base_color` and `emission` (used when an emitter has a pattern) are the PNG files to embed. The same input gives
 * the same bytes; STATUS_LIMIT for 4 GiB or more. */
enum status glb_write(const char *path, const struct export_input *input, const struct parts *parts,
                      const char *base_color, const char *emission, struct error *err);

#endif
