/* applied.c -- see applied.h. */
#include "server/ingest/applied.h"

#include <fnmatch.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "server/ingest/path.h"

/* inverse = m^-1 for the affine m; returns the determinant of its linear part. */
static double invert(const double m[3][4], double inverse[3][4]) {
    double det = 0.0;
    for (int j = 0; j < 3; j++)
        det += m[0][j] * (m[1][(j + 1) % 3] * m[2][(j + 2) % 3] - m[1][(j + 2) % 3] * m[2][(j + 1) % 3]);
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) {
            int i1 = (i + 1) % 3, i2 = (i + 2) % 3, j1 = (j + 1) % 3, j2 = (j + 2) % 3;
            inverse[j][i] = (m[i1][j1] * m[i2][j2] - m[i1][j2] * m[i2][j1]) / det;
        }
    for (int i = 0; i < 3; i++)
        inverse[i][3] = -(inverse[i][0] * m[0][3] + inverse[i][1] * m[1][3] + inverse[i][2] * m[2][3]);
    return det;
}

/* pose = inverse(applied) of the pose whose position is divided by the scale. */
static void undo(const double inverse[3][4], double stretch, double scale, struct exact_pose *pose) {
    struct exact_pose old = *pose;
    for (int i = 0; i < 3; i++) {
        pose->translation[i] = inverse[i][3];
        for (int k = 0; k < 3; k++)
            pose->translation[i] += inverse[i][k] * old.translation[k] / scale;
        for (int j = 0; j < 3; j++) {
            pose->rotation[i][j] = 0.0;
            for (int k = 0; k < 3; k++)
                pose->rotation[i][j] += inverse[i][k] * stretch * old.rotation[k][j];
        }
    }
}

void applied_undo(struct frames *t, const char *name, const char *reason, struct findings *f) {
    double inverse[3][4], det = invert((const double(*)[4])t->applied, inverse);
    if (!(det > 1e-9 && isfinite(det))) {
        findings_problem(f, name, "applied_transform %s, which no pose can be turned back from",
                         det < 0.0 ? "mirrors space" : "is singular");
        return;
    }
    for (size_t i = 0; i < t->frame_count; i++)
        undo((const double(*)[4])inverse, cbrt(det), t->applied_scale, &t->frame[i].world_from_camera);
    t->has_applied = false;
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

void applied_settle(struct frames *t, const char *name, const char *mesh, struct findings *f) {
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
    if (is_of_capture(mesh)) {
        snprintf(reason, sizeof reason, "%.200s is a mesh of the capture itself", mesh);
        applied_undo(t, name, reason, f);
    } else if (as_axes(t, axes)) {
        findings_warning(f,
                         "%s: the poses are in nerfstudio's axes (applied_transform); a mesh in those of the capture "
                         "needs mesh_axes=\"%s\"",
                         name, axes);
    } else {
        findings_warning(f,
                         "%s: nerfstudio moved or scaled the poses (applied_transform, applied_scale); a mesh in the "
                         "capture's own coordinates does not fit them",
                         name);
    }
}
