/* albedo.h -- which base colours are plausible: every estimate of light in this folder is held against that.
 *
 * Deviations are standard deviations of a natural logarithm. */
#ifndef UNBAKE_LIGHT_ALBEDO_H
#define UNBAKE_LIGHT_ALBEDO_H

/* Of a segment. Recommended reflectances of interiors are .2 for floors, .5 for walls, .8 for ceilings (EN 12464-1). */
#define ALBEDO_MEAN 0.4
#define ALBEDO_DEVIATION 0.7

/* Of white paint. */
#define ALBEDO_WHITE 0.85
#define ALBEDO_WHITE_DEVIATION 0.15

/* About the segment: of points about their patch, by texture; of a patch, by texture and light that is not modelled,
 * which also bounds how far it exceeds white paint; and of points, by both. */
#define ALBEDO_POINT 0.25
#define ALBEDO_PATCH 0.15
#define ALBEDO_WITHIN 0.3

/* What a highlight that is not known yet may add. */
#define ALBEDO_HIGHLIGHT 0.04f

#endif
