/* segments_json.h -- the segments for report.json: parameters, size and mean base colour of each. */
#ifndef UNBAKE_EXPORT_SEGMENTS_JSON_H
#define UNBAKE_EXPORT_SEGMENTS_JSON_H

#include "common/json.h"
#include "server/export/input.h"

/* An array with an object for each segment, in their order; the caller's. */
cJSON *segments_json(const struct export_input *in);

#endif
