/* luminance_per_unit.h -- the luminance of radiance 1 in a render, cd/m2: told by a setting, else by the
 * reconstruction's report. */
#ifndef UNBAKE_RELIGHT_LUMINANCE_PER_UNIT_H
#define UNBAKE_RELIGHT_LUMINANCE_PER_UNIT_H

#include "common/error.h"
#include "server/relight/relight_job.h"

/* The job's settings, with luminance_per_unit where it is known; *settings is the caller's (cJSON_Delete), also after a
 * failure. Tells the watch of what the report says. STATUS_INPUT where a setting needs it and it is not known. */
enum status luminance_per_unit_resolve(const struct relight_job *job, const struct relight_watch *watch,
                                       cJSON **settings, struct error *err);

#endif
