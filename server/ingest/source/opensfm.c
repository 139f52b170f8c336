/* opensfm.c -- OpenSfM and OpenDroneMap (opensfm.org/docs/dataset.html): reconstruction.json.
 *
 * Shots are world-to-camera, an axis times an angle and a translation, with our camera axes. Lengths of a lens are
 * shares of the picture's longer side. OpenDroneMap writes the reconstruction a second time in the coordinates of its
 * georeferenced mesh (odm_textured_model_geo.obj): reconstruction.geocoords.json, which is preferred. Since version 2.0
 * it is that which it calls reconstruction.json, and the other one reconstruction.topocentric.json. */
#include <math.h>
#include <string.h>

#include "common/mem.h"
#include "server/ingest/path.h"
#include "server/ingest/source/frame_list.h"
#include "server/ingest/source/photo_folder.h"
#include "server/ingest/source/values.h"

#define PLAIN "reconstruction.json"
#define GEOREFERENCED "reconstruction.geocoords.json"
#define TOPOCENTRIC "reconstruction.topocentric.json"

static char *recognise(const struct listing *l, const char *base) {
    static const char *const names[] = {"opensfm/" GEOREFERENCED, "opensfm/" PLAIN, GEOREFERENCED, PLAIN};
    return listing_find_any(l, base, names, 4);
}

static double number(const cJSON *camera, const char *key, double fallback) {
    double value = json_member(camera, key);
    return isnan(value) ? fallback : value;
}

/* STATUS_INPUT for panoramas and other models that are not read. */
static enum status read_lens(const cJSON *camera, const char *name, struct lens *lens, struct error *err) {
    static const char *const radial[] = {"k1", "k2", "k3", "k4", "k5", "k6"};
    const char *type = json_text_member(camera, "projection_type");
    double width = json_member(camera, "width"), height = json_member(camera, "height"), longer = fmax(width, height);
    double focal = number(camera, "focal", json_member(camera, "focal_x"));
    bool is_fisheye = type && (strcmp(type, "fisheye") == 0 || strcmp(type, "fisheye_opencv") == 0);
    bool is_pinhole = !type || strcmp(type, "perspective") == 0 || strcmp(type, "brown") == 0 ||
                      strcmp(type, "simple_radial") == 0 || strcmp(type, "radial") == 0;
    if (!is_fisheye && !is_pinhole)
        return error_set(err, STATUS_INPUT, "%s: cameras of type %.40s are not read", name, type);
    *lens = lens_pinhole(width, height, focal * longer, number(camera, "focal_y", focal) * longer,
                         0.5 * width + number(camera, "c_x", 0.0) * longer,
                         0.5 * height + number(camera, "c_y", 0.0) * longer);
    lens->model = is_fisheye ? CAMERA_OPENCV_FISHEYE : CAMERA_OPENCV;
    for (int i = 0; i < (is_fisheye ? 4 : 3); i++)
        lens->k[i] = number(camera, radial[i], 0.0);
    lens->p[0] = is_fisheye ? 0.0 : number(camera, "p1", 0.0);
    lens->p[1] = is_fisheye ? 0.0 : number(camera, "p2", 0.0);
    return STATUS_OK;
}

static enum status read_shot(const cJSON *cameras, const cJSON *shot, struct frame_list *list, struct error *err) {
    const char *id = json_text_member(shot, "camera");
    const cJSON *camera = id ? cJSON_GetObjectItemCaseSensitive(cameras, id) : NULL;
    double v[3], translation[3], r[3][3], m[3][4];
    struct lens lens;
    if (!camera || !json_numbers(cJSON_GetObjectItemCaseSensitive(shot, "rotation"), 3, v) ||
        !json_numbers(cJSON_GetObjectItemCaseSensitive(shot, "translation"), 3, translation))
        return error_set(err, STATUS_INPUT, "%s: shot %.200s has no camera, rotation and translation", list->name,
                         shot->string);
    enum status status = read_lens(camera, list->name, &lens, err);
    if (status != STATUS_OK)
        return status;
    rotation_from_axis_angle(v, r);
    pose_invert(r, translation, m);
    return frame_list_add(list, m, &lens, shot->string, shot->string, NULL, err);
}

static size_t shot_count(const cJSON *part) {
    return (size_t)cJSON_GetArraySize(cJSON_GetObjectItemCaseSensitive(part, "shots"));
}

/* The part with most shots: the others have coordinates of their own. */
static const cJSON *largest_part(const cJSON *tree, struct findings *f, const char *name) {
    const cJSON *part, *best = NULL;
    size_t total = 0;
    cJSON_ArrayForEach(part, tree) {
        total += shot_count(part);
        if (!best || shot_count(part) > shot_count(best))
            best = part;
    }
    if (best && total > shot_count(best))
        findings_warning(f,
                         "%s has %d parts that do not hang together: the largest is used, with %zu of %zu photographs",
                         name, cJSON_GetArraySize(tree), shot_count(best), total);
    return best;
}

/* A georeferenced mesh beside poses that are not. */
static void warn_of_georeference(const struct source_place *place, struct findings *f) {
    char *other = mem_printf("%.*s" TOPOCENTRIC, (int)(path_base(place->found) - place->found), place->found);
    bool is_georeferenced = strstr(place->found, GEOREFERENCED) || listing_find(place->listing, "", other);
    mem_free(other);
    if (!is_georeferenced && listing_find(place->listing, place->base, "odm_georeferencing/coords.txt"))
        findings_warning(f,
                         "%s may be in other coordinates than a georeferenced mesh (*_geo): if they do not fit, copy "
                         "all of the project's opensfm/reconstruction*.json",
                         place->found);
}

static enum status read(const struct source_place *place, struct frames *t, struct findings *f, struct error *err) {
    struct frame_list list = frame_list_make(t, place->found, AXES_OPENCV_INVERSE, f);
    struct error own;
    cJSON *tree;
    const cJSON *shot;
    enum status status = json_file_read(place->listing, place->found, &tree, &own);
    const cJSON *part = status == STATUS_OK ? largest_part(tree, f, place->found) : NULL;
    const cJSON *cameras = cJSON_GetObjectItemCaseSensitive(part, "cameras");
    cJSON_ArrayForEach(shot, cJSON_GetObjectItemCaseSensitive(part, "shots")) {
        if (status == STATUS_OK)
            status = read_shot(cameras, shot, &list, &own);
    }
    cJSON_Delete(tree);
    frame_list_finish(&list);
    warn_of_georeference(place, f);
    photo_folder_resolve(place->listing, place->base, true, t, f);
    return findings_settle(f, place->found, status, &own, err);
}

const struct source source_opensfm = {"OpenDroneMap or OpenSfM", recognise, read};
