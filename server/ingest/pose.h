/* pose.h -- turns a file's camera-to-world matrix into a pair of rigid motions. */
#ifndef UNBAKE_INGEST_POSE_H
#define UNBAKE_INGEST_POSE_H

#include <stdbool.h>

#include "common/error.h"
#include "common/vec.h"

/* Camera axes of a file; ours are x right, y down, z forward (COLMAP). */
enum pose_axes { POSE_RIGHT_DOWN_FORWARD, POSE_RIGHT_UP_BACK /* OpenGL, nerfstudio */ };

/* matrix[3][4]: camera-to-world, row-major. Removes a uniform scale of the rotation (and sets *scaled) and rounding
 * errors. STATUS_INPUT: not finite, singular, mirrored, or not a rotation within 2 %; the message begins with `what`,
 * the user's name for the matrix. */
enum status pose_from_matrix(const double matrix[3][4], const char *what, enum pose_axes axes,
                             struct rigid *world_from_camera, struct rigid *camera_from_world, bool *scaled,
                             struct error *err);

#endif
