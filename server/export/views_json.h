/* views_json.h -- views.json: the cameras of the held-out views, as nerfstudio's transforms.json
 * has them, so that whatever reads that can look from there again. */
#ifndef UNBAKE_EXPORT_VIEWS_JSON_H
#define UNBAKE_EXPORT_VIEWS_JSON_H

#include "common/json.h"
#include "server/export/input.h"

/* One frame for each comparison, in order, with its lens; the caller's. */
cJSON *views_json(const struct export_comparison *comparison, size_t count);

#endif
