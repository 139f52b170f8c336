/* alicevision.c -- Meshroom's .sfm or .json of AliceVision (aliceVision/sfmDataIO/jsonIO.cpp): views, intrinsics and poses;
 * numbers are strings.
 *
 * A pose's rotation is stored column by column and is that of the world into the camera, so that it reads row by row as
 * camera-to-world; camera axes are ours. Since version 1.2.3 (2021) meshes are written with y and z turned around, as
 * computer graphics has them, while this file is not: the poses here are turned into the mesh's world. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "common/mem.h"
#include "server/ingest/source/frame_list.h"
#include "server/ingest/source/photo_folder.h"
#include "server/ingest/source/values.h"

static char *recognise(const struct listing *l, const char *base) {
    static const char *const patterns[] = {"*.sfm", "StructureFromMotion/*/*.sfm",
                                           "MeshroomCache/StructureFromMotion/*/*.sfm", "sfmData.json"};
    for (size_t i = 0; i < sizeof patterns / sizeof *patterns; i++) {
        const struct listed_file *file = listing_first(l, base, patterns[i]);
        if (file)
            return mem_strdup(file->path);
    }
    return NULL;
}

/* A file and where in its arrays the last view's pose and lens were. */
struct alice_file {
    const cJSON *tree, *pose, *intrinsic;
    bool turns_meshes;
    size_t unposed_count;
};

/* The element of that array with the id that the view has in its member `key`; NULL: none. */
static const cJSON *of_view(const cJSON *tree, const char *array, const cJSON *view, const char *key,
                            const cJSON **hint) {
    const cJSON *id = cJSON_GetObjectItemCaseSensitive(view, key);
    return json_find(cJSON_GetObjectItemCaseSensitive(tree, array), key, id, hint);
}

/* At least version 1.2.3 of the file. */
static bool turns_meshes(const cJSON *tree) {
    double v[3];
    if (!json_numbers(cJSON_GetObjectItemCaseSensitive(tree, "version"), 3, v))
        return false;
    return v[0] > 1.0 || (v[0] == 1.0 && (v[1] > 2.0 || (v[1] == 2.0 && v[2] >= 3.0)));
}

/* Focal lengths are in millimetres of a sensor (since 1.2.0) or in pixels; the principal point is an offset from the
 * picture's centre (since 1.2.0) or absolute. */
static enum status read_lens(const cJSON *in, const char *name, struct lens *lens, struct error *err) {
    const char *type = json_text_member(in, "type"), *distortion = json_text_member(in, "distortionType");
    double width = json_member(in, "width"), height = json_member(in, "height"), f = json_member(in, "focalLength");
    double sensor = json_member(in, "sensorWidth"), pixels = json_member(in, "pxFocalLength"), centre[2] = {0.0, 0.0};
    double ratio = json_member(in, "pixelRatio"), c[5] = {0.0};
    const cJSON *parameters = cJSON_GetObjectItemCaseSensitive(in, "distortionParams");
    if (isnan(pixels))
        json_numbers(cJSON_GetObjectItemCaseSensitive(in, "pxFocalLength"), 1, &pixels);
    double fx = f > 0.0 && sensor > 0.0 ? f / sensor * width : pixels;
    json_numbers(cJSON_GetObjectItemCaseSensitive(in, "principalPoint"), 2, centre);
    if (centre[0] < 0.25 * width && centre[1] < 0.25 * height) {
        centre[0] += 0.5 * width;
        centre[1] += 0.5 * height;
    }
    *lens = lens_pinhole(width, height, fx, ratio > 0.0 ? fx / ratio : fx, centre[0], centre[1]);
    const char *model = distortion ? distortion : type ? type : "";
    for (size_t i = 0; parameters && i < 5; i++) {
        double value = json_value(cJSON_GetArrayItem(parameters, (int)i));
        c[i] = isnan(value) ? 0.0 : value;
    }
    if (strstr(model, "fisheye")) {
        lens->model = CAMERA_OPENCV_FISHEYE;
        memcpy(lens->k, c, 4 * sizeof *c);
    } else if (strstr(model, "radialk1") || strstr(model, "radialk3") || strcmp(model, "radial1") == 0 ||
               strcmp(model, "radial3") == 0) {
        memcpy(lens->k, c, 3 * sizeof *c);
    } else if (strstr(model, "brown")) {
        memcpy(lens->k, c, 3 * sizeof *c);
        memcpy(lens->p, c + 3, 2 * sizeof *c);
    } else if (fabs(c[0]) + fabs(c[1]) + fabs(c[2]) > 0.0) {
        error_set(err, STATUS_INPUT, "%s: lenses of type %.60s are not read", name, model);
        return error_hint(err, "Meshroom's node PrepareDenseScene writes photographs without distortion");
    }
    return STATUS_OK;
}

static enum status read_view(struct alice_file *file, const cJSON *view, struct frame_list *list, struct error *err) {
    const char *path = json_text_member(view, "path");
    const cJSON *item = of_view(file->tree, "poses", view, "poseId", &file->pose);
    const cJSON *pose = cJSON_GetObjectItemCaseSensitive(cJSON_GetObjectItemCaseSensitive(item, "pose"), "transform");
    const cJSON *in = of_view(file->tree, "intrinsics", view, "intrinsicId", &file->intrinsic);
    double r[9], centre[3], m[3][4];
    struct lens lens;
    if (!path)
        return error_set(err, STATUS_INPUT, "%s: a view has no path", list->name);
    if (!pose || !in) {
        file->unposed_count++;
        return STATUS_OK;
    }
    if (!json_numbers(cJSON_GetObjectItemCaseSensitive(pose, "rotation"), 9, r) ||
        !json_numbers(cJSON_GetObjectItemCaseSensitive(pose, "center"), 3, centre))
        return error_set(err, STATUS_INPUT, "%s: the pose of %.200s has no rotation and center", list->name, path);
    enum status status = read_lens(in, list->name, &lens, err);
    for (int i = 0; i < 12; i++) {
        double sign = file->turns_meshes && i >= 4 ? -1.0 : 1.0; /* the mesh's world: y and z turned around */
        m[i / 4][i % 4] = sign * (i % 4 < 3 ? r[3 * (i / 4) + i % 4] : centre[i / 4]);
    }
    return status == STATUS_OK ? frame_list_add(list, m, &lens, path, path, NULL, err) : status;
}

static enum status read(const struct source_place *place, struct frames *t, struct findings *f, struct error *err) {
    struct frame_list list = frame_list_make(t, place->found, AXES_OPENCV, f);
    struct error own;
    const cJSON *view;
    cJSON *tree;
    enum status status = json_file_read(place->listing, place->found, &tree, &own);
    struct alice_file file = {.tree = tree, .turns_meshes = turns_meshes(tree)};
    cJSON_ArrayForEach(view, cJSON_GetObjectItemCaseSensitive(tree, "views")) {
        if (status == STATUS_OK)
            status = read_view(&file, view, &list, &own);
    }
    cJSON_Delete(tree);
    frame_list_finish(&list);
    if (file.unposed_count > 0)
        findings_warning(f, "%s: %zu photographs have no pose and are not used", place->found, file.unposed_count);
    photo_folder_settle(place->listing, place->base, false, t, f);
    return findings_settle(f, place->found, status, &own, err);
}

const struct source source_alicevision = {"Meshroom", recognise, read};
