/* camera.h -- pinhole and fisheye cameras with lens distortion.
 *
 * Camera axes: x right, y down, z forward. Pixel (i, j) covers [i, i+1) x [j, j+1), its centre is at +0.5. Distortion:
 *
 *   OPENCV              k1 to k6, p1 p2 (Brown-Conrady, rational), as OpenCV's calibration page defines it, and k8, the
 *                       eighth power of the radius, which nerfstudio and others have. Pinhole: all zero
 *   OPENCV_FISHEYE      k1 to k4 (Kannala-Brandt), as OpenCV's fisheye page defines it
 *   THIN_PRISM_FISHEYE  k1 to k4, p1 p2, s1 s2, as COLMAP defines it
 *   DIVISION            k[0] is Fitzgibbon's lambda (2001), as RealityCapture's "division" has it
 *   FOV                 k[0] is the angle omega in radians (Devernay & Faugeras 2001), as COLMAP defines it
 *   PANORAMA            no lens: the whole sphere, equirectangular; its middle is z, columns are azimuth from -pi to pi
 *                       over +x, rows polar angle from -y; fx, fy, cx, cy are not used. Rendered, never read */
#ifndef UNBAKE_SCENE_CAMERA_H
#define UNBAKE_SCENE_CAMERA_H

#include <stdbool.h>
#include <stdint.h>

#include "common/vec.h"

enum camera_model {
    CAMERA_OPENCV,
    CAMERA_OPENCV_FISHEYE,
    CAMERA_THIN_PRISM_FISHEYE,
    CAMERA_FOV,
    CAMERA_DIVISION,
    CAMERA_PANORAMA
};

struct camera {
    enum camera_model model;
    uint32_t width, height; /* pixels */
    float fx, fy, cx, cy;   /* pixels */
    float k[6];             /* radial */
    float k8;               /* radial, of the eighth power; OPENCV only */
    float p[2];             /* tangential; OPENCV and THIN_PRISM_FISHEYE */
    float s[2];             /* thin prism; THIN_PRISM_FISHEYE only */
    float fold;             /* set by camera_find_fold, see there; 0: no limit */
    bool looks_in;          /* its pictures (film.h) do not show the backs of surfaces: from outside, a room's inside */
    struct rigid camera_from_world, world_from_camera;
};

/* Finds where the distortion stops growing and sets `fold`, the limit up to which the model is one-to-one: tan of the
 * angle from the axis (OPENCV) or that angle in radians (fisheye); well outside the picture if it never folds; 0
 * without distortion and for FOV and DIVISION, which have closed forms. Beyond it the polynomial maps directions
 * outside the view into the picture. Call once after size and lens parameters are set. */
void camera_find_fold(struct camera *camera);

/* Whether the lens differs from a pinhole. */
bool camera_is_distorted(const struct camera *camera);

/* Projects a world point, in closed form. False when it is behind the camera, beyond the fold or outside the picture.
 * *depth_m is along the optical axis. */
bool camera_project(const struct camera *camera, vec3 point, float *x, float *y, float *depth_m);

/* Unit world direction of the ray through pixel coordinates (x, y); inverts the distortion by Newton's method. False
 * when it does not converge; such pixels are not used. */
bool camera_direction(const struct camera *camera, float x, float y, vec3 *direction);

static inline vec3 camera_origin(const struct camera *camera) { return camera->world_from_camera.translation; }

#endif
