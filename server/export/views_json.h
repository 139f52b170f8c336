/* views_json.h -- views.json, the cameras of the held-out views, and cameras.json, those of all photographs, in the
 * format of nerfstudio's transforms.json, in the coordinates of the input. */
#ifndef UNBAKE_EXPORT_VIEWS_JSON_H
#define UNBAKE_EXPORT_VIEWS_JSON_H

#include "common/json.h"
#include "server/export/input.h"

/* One frame per comparison, in order, with its lens parameters; the caller's. `offset` is that of the mesh. */
cJSON *views_json(const struct export_comparison *comparison, size_t count, const double offset[3]);
cJSON *cameras_json(const struct export_input *in);

/* One frame; split NULL: none. A panorama's camera_model is EQUIRECTANGULAR, and has no lens parameters. */
cJSON *views_json_frame(const char *name, const char *split, const struct camera *camera, const double offset[3]);

#endif
