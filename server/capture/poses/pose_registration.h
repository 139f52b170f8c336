/* pose_registration.h -- the rigid motion by which a mesh lies beside what the photographs show.
 *
 * A mesh that was fused from depth lies turned by as much as the depth camera is off its calibration (.1 degree), or in
 * another map of the tracker. All photographs are off together then, each by too little to be surely moved by itself.
 * The cameras move in world axes: by a turn about their centre, then by a move. A motion along a plane makes no
 * photographs disagree there; their parallax on planes of other directions tells.
 *
 * Solved by robust Gauss-Newton with the equations of pose_solver.h, from which offsets and consensus are eliminated
 * exactly. Errors of neighbouring observations go together, by what is wrong with a photograph's pose and with the mesh
 * at a place: the gradient's covariance is the sum of those clustered by photographs and by places (Cameron, Gelbach &
 * Miller 2011, without what they subtract, so that it is an upper bound).
 *
 * Photographs answer a motion by less than the equations foretell, .24 to .34 of it: those with a flatter slope than
 * the track's mean, as from farther away, change by less along what all share, and robust weights let go of what
 * disagrees. Steps shorten slowly for it, and the motion's errors are larger by as much (the bread of the sandwich,
 * Huber 1967). Whether the motion is surely not 0 needs no response: the score test (Rao 1948) asks for the gradient
 * where the bundle tells the cameras. */
#ifndef UNBAKE_CAPTURE_POSE_REGISTRATION_H
#define UNBAKE_CAPTURE_POSE_REGISTRATION_H

#include <stdbool.h>

#include "common/parallel.h"
#include "server/capture/tracks.h"
#include "server/scene/scene.h"

struct pose_registration {
    bool is_applied;               /* the cameras were moved by it */
    vec3 centre;                   /* mean position of the training cameras, metres */
    double turn[3], turn_error[3]; /* of the cameras about it, radians, world axes; standard errors */
    double move[3], move_error[3]; /* of the centre, metres */
    double deviations;             /* root of the score test's chi-square; six independent errors have 2.4 */
    double response;               /* share of what the equations foretell by which photographs answer the motion */
    double shift_px;               /* of the tracks in their photographs, rms */
};

/* Finds the motion from where the cameras are, and moves all of them, held-out ones, too, where it is surely not 0 and
 * large enough to matter; `is_rest`: however small. Returns whether. Edges and tracks are then those of the old poses.
 * What they hide on the wrong side of outlines makes a motion a tenth to twice too large: with new ones the rest of it
 * is to be found. The same for any number of threads. */
bool pose_registration_find(struct scene *scene, const struct tracks *tracks, bool is_rest, struct parallel *pool,
                            struct pose_registration *registration);

/* Adds the rest that was found from where the registration had moved the cameras. Errors stay those of the whole, whose
 * response is told best. */
void pose_registration_add(struct pose_registration *registration, const struct pose_registration *rest);

/* Whether photographs agree significantly better at held-out tracks of the present cameras than they do there with the
 * cameras of `told`, photographs of the scene by their order, and whether that is far enough to matter (then in
 * shift_px). */
bool pose_registration_agrees(struct pose_registration *registration, const struct tracks *tracks,
                              const struct photograph *told, struct parallel *pool);

/* Moves a camera by it. */
void pose_registration_move(const struct pose_registration *registration, struct camera *camera);

#endif
