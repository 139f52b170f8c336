/* pose.h -- turns a file's camera-to-world matrix into a rigid motion.
 *
 * Poses are double until the origin is known that they share with the mesh (positions.h): a georeferenced pose lies
 * millions of metres from the file's origin, where single precision has steps of half a metre. */
#ifndef UNBAKE_INGEST_POSE_H
#define UNBAKE_INGEST_POSE_H

#include <stdbool.h>

#include "common/error.h"
#include "common/vec.h"

/* Camera axes of a file; ours are x right, y down, z forward (COLMAP). */
enum pose_axes { POSE_RIGHT_DOWN_FORWARD, POSE_RIGHT_UP_BACK /* OpenGL, nerfstudio */ };

/* World from camera, in the file's coordinates and with our camera axes; rows of the rotation first. */
struct exact_pose {
    double rotation[3][3], translation[3];
};

/* matrix[3][4]: camera-to-world, row-major. Removes a uniform scale of the rotation (and sets *scaled) and rounding
 * errors. STATUS_INPUT: not finite, singular, mirrored, or not a rotation within 2 %; the message begins with `what`,
 * the user's name for the matrix. */
enum status pose_from_matrix(const double matrix[3][4], const char *what, enum pose_axes axes,
                             struct exact_pose *world_from_camera, bool *scaled, struct error *err);

/* The pose in the coordinates to which `to` leads: a similarity, whose scale goes to the position only. */
void pose_transform(const double to[3][4], struct exact_pose *pose);

/* The pose and its inverse in single precision, in coordinates whose origin lies at `offset` in the file's. */
void pose_to_rigid(const struct exact_pose *world_from_camera, const double offset[3], struct rigid *forward,
                   struct rigid *inverse);

#endif
