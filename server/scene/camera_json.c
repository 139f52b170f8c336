/* camera_json.c -- see camera_json.h. */
#include "server/scene/camera_json.h"

cJSON *camera_transform_matrix(const struct camera *camera, const double offset[3]) {
    const struct rigid *m = &camera->world_from_camera;
    const float t[3] = {m->translation.x, m->translation.y, m->translation.z};
    cJSON *rows = cJSON_CreateArray();
    for (int i = 0; i < 3; i++)
        cJSON_AddItemToArray(rows,
                             cJSON_CreateDoubleArray((double[]){(double)m->rotation[i][0], -(double)m->rotation[i][1],
                                                                -(double)m->rotation[i][2], (double)t[i] + offset[i]},
                                                     4));
    cJSON_AddItemToArray(rows, cJSON_CreateDoubleArray((double[]){0.0, 0.0, 0.0, 1.0}, 4));
    return rows;
}
