/* frames.h -- what a capture's files say of its photographs: names, lenses, poses, exposures. Each source
 * (source/source.h) makes these of its own format. */
#ifndef UNBAKE_INGEST_FRAMES_H
#define UNBAKE_INGEST_FRAMES_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "common/error.h"
#include "common/reading.h"
#include "server/ingest/pose.h"
#include "server/scene/camera.h"
#include "server/scene/coordinates.h"
#include "server/scene/mesh.h"

#define FRAMES_MAX 20000 /* of a bundle */

struct lens {
    enum camera_model model;
    /* NAN if absent. */
    double width, height, fl_x, fl_y, cx, cy, angle_x, angle_y;
    double k[6], k8, p[2], s[2]; /* as in struct camera */
    double crop_radius;          /* pixels from the picture's centre beyond which nothing is used; 0: none */
    double rescale;              /* of focal lengths and principal point in pixels, at last; 0: none */
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

struct frame {
    size_t number;     /* position in `frames`, from 0 */
    char *file, *mask; /* clean paths (path_clean); mask may be NULL; owned */
    bool is_test;
    struct lens lens;
    struct exact_pose world_from_camera;
    enum exposure_source exposure_source;
    double exposure;          /* 0 if unknown */
    double settings_exposure; /* frame_exposure where all three settings are told; else 0 */
};

struct frames {
    enum matrix_axes axes; /* of the file's matrices; the frames' are with our axes already */
    char *mesh;            /* clean path or NULL; owned */
    char *point_cloud;     /* ply_file_path, a mesh or a point cloud, or NULL; owned */
    /* stored = applied_scale * applied (world of the capture), where the file says so: applied_transform.h */
    bool has_applied;
    double applied[3][4], applied_scale;
    /* Others than those of the poses, which are called `coordinates`; NULL: "file". */
    const char *coordinates;
    struct coordinates other[COORDINATES_MAX];
    size_t other_count;
    bool is_placed_by_mesh; /* nothing tells which the mesh is in: where the cameras stand about it decides */
    bool stands_apart;      /* they stand about it in none */
    size_t named_count;     /* frames in the file */
    size_t frame_count;     /* usable frames: faulty ones are left out */
    struct frame *frame;
};

void frames_release(struct frames *t);
void frame_release(struct frame *frame);

/* Adds coordinates of which the poses' are poses_from * those. */
void frames_add_coordinates(struct frames *t, const char *name, const char *text, const double poses_from[3][4]);
/* Takes the poses to those that the reading names ("file": as the files are) or, where it names none and nothing else
 * tells, to those in which most cameras stand within the mesh's bounds (NULL: no mesh). STATUS_INPUT: the capture knows
 * none of that name. */
enum status frames_choose_coordinates(struct frames *t, const char *given, const struct mesh *mesh, struct error *err);

/* The camera of a frame whose picture is width x height pixels, in coordinates whose origin lies at `offset` in the
 * file's (that of struct mesh). STATUS_INPUT when the file states another size or an invalid lens. */
enum status frame_camera(const struct frame *frame, uint32_t width, uint32_t height, const double offset[3],
                         struct camera *camera, struct error *err);

/* Pixel value per radiance from the camera's settings: seconds x ISO / 100 / f-number^2. Missing (0) factors except
 * the time count as 1. */
double frame_exposure(double time_sec, double iso, double f_number);
/* The same where none is missing; else 0. */
double frame_settings_exposure(double time_sec, double iso, double f_number);

#endif
