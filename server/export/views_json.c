/* views_json.c -- see views_json.h. */
#include "server/export/views_json.h"

#include "server/scene/camera_json.h"

static void add_lens(cJSON *frame, const struct camera *camera) {
    static const char *const radial[6] = {"k1", "k2", "k3", "k4", "k5", "k6"};
    static const char *const name[] = {
        [CAMERA_OPENCV] = "FULL_OPENCV",
        [CAMERA_OPENCV_FISHEYE] = "OPENCV_FISHEYE",
        [CAMERA_THIN_PRISM_FISHEYE] = "THIN_PRISM_FISHEYE",
        [CAMERA_FOV] = "FOV",
        [CAMERA_DIVISION] = "DIVISION",
        [CAMERA_PANORAMA] = "EQUIRECTANGULAR",
    };
    bool has_octic = camera->k8 != 0.0f; /* then there is no denominator: k4 is nerfstudio's */
    json_add_string(frame, "camera_model", has_octic ? "OPENCV" : name[camera->model]);
    json_add_int(frame, "w", camera->width);
    json_add_int(frame, "h", camera->height);
    if (camera->model == CAMERA_PANORAMA)
        return;
    json_add_number(frame, "fl_x", (double)camera->fx);
    json_add_number(frame, "fl_y", (double)camera->fy);
    json_add_number(frame, "cx", (double)camera->cx);
    json_add_number(frame, "cy", (double)camera->cy);
    if (camera->model == CAMERA_FOV) {
        json_add_number(frame, "omega", (double)camera->k[0]);
        return;
    }
    if (camera->model == CAMERA_DIVISION) {
        json_add_number(frame, "k1", (double)camera->k[0]);
        return;
    }
    int count = camera->model == CAMERA_OPENCV && !has_octic ? 6 : 4;
    for (int i = 0; i < count; i++)
        json_add_number(frame, radial[i], (double)(i == 3 && has_octic ? camera->k8 : camera->k[i]));
    if (camera->model == CAMERA_OPENCV_FISHEYE)
        return;
    json_add_number(frame, "p1", (double)camera->p[0]);
    json_add_number(frame, "p2", (double)camera->p[1]);
    if (camera->model == CAMERA_THIN_PRISM_FISHEYE) {
        json_add_number(frame, "sx1", (double)camera->s[0]);
        json_add_number(frame, "sy1", (double)camera->s[1]);
    }
}

cJSON *views_json_frame(const char *name, const char *split, const struct camera *camera, const double offset[3]) {
    cJSON *frame = cJSON_CreateObject();
    json_add_string(frame, "file_path", name);
    if (split)
        json_add_string(frame, "split", split);
    add_lens(frame, camera);
    json_add(frame, "transform_matrix", camera_transform_matrix(camera, offset));
    return frame;
}

cJSON *views_json(const struct export_comparison *comparison, size_t count, const double offset[3]) {
    cJSON *root = cJSON_CreateObject(), *frames = cJSON_AddArrayToObject(root, "frames");
    for (size_t i = 0; i < count; i++)
        cJSON_AddItemToArray(frames, views_json_frame(comparison[i].name, "test", comparison[i].camera, offset));
    return root;
}

cJSON *cameras_json(const struct export_input *in) {
    cJSON *root = cJSON_CreateObject(), *frames = cJSON_AddArrayToObject(root, "frames");
    for (size_t i = 0; i < in->camera_count; i++)
        cJSON_AddItemToArray(frames, views_json_frame(in->camera[i].name, in->camera[i].is_held_out ? "test" : "train",
                                                      &in->camera[i].camera, in->mesh->offset));
    return root;
}
