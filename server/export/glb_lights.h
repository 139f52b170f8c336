/* glb_lights.h -- lamps and sun as KHR_lights_punctual, for viewers of glTF that compute no light from emitting
 * surfaces and would show the room black.
 *
 * An emitter of area A and radiance L sends out the flux pi L A. Its stand-in sends out the same:
 *
 *   spot    of flat emitters: along the mean normal, with a cone from 0 to 90 degrees. By the falloff that the
 *           extension recommends, the square of the cosine, its intensity is 3/2 L A. 1 cm in front of the surface,
 *           which would otherwise shade it
 *   point   where normals cancel (bulbs): L A / 4, in the middle
 *
 * Emitters longer than LIGHT_SPAN_M are divided, longest first, into LIGHTS_MAX stand-ins in all; of more emitters
 * the ones with the most flux have one. The sun, where one was found that no photograph shows, is directional. The sky
 * has no stand-in. Renderers that do take light from emitting surfaces have it twice: hide one of the two.
 *
 * Units: candela and lux where luminance is known (export_input), and nits of emission then, too; else relative, with
 * emission in the same. */
#ifndef UNBAKE_EXPORT_GLB_LIGHTS_H
#define UNBAKE_EXPORT_GLB_LIGHTS_H

#include "common/json.h"
#include "server/export/input.h"

#define LIGHTS_MAX 16 /* without the sun; viewers slow down with each */
#define LIGHT_SPAN_M                                                                                                   \
    1.0f /* metres: at some metres' distance the light of a point beside that of a lamp of this length */

/* Cd/m2 of radiance 1 in the file; 1 where unknown. */
double glb_lights_unit(const struct export_input *in);

/* Appends lights, and a node in the room's axes for each. */
void glb_lights_add(const struct export_input *in, cJSON *lights, cJSON *nodes);

#endif
