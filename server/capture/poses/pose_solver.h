/* pose_solver.h -- the equations behind calibrate_poses.h: all photographs at all tracks, linearised.
 *
 * Photograph f moves by a twist (rotation w, translation v, in camera axes) of its camera_from_world: a track's point p
 * in camera space moves by w x p + v. With I the photograph's pyramid, u the track's image position and L the consensus
 * of all photographs,
 *
 *      I(u) + grad I . du/dp . (-[p]x, 1) (w, v) - b - L = error,
 *
 * where b is one offset for each cell of a coarse grid over the picture: it absorbs what is left of a wrong exposure, a
 * vignette and slowly varying reflections. Both w and v are in pixels: w times the focal length, v times the focal
 * length over the mean depth. grad I is the mean slope over all photographs of the track: noise in slopes would make
 * steps too short. */
#ifndef UNBAKE_CAPTURE_POSES_POSE_SOLVER_H
#define UNBAKE_CAPTURE_POSES_POSE_SOLVER_H

#include <assert.h>
#include <math.h>
#include <stdbool.h>

#include "common/cholesky.h"
#include "common/parallel.h"
#include "server/capture/tracks.h"
#include "server/capture/validation.h"

#define POSE_UNKNOWNS 6 /* of a pose: rotation and translation */
/* Of the grid of offsets: as smooth as a vignette or a reflection; +25 %: no change. */
#define POSE_CELL_COLUMNS 8
#define POSE_CELL_ROWS 6 /* as coarse as 8 columns in a picture of 4 : 3; to 7: no change */
#define POSE_CELLS (POSE_CELL_COLUMNS * POSE_CELL_ROWS)
#define POSE_OBSERVATIONS_MAX (TRACK_OTHERS + 1) /* of a track, with its own photograph */
/* One track in so many is held out: 50 of TRACKS_MIN judge a photograph. */
#define POSE_HELD_OUT_EVERY 3    /* to 4: no change */
#define POSE_MIN_OBSERVATIONS 60 /* finite ones, for a photograph to be moved: ten an unknown */
#define POSE_ROUNDS 12 /* Gauss-Newton steps at each level: 18 of its pixels at POSE_STEP_PX; +25 %: no change */
/* Pixels of a level: largest step; slopes of the 1 2 1 smoothed level hold for as far. */
#define POSE_STEP_PX 1.5 /* +25 %: no change */
/* Pixels, rms: smaller corrections are not applied, as a look-up averages over a pixel. */
#define POSE_MIN_SHIFT_PX 0.15 /* +25 %: no change */
/* Share of the diagonal that is added to it (Levenberg-Marquardt): shortens steps by 1 %. */
#define POSE_DAMPING 0.01 /* +25 %: no change */
/* Of log residuals: bounds weights where photographs agree; twice the rounding of 8-bit sRGB. */
#define POSE_MIN_SCALE 0.01 /* +25 %: no change */

struct pose { /* camera_from_world */
    double r[3][3], t[3];
};

struct pose_frame {
    struct camera before, now;
    struct pose pose;
    double total[POSE_UNKNOWNS]; /* sum of the twists applied, pixels */
    double depth_m;              /* mean over its observations */
    double scale;                /* of its residuals */
    double shift_px;             /* between `before` and `now`, as judged last */
    size_t observation_count;
    bool is_fixed;
};

/* One photograph's observation of one track. */
struct pose_observation {
    uint32_t frame;
    uint32_t offset;        /* index into x: of its cell */
    float value;            /* log radiance; NAN: none */
    float weight;           /* robust inverse variance; 0 where held out */
    float d[POSE_UNKNOWNS]; /* derivative of `value` by the frame's twist, per pixel */
};

/* What a frame needs of an observation. Frames read theirs one after the other: through of_frame a sum would wait for
 * memory at each. */
struct pose_lever {
    float d[POSE_UNKNOWNS], weight;
    uint32_t offset;
};

/* Prior of corrections along the order of the photographs: variances of a step, of each axis (pose_walk.h). */
struct pose_walk {
    bool is_known, is_learnt;            /* learnt: pose_solve improves the variances */
    double turn_variance, move_variance; /* radians^2, metres^2 */
};

struct pose_solver {
    const struct tracks *tracks;
    struct parallel *pool;
    struct pose_walk walk; /* in place of pose_prior where it is known */
    size_t frames, track_count, unknowns;
    const struct track **track;           /* [track_count] */
    uint32_t *owner;                      /* [track_count] the photograph it comes from */
    struct pose_observation *observation; /* [track_count][POSE_OBSERVATIONS_MAX], the owner's first */
    size_t *first_of_frame;               /* [frames + 1] into of_frame */
    uint32_t *of_frame;       /* observations of tracks that are not held out, by frame, in the order of tracks */
    uint32_t *place;          /* [track_count][POSE_OBSERVATIONS_MAX] of each in of_frame */
    struct pose_lever *lever; /* of each in of_frame; scratch of pose_solve, as the next */
    double *pull;             /* of each in of_frame: its weight times its error less the track's mean */
    float (*along)[2];        /* [track_count] mean change of the value per `right` and `down`, at this level */
    struct pose_frame *frame; /* [frames] */
    double *x;                /* [unknowns]: twist of each frame, then POSE_CELLS offsets of each */
    int level;
};

/* Every photograph starts at its camera; one with few observations is fixed. Both are borrowed. */
void pose_solver_init(struct pose_solver *s, const struct tracks *tracks, struct parallel *pool);
void pose_solver_release(struct pose_solver *s);

/* Values and derivatives of all observations at the present cameras. */
void pose_linearise(struct pose_solver *s);

/* Image gradient g of a track in any camera, from the mean of all photographs (after pose_linearise): texture moves
 * with the surface, reflections do not. */
bool pose_slope(const struct pose_solver *s, size_t track, const struct camera *camera, float g[2]);

/* Robust weights of all observations and scales of all frames, from the present residuals. A scale is that of errors:
 * what an observation's own share in its consensus takes from its residual is given back. */
void pose_reweight(struct pose_solver *s);

/* Consensus of a track: the robust mean of its observations, offsets subtracted (NAN of fewer than three), and the
 * weight of each. */
void pose_weigh_track(const struct pose_solver *s, size_t track, double *consensus,
                      double weight[POSE_OBSERVATIONS_MAX]);

/* Prior precision of a frame's total twist, on the diagonal of the equations. */
double pose_prior(const struct pose_frame *frame);

/* The lower Cholesky factor of a frame's equations in their place; pose_prior on their diagonal keeps them positive. */
static inline void pose_factor(double a[POSE_UNKNOWNS][POSE_UNKNOWNS]) {
    bool is_positive = cholesky_factor(POSE_UNKNOWNS, POSE_UNKNOWNS, &a[0][0]);
    assert(is_positive);
    (void)is_positive;
}

/* Solves for x: twists to apply, and offsets. A walk that is learnt is improved first. */
void pose_solve(struct pose_solver *s);

/* Of POSE_UNKNOWNS motions that all frames share and, last, of the observed values: offsets that make the errors least,
 * and what each observation then pulls at: its weight times its error less the track's mean. x[POSE_UNKNOWNS +
 * 1][unknowns]: in, the frames' twists by a unit of each motion (0 of the values) and offsets to start with; out, the
 * offsets. pull[POSE_UNKNOWNS + 1][observations of first_of_frame]. */
void pose_profile(struct pose_solver *s, double *x, double *pull);

/* At its camera, not moved yet. */
void pose_frame_init(struct pose_frame *frame, const struct camera *camera);

/* Derivative of a frame's value at a world point by its twist, from image gradient g; false where the point is not in
 * front of the camera. */
bool pose_derive(const struct pose_frame *frame, vec3 point, const float g[2], float d[POSE_UNKNOWNS]);

/* Squared distance, in pixels, between a point's image positions in two cameras; NAN where one does not see it. */
double pose_squared_shift(const struct camera *a, const struct camera *b, vec3 point);

/* Moves a frame by a twist, clamped to `most` pixels. */
void pose_twist(struct pose_frame *frame, const double twist[POSE_UNKNOWNS], double most);

/* Puts a frame at a camera. */
void pose_place(struct pose_frame *frame, const struct camera *camera);

/* Moves a frame by its twist in x; resets it to its first camera and fixes it there. */
void pose_move(struct pose_solver *s, size_t f, double most);
void pose_reset(struct pose_solver *s, size_t f);

static inline size_t pose_observation_count(const struct track *track) { return (size_t)track->other_count + 1; }

/* Held-out tracks take part in no solve: they judge it. */
static inline bool pose_is_held_out(size_t track) { return track % POSE_HELD_OUT_EVERY == 0; }

static inline double pose_robust_cost(double residual, double scale) {
    double e = residual / scale;
    return log1p(e * e);
}

/* Whether the saving is large enough, and significant. */
bool pose_is_improved(const struct validation *v);

#endif
