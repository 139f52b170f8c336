/* reading.h -- how a bundle is to be read where its files do not say, or say it wrongly.
 *
 * A reading belongs to the scene: it is given with the upload, changed later, or found by the check of fit
 * (server/check). As JSON it is an object of these members, each optional:
 *
 *   "transforms"  file of the cameras; otherwise searched for
 *   "mesh"        file of the mesh; otherwise chosen among those of the bundle
 *   "axes"        what the file's pose matrices mean: "opencv" (camera-to-world; x right, y down, z forward), "opengl"
 *                 (camera-to-world; x right, y up, z back), "opencv-inverse", "opengl-inverse" (world-to-camera with
 *                 these axes); otherwise as the format defines it
 *   "mesh_axes"   the mesh's axes in the cameras' world, as three signed letters: "x -z y" places the mesh's point
 *                 (x, y, z) at (x, -z, y), that is, turns a y-up mesh z-up; one that mirrors ("-x y z") turns the
 *                 triangles over
 *   "scale"       length of the mesh's unit in units of the cameras' world (.001: the mesh is in millimetres)
 *   "shift"       photograph i has the pose of frame i + shift; frames without one are left out
 *   "coordinates" those in which the mesh is, where the cameras' file knows several: "file" (its poses'), "capture"
 *                 (before nerfstudio's applied_transform and applied_scale), "chunk", "local" and "projected" (of a
 *                 georeferenced Metashape chunk); otherwise by the mesh
 *   "lens"        factor of all focal lengths and principal points: .5 where they are those of pictures of twice the
 *                 size
 *   "distortion"  "told" or "ignored": the pictures have the lens's distortion as the files state it, or none
 *   "exposures"   "told" or "ignored": exposures that the files state are taken, or estimated as if they did not */
#ifndef UNBAKE_COMMON_READING_H
#define UNBAKE_COMMON_READING_H

#include <stdbool.h>

#include "common/error.h"
#include "common/json.h"
#include "common/vec.h"

#define READING_MAX_SHIFT 10  /* frames, either way */
#define READING_MAX_PATH 1000 /* bytes */

/* What a file's pose matrices mean: camera-to-world, or world-to-camera (inverse); with camera axes x right, y down,
 * z forward (OpenCV, COLMAP) or x right, y up, z back (OpenGL, nerfstudio). */
enum matrix_axes { AXES_OF_FORMAT, AXES_OPENCV, AXES_OPENGL, AXES_OPENCV_INVERSE, AXES_OPENGL_INVERSE };

/* A rotation by multiples of 90 degrees, with or without a mirror: component i of the result is
 * sign[i] * p[axis[i]]. */
struct signed_axes {
    int axis[3];
    float sign[3];
};

struct reading {
    char *transforms, *mesh; /* paths in the bundle as they were given, or NULL; owned */
    enum matrix_axes axes;
    struct signed_axes mesh_axes;
    double scale;
    int shift;
    char *coordinates; /* or NULL; owned */
    double lens;
    bool ignores_distortion;
    bool ignores_exposures;
};

extern const char *const reading_keys[]; /* the members' names; ends with NULL */

/* As the bundle says. */
struct reading reading_default(void);
void reading_release(struct reading *reading);
struct reading reading_copy(const struct reading *reading); /* the caller's */

/* Reads the object; NULL is the default. STATUS_INPUT names the faulty member and what is accepted. *reading is the
 * caller's (reading_release) in any case. */
enum status reading_parse(const cJSON *json, struct reading *reading, struct error *err);
/* "key=value" of a command line into `object`, with the JSON type that the key has. STATUS_INPUT as above. */
enum status reading_parse_assignment(const char *text, cJSON *object, struct error *err);
/* Only the members that differ from the default; the caller's. */
cJSON *reading_json(const struct reading *reading);
/* The object as the words of a command line that reading_parse_assignment takes, quoted for a shell:
 * mesh_axes='x -z y' scale=0.001. The caller's (mem_free). */
char *reading_words(const cJSON *object);

vec3 signed_axes_apply(const struct signed_axes *axes, vec3 v);
bool signed_axes_is_mirror(const struct signed_axes *axes);

#endif
