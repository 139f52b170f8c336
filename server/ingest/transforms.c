/* transforms.c -- see transforms.h. */
#include "server/ingest/transforms.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include "common/image.h"
#include "common/mem.h"
#include "server/ingest/path.h"

/* State of reading a file. */
struct context {
    const cJSON *root, *frame; /* frame: NULL while the top level is read */
    const char *name;          /* of the file */
    char place[256];           /* "frames[3] (images/003.png)" */
    struct findings *findings;
    bool ok; /* no problem so far in this frame */
    size_t scaled_count;
    size_t bad_count;
    const cJSON *list[3]; /* train_filenames, val_filenames, test_filenames or NULL */
    size_t unlisted_count;
};

__attribute__((format(printf, 2, 3))) static void problem(struct context *c, const char *format, ...) {
    char what[1024]; /* longer messages are truncated */
    va_list args;
    va_start(args, format);
    vsnprintf(what, sizeof what, format, args);
    va_end(args);
    findings_problem(c->findings, c->name, "%s: %s", c->place, what);
    c->ok = false;
}

/* --- values ------------------------------------------------------------------------------ */

/* The object that has the value: the frame or the file; NULL when neither does. Faults at the top level are reported
 * once, by read_top. */
static const cJSON *holder(const struct context *c, const char *key) {
    const cJSON *own = c->frame ? cJSON_GetObjectItemCaseSensitive(c->frame, key) : NULL;
    return own && !cJSON_IsNull(own) ? c->frame : c->root;
}

/* A number, also in quotes, as some scripts write it. */
static bool is_plain_number(const cJSON *item, double *value) {
    const char *text = cJSON_GetStringValue(item);
    char *end = NULL;
    if (cJSON_IsNumber(item)) {
        *value = item->valuedouble;
        return true;
    }
    if (!text || text[0] == '\0' || text[strspn(text, "0123456789+-.eE")] != '\0')
        return false;
    *value = strtod(text, &end);
    return *end == '\0' && isfinite(*value);
}

static double number(struct context *c, const char *key, double fallback) {
    struct error err;
    double value;
    if (is_plain_number(cJSON_GetObjectItemCaseSensitive(holder(c, key), key), &value) && isfinite(value))
        return value;
    if (json_number(holder(c, key), key, c->place, fallback, &value, &err) != STATUS_OK) {
        findings_error(c->findings, c->name, &err);
        c->ok = false;
        return fallback;
    }
    return value;
}

static const char *string(struct context *c, const cJSON *object, const char *key) {
    struct error err;
    const char *value;
    if (json_string(object, key, c->place, NULL, &value, &err) != STATUS_OK) {
        findings_error(c->findings, c->name, &err);
        c->ok = false;
        return NULL;
    }
    return value;
}

/* A path in the bundle; NULL when absent or faulty. Backslashes (Windows tools) separate folders. */
static char *path(struct context *c, const cJSON *object, const char *key) {
    const char *value = string(c, object, key);
    if (!value)
        return NULL;
    char *copy = mem_strdup(value), *clean = NULL;
    for (char *p = copy; *p; p++)
        if (*p == '\\')
            *p = '/';
    struct error err;
    if (path_clean(copy, &clean, &err) != STATUS_OK) {
        problem(c, "%s %s", key, err.message);
    } else if (clean[0] == '\0') {
        problem(c, "%s is empty", key);
        mem_free(clean);
        clean = NULL;
    }
    mem_free(copy);
    return clean;
}

/* The name of a photograph, which may be one of another machine's. */
static char *photograph(struct context *c, const char *key) {
    const char *value = string(c, c->frame, key);
    char *clean = NULL;
    struct error err;
    if (value && path_clean_foreign(value, &clean, &err) != STATUS_OK)
        problem(c, "%s %s", key, value[0] ? err.message : "is empty");
    return clean;
}

/* --- lens -------------------------------------------------------------------------------- */

/* Reports a lens that is not modelled, with what to do. */
static void unknown_model(struct context *c, const char *name) {
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
    error_set(&err, STATUS_INPUT,
              "%s: unknown camera_model \"%.80s\"; known are PINHOLE, SIMPLE_PINHOLE, SIMPLE_RADIAL, RADIAL, OPENCV, "
              "FULL_OPENCV, OPENCV_FISHEYE, SIMPLE_RADIAL_FISHEYE, RADIAL_FISHEYE, THIN_PRISM_FISHEYE and FOV",
              c->place, name);
    error_hint(&err, "colmap image_undistorter makes pinhole photographs of any");
    for (size_t i = 0; i < sizeof others / sizeof *others; i++)
        if (strcasecmp(name, others[i].name) == 0)
            error_hint(&err, "%s", others[i].hint);
    findings_error(c->findings, c->name, &err);
    c->ok = false;
}

/* *is_rational: k4 to k6 are of OpenCV's denominator, as the model's name says. */
static enum camera_model read_model(struct context *c, bool *is_rational) {
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
    };
    const char *name = string(c, holder(c, "camera_model"), "camera_model");
    struct error err;
    bool fisheye = false;
    *is_rational = name && strcasecmp(name, "FULL_OPENCV") == 0;
    if (!name) {
        const cJSON *object = holder(c, "is_fisheye");
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

static bool has(const struct context *c, const char *key) {
    const cJSON *value = cJSON_GetObjectItemCaseSensitive(holder(c, key), key);
    return value && !cJSON_IsNull(value);
}

/* The lens's polynomials. Beside k5 and k6, k4 is OpenCV's, of the denominator; alone, it is nerfstudio's, of the eighth
 * power of the radius (its camera_utils.py; ns-process-data writes it for RealityCapture's lenses). */
static void read_distortion(struct context *c, struct lens *lens) {
    static const char *const radial[6] = {"k1", "k2", "k3", "k4", "k5", "k6"};
    bool is_rational;
    lens->model = read_model(c, &is_rational);
    for (int i = 0; i < 6; i++)
        lens->k[i] = number(c, radial[i], 0.0);
    lens->k8 = 0.0;
    if (lens->model == CAMERA_OPENCV && !is_rational && !has(c, "k5") && !has(c, "k6")) {
        lens->k8 = lens->k[3];
        lens->k[3] = 0.0;
    }
    lens->p[0] = number(c, "p1", 0.0);
    lens->p[1] = number(c, "p2", 0.0);
    lens->s[0] = number(c, "sx1", 0.0);
    lens->s[1] = number(c, "sy1", 0.0);
    if (lens->model == CAMERA_FOV)
        lens->k[0] = number(c, "omega", 0.0);
}

/* A value that must be positive if present. */
static double positive(struct context *c, const char *key) {
    double value = number(c, key, NAN);
    if (value <= 0.0) {
        problem(c, "%s is %.9g, it must be positive", key, value);
        return NAN;
    }
    return value;
}

static double side(struct context *c, const char *key) {
    double value = number(c, key, NAN);
    if (!isnan(value) && (value < 1.0 || value > IMAGE_MAX_SIDE || value != floor(value))) {
        problem(c, "%s is %.9g, it must be a number of pixels", key, value);
        return NAN;
    }
    return value;
}

static double angle(struct context *c, const char *key) {
    double value = number(c, key, NAN);
    if (!isnan(value) && !(value > 0.0 && value < 3.14)) {
        problem(c, "%s is %.9g, it must be an angle in radians below pi", key, value);
        return NAN;
    }
    return value;
}

static void read_lens(struct context *c, struct lens *lens) {
    read_distortion(c, lens);
    lens->width = side(c, "w");
    lens->height = side(c, "h");
    lens->fl_x = positive(c, "fl_x");
    lens->fl_y = positive(c, "fl_y");
    lens->cx = number(c, "cx", NAN);
    lens->cy = number(c, "cy", NAN);
    lens->angle_x = angle(c, "camera_angle_x");
    lens->angle_y = angle(c, "camera_angle_y");
}

enum status transforms_camera(const struct transforms_frame *frame, uint32_t width, uint32_t height,
                              const double offset[3], struct camera *camera, struct error *err) {
    const struct lens *lens = &frame->lens;
    double stated_width = isnan(lens->width) ? width : lens->width;
    double stated_height = isnan(lens->height) ? height : lens->height;
    if (stated_width != width || stated_height != height)
        return error_set(err, STATUS_INPUT, "the picture is %u x %u pixels, but frames[%zu] says %.0f x %.0f", width,
                         height, frame->number, stated_width, stated_height);
    double fx = lens->fl_x, fy = lens->fl_y;
    if (isnan(fx) && !isnan(lens->angle_x))
        fx = 0.5 * width / tan(0.5 * lens->angle_x);
    if (isnan(fy) && !isnan(lens->angle_y))
        fy = 0.5 * height / tan(0.5 * lens->angle_y);
    /* square pixels by default */
    fx = isnan(fx) ? fy : fx;
    fy = isnan(fy) ? fx : fy;
    double cx = isnan(lens->cx) ? 0.5 * width : lens->cx;
    double cy = isnan(lens->cy) ? 0.5 * height : lens->cy;
    if (lens->is_relative) {
        double longer = width > height ? width : height;
        fx *= longer;
        fy *= longer;
        cx = 0.5 * width + lens->cx * longer;
        cy = 0.5 * height + lens->cy * longer;
    }
    if (!(fx > 1e-3 * width && fx < 1e4 * width && fy > 1e-3 * height && fy < 1e4 * height))
        return error_set(err, STATUS_INPUT,
                         "a focal length of %.6g x %.6g pixels cannot belong to a picture of %u x %u", fx, fy, width,
                         height);
    if (!(fabs(cx) < 10.0 * width && fabs(cy) < 10.0 * height))
        return error_set(err, STATUS_INPUT, "the principal point %.6g, %.6g lies far outside the picture of %u x %u",
                         cx, cy, width, height);
    if (lens->model == CAMERA_FOV && !(lens->k[0] >= 0.0 && lens->k[0] < 3.1))
        return error_set(err, STATUS_INPUT, "the lens's omega is %.9g, it must be an angle in radians below pi",
                         lens->k[0]);
    *camera = (struct camera){
        .model = lens->model,
        .width = width,
        .height = height,
        .fx = (float)fx,
        .fy = (float)fy,
        .cx = (float)cx,
        .cy = (float)cy,
    };
    pose_to_rigid(&frame->world_from_camera, offset, &camera->world_from_camera, &camera->camera_from_world);
    for (int i = 0; i < 6; i++)
        camera->k[i] = (float)lens->k[i];
    camera->k8 = (float)lens->k8;
    for (int i = 0; i < 2; i++) {
        camera->p[i] = (float)lens->p[i];
        camera->s[i] = (float)lens->s[i];
    }
    camera_find_fold(camera);
    return STATUS_OK;
}

/* --- pose, exposure, split --------------------------------------------------------------- */

/* Reads 3 or 4 rows of 4 numbers; false when it is anything else. The last row is 0 0 0 1 unless it is
 * given. */
static bool read_matrix(const cJSON *matrix, double m[4][4]) {
    const cJSON *row, *cell;
    int rows = 0;
    m[3][3] = 1.0;
    cJSON_ArrayForEach(row, matrix) {
        int columns = 0;
        cJSON_ArrayForEach(cell, row) {
            if (rows < 4 && columns < 4)
                m[rows][columns] = is_plain_number(cell, &m[rows][columns]) ? m[rows][columns] : (double)NAN;
            columns++;
        }
        if (columns != 4)
            return false;
        rows++;
    }
    return rows == 3 || rows == 4;
}

static void read_pose(struct context *c, struct transforms_frame *frame) {
    double m[4][4] = {{0}};
    if (!read_matrix(cJSON_GetObjectItemCaseSensitive(c->frame, "transform_matrix"), m)) {
        problem(c, "transform_matrix must be an array of 4 (or 3) rows of 4 numbers");
        return;
    }
    /* but for rounding of single precision */
    if (!(fabs(m[3][0]) + fabs(m[3][1]) + fabs(m[3][2]) + fabs(m[3][3] - 1.0) < 1e-5)) {
        problem(c, "the last row of transform_matrix must be 0 0 0 1");
        return;
    }
    struct error err;
    bool scaled = false;
    if (pose_from_matrix((const double(*)[4])m, "transform_matrix", POSE_RIGHT_UP_BACK, &frame->world_from_camera,
                         &scaled, &err) != STATUS_OK)
        problem(c, "%s", err.message);
    c->scaled_count += scaled;
}

double transforms_exposure(double time_sec, double iso, double f_number) {
    if (!(time_sec > 0.0))
        return 0.0;
    return time_sec * (iso > 0.0 ? iso / 100.0 : 1.0) / (f_number > 0.0 ? f_number * f_number : 1.0);
}

static void read_exposure(struct context *c, struct transforms_frame *frame) {
    double factor = positive(c, "exposure"), time_sec = positive(c, "exposure_time");
    double iso = positive(c, "iso"), f_number = positive(c, "f_number");
    frame->exposure = !isnan(factor) ? factor : isnan(time_sec) ? 0.0 : transforms_exposure(time_sec, iso, f_number);
    frame->exposure_source = !isnan(factor) ? EXPOSURE_FACTOR : isnan(time_sec) ? EXPOSURE_UNKNOWN : EXPOSURE_CAMERA;
}

static bool is_listed(const cJSON *list, const char *clean) {
    const cJSON *item;
    cJSON_ArrayForEach(item, list) {
        const char *name = cJSON_IsString(item) ? item->valuestring : "";
        while (strncmp(name, "./", 2) == 0)
            name += 2;
        if (strcmp(name, clean) == 0)
            return true;
    }
    return false;
}

/* False when the frame is in none of the file's split lists: it is left out, as in nerfstudio. */
static bool read_split(struct context *c, struct transforms_frame *frame) {
    const char *split = string(c, c->frame, "split");
    frame->is_test = false;
    if (split) {
        frame->is_test = strcmp(split, "test") == 0 || strcmp(split, "val") == 0;
        if (!frame->is_test && strcmp(split, "train") != 0)
            problem(c, "split must be \"train\", \"test\" or \"val\"");
        return true;
    }
    if (is_listed(c->list[1], frame->file) || is_listed(c->list[2], frame->file)) {
        frame->is_test = true;
        return true;
    }
    return !c->list[0] || is_listed(c->list[0], frame->file);
}

/* --- the file ---------------------------------------------------------------------------- */

void transforms_frame_release(struct transforms_frame *frame) {
    mem_free(frame->file);
    mem_free(frame->mask);
}

void transforms_release(struct transforms *t) {
    for (size_t i = 0; i < t->frame_count; i++)
        transforms_frame_release(&t->frame[i]);
    mem_free(t->frame);
    mem_free(t->mesh);
    mem_free(t->point_cloud);
    *t = (struct transforms){0};
}

static bool read_frame(struct context *c, const cJSON *object, struct transforms_frame *frame) {
    *frame = (struct transforms_frame){.number = frame->number};
    c->ok = true;
    c->frame = object;
    snprintf(c->place, sizeof c->place, "frames[%zu]", frame->number);
    if (!cJSON_IsObject(object)) {
        problem(c, "must be an object");
        return false;
    }
    frame->file = photograph(c, "file_path");
    if (!frame->file) {
        if (c->ok)
            problem(c, "no file_path");
        return false;
    }
    snprintf(c->place, sizeof c->place, "frames[%zu] (%.200s)", frame->number, frame->file);
    frame->mask = photograph(c, "mask_path");
    if (cJSON_IsTrue(cJSON_GetObjectItemCaseSensitive(object, "is_bad"))) {
        c->bad_count++;
        return false;
    }
    struct lens *lens = &frame->lens;
    read_lens(c, lens);
    if (c->ok && isnan(lens->fl_x) && isnan(lens->fl_y) && isnan(lens->angle_x) && isnan(lens->angle_y))
        problem(c, "no focal length: expected fl_x, fl_y or camera_angle_x");
    read_pose(c, frame);
    read_exposure(c, frame);
    bool listed = read_split(c, frame);
    c->unlisted_count += !listed;
    return c->ok && listed;
}

static void read_applied(struct context *c, struct transforms *t) {
    const cJSON *matrix = cJSON_GetObjectItemCaseSensitive(c->root, "applied_transform");
    double m[4][4] = {{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 0}}, scale = positive(c, "applied_scale");
    if (matrix && !cJSON_IsNull(matrix) && !read_matrix(matrix, m))
        problem(c, "applied_transform must be an array of 3 (or 4) rows of 4 numbers");
    memcpy(t->applied, m, sizeof t->applied);
    t->applied_scale = isnan(scale) ? 1.0 : scale;
    t->has_applied = cJSON_IsArray(matrix) || !isnan(scale);
}

/* Faults at the top level are reported here once, and not per frame. */
static bool read_top(struct context *c, struct transforms *t) {
    static const char *const lists[3] = {"train_filenames", "val_filenames", "test_filenames"};
    struct transforms_frame scratch;
    const cJSON *frames = cJSON_GetObjectItemCaseSensitive(c->root, "frames");
    snprintf(c->place, sizeof c->place, "at the top");
    c->ok = true;
    if (!cJSON_IsObject(c->root) || !cJSON_IsArray(frames)) {
        problem(c, "expected an object with an array \"frames\"");
        return false;
    }
    int count = cJSON_GetArraySize(frames);
    if (count > TRANSFORMS_MAX_FRAMES) {
        problem(c, "there are %d frames; %d are the limit", count, TRANSFORMS_MAX_FRAMES);
        return false;
    }
    t->mesh = path(c, c->root, "mesh");
    t->point_cloud = path(c, c->root, "ply_file_path");
    for (int i = 0; i < 3; i++) {
        c->list[i] = cJSON_GetObjectItemCaseSensitive(c->root, lists[i]);
        if (c->list[i] && !cJSON_IsArray(c->list[i])) {
            problem(c, "train_filenames, val_filenames and test_filenames must be arrays");
            return false;
        }
    }
    read_lens(c, &scratch.lens);
    read_exposure(c, &scratch);
    read_applied(c, t);
    return c->ok;
}

/* Adds the frames of an array; all of `test_frames` are held out. */
static void read_frames(struct context *c, const cJSON *frames, bool is_test, struct transforms *t) {
    const cJSON *object;
    cJSON_ArrayForEach(object, frames) {
        struct transforms_frame *frame = &t->frame[t->frame_count];
        frame->number = t->named_count++;
        if (read_frame(c, object, frame)) {
            frame->is_test = frame->is_test || is_test;
            t->frame_count++;
        } else {
            transforms_frame_release(frame);
        }
    }
}

static void warn(const struct context *c) {
    if (c->scaled_count > 0)
        findings_warning(c->findings, "%s: the rotation of %zu frames carries a scale, which was taken out", c->name,
                         c->scaled_count);
    if (c->bad_count > 0)
        findings_warning(c->findings, "%s: %zu frames are marked is_bad and were left out", c->name, c->bad_count);
    if (c->unlisted_count > 0)
        findings_warning(c->findings,
                         "%s: %zu frames are in none of train_filenames, val_filenames and "
                         "test_filenames and were left out",
                         c->name, c->unlisted_count);
}

void transforms_read(const cJSON *root, const char *name, struct transforms *t, struct findings *f) {
    struct context c = {.root = root, .name = name, .findings = f};
    *t = (struct transforms){.axes = AXES_OPENGL};
    if (!read_top(&c, t))
        return;
    const cJSON *frames = cJSON_GetObjectItemCaseSensitive(root, "frames");
    const cJSON *test_frames = cJSON_GetObjectItemCaseSensitive(root, "test_frames");
    t->frame =
        mem_calloc((size_t)cJSON_GetArraySize(frames) + (size_t)cJSON_GetArraySize(test_frames) + 1, sizeof *t->frame);
    read_frames(&c, frames, false, t);
    if (cJSON_IsArray(test_frames) && cJSON_GetArraySize(test_frames) <= TRANSFORMS_MAX_FRAMES) {
        size_t before = t->frame_count;
        memset(c.list, 0, sizeof c.list);
        read_frames(&c, test_frames, true, t);
        if (t->frame_count > before)
            findings_warning(f, "%s: the %zu frames of test_frames are held out", name, t->frame_count - before);
    }
    warn(&c);
}
