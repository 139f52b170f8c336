/* outputs.h -- what a job leaves for its user: textures, previews, the mesh, side-by-sides, the
 * report.
 *
 * Every file appears whole (output_files.h). The same input gives the same bytes.
 *
 *   base_color.exr  roughness.exr  specular.exr  emission.exr   half, tiled, ZIP; R G B or Y. The
 *                    values continue EXPORT_MARGIN texels beyond the charts, so that other
 *                    renderers may filter and make mipmaps
 *   confidence.exr   float: R G B standard deviation of base colour by texel; not where it is unknown
 *   environment.exr  float: distant light, R G B by latitude and longitude in the layout of latlong.h (column x is
 *                    at atan2(x, -z) = 2 pi (x + 1/2) / width, row y at acos(y) = pi y / (height - 1)), where
 *                    some was seen
 *   environment_confidence.exr   float: by direction the `count` of photographs that show it, 0 where it
 *                    was filled in, and the `spread` of what they show
 *   preview/radiance.png   what the photographs show of each texel: known before anything else
 *   preview/base_color.png roughness.png specular.png emission.png confidence.png
 *           environment.png
 *                    at most EXPORT_PREVIEW_SIZE texels a side
 *   base_color.png   the same as base_color.exr in 8-bit sRGB
 *   emission.png     where an emitter has a pattern: 8-bit sRGB, see emission_texture.h
 *   uv_base_color.exr uv_base_color.png uv_roughness.exr ...   the same in the input's own texture coordinates, where
 *                    it has some of one picture that do not overlap (uv_bake.h)
 *   scene.ply        the mesh with its atlas coordinates (mesh_ply.h)
 *   scene.glb        all of it but distant light, as glTF (glb.h)
 *   scene.obj scene.mtl   the mesh, with base_color.png (mesh_obj.h)
 *   scene.xml scene.serialized   the room for Mitsuba 3, with the EXR files (mitsuba.h)
 *   sky.exr          environment.exr without a sun that no photograph shows, where there is one
 *   scene.usda scene.usdz   the room as OpenUSD, with lights and cameras (usd.h)
 *   compare/NNN.png  a held-out photograph | its re-render | their difference
 *   views.json       the cameras of these (views_json.h)
 *   cameras.json     the cameras of all photographs
 *   report.json      every setting, version, stage time and metric
 *   report.html      the same for the eye; needs no other file and no network
 *
 * Coordinates are relative to the mesh's offset (report.json: "offset"), which is 0 unless the input lies far from its
 * origin. scene.ply and scene.obj have it as a comment, "unbake offset X Y Z", which our readers add; scene.glb as the
 * translation of its root node; scene.xml as a comment; scene.usda as the transform of /Room; the cameras of views.json
 * contain it.
 *
 * Those of glb.h, mesh_obj.h, mitsuba.h and usd.h are left out where they would have too many objects or bytes;
 * report.json says so under "left_out". */
#ifndef UNBAKE_EXPORT_OUTPUTS_H
#define UNBAKE_EXPORT_OUTPUTS_H

#include "common/error.h"
#include "server/export/input.h"
#include "server/export/output_files.h"

/* Writes what is known by now to preview/ under the folder `dir`, which exists, and scene.ply if it is not there. Needs
 * no report and no comparisons. */
enum status export_preview(const char *dir, const struct export_input *input, export_announce *announce, void *user,
                           struct error *err);

/* Writes all files, previews first and the report last. */
enum status export_outputs(const char *dir, const struct export_input *input, export_announce *announce, void *user,
                           struct error *err);

#endif
