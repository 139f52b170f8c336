/* scene_fit.h -- what the check of a scene says about a job on it: whether mesh and photographs fit, how the scene is
 * read.
 *
 * The check's facts (server/check) have "fit": {"verdict": "yes", "doubtful" or "no", "evidence", "remedy",
 * "remedy_text", ...} and "reading". A scene that an older version has checked has neither: its fit is not known, and
 * jobs on it are taken. */
#ifndef UNBAKE_JOB_SCENE_FIT_H
#define UNBAKE_JOB_SCENE_FIT_H

#include "common/error.h"
#include "common/json.h"

struct scene_row; /* store/store.h */

/* STATUS_CONFLICT where the scene does not fit, with the evidence, and the remedy as the hint. *remedy, the caller's,
 * is the reading that would fit, NULL where none is known; `remedy` may be NULL. */
enum status scene_fit_check(const struct scene_row *scene, cJSON **remedy, struct error *err);

/* How jobs read the scene: as its check has found that it is to be read, or as it was given. The caller's. */
cJSON *scene_fit_reading(const struct scene_row *scene);

#endif
