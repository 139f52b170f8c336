/* transforms.h -- reads transforms.json of nerfstudio and instant-ngp.
 *
 * Per frame, else at the top level: fl_x fl_y cx cy w h, camera_angle_x / _y (radians), k1 to k6, p1, p2,
 * camera_model (PINHOLE, SIMPLE_PINHOLE, SIMPLE_RADIAL, RADIAL, OPENCV, FULL_OPENCV, OPENCV_FISHEYE or FISHEYE,
 * SIMPLE_RADIAL_FISHEYE, RADIAL_FISHEYE, THIN_PRISM_FISHEYE with sx1 sy1, FOV with omega, DIVISION with k1; in any
 * letters) or is_fisheye, exposure, exposure_time (s), iso, f_number. Per frame: file_path, transform_matrix,
 * mask_path, split (train, test, val), is_bad (left out). At the top level: test_frames, further ones that are held
 * out; applied_transform and applied_scale; `mesh` or ply_file_path; the lists train_filenames, val_filenames,
 * test_filenames. val counts as test. Everything else is ignored. Numbers may be in quotes. w and h may be those of the
 * picture at another scale, or turned upright (photo_fit.h).
 *
 * With a lens that is no fisheye, k4 is nerfstudio's, of the eighth power of the radius, unless k5 or k6 is there or
 * the model is FULL_OPENCV: then k4 to k6 are OpenCV's, of the denominator. */
#ifndef UNBAKE_INGEST_TRANSFORMS_H
#define UNBAKE_INGEST_TRANSFORMS_H

#include "common/json.h"
#include "server/ingest/findings.h"
#include "server/ingest/frames.h"

#define TRANSFORMS_MAX_BYTES (256 << 20) /* of the file */

/* Reads the parsed file; `name` is for messages. Problems and warnings go to *f. The result is the caller's
 * (frames_release) in any case. */
void transforms_read(const cJSON *root, const char *name, struct frames *t, struct findings *f);

#endif
