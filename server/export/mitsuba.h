/* mitsuba.h -- scene.xml: the room for Mitsuba 3 (mitsuba-renderer.org), and its shapes in scene.serialized,
 * Mitsuba's format for many meshes in one file (one per segment).
 *
 * Mitsuba's `principled` with base colour, roughness and specular is the model of bsdf.h, so a view rendered by
 * Mitsuba equals ours up to noise, texture filtering at chart borders, and specular 0, which Mitsuba clamps to 0.001.
 * base_color.exr and environment.exr are used unchanged. Emitters are area lights with the segment's radiance,
 * one-sided and reflecting as ours; those with a pattern use emission.exr.
 *
 * Each held-out view N of views.json is the sensor view_N: a pinhole camera with fx for both axes and no lens
 * distortion. */
#ifndef UNBAKE_EXPORT_MITSUBA_H
#define UNBAKE_EXPORT_MITSUBA_H

#include "server/export/input.h"
#include "server/export/parts.h"

/* The same input gives the same bytes. `shapes` is the name of scene.serialized. */
enum status mitsuba_xml_write(const char *path, const struct export_input *input, const struct parts *parts,
                              const char *shapes, struct error *err);
enum status mitsuba_shapes_write(const char *path, const struct export_input *input, const struct parts *parts,
                                 struct error *err);

#endif
