/* pose.c -- see pose.h. The nearest rotation is the orthogonal factor of the polar decomposition,
 * by Newton's iteration (Higham, "Computing the Polar Decomposition", 1986). */
#include "server/ingest/pose.h"

#include <math.h>
#include <stddef.h>

#define SHEAR_LIMIT 0.02 /* largest entry of R^T R - 1 that counts as rounding or estimation error */

static double determinant(double m[3][3]) {
    return m[0][0] * (m[1][1] * m[2][2] - m[1][2] * m[2][1]) - m[0][1] * (m[1][0] * m[2][2] - m[1][2] * m[2][0]) +
           m[0][2] * (m[1][0] * m[2][1] - m[1][1] * m[2][0]);
}

/* out = (m + m^-T) / 2, m^-T being the cofactors over the determinant. */
static void newton_step(double m[3][3], double out[3][3]) {
    double det = determinant(m);
    for (int i = 0; i < 3; i++) {
        for (int j = 0; j < 3; j++) {
            int i1 = (i + 1) % 3, i2 = (i + 2) % 3, j1 = (j + 1) % 3, j2 = (j + 2) % 3;
            double cofactor = m[i1][j1] * m[i2][j2] - m[i1][j2] * m[i2][j1];
            out[i][j] = 0.5 * (m[i][j] + cofactor / det);
        }
    }
}

static double shear(double m[3][3]) {
    double worst = 0.0;
    for (int i = 0; i < 3; i++) {
        for (int j = 0; j < 3; j++) {
            double dot = m[0][i] * m[0][j] + m[1][i] * m[1][j] + m[2][i] * m[2][j];
            worst = fmax(worst, fabs(dot - (i == j ? 1.0 : 0.0)));
        }
    }
    return worst;
}

/* Orthonormalises m; NULL, or the reason why it is no rotation. */
static const char *make_rotation(double m[3][3], double *scale) {
    double det = determinant(m), largest = 0.0;
    for (int i = 0; i < 9; i++)
        largest = fmax(largest, fabs(m[i / 3][i % 3]));
    if (!(fabs(det) > 1e-9 * largest * largest * largest))
        return "is singular";
    if (det < 0.0)
        return "mirrors space (its determinant is negative)";
    *scale = cbrt(det);
    for (int i = 0; i < 9; i++)
        m[i / 3][i % 3] /= *scale;
    if (!(shear(m) < SHEAR_LIMIT))
        return "is not a rotation: its axes are not at right angles and of one length";
    for (int step = 0; step < 6; step++) {
        double next[3][3];
        newton_step(m, next);
        for (int i = 0; i < 9; i++)
            m[i / 3][i % 3] = next[i / 3][i % 3];
    }
    return NULL;
}

enum status pose_from_matrix(const double matrix[3][4], const char *what, enum pose_axes axes,
                             struct exact_pose *world_from_camera, bool *scaled, struct error *err) {
    double m[3][3], scale = 1.0;
    for (int i = 0; i < 3; i++) {
        for (int j = 0; j < 4; j++)
            if (!isfinite(matrix[i][j]) || fabs(matrix[i][j]) > 1e9)
                return error_set(err, STATUS_INPUT,
                                 "%s holds a number that is not finite or too large in row %d, column %d", what, i + 1,
                                 j + 1);
        for (int j = 0; j < 3; j++)
            m[i][j] = matrix[i][j];
    }
    const char *fault = make_rotation(m, &scale);
    if (fault)
        return error_set(err, STATUS_INPUT, "%s %s", what, fault);
    *scaled = fabs(scale - 1.0) > 1e-3;
    for (int i = 0; i < 3; i++) {
        world_from_camera->translation[i] = matrix[i][3];
        for (int j = 0; j < 3; j++) {
            double sign = axes == POSE_RIGHT_UP_BACK && j > 0 ? -1.0 : 1.0;
            world_from_camera->rotation[i][j] = sign * m[i][j];
        }
    }
    return STATUS_OK;
}

void pose_to_rigid(const struct exact_pose *pose, const double offset[3], struct rigid *forward,
                   struct rigid *inverse) {
    double t[3], back[3];
    for (int i = 0; i < 3; i++)
        t[i] = pose->translation[i] - offset[i];
    for (int j = 0; j < 3; j++) {
        for (int i = 0; i < 3; i++) {
            forward->rotation[i][j] = (float)pose->rotation[i][j];
            inverse->rotation[j][i] = (float)pose->rotation[i][j];
        }
        /* in double: rigid_inverse would lose precision for a far origin */
        back[j] = -(pose->rotation[0][j] * t[0] + pose->rotation[1][j] * t[1] + pose->rotation[2][j] * t[2]);
    }
    forward->translation = vec3_make((float)t[0], (float)t[1], (float)t[2]);
    inverse->translation = vec3_make((float)back[0], (float)back[1], (float)back[2]);
}

void pose_transform(const double to[3][4], struct exact_pose *pose) {
    const struct exact_pose old = *pose;
    double scale = sqrt(to[0][0] * to[0][0] + to[1][0] * to[1][0] + to[2][0] * to[2][0]);
    for (int i = 0; i < 3; i++) {
        pose->translation[i] = to[i][3];
        for (int k = 0; k < 3; k++)
            pose->translation[i] += to[i][k] * old.translation[k];
        for (int j = 0; j < 3; j++) {
            pose->rotation[i][j] = 0.0;
            for (int k = 0; k < 3; k++)
                pose->rotation[i][j] += to[i][k] / scale * old.rotation[k][j];
        }
    }
}
