/* applied_transform.c -- see applied_transform.h. */
#include "server/ingest/applied_transform.h"

#include <fnmatch.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "server/ingest/path.h"

#define CAPTURE "capture"

/* poses = m * the capture's. */
static void similarity(const struct frames *t, double m[3][4]) {
    for (int i = 0; i < 12; i++)
        m[i / 4][i % 4] = t->applied_scale * t->applied[i / 4][i % 4];
}

void applied_transform_undo(struct frames *t, const char *name, const char *reason, struct findings *f) {
    double applied[3][4], inverse[3][4];
    similarity(t, applied);
    double det = coordinates_invert((const double(*)[4])applied, inverse);
    if (!(det > 1e-9 && isfinite(det))) {
        findings_problem(f, name, "applied_transform %s, which no pose can be turned back from",
                         det < 0.0 ? "mirrors space" : "is singular");
        return;
    }
    for (size_t i = 0; i < t->frame_count; i++)
        pose_transform((const double(*)[4])inverse, &t->frame[i].world_from_camera);
    t->has_applied = false;
    t->coordinates = CAPTURE;
    frames_add_coordinates(t, "file", "those of the cameras' file", (const double(*)[4])inverse);
    findings_warning(f, "%s: the poses are in nerfstudio's axes (applied_transform) and were turned back: %s", name,
                     reason);
}

/* Whether the mesh is one of a name that a tool gives which knows nothing of nerfstudio's axes. */
static bool is_of_capture(const char *mesh) {
    static const char *const names[] = {"raw.*",          "meshed-*.ply",   "scene_dense_mesh*",
                                        "scene_mesh*",    "odm_textured_*", "*_vh_clean*",
                                        "mesh_aligned_*", "texturedMesh.*", "textured_output.*"};
    for (size_t i = 0; mesh && i < sizeof names / sizeof *names; i++)
        if (fnmatch(names[i], path_base(mesh), 0) == 0)
            return true;
    return false;
}

/* The transform as a reading's mesh_axes, "y x -z"; false when it is more than that. */
static bool as_axes(const struct frames *t, char text[16]) {
    size_t used = 0;
    for (int i = 0; i < 3; i++) {
        int axis = -1;
        for (int j = 0; j < 4; j++) {
            double size = fabs(t->applied[i][j]);
            if (size > 1e-6 && (axis >= 0 || fabs(size - 1.0) > 1e-6 || j == 3))
                return false;
            axis = size > 1e-6 ? j : axis;
        }
        if (axis < 0)
            return false;
        used += (size_t)snprintf(text + used, 16 - used, "%s%s%c", i ? " " : "", t->applied[i][axis] < 0.0 ? "-" : "",
                                 'x' + axis);
    }
    return t->applied_scale == 1.0;
}

/* Polycam's raw mesh beside what ns-process-data polycam wrote, which permutes axes and does not say so. */
static bool is_polycam(const struct frames *t, const char *mesh) {
    return mesh && t->axes == AXES_OPENGL && t->frame_count > 0 && fnmatch("raw.*", path_base(mesh), 0) == 0 &&
           fnmatch("frame_[0-9][0-9][0-9][0-9][0-9].*", path_base(t->frame[0].file), 0) == 0;
}

/* The capture's coordinates, where they differ; a transform that mirrors space or is singular has none. */
static void know_capture(struct frames *t) {
    double m[3][4], inverse[3][4];
    similarity(t, m);
    double det = coordinates_invert((const double(*)[4])m, inverse);
    if (det > 1e-9 && isfinite(det))
        frames_add_coordinates(t, CAPTURE,
                               "those of the capture before nerfstudio's applied_transform and applied_scale",
                               (const double(*)[4])m);
}

void applied_transform_settle(struct frames *t, const char *name, const char *mesh, const char *given,
                              struct findings *f) {
    static const double polycam[3][4] = {{0, 0, 1, 0}, {1, 0, 0, 0}, {0, 1, 0, 0}};
    static const double identity[3][4] = {{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 0}};
    char axes[16], reason[300];
    if (!t->has_applied && is_polycam(t, mesh)) {
        t->has_applied = true;
        t->applied_scale = 1.0;
        memcpy(t->applied, polycam, sizeof polycam);
    }
    if (!t->has_applied || (t->applied_scale == 1.0 && memcmp(t->applied, identity, sizeof identity) == 0))
        return;
    if (given) {
        know_capture(t);
    } else if (is_of_capture(mesh)) {
        snprintf(reason, sizeof reason, "%.200s is a mesh of the capture itself", mesh);
        applied_transform_undo(t, name, reason, f);
    } else if (as_axes(t, axes)) {
        know_capture(t);
        findings_warning(f,
                         "%s: the poses are in nerfstudio's axes (applied_transform); a mesh in those of the capture "
                         "needs mesh_axes=\"%s\"",
                         name, axes);
    } else {
        know_capture(t);
        findings_warning(f,
                         "%s: nerfstudio moved or scaled the poses (applied_transform, applied_scale); a mesh in the "
                         "capture's own coordinates needs coordinates=" CAPTURE,
                         name);
    }
}
