/* transforms_lens.c -- see transforms_lens.h. */
#include "server/ingest/transforms_lens.h"

#include <math.h>
#include <strings.h>

#include "common/image.h"

/* Reports a lens that is not modelled, with what to do. */
static void unknown_model(struct frame_context *c, const char *name) {
    static const struct {
        const char *name, *hint;
    } others[] = {
        {"EQUIRECTANGULAR",
         "cut the panoramas: ns-process-data images --camera-type equirectangular makes perspective views"},
        {"OMNIDIRECTIONALSTEREO_L", "render perspective views"},
        {"OMNIDIRECTIONALSTEREO_R", "render perspective views"},
        {"VR180_L", "render perspective views"},
        {"VR180_R", "render perspective views"},
        {"ORTHOPHOTO", "perspective or fisheye photographs are needed"},
        {"FISHEYE624", "undistort the photographs, or calibrate as OPENCV_FISHEYE or THIN_PRISM_FISHEYE"},
    };
    struct error err;
    error_set(
        &err, STATUS_INPUT,
        "%s: unknown camera_model \"%.80s\"; known are PINHOLE, SIMPLE_PINHOLE, SIMPLE_RADIAL, RADIAL, OPENCV, "
        "FULL_OPENCV, OPENCV_FISHEYE, SIMPLE_RADIAL_FISHEYE, RADIAL_FISHEYE, THIN_PRISM_FISHEYE, FOV and DIVISION",
        c->place, name);
    error_hint(&err, "colmap image_undistorter makes pinhole photographs of any");
    for (size_t i = 0; i < sizeof others / sizeof *others; i++)
        if (strcasecmp(name, others[i].name) == 0)
            error_hint(&err, "%s", others[i].hint);
    findings_error(c->findings, c->name, &err);
    c->ok = false;
}

/* *is_rational: k4 to k6 are of OpenCV's denominator, as the model's name says. */
static enum camera_model read_model(struct frame_context *c, bool *is_rational) {
    static const struct {
        const char *name;
        enum camera_model model;
    } models[] = {
        {"PINHOLE", CAMERA_OPENCV},
        {"SIMPLE_PINHOLE", CAMERA_OPENCV},
        {"SIMPLE_RADIAL", CAMERA_OPENCV},
        {"RADIAL", CAMERA_OPENCV},
        {"OPENCV", CAMERA_OPENCV},
        {"PERSPECTIVE", CAMERA_OPENCV},
        {"FULL_OPENCV", CAMERA_OPENCV},
        {"OPENCV_FISHEYE", CAMERA_OPENCV_FISHEYE},
        {"FISHEYE", CAMERA_OPENCV_FISHEYE},
        {"SIMPLE_RADIAL_FISHEYE", CAMERA_OPENCV_FISHEYE},
        {"RADIAL_FISHEYE", CAMERA_OPENCV_FISHEYE},
        {"THIN_PRISM_FISHEYE", CAMERA_THIN_PRISM_FISHEYE},
        {"FOV", CAMERA_FOV},
        {"DIVISION", CAMERA_DIVISION},
    };
    const char *name = frame_context_string(c, frame_context_holder(c, "camera_model"), "camera_model");
    struct error err;
    bool fisheye = false;
    *is_rational = name && strcasecmp(name, "FULL_OPENCV") == 0;
    if (!name) {
        const cJSON *object = frame_context_holder(c, "is_fisheye");
        if (json_bool(object, "is_fisheye", c->place, false, &fisheye, &err) != STATUS_OK) {
            findings_error(c->findings, c->name, &err);
            c->ok = false;
        }
        return fisheye ? CAMERA_OPENCV_FISHEYE : CAMERA_OPENCV;
    }
    for (size_t i = 0; i < sizeof models / sizeof *models; i++)
        if (strcasecmp(name, models[i].name) == 0)
            return models[i].model;
    unknown_model(c, name);
    return CAMERA_OPENCV;
}

static bool has(const struct frame_context *c, const char *key) {
    const cJSON *value = cJSON_GetObjectItemCaseSensitive(frame_context_holder(c, key), key);
    return value && !cJSON_IsNull(value);
}

/* instant-ngp says by such members that the lens is another one than camera_model or is_fisheye name (its
 * json_binding.h). */
static void refuse_others(struct frame_context *c) {
    static const char *const members[] = {"ftheta_p0", "latlong", "equirectangular", "orthographic"};
    for (size_t i = 0; i < sizeof members / sizeof *members; i++)
        if (has(c, members[i]) &&
            !cJSON_IsFalse(cJSON_GetObjectItemCaseSensitive(frame_context_holder(c, members[i]), members[i])))
            frame_context_problem(c, "the lens is described by %s, which is not read: render or cut perspective views",
                                  members[i]);
}

/* The lens's polynomials. Beside k5 and k6, k4 is OpenCV's, of the denominator; alone, it is nerfstudio's, of the
 * eighth power of the radius (its camera_utils.py; ns-process-data writes it for RealityCapture's lenses). */
static void read_distortion(struct frame_context *c, struct lens *lens) {
    static const char *const radial[6] = {"k1", "k2", "k3", "k4", "k5", "k6"};
    bool is_rational;
    lens->model = read_model(c, &is_rational);
    for (int i = 0; i < 6; i++)
        lens->k[i] = frame_context_number(c, radial[i], 0.0);
    lens->k8 = 0.0;
    if (lens->model == CAMERA_OPENCV && !is_rational && !has(c, "k5") && !has(c, "k6")) {
        lens->k8 = lens->k[3];
        lens->k[3] = 0.0;
    }
    lens->p[0] = frame_context_number(c, "p1", 0.0);
    lens->p[1] = frame_context_number(c, "p2", 0.0);
    lens->s[0] = frame_context_number(c, "sx1", 0.0);
    lens->s[1] = frame_context_number(c, "sy1", 0.0);
    if (lens->model == CAMERA_FOV)
        lens->k[0] = frame_context_number(c, "omega", 0.0);
}

static double side(struct frame_context *c, const char *key) {
    double value = frame_context_number(c, key, NAN);
    if (!isnan(value) && (value < 1.0 || value > IMAGE_MAX_SIDE || value != floor(value))) {
        frame_context_problem(c, "%s is %.9g, it must be a number of pixels", key, value);
        return NAN;
    }
    return value;
}

static double angle(struct frame_context *c, const char *key) {
    double value = frame_context_number(c, key, NAN);
    if (!isnan(value) && !(value > 0.0 && value < 3.14)) {
        frame_context_problem(c, "%s is %.9g, it must be an angle in radians below pi", key, value);
        return NAN;
    }
    return value;
}

void transforms_lens_read(struct frame_context *c, struct lens *lens) {
    refuse_others(c);
    read_distortion(c, lens);
    lens->width = side(c, "w");
    lens->height = side(c, "h");
    lens->fl_x = frame_context_positive(c, "fl_x");
    lens->fl_y = frame_context_positive(c, "fl_y");
    lens->cx = frame_context_number(c, "cx", NAN);
    lens->cy = frame_context_number(c, "cy", NAN);
    lens->angle_x = angle(c, "camera_angle_x");
    lens->angle_y = angle(c, "camera_angle_y");
    double radius = frame_context_positive(c, "fisheye_crop_radius"); /* as nerfstudio's pixel sampler takes it */
    lens->crop_radius = isnan(radius) ? 0.0 : radius;
}
