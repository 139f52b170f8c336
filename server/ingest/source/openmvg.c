/* openmvg.c -- OpenMVG's sfm_data.json (openMVG/src/openMVG/sfm/sfm_data_io_cereal.hpp): views, intrinsics and
 * extrinsics, each an array of {key, value}. A pose is the rotation of the world into the camera and the camera's
 * centre, with our camera axes. Distortion is OpenCV's, with the tangential coefficients in its order: x gets t2 (r^2 +
 * 2 x^2) + 2 t1 x y. */
#include <math.h>
#include <string.h>

#include "common/mem.h"
#include "server/ingest/source/frame_list.h"
#include "server/ingest/source/photo_folder.h"
#include "server/ingest/source/values.h"

static char *recognise(const struct listing *l, const char *base) {
    static const char *const names[] = {"sfm_data.json", "reconstruction/sfm_data.json", "sfm_data_extrinsics.json"};
    return listing_find_any(l, base, names, 3);
}

/* A file and where in its arrays the last view's pose and lens were. */
struct mvg_file {
    const cJSON *tree, *pose, *intrinsic;
    size_t unposed_count;
};

/* The value of that id in an array of {key, value}; NULL: none. */
static const cJSON *of_key(const cJSON *tree, const char *array, const cJSON *id, const cJSON **hint) {
    const cJSON *item = json_find(cJSON_GetObjectItemCaseSensitive(tree, array), "key", id, hint);
    return cJSON_GetObjectItemCaseSensitive(item, "value");
}

static const cJSON *data_of(const cJSON *value) {
    const cJSON *wrapper = cJSON_GetObjectItemCaseSensitive(value, "ptr_wrapper");
    return cJSON_GetObjectItemCaseSensitive(wrapper, "data");
}

/* Whether all that is said of the lens is known: distortion is an array, and of a name of its own in each type. */
static bool is_known(const cJSON *data) {
    static const char *const known[] = {"principal_point", "disto_k1", "disto_k3", "disto_t2", "fisheye"};
    const cJSON *member;
    cJSON_ArrayForEach(member, data) {
        bool is_one = !cJSON_IsArray(member);
        for (size_t i = 0; i < sizeof known / sizeof *known; i++)
            is_one = is_one || strcmp(member->string, known[i]) == 0;
        if (!is_one)
            return false;
    }
    return true;
}

/* Reads an intrinsic; STATUS_INPUT for models that are not pinhole or fisheye. The type's name is given where a type
 * is used first; the arrays of coefficients tell it everywhere. */
static enum status read_lens(const cJSON *value, const char *name, struct lens *lens, struct error *err) {
    const cJSON *data = data_of(value), *inner = cJSON_GetObjectItemCaseSensitive(data, "value0");
    const cJSON *base = inner ? inner : data;
    double centre[2] = {NAN, NAN}, f = json_member(base, "focal_length");
    if (!json_numbers(cJSON_GetObjectItemCaseSensitive(base, "principal_point"), 2, centre) || isnan(f) ||
        !is_known(data))
        return error_set(err, STATUS_INPUT, "%s: an intrinsic is no pinhole or fisheye camera", name);
    *lens = lens_pinhole(json_member(base, "width"), json_member(base, "height"), f, f, centre[0], centre[1]);
    const cJSON *fisheye = cJSON_GetObjectItemCaseSensitive(data, "fisheye");
    double brown[5];
    if (json_numbers(fisheye, 4, lens->k))
        lens->model = CAMERA_OPENCV_FISHEYE;
    json_numbers(cJSON_GetObjectItemCaseSensitive(data, "disto_k1"), 1, lens->k);
    json_numbers(cJSON_GetObjectItemCaseSensitive(data, "disto_k3"), 3, lens->k);
    if (json_numbers(cJSON_GetObjectItemCaseSensitive(data, "disto_t2"), 5, brown)) {
        memcpy(lens->k, brown, 3 * sizeof *brown);
        memcpy(lens->p, brown + 3, 2 * sizeof *brown);
    }
    return STATUS_OK;
}

static enum status read_view(struct mvg_file *in, const cJSON *view, struct frame_list *list, struct error *err) {
    const cJSON *tree = in->tree;
    const cJSON *data = data_of(cJSON_GetObjectItemCaseSensitive(view, "value"));
    const char *root = json_text_member(tree, "root_path"), *folder = json_text_member(data, "local_path");
    const char *file = json_text_member(data, "filename");
    const cJSON *pose = of_key(tree, "extrinsics", cJSON_GetObjectItemCaseSensitive(data, "id_pose"), &in->pose);
    const cJSON *intrinsic =
        of_key(tree, "intrinsics", cJSON_GetObjectItemCaseSensitive(data, "id_intrinsic"), &in->intrinsic);
    double r[9], centre[3], rotation[3][3], m[3][4];
    struct lens lens;
    if (!file)
        return error_set(err, STATUS_INPUT, "%s: a view has no filename", list->name);
    if (!pose || !intrinsic) {
        in->unposed_count++;
        return STATUS_OK;
    }
    if (!json_numbers(cJSON_GetObjectItemCaseSensitive(pose, "rotation"), 9, r) ||
        !json_numbers(cJSON_GetObjectItemCaseSensitive(pose, "center"), 3, centre))
        return error_set(err, STATUS_INPUT, "%s: the pose of %s has no rotation and center", list->name, file);
    enum status status = read_lens(intrinsic, list->name, &lens, err);
    if (status != STATUS_OK)
        return status;
    memcpy(rotation, r, sizeof rotation);
    pose_at_centre(rotation, centre, m);
    char *full = mem_printf("%s/%s/%s", root ? root : "", folder ? folder : "", file);
    status = frame_list_add(list, m, &lens, full, file, NULL, err);
    mem_free(full);
    return status;
}

static enum status read(const struct source_place *place, struct frames *t, struct findings *f, struct error *err) {
    struct frame_list list = frame_list_make(t, place->found, AXES_OPENCV_INVERSE, f);
    struct error own;
    const cJSON *view;
    cJSON *tree;
    enum status status = json_file_read(place->listing, place->found, &tree, &own);
    struct mvg_file in = {.tree = tree};
    cJSON_ArrayForEach(view, cJSON_GetObjectItemCaseSensitive(tree, "views")) {
        if (status == STATUS_OK)
            status = read_view(&in, view, &list, &own);
    }
    cJSON_Delete(tree);
    frame_list_finish(&list);
    frame_list_warn_unposed(&list, in.unposed_count);
    photo_folder_resolve(place->listing, place->base, false, t, f);
    return findings_settle(f, place->found, status, &own, err);
}

const struct source source_openmvg = {"OpenMVG", recognise, read};
