/* outputs.h -- what a job leaves for its user: textures, previews, the mesh, side-by-sides, the
 * report.
 *
 * Every file is written under a temporary name, synced and renamed, and only then announced: a
 * reader (or a crash) sees the old content or the new and never a part. The same input gives the
 * same bytes.
 *
 *   base_color.exr  roughness.exr  specular.exr  emission.exr   half, tiled, ZIP; R G B or Y. The
 *                    values continue EXPORT_MARGIN texels beyond the charts, so that other
 *                    renderers may filter and make mipmaps
 *   confidence.exr   float: `count` observations and `spread` of their radiance, by texel
 *   environment.exr  float: distant light, R G B by latitude and longitude (the column over the width is
 *                    atan2(x, -z) / 2 pi modulo 1, the row over the height acos(y) / pi), where
 *                    some was seen
 *   environment_confidence.exr   float: by direction the `count` of photographs that show it, 0 where it
 *                    was filled in, and the `spread` of what they show
 *   preview/base_color.png roughness.png specular.png emission.png confidence.png
 *           environment.png
 *                    at most EXPORT_PREVIEW_SIZE texels a side
 *   base_color.png   the same as base_color.exr in 8-bit sRGB
 *   scene.ply        the mesh with its atlas coordinates (mesh_ply.h)
 *   scene.glb        all of it but distant light, as glTF (glb.h)
 *   scene.obj scene.mtl   the mesh, with base_color.png (mesh_obj.h)
 *   scene.xml scene.serialized   the room for Mitsuba 3, with the EXR files (mitsuba.h)
 *   compare/NNN.png  a held-out photograph | its re-render | their difference
 *   views.json       the cameras of these (views_json.h)
 *   report.json      every setting, version, stage time and metric
 *   report.html      the same for the eye; needs no other file and no network
 *
 * Those of glb.h, mesh_obj.h and mitsuba.h are left out where they would have too many objects or bytes;
 * report.json says so under "left_out". */
#ifndef UNBAKE_EXPORT_OUTPUTS_H
#define UNBAKE_EXPORT_OUTPUTS_H

#include <stdbool.h>
#include <stddef.h>

#include "common/error.h"
#include "common/image.h"
#include "common/json.h"
#include "server/scene/atlas.h"
#include "server/scene/camera.h"
#include "server/scene/inverse_uv.h"
#include "server/scene/materials.h"
#include "server/scene/mesh.h"
#include "server/scene/segment.h"

#define EXPORT_MARGIN 16         /* texels */
#define EXPORT_PREVIEW_SIZE 1024 /* texels */

/* A held-out view: both pictures in linear radiance, R G B, of one size. */
struct export_comparison {
    const char *name;               /* the photograph's, for labels */
    const struct image *photograph; /* saturated or masked pixels as they are */
    const struct image *render;
    const struct camera *camera;    /* that took it */
};

/* All borrowed. */
struct export_input {
    const char *title;                 /* the job's or the scene's name */
    const struct mesh *mesh;
    const struct segments *segments;
    const struct atlas *atlas;
    const struct inverse_uv *inverse;
    const struct materials *materials;
    const float *confidence_count;     /* [height][width] observations; NULL while not known: */
    const float *confidence_spread;    /* [height][width] their spread;  then no preview of it */
    const bool *is_emitter;            /* [segment_count] */
    const struct image *environment;   /* R G B; NULL: no distant light; */
    const struct image *environment_confidence; /* count, spread; NULL as the former */
    size_t comparison_count;
    const struct export_comparison *comparison;
    /* An object. report.json is this plus "segments" (one entry each) and "files". The page draws
     * these members when they are there, and shows all others as tables:
     *   "series": {"loss": [[step, value], ...], ...}   one curve each
     *   "stages": [{"name": "refine", "seconds": 12.3}, ...]
     *   "views":  [{"name": ..., "msre": ..., ...}, ...] in the order of `comparison` */
    const cJSON *report;
    vec3 up; /* the axis of the room that points up, see scene_up; 0: y */
};

/* Called after each file is complete under its final name; `type` is EVENT_PREVIEW or
 * EVENT_OUTPUT, `name` is relative to the folder. A failure ends the export. */
typedef enum status export_announce(void *user, const char *type, const char *name,
                                    const char *content_type, struct error *err);

/* Writes preview/ under the folder `dir`, which exists. Needs no report and no comparisons. */
enum status export_preview(const char *dir, const struct export_input *input,
                           export_announce *announce, void *user, struct error *err);

/* Writes everything, previews first and the report last. */
enum status export_outputs(const char *dir, const struct export_input *input,
                           export_announce *announce, void *user, struct error *err);

#endif
