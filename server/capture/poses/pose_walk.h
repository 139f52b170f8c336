/* pose_walk.h -- drift of a tracker: corrections of poses that are common to neighbours in time.
 *
 * A tracker's error grows slowly along the path of the camera. In world axes, about each camera's own centre, the
 * correction of a photograph (a rotation and a translation) is modelled as a random walk over the photographs' order:
 * between two of them, k steps apart, each axis differs by N(0, k variance). In pose_solver.h's equations the walk
 * takes the place of the prior of single photographs, so that those which show little follow their neighbours.
 *
 * The two variances are those of greatest evidence, by expectation-maximisation (Dempster, Laird and Rubin 1977) with
 * photographs taken for independent given their neighbours' means: the expected square of a step is that of the
 * difference of both means plus both variances. */
#ifndef UNBAKE_CAPTURE_POSES_POSE_WALK_H
#define UNBAKE_CAPTURE_POSES_POSE_WALK_H

#include <stddef.h>

#include "server/capture/poses/pose_solver.h"

/* A photograph's correction in world axes: rotation vector, radians, and translation, metres. */
struct pose_drift {
    double turn[3], move[3];
};

/* Mean squared step of the frames' corrections over twice their variance, pixels (von Neumann 1941): 1 where they are
 * independent, near 0 where they drift. Steps to the next frame, however far it is in the order. */
double pose_walk_roughness(const struct pose_solver *s);

/* A walk to start with: a pixel of rotation a step, half a pixel of translation. */
struct pose_walk pose_walk_begin(const struct pose_solver *s);

/* Improves the variances of s->walk from the frames' totals. block[frames]: lower Cholesky factors of the frames' own
 * equations, the walk included. */
void pose_walk_update_variances(struct pose_solver *s, double (*block)[POSE_UNKNOWNS][POSE_UNKNOWNS]);

/* The expected correction of the photograph at place `at` of the order (an index into scene->photograph): on the line
 * between the training photographs around it, beyond the first and the last as theirs. There must be one. */
struct pose_drift pose_walk_expect(const struct pose_solver *s, size_t at);

/* A frame's correction, and the frame's twist, pixels, that corrects by a drift. Its depth must be known. */
struct pose_drift pose_walk_drift(const struct pose_frame *frame);
void pose_walk_twist(const struct pose_frame *frame, const struct pose_drift *drift, double twist[POSE_UNKNOWNS]);

/* The walk's part of the normal equations, P being the precision of all twists: out += P x; out -= P totals; the
 * diagonal of a frame's block, of rotation and of translation. */
void pose_walk_multiply(const struct pose_solver *s, const double *x, double *out);
void pose_walk_pull(const struct pose_solver *s, double *out);
void pose_walk_diagonal(const struct pose_solver *s, size_t frame, double diagonal[2]);

#endif
