/* transforms.h -- reads transforms.json of nerfstudio and instant-ngp.
 *
 * Per frame, else at the top level: fl_x fl_y cx cy w h, camera_angle_x / _y (radians), k1 to k6, p1, p2,
 * camera_model (PINHOLE, SIMPLE_PINHOLE, SIMPLE_RADIAL, RADIAL, OPENCV, FULL_OPENCV, OPENCV_FISHEYE or FISHEYE,
 * SIMPLE_RADIAL_FISHEYE, RADIAL_FISHEYE, THIN_PRISM_FISHEYE with sx1 sy1, FOV with omega; in any letters) or
 * is_fisheye, exposure, exposure_time (s), iso, f_number. Per frame: file_path, transform_matrix, mask_path, split
 * (train, test, val), is_bad (left out). At the top level: test_frames, further ones that are held out;
 * applied_transform and applied_scale; `mesh` or ply_file_path; the lists train_filenames, val_filenames,
 * test_filenames. val counts as test. Everything else is ignored. Numbers may be in quotes. w and h may be those of the
 * picture at another scale, or turned upright (photo_fit.h).
 *
 * With a lens that is no fisheye, k4 is nerfstudio's, of the eighth power of the radius, unless k5 or k6 is there or
 * the model is FULL_OPENCV: then k4 to k6 are OpenCV's, of the denominator. */
#ifndef UNBAKE_INGEST_TRANSFORMS_H
#define UNBAKE_INGEST_TRANSFORMS_H

#include <stdbool.h>
#include <stddef.h>

#include "common/json.h"
#include "common/reading.h"
#include "server/ingest/findings.h"
#include "server/ingest/pose.h"
#include "server/scene/camera.h"

#define TRANSFORMS_MAX_FRAMES 20000
#define TRANSFORMS_MAX_BYTES (256 << 20)

struct lens {
    enum camera_model model;
    /* NAN if absent. */
    double width, height, fl_x, fl_y, cx, cy, angle_x, angle_y;
    double k[6], k8, p[2], s[2]; /* as in struct camera */
    bool is_relative; /* fl_x, fl_y are shares of the picture's longer side; cx, cy, too, from the picture's centre */
};

/* Source of a frame's exposure; a bundle that mixes sources has mixed units. */
enum exposure_source {
    EXPOSURE_UNKNOWN,
    EXPOSURE_FACTOR, /* "exposure" */
    EXPOSURE_CAMERA, /* "exposure_time", "iso", "f_number" */
    EXPOSURE_EXIF,
    EXPOSURE_HDR /* a linear picture without these: 1 */
};

struct transforms_frame {
    size_t number;     /* position in `frames`, from 0 */
    char *file, *mask; /* clean paths (path_clean); mask may be NULL; owned */
    bool is_test;
    struct lens lens;
    struct exact_pose world_from_camera;
    enum exposure_source exposure_source;
    double exposure; /* 0 if unknown */
};

struct transforms {
    enum matrix_axes axes; /* of the file's matrices; the frames' are with our axes already */
    char *mesh;            /* clean path or NULL; owned */
    char *point_cloud;     /* ply_file_path, a mesh or a point cloud, or NULL; owned */
    /* stored = applied_scale * applied (world of the capture), where the file says so: applied.h */
    bool has_applied;
    double applied[3][4], applied_scale;
    size_t named_count; /* frames in the file */
    size_t frame_count; /* usable frames: faulty ones are left out */
    struct transforms_frame *frame;
};

/* Reads the parsed file; `name` is for messages. Problems and warnings go to *f. The result is the caller's
 * (transforms_release) in any case. */
void transforms_read(const cJSON *root, const char *name, struct transforms *t, struct findings *f);
void transforms_release(struct transforms *t);
void transforms_frame_release(struct transforms_frame *frame);

/* The camera of a frame whose picture is width x height pixels, in coordinates whose origin lies at `offset` in the
 * file's (that of struct mesh). STATUS_INPUT when the file states another size or an invalid lens. */
enum status transforms_camera(const struct transforms_frame *frame, uint32_t width, uint32_t height,
                              const double offset[3], struct camera *camera, struct error *err);

/* Pixel value per radiance from the camera's settings: seconds x ISO / 100 / f-number^2. Missing (0) factors except
 * the time count as 1. */
double transforms_exposure(double time_sec, double iso, double f_number);

#endif
