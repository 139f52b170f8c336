/* cameras.h -- the places that a render looks from: cameras of a file, a path between them, panoramas. */
#ifndef UNBAKE_RELIGHT_CAMERAS_H
#define UNBAKE_RELIGHT_CAMERAS_H

#include <stddef.h>

#include "common/error.h"
#include "server/relight/compass.h"
#include "server/relight/relight_job.h"
#include "server/scene/camera.h"

struct placed_camera {
    struct camera camera;
    char *name; /* of the photograph, or of the place on a path; owned */
};

struct cameras {
    size_t count;
    struct placed_camera *view; /* [count] owned */
    struct compass compass;
};

/* The views that the settings mean, in coordinates whose origin lies at `offset` in the file's (struct mesh).
 * STATUS_NOT_FOUND: the file has no such view, or is not there. */
enum status cameras_read(const struct relight_job *job, const double offset[3], struct cameras *views,
                         struct error *err);
void cameras_release(struct cameras *views);

/* The outputs' own file that the setting `cameras` means; NULL where it means another, or it cannot be read. The
 * caller's (cJSON_Delete). */
cJSON *cameras_own(const struct relight_job *job);

/* The same view at another size; where the aspect differs, the largest part of it that has the new one. */
void camera_resize(struct camera *camera, uint32_t width, uint32_t height);

#endif
