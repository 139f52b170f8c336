/* usd.h -- scene.usda: the room as OpenUSD, in text, and scene.usdz: the same with its textures in one file.
 *
 * /Room turns the room's upward axis to +y and moves it by the mesh's offset. Below it:
 *   Segments    a Mesh for each segment, named by parts_label; its displayName is the input's name for it, and its
 *               customData have the numbers of segment and object. `st` has its origin at the lower left;
 *               `st1` are the input's own texture coordinates, where it has some
 *   Materials   a Material of the same name and displayName: UsdPreviewSurface, with base_color.png. Roughness is ours
 *               (alpha is its square in both), ior gives the reflectance at normal incidence of `specular` as in glb.h
 *   Lights      Sky, a DomeLight with environment.exr (whose layout is that of OpenEXR and UsdLux, but for half a row
 *               at the poles); where a sun was found that no photograph shows, Sun, a DistantLight, and then Sky has
 *               sky.exr, without it
 *   Cameras     the held-out views, without lens distortion
 *
 * An emitter is a single-sided Mesh with MeshLightAPI: what it emits is the emissiveColor of its material
 * (materialGlowTintsLight), so renderers without mesh lights see it shine all the same. One with a pattern takes it
 * from emission.png, times a scale.
 *
 * Radiance is in the units of the photographs (1 is the pixel value 1 of an exposure of 1), not in nits: the layer's
 * customLayerData say so. */
#ifndef UNBAKE_EXPORT_USD_H
#define UNBAKE_EXPORT_USD_H

#include "server/export/input.h"
#include "server/export/parts.h"

/* Names of the textures beside the file; those that the room does not have are not read. */
struct usd_textures {
    const char *base_color, *emission, *sky;
};

/* The same input gives the same bytes. */
enum status usd_write(const char *path, const struct export_input *input, const struct parts *parts,
                      const struct usd_textures *textures, struct error *err);

/* Packs the files name[count] of the folder `dir`, the layer first: a zip archive of stored files, each from a multiple
 * of 64 bytes on. STATUS_LIMIT for 4 GiB or more, or where one is not there, since then it was too large. */
enum status usdz_write(const char *path, const char *dir, const char *const *name, size_t count, struct error *err);

#endif
