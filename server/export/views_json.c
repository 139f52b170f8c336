/* views_json.c -- see views_json.h. */
#include "server/export/views_json.h"

#include "server/scene/camera_json.h"

static void add_lens(cJSON *frame, const struct camera *camera) {
    static const char *const radial[6] = {"k1", "k2", "k3", "k4", "k5", "k6"};
    bool is_fisheye = camera->model == CAMERA_OPENCV_FISHEYE;
    json_add_string(frame, "camera_model", is_fisheye ? "OPENCV_FISHEYE" : "FULL_OPENCV");
    json_add_int(frame, "w", camera->width);
    json_add_int(frame, "h", camera->height);
    json_add_number(frame, "fl_x", (double)camera->fx);
    json_add_number(frame, "fl_y", (double)camera->fy);
    json_add_number(frame, "cx", (double)camera->cx);
    json_add_number(frame, "cy", (double)camera->cy);
    for (int i = 0; i < (is_fisheye ? 4 : 6); i++)
        json_add_number(frame, radial[i], (double)camera->k[i]);
    if (!is_fisheye) {
        json_add_number(frame, "p1", (double)camera->p[0]);
        json_add_number(frame, "p2", (double)camera->p[1]);
    }
}

cJSON *views_json(const struct export_comparison *comparison, size_t count, const double offset[3]) {
    cJSON *root = cJSON_CreateObject(), *frames = cJSON_AddArrayToObject(root, "frames");
    for (size_t i = 0; i < count; i++) {
        cJSON *frame = cJSON_CreateObject();
        json_add_string(frame, "file_path", comparison[i].name);
        json_add_string(frame, "split", "test");
        add_lens(frame, comparison[i].camera);
        json_add(frame, "transform_matrix", camera_transform_matrix(comparison[i].camera, offset));
        cJSON_AddItemToArray(frames, frame);
    }
    return root;
}
