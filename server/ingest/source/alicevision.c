/* alicevision.c -- Meshroom's .sfm or .json of AliceVision (aliceVision/sfmDataIO/jsonIO.cpp): views, intrinsics and
 * poses; numbers are strings.
 *
 * A pose's rotation is stored column by column and is that of the world into the camera, so that it reads row by row as
 * camera-to-world; camera axes are ours. The pose of a view of a rig is that of the rig times its own in the rig. Since
 * version 1.2.3 (2021) meshes are written with y and z turned around, as computer graphics has them, while this file is
 * not: the poses here are turned into the mesh's world. */
#include <math.h>
#include <string.h>
#include <strings.h>

#include "common/mem.h"
#include "server/ingest/source/frame_list.h"
#include "server/ingest/source/photo_folder.h"
#include "server/ingest/source/values.h"
#include "server/scene/coordinates.h"

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

#define VERSION(major, minor, revision) ((major)*10000 + (minor)*100 + (revision))

/* A file and where in its arrays the last view's pose, lens and rig were. */
struct alice_file {
    const cJSON *tree, *pose, *intrinsic, *rig;
    int version; /* of the format, VERSION() */
    size_t unposed_count;
};

/* The element of that array with the id that the view has in its member `key`; NULL: none. */
static const cJSON *of_view(const cJSON *tree, const char *array, const cJSON *view, const char *key,
                            const cJSON **hint) {
    const cJSON *id = cJSON_GetObjectItemCaseSensitive(view, key);
    return json_find(cJSON_GetObjectItemCaseSensitive(tree, array), key, id, hint);
}

static int version_of(const cJSON *tree) {
    double v[3];
    bool has_version = json_numbers(cJSON_GetObjectItemCaseSensitive(tree, "version"), 3, v);
    bool is_valid =
        has_version && v[0] >= 0.0 && v[0] < 100.0 && v[1] >= 0.0 && v[1] < 100.0 && v[2] >= 0.0 && v[2] < 100.0;
    return is_valid ? VERSION((int)v[0], (int)v[1], (int)v[2]) : VERSION(1, 0, 0);
}

/* --- lenses ----------------------------------------------------------------------------------- */

/* Focal lengths are in millimetres of a sensor (since 1.2.2) or in pixels, one for both axes (until 1.2.0) or two.
 * pixelRatio is fy / fx since 1.2.5 and was fx / fy before. */
static void read_focal(const cJSON *in, int version, double width, double focal[2]) {
    const cJSON *pixels = cJSON_GetObjectItemCaseSensitive(in, "pxFocalLength");
    double length = json_member(in, "focalLength"), sensor = json_member(in, "sensorWidth");
    double ratio = json_member(in, "pixelRatio");
    if (length > 0.0 && sensor > 0.0) {
        focal[0] = length / sensor * width;
        focal[1] = !(ratio > 0.0) ? focal[0] : version < VERSION(1, 2, 5) ? focal[0] / ratio : focal[0] * ratio;
    } else if (!json_numbers(pixels, 2, focal)) {
        focal[0] = json_value(pixels);
        if (isnan(focal[0]))
            json_numbers(pixels, 1, focal);
        focal[1] = focal[0];
    }
}

enum alice_distortion {
    DISTORTION_NONE,
    DISTORTION_RADIAL,
    DISTORTION_RADIAL_FIXED,
    DISTORTION_BROWN,
    DISTORTION_FISHEYE,
    DISTORTION_FOV
};

/* By the names of distortionType and, in files that have none, of the intrinsic's type (camera/cameraCommon.hpp). False
 * for those that are not read: 3DEqualizer's. */
static bool find_distortion(const char *name, enum alice_distortion *distortion) {
    static const struct {
        const char *name;
        enum alice_distortion distortion;
    } known[] = {{"none", DISTORTION_NONE},
                 {"pinhole", DISTORTION_NONE},
                 {"radialk1", DISTORTION_RADIAL},
                 {"radial1", DISTORTION_RADIAL},
                 {"radialk3", DISTORTION_RADIAL},
                 {"radial3", DISTORTION_RADIAL},
                 {"radialk3pt", DISTORTION_RADIAL_FIXED},
                 {"brown", DISTORTION_BROWN},
                 {"fisheye4", DISTORTION_FISHEYE},
                 {"fisheye1", DISTORTION_FOV}};
    for (size_t i = 0; i < sizeof known / sizeof *known; i++)
        if (strcasecmp(name, known[i].name) == 0) {
            *distortion = known[i].distortion;
            return true;
        }
    return false;
}

/* radialk3pt divides by what the polynomial is at radius 1, fisheye1 is the FOV model of Devernay & Faugeras with k1 as
 * its angle (camera/DistortionRadial.cpp, DistortionFisheye1.cpp). */
static void set_distortion(enum alice_distortion distortion, const double c[5], struct lens *lens) {
    double at_one = 1.0 + c[0] + c[1] + c[2];
    if (distortion == DISTORTION_FISHEYE) {
        lens->model = CAMERA_OPENCV_FISHEYE;
        memcpy(lens->k, c, 4 * sizeof *c);
    } else if (distortion == DISTORTION_FOV) {
        lens->model = CAMERA_FOV;
        lens->k[0] = fmax(c[0], 0.0);
    } else if (distortion != DISTORTION_NONE) {
        memcpy(lens->k, c, 3 * sizeof *c);
        if (distortion == DISTORTION_BROWN)
            memcpy(lens->p, c + 3, 2 * sizeof *c);
        if (distortion == DISTORTION_RADIAL_FIXED) {
            lens->fl_x /= at_one;
            lens->fl_y /= at_one;
        }
    }
}

static bool has_undistortion(const cJSON *in) {
    const char *type = json_text_member(in, "undistortionType");
    return type && strcmp(type, "none") != 0 &&
           cJSON_GetArraySize(cJSON_GetObjectItemCaseSensitive(in, "undistortionParams")) > 0;
}

static enum status refuse_lens(const char *name, const char *what, const char *model, struct error *err) {
    error_set(err, STATUS_INPUT, "%s: lenses of %s %.60s are not read", name, what, model);
    return error_hint(err, "Meshroom's node PrepareDenseScene writes photographs without distortion");
}

/* The principal point is an offset from the picture's centre since 1.2.1. */
static enum status read_lens(const cJSON *in, int version, const char *name, struct lens *lens, struct error *err) {
    const char *type = json_text_member(in, "type"), *own = json_text_member(in, "distortionType");
    double width = json_member(in, "width"), height = json_member(in, "height"), centre[2] = {0.0, 0.0};
    double focal[2] = {NAN, NAN}, c[5] = {0.0};
    const cJSON *parameters = cJSON_GetObjectItemCaseSensitive(in, "distortionParams");
    enum alice_distortion distortion;
    if (type && strncasecmp(type, "equidistant", 11) == 0)
        return refuse_lens(name, "type", type, err);
    const char *model = own ? own : type ? type : "none";
    if (!find_distortion(model, &distortion))
        return refuse_lens(name, "type", model, err);
    if (has_undistortion(in))
        return refuse_lens(name, "undistortionType", json_text_member(in, "undistortionType"), err);
    read_focal(in, version, width, focal);
    bool has_centre = json_numbers(cJSON_GetObjectItemCaseSensitive(in, "principalPoint"), 2, centre);
    if (version >= VERSION(1, 2, 1) || !has_centre) {
        centre[0] += 0.5 * width;
        centre[1] += 0.5 * height;
    }
    *lens = lens_pinhole(width, height, focal[0], focal[1], centre[0], centre[1]);
    for (size_t i = 0; cJSON_IsArray(parameters) && i < 5; i++) {
        double value = json_value(cJSON_GetArrayItem(parameters, (int)i));
        c[i] = isnan(value) ? 0.0 : value;
    }
    set_distortion(distortion, c, lens);
    return STATUS_OK;
}

/* --- poses ------------------------------------------------------------------------------------ */

/* Camera-to-world of an object with rotation and center, or in a rig's case camera-to-rig; false when it has none. */
static bool read_pose(const cJSON *pose, double m[3][4]) {
    double r[9], centre[3];
    if (!json_numbers(cJSON_GetObjectItemCaseSensitive(pose, "rotation"), 9, r) ||
        !json_numbers(cJSON_GetObjectItemCaseSensitive(pose, "center"), 3, centre))
        return false;
    for (int i = 0; i < 12; i++)
        m[i / 4][i % 4] = i % 4 < 3 ? r[3 * (i / 4) + i % 4] : centre[i / 4];
    return true;
}

/* Of a view whose poseId is its rig's: the pose within the rig. NULL: of no rig, or of a pose of its own; *is_lost: of
 * a rig that does not know it. */
static const cJSON *find_sub_pose(struct alice_file *file, const cJSON *view, bool *is_lost) {
    const cJSON *independent = cJSON_GetObjectItemCaseSensitive(view, "isPoseIndependant");
    const char *text = cJSON_GetStringValue(independent);
    double number = json_member(view, "subPoseId");
    bool is_of_rig = cJSON_HasObjectItem(view, "rigId") &&
                     (cJSON_IsFalse(independent) || (text && (strcmp(text, "false") == 0 || strcmp(text, "0") == 0)));
    *is_lost = false;
    if (!is_of_rig)
        return NULL;
    const cJSON *rig = of_view(file->tree, "rigs", view, "rigId", &file->rig);
    const cJSON *sub_poses = cJSON_GetObjectItemCaseSensitive(rig, "subPoses");
    const cJSON *sub = number >= 0.0 && number < 1e6 ? cJSON_GetArrayItem(sub_poses, (int)number) : NULL;
    const char *state = json_text_member(sub, "status");
    *is_lost = !sub || (state && strcmp(state, "uninitialized") == 0);
    return cJSON_GetObjectItemCaseSensitive(sub, "pose");
}

static enum status read_view(struct alice_file *file, const cJSON *view, struct frame_list *list, struct error *err) {
    const char *path = json_text_member(view, "path");
    const cJSON *item = of_view(file->tree, "poses", view, "poseId", &file->pose);
    const cJSON *pose = cJSON_GetObjectItemCaseSensitive(cJSON_GetObjectItemCaseSensitive(item, "pose"), "transform");
    const cJSON *in = of_view(file->tree, "intrinsics", view, "intrinsicId", &file->intrinsic);
    double m[3][4], rig[3][4], sub[3][4];
    bool is_lost;
    struct lens lens;
    if (!path)
        return error_set(err, STATUS_INPUT, "%s: a view has no path", list->name);
    const cJSON *sub_pose = find_sub_pose(file, view, &is_lost);
    if (!pose || !in || is_lost) {
        file->unposed_count++;
        return STATUS_OK;
    }
    if (!read_pose(pose, m) || (sub_pose && !read_pose(sub_pose, sub)))
        return error_set(err, STATUS_INPUT, "%s: the pose of %.200s has no rotation and center", list->name, path);
    if (sub_pose) {
        memcpy(rig, m, sizeof rig);
        coordinates_product((const double(*)[4])rig, (const double(*)[4])sub, m);
    }
    for (int i = 4; i < 12 && file->version >= VERSION(1, 2, 3); i++)
        m[i / 4][i % 4] = -m[i / 4][i % 4]; /* the mesh's world: y and z turned around */
    enum status status = read_lens(in, file->version, list->name, &lens, err);
    return status == STATUS_OK ? frame_list_add(list, m, &lens, path, path, NULL, err) : status;
}

static enum status read(const struct source_place *place, struct frames *t, struct findings *f, struct error *err) {
    struct frame_list list = frame_list_make(t, place->found, AXES_OPENCV, f);
    struct error own;
    const cJSON *view;
    cJSON *tree;
    enum status status = json_file_read(place->listing, place->found, &tree, &own);
    struct alice_file file = {.tree = tree, .version = version_of(tree)};
    cJSON_ArrayForEach(view, cJSON_GetObjectItemCaseSensitive(tree, "views")) {
        if (status == STATUS_OK)
            status = read_view(&file, view, &list, &own);
    }
    cJSON_Delete(tree);
    frame_list_finish(&list);
    frame_list_warn_unposed(&list, file.unposed_count);
    photo_folder_resolve(place->listing, place->base, false, t, f);
    return findings_settle(f, place->found, status, &own, err);
}

const struct source source_alicevision = {"Meshroom", recognise, read};
