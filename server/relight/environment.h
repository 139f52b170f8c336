/* environment.h -- the distant light of a render: found, none, a file's, or sun and sky. It is one light, or two that
 * are told apart: the sun, and the sky, which is all the rest. */
#ifndef UNBAKE_RELIGHT_ENVIRONMENT_H
#define UNBAKE_RELIGHT_ENVIRONMENT_H

#include <stdbool.h>

#include "common/image.h"
#include "server/relight/relight_job.h"
#include "server/relight/sky.h"

/* cd/m2 of radiance 1 under environment=sky where luminance_per_unit is not told: brings a clear sky to about 1. */
#define ENVIRONMENT_SKY_UNIT 5000.0

/* Resamples a latitude-longitude map into the room's frame (layout of latlong.h), turned counter-clockwise from above
 * and scaled. The top of a file's map is up and its left edge north; a reconstruction's is in the room's frame already.
 * *out, of the same size, is the caller's. */
enum environment_frame { ENVIRONMENT_OF_FILE, ENVIRONMENT_OF_ROOM };
void environment_orient(const struct image *picture, enum environment_frame frame, const struct compass *compass,
                        float turn_deg, float scale, struct image *out);

/* How many suns the job has, at least 1. */
uint32_t environment_suns(const struct relight_job *job);

/* The sky of sun number `sun`. Only for environment=sky. STATUS_INPUT where it does not rise on that day and suns are
 * asked for. */
enum status environment_sky(const struct relight_job *job, uint32_t sun, struct sky *sky, struct error *err);

/* The map, or a part of it, under the settings sky and sun; *has false: there is none, and *map is empty. The sun is
 * told apart in environment=sky, and in what was found where the reconstruction has written a sky without it. */
enum status environment_read(const struct relight_job *job, const struct compass *compass, uint32_t sun,
                             enum distant_part part, bool *has, struct image *map, struct error *err);

#endif
