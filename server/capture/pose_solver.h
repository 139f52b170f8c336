/* pose_solver.h -- the equations behind calibrate_poses.h: all photographs at all tracks, linearised.
 *
 * Photograph f moves by a twist (rotation w, translation v, in camera axes) of its camera_from_world:
 * a track's point p in camera space moves by w x p + v. With I the photograph's pyramid, u the
 * track's place in it and L what the track really looks like,
 *
 *     I(u) + grad I . du/dp . (-[p]x, 1) (w, v) - b - L = error,
 *
 * b being one offset for each cell of a coarse grid over the picture: what is left of a wrong
 * exposure, a vignette and the slow change of glossy reflections. Both w and v are counted in
 * pixels: w times the focal length, v times the focal length over the mean depth. grad I is the
 * mean slope over all photographs of the track: noise in slopes would make steps too short. */
#ifndef UNBAKE_CAPTURE_POSE_SOLVER_H
#define UNBAKE_CAPTURE_POSE_SOLVER_H

#include <assert.h>
#include <math.h>
#include <stdbool.h>

#include "common/cholesky.h"
#include "common/parallel.h"
#include "server/capture/tracks.h"

#define POSE_UNKNOWNS 6
#define POSE_CELL_COLUMNS 8 /* of the grid of offsets */
#define POSE_CELL_ROWS 6
#define POSE_CELLS (POSE_CELL_COLUMNS * POSE_CELL_ROWS)
#define POSE_OBSERVATIONS_MAX (TRACK_OTHERS + 1)
#define POSE_HELD_BACK_EVERY 3
#define POSE_MIN_OBSERVATIONS 60 /* that must tell something, for a photograph to be moved */
#define POSE_ROUNDS 12       /* at each level */
#define POSE_STEP_PX 1.5     /* of a level, that a round moves a photograph at most */
#define POSE_MIN_SHIFT_PX 0.15 /* rms; less is not worth a correction */
#define POSE_DAMPING 0.01    /* of the diagonal */
#define POSE_MIN_SCALE 0.01 /* residuals below it are all as good */

struct pose { /* camera_from_world */
    double r[3][3], t[3];
};

struct pose_frame {
    struct camera before, now;
    struct pose pose;
    double total[POSE_UNKNOWNS]; /* sum of the twists taken, pixels */
    double depth_m;         /* mean over its sights */
    double scale;           /* of its residuals */
    double shift_px;        /* between `before` and `now`, as judged last */
    size_t observation_count;
    bool is_fixed;
};

/* One photograph's look at one track. */
struct pose_observation {
    uint32_t frame;
    uint32_t offset;     /* index into x: of its cell */
    float value;         /* NAN: none */
    float weight;        /* inverse variance, made robust; 0 where held back */
    float d[POSE_UNKNOWNS];   /* derivative of `value` by the frame's twist, per pixel */
};

struct pose_solver {
    const struct tracks *tracks;
    size_t frames, track_count, unknowns;
    const struct track **track; /* [track_count] */
    uint32_t *owner;            /* [track_count] the photograph it comes from */
    struct pose_observation *observation;        /* [track_count][POSE_OBSERVATIONS_MAX], the owner's first */
    float (*along)[2];          /* [track_count] how what it shows changes by its `right` and `down`, at this level */
    struct pose_frame *frame;        /* [frames] */
    double *x;                  /* [unknowns]: twist of each frame, then POSE_CELLS offsets of each */
    int level;
};

/* Every photograph at its camera; a photograph with few sights stays. `tracks` is borrowed. */
void pose_solver_init(struct pose_solver *s, const struct tracks *tracks);
void pose_solver_release(struct pose_solver *s);

/* Values and derivatives of all sights with the cameras as they are now. */
void pose_linearise(struct pose_solver *s, struct parallel *pool);

/* The slope by pixels of what a track shows in any camera, as all photographs together have it after pose_linearise:
 * reflections wander over it, texture does not. */
bool pose_slope(const struct pose_solver *s, size_t track, const struct camera *camera, float g[2]);

/* Weights of all sights and scales of all frames, by how well sights agree now. */
void pose_reweight(struct pose_solver *s);

/* What a track looks like by the robust mean of its sights, offsets taken off (NAN where fewer than
 * three tell), and the weight of each. */
void pose_weigh_track(const struct pose_solver *s, size_t track, double *consensus,
                      double weight[POSE_OBSERVATIONS_MAX]);

/* What a frame's twist in all is held to 0 by, on the diagonal of the equations. */
double pose_prior(const struct pose_frame *frame);

/* The lower Cholesky factor of a frame's equations in their place; pose_prior on their diagonal keeps them positive. */
static inline void pose_factor(double a[POSE_UNKNOWNS][POSE_UNKNOWNS]) {
    bool is_positive = cholesky_factor(POSE_UNKNOWNS, POSE_UNKNOWNS, &a[0][0]);
    assert(is_positive);
    (void)is_positive;
}

/* Solves for x: twists by which frames should move, and offsets. */
void pose_solve(struct pose_solver *s);

/* At a camera, from which it was not moved yet. */
void pose_frame_init(struct pose_frame *frame, const struct camera *camera);

/* Derivative of a frame's value at a point of the world by its twist, from its slope g by pixels; false where the point
 * is not before the camera. */
bool pose_derive(const struct pose_frame *frame, vec3 point, const float g[2], float d[POSE_UNKNOWNS]);

/* Square of the distance, in pixels, between a point's places in two cameras; NAN where one does not see it. */
double pose_squared_shift(const struct camera *a, const struct camera *b, vec3 point);

/* Moves a frame by a twist, at most `most` pixels of it. */
void pose_twist(struct pose_frame *frame, const double twist[POSE_UNKNOWNS], double most);

/* Moves a frame by its twist in x; or back to where it was at first, for good. */
void pose_move(struct pose_solver *s, size_t f, double most);
void pose_reset(struct pose_solver *s, size_t f);

/* Evidence for a frame's correction: gains of robust cost over what was held back. */
struct pose_evidence {
    double sum, squares, total;
    size_t count;
};

static inline size_t pose_observation_count(const struct track *track) {
    return (size_t)track->other_count + 1;
}

/* Held-back tracks take part in no solve: they judge it. */
static inline bool pose_is_held_back(size_t track) {
    return track % POSE_HELD_BACK_EVERY == 0;
}

static inline double pose_robust_cost(double residual, double scale) {
    double e = residual / scale;
    return log1p(e * e);
}

/* What a correction makes of a robust cost. */
static inline void pose_evidence_add(struct pose_evidence *e, double before, double now) {
    e->sum += before - now;
    e->squares += (before - now) * (before - now);
    e->total += before;
    e->count++;
}

/* Whether that is clearly better: by a part of it, and by many standard errors. */
bool pose_is_improved(const struct pose_evidence *e);

#endif
