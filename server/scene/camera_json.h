/* camera_json.h -- a camera's pose as nerfstudio's transforms.json has it. */
#ifndef UNBAKE_SCENE_CAMERA_JSON_H
#define UNBAKE_SCENE_CAMERA_JSON_H

#include "common/json.h"
#include "server/scene/camera.h"

/* Four rows of four: camera to world, x right, y up, looking along -z, metres, in the coordinates of the input, whose
 * origin lies at -offset (struct mesh); the caller's. */
cJSON *camera_transform_matrix(const struct camera *camera, const double offset[3]);

#endif
