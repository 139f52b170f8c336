/* glb.h -- scene.glb: the room as binary glTF 2.0, for Blender and whatever else reads glTF.
 *
 * A node "room" turns the room's upward axis to glTF's +y; below it are one node, mesh and material
 * for each segment, named "segment N" as the report numbers them, and the cameras of the held-out
 * views (without lens distortion and offset of the principal point, which glTF does not have).
 * Metres; texture coordinates from the top left corner, as glTF wants them.
 *
 * The material model is metallic-roughness (glTF 2.0 specification, appendix B) with metallic 0:
 *
 *   base colour   the texture, 8-bit sRGB
 *   roughness     as it is: there, too, alpha = roughness^2
 *   specular      KHR_materials_ior: ior = (1 + r) / (1 - r), r^2 = 0.08 specular, so that the
 *                 reflectance at normal incidence is 0.08 specular, as ours is
 *                 (KHR_materials_specular, "Materials with reflectance parameter"). Specular 0 has no
 *                 reflection at all: KHR_materials_specular, specularFactor 0
 *   emission      emissiveFactor times KHR_materials_emissive_strength = radiance, in our units; where an
 *                 emitter has a pattern, times a texture, 8-bit sRGB (emission_texture.h)
 *
 * These but base colour and patterns are one number a segment, so factors hold them exactly where textures would
 * round them to 8 bits and bleed at seams. What differs: glTF takes from the diffuse light what the
 * surface reflects (times 1 - F, F by Schlick), ours does not, so glossy surfaces look a few percent
 * darker, and rooms of them more; its diffuse lobe is Lambert's. Emitters are single-sided, since ours
 * shine from their front only; everything else is double-sided.
 *
 * glTF has no ratified place for distant light: the node "room" names environment.exr in its extras,
 * with the layout of outputs.h in the room's own axes. */
#ifndef UNBAKE_EXPORT_GLB_H
#define UNBAKE_EXPORT_GLB_H

#include "server/export/input.h"
#include "server/export/parts.h"

/* `base_color` and, where an emitter has a pattern, `emission` are the PNGs that go into the file. The same input gives
 * the same bytes; STATUS_LIMIT where they would be 4 GiB or more. */
enum status glb_write(const char *path, const struct export_input *input, const struct parts *parts,
                      const char *base_color, const char *emission, struct error *err);

#endif
