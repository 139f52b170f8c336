/* hypothesis.h -- another way in which cameras and mesh of a loaded scene might belong together.
 *
 * Moving the mesh is the same as moving the cameras the other way: a hypothesis is applied to the cameras, and the mesh
 * (with its acceleration structure) stays as it was loaded. */
#ifndef UNBAKE_CHECK_HYPOTHESIS_H
#define UNBAKE_CHECK_HYPOTHESIS_H

#include <stdbool.h>
#include <stddef.h>

#include "common/reading.h"
#include "server/scene/scene.h"

struct hypothesis {
    enum matrix_axes axes;          /* that the file's matrices mean; AXES_OF_FORMAT: as loaded */
    struct signed_axes mesh_axes;   /* of the mesh as loaded, in the cameras' world */
    double scale;                   /* of the mesh as loaded, units of the cameras' world */
    int shift;                      /* photograph i has the pose of photograph i + shift */
    struct coordinates coordinates; /* that the mesh is in, one of scene->other; of name NULL: as loaded */
    double lens;                    /* factor of focal lengths and principal point */
    vec3 offset;                    /* of the mesh, in its own units: another origin, which no reading can say */
    bool is_pinhole;                /* the pictures have no distortion, whatever their lens has */
};

/* As loaded. */
struct hypothesis hypothesis_given(void);
bool hypothesis_is_given(const struct hypothesis *h);

/* The camera of photograph `index` in the coordinates of the mesh as loaded. False when the photograph has no
 * pose under the hypothesis. */
bool hypothesis_camera(const struct hypothesis *h, const struct scene *scene, size_t index, struct camera *camera);

/* The reading that would load the scene in this way, given the one by which it was loaded; the caller's
 * (reading_release). An offset has no part in it. */
struct reading hypothesis_reading(const struct hypothesis *h, const struct reading *loaded);

/* "the mesh is y-up: set mesh_axes=\"x -z y\""; the caller's. */
char *hypothesis_text(const struct hypothesis *h, const struct reading *loaded);

/* Signed permutation number 0 to 47: the first 24 are rotations, 0 is the identity. */
struct signed_axes hypothesis_signed_axes(int number);

#endif
