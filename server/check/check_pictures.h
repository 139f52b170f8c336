/* check_pictures.h -- the pictures of a check: overlays, plan, exposures; as PNG files. */
#ifndef UNBAKE_CHECK_CHECK_PICTURES_H
#define UNBAKE_CHECK_CHECK_PICTURES_H

#include "server/check/scene_check.h"

#define CHECK_OVERLAYS 6 /* photographs, spread over the capture */

/* Told when pictures are in the folder and in `previews`. */
typedef void check_pictures_drawn(void *user);

/* Writes the pictures into the folder `dir`, which exists, and appends {"name", "caption"} of each to the array
 * `previews`, in the order in which they are to be shown. `drawn` may be NULL. */

enum status check_pictures_write(const struct scene_check *room, const char *dir, struct parallel *pool,
                                 cJSON *previews, check_pictures_drawn *drawn, void *user, struct error *err);

#endif
