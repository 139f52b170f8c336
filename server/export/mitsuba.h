/* mitsuba.h -- scene.xml: the room for Mitsuba 3 (mitsuba-renderer.org), and its shapes in
 * scene.serialized, Mitsuba's own format, which holds one mesh for each segment in one file.
 *
 * Mitsuba's `principled` with base colour, roughness and specular is the model of bsdf.h, so a view
 * rendered there is ours but for noise, for how values are filtered at the border of charts, and
 * where specular is 0, which Mitsuba takes for 0.001. base_color.exr and environment.exr are used as
 * they are. Emitters are area lights with the segment's radiance: they shine from their front and
 * reflect, as ours do; those with a pattern have emission.exr.
 *
 * Each held-out view N of views.json is the sensor view_N: its pinhole, with fx for both axes and
 * without lens distortion. */
#ifndef UNBAKE_EXPORT_MITSUBA_H
#define UNBAKE_EXPORT_MITSUBA_H

#include "server/export/input.h"
#include "server/export/parts.h"

/* The same input gives the same bytes. `shapes` is the other file's name. */
enum status mitsuba_xml_write(const char *path, const struct export_input *input,
                              const struct parts *parts, const char *shapes, struct error *err);
enum status mitsuba_shapes_write(const char *path, const struct export_input *input,
                                 const struct parts *parts, struct error *err);

#endif
