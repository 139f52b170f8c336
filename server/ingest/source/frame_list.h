/* frame_list.h -- what the readers of poses share: a growing list of frames, and how poses are turned into ours. */
#ifndef UNBAKE_INGEST_SOURCE_FRAME_LIST_H
#define UNBAKE_INGEST_SOURCE_FRAME_LIST_H

#include "server/ingest/pose.h"
#include "server/ingest/source/source.h"

struct frame_list {
    struct frames *t;    /* receives the frames */
    const char *name;    /* of the file, for messages */
    enum pose_axes axes; /* of the matrices */
    struct findings *findings;
    bool may_be_lost; /* a matrix that is not finite stands for lost tracking, and is no fault */
    size_t capacity, lost_count;
};

/* The list for a file of camera-to-world matrices; empties *t. */
struct frame_list frame_list_make(struct frames *t, const char *name, enum matrix_axes axes, struct findings *f);
/* Adds a frame with the camera-to-world matrix m[3][4] and photograph `file`, which is copied: as the tool wrote it,
 * cleaned by path_clean_foreign; photo_folder_resolve then finds the files. A name that is none or a matrix that is no
 * pose is a problem that names `place`; a lost pose is counted. The new frame, borrowed until the next call, or NULL.
 * STATUS_INPUT: too many. */
enum status frame_list_add(struct frame_list *in, double m[3][4], const struct lens *lens, const char *file,
                           const char *place, struct frame **frame, struct error *err);
/* The end of reading a file `path` that holds one frame. `status` and `own` are those of the reading: after STATUS_OK
 * the frame is added, with messages that name `path`; else m and lens are not looked at, and a fault of the file is a
 * problem. */
enum status frame_list_settle(struct frame_list *in, const char *path, enum status status, const struct error *own,
                              double m[3][4], const struct lens *lens, const char *file, const char *place,
                              struct error *err);
/* Warns of photographs that the file names without a pose; 0: of none. */
void frame_list_warn_unposed(const struct frame_list *in, size_t count);
/* Warns of what was counted. */
void frame_list_finish(const struct frame_list *in);
/* Sorts by the photographs' paths, for files that have them in no order. */
void frame_list_sort(struct frames *t);

/* A lens without distortion; width and height may be NAN (unknown). cx and cy with pixel centres at .5. */
struct lens lens_pinhole(double width, double height, double fx, double fy, double cx, double cy);
/* For formats whose pixel centres lie at integers. */
#define LENS_PIXEL_CENTRE 0.5

/* Rotation matrices of a quaternion, of any length but 0, and of an axis times an angle in radians. */
void rotation_from_quaternion(double w, double x, double y, double z, double r[3][3]);
void rotation_from_axis_angle(const double v[3], double r[3][3]);
/* Camera-to-world of a world-to-camera pose: m = [r^T | -r^T t]. */
void pose_invert(double r[3][3], const double t[3], double m[3][4]);
/* Camera-to-world of a rotation that turns the world into the camera, and the camera's centre. */
void pose_at_centre(double r[3][3], const double centre[3], double m[3][4]);

#endif
