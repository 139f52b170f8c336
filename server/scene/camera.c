/* camera.c -- see camera.h. The models are those of OpenCV's calib3d and fisheye pages:
 *
 *   OPENCV          r^2 = x^2 + y^2
 *                   s = (1 + k1 r^2 + k2 r^4 + k3 r^6) / (1 + k4 r^2 + k5 r^4 + k6 r^6)
 *                   x' = s x + 2 p1 x y + p2 (r^2 + 2 x^2),  y' = s y + p1 (r^2 + 2 y^2) + 2 p2 x y
 *   OPENCV_FISHEYE  t = atan r,  t' = t (1 + k1 t^2 + k2 t^4 + k3 t^6 + k4 t^8)
 *                   (x', y') = t' (x, y) / r
 *
 * with (x, y) = (X / Z, Y / Z). The Jacobian determinant is positive at the axis; where it stops
 * being so, the picture folds over. The radial part's fold is found once (camera_find_fold); the
 * tangential part's sign is looked at point by point, since it costs nothing there. */
#include "server/scene/camera.h"

#include <math.h>
#include <stddef.h>

#define HALF_PI (0.5 * PI)
#define FOLD_STEPS 4096 /* of the march towards the fold */
#define NEWTON_STEPS 50
#define NEWTON_PIXELS 1e-6 /* residual at which the inverse is taken as found */

static bool has_distortion(const struct camera *c) {
    float sum = fabsf(c->p[0]) + fabsf(c->p[1]);
    for (int i = 0; i < 6; i++)
        sum += fabsf(c->k[i]);
    return sum != 0.0f;
}

/* Radial scale s and ds/d(r^2). */
static double radial(const struct camera *c, double r2, double *d_scale) {
    double k1 = (double)c->k[0], k2 = (double)c->k[1], k3 = (double)c->k[2];
    double k4 = (double)c->k[3], k5 = (double)c->k[4], k6 = (double)c->k[5];
    double above = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3));
    double below = 1.0 + r2 * (k4 + r2 * (k5 + r2 * k6));
    double d_above = k1 + r2 * (2.0 * k2 + r2 * 3.0 * k3);
    double d_below = k4 + r2 * (2.0 * k5 + r2 * 3.0 * k6);
    *d_scale = (d_above * below - above * d_below) / (below * below);
    return above / below;
}

/* t' and dt'/dt. */
static double fisheye(const struct camera *c, double t, double *derivative) {
    double t2 = t * t, sum = 1.0, d_sum = 1.0, power = 1.0;
    for (int i = 0; i < 4; i++) {
        power *= t2;
        sum += (double)c->k[i] * power;
        d_sum += (2 * i + 3) * (double)c->k[i] * power;
    }
    *derivative = d_sum;
    return t * sum;
}

/* Distorted (x', y') and its Jacobian {dx'/dx, dx'/dy = dy'/dx, dy'/dy}. */
static void opencv(const struct camera *c, double x, double y, double out[2], double jacobian[3]) {
    double p1 = (double)c->p[0], p2 = (double)c->p[1], r2 = x * x + y * y, d_scale;
    double scale = radial(c, r2, &d_scale);
    out[0] = scale * x + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x);
    out[1] = scale * y + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y;
    jacobian[0] = scale + 2.0 * x * x * d_scale + 2.0 * p1 * y + 6.0 * p2 * x;
    jacobian[1] = 2.0 * x * y * d_scale + 2.0 * p1 * x + 2.0 * p2 * y;
    jacobian[2] = scale + 2.0 * y * y * d_scale + 6.0 * p1 * y + 2.0 * p2 * x;
}

/* Derivative of the distorted radius by the undistorted one, and that radius; not finite or not
 * positive where the model has broken down (a denominator that went through zero included). */
static double radial_growth(const struct camera *c, double r, double *distorted) {
    double derivative;
    if (c->model == CAMERA_OPENCV_FISHEYE) {
        *distorted = fisheye(c, r, &derivative);
        return derivative;
    }
    double r2 = r * r;
    double below = 1.0 + r2 * ((double)c->k[3] + r2 * ((double)c->k[4] + r2 * (double)c->k[5]));
    double scale = radial(c, r2, &derivative);
    *distorted = r * scale;
    return below > 0.0 ? scale + 2.0 * r2 * derivative : -1.0;
}

void camera_find_fold(struct camera *c) {
    c->fold = 0.0f;
    if (!has_distortion(c))
        return;
    /* March over the angle in even steps to just below 90 degrees. Twice the picture's corner leaves room for the
     * tangential part. */
    double dx = fmax(fabs((double)c->cx), fabs((double)c->width - (double)c->cx)) / (double)c->fx;
    double dy = fmax(fabs((double)c->cy), fabs((double)c->height - (double)c->cy)) / (double)c->fy;
    double reach = 2.0 * hypot(dx, dy), inside = 0.0, outside = 0.0, distorted;
    bool is_fisheye = c->model == CAMERA_OPENCV_FISHEYE;
    for (int i = 1; i < FOLD_STEPS; i++) {
        double angle = HALF_PI * i / FOLD_STEPS, r = is_fisheye ? angle : tan(angle);
        if (!(radial_growth(c, r, &distorted) > 0.0)) {
            outside = r;
            break;
        }
        inside = r;
        if (distorted > reach)
            break;
    }
    for (int i = 0; outside > 0.0 && i < 60; i++) {
        double middle = 0.5 * (inside + outside);
        if (radial_growth(c, middle, &distorted) > 0.0)
            inside = middle;
        else
            outside = middle;
    }
    /* A march that ended without a fold also gives a limit: the polynomial is unconstrained beyond the picture. */
    c->fold = (float)inside;
}

static bool project_opencv(const struct camera *c, float x, float y, float *u, float *v) {
    float r2 = x * x + y * y;
    if (c->fold > 0.0f && !(r2 < c->fold * c->fold))
        return false;
    const float *k = c->k, p1 = c->p[0], p2 = c->p[1];
    float above = 1.0f + r2 * (k[0] + r2 * (k[1] + r2 * k[2]));
    float below = 1.0f + r2 * (k[3] + r2 * (k[4] + r2 * k[5]));
    float scale = above / below;
    if (p1 != 0.0f || p2 != 0.0f) {
        double out[2], jacobian[3];
        opencv(c, (double)x, (double)y, out, jacobian);
        if (!(jacobian[0] * jacobian[2] - jacobian[1] * jacobian[1] > 0.0) || !(jacobian[0] > 0.0))
            return false;
    }
    *u = scale * x + 2.0f * p1 * x * y + p2 * (r2 + 2.0f * x * x);
    *v = scale * y + p1 * (r2 + 2.0f * y * y) + 2.0f * p2 * x * y;
    return true;
}

static bool project_fisheye(const struct camera *c, float x, float y, float *u, float *v) {
    float r = sqrtf(x * x + y * y), t = atanf(r), t2 = t * t;
    if (c->fold > 0.0f && !(t < c->fold))
        return false;
    const float *k = c->k;
    float bent = t * (1.0f + t2 * (k[0] + t2 * (k[1] + t2 * (k[2] + t2 * k[3]))));
    float scale = r > 1e-8f ? bent / r : 1.0f;
    *u = scale * x;
    *v = scale * y;
    return true;
}

bool camera_project(const struct camera *c, vec3 point, float *x, float *y, float *depth_m) {
    vec3 p = rigid_point(&c->camera_from_world, point);
    if (!(p.z > 0.0f))
        return false;
    float u, v;
    bool inside = c->model == CAMERA_OPENCV_FISHEYE ? project_fisheye(c, p.x / p.z, p.y / p.z, &u, &v)
                                                    : project_opencv(c, p.x / p.z, p.y / p.z, &u, &v);
    if (!inside)
        return false;
    u = c->fx * u + c->cx;
    v = c->fy * v + c->cy;
    *x = u;
    *y = v;
    *depth_m = p.z;
    return u >= 0.0f && u < (float)c->width && v >= 0.0f && v < (float)c->height;
}

/* Newton's method in the plane, the step halved until it stays where the map is one-to-one and
 * the residual shrinks. (x, y) begins at the distorted place and ends at the undistorted one. */
static bool invert_opencv(const struct camera *c, double *x, double *y) {
    double goal[2] = {*x, *y}, out[2], j[3];
    double fold = c->fold > 0.0f ? (double)c->fold : INFINITY;
    double scale = fmin(1.0, 0.99 * fold / fmax(hypot(*x, *y), 1e-30));
    *x *= scale;
    *y *= scale;
    opencv(c, *x, *y, out, j);
    double tolerance = NEWTON_PIXELS / (double)fmaxf(fabsf(c->fx), fabsf(c->fy));
    double residual = hypot(out[0] - goal[0], out[1] - goal[1]);
    for (int i = 0; i < NEWTON_STEPS && residual > tolerance; i++) {
        double det = j[0] * j[2] - j[1] * j[1];
        if (!(fabs(det) > 1e-12))
            return false;
        double ex = out[0] - goal[0], ey = out[1] - goal[1];
        double sx = (j[2] * ex - j[1] * ey) / det, sy = (j[0] * ey - j[1] * ex) / det;
        double next_x, next_y, next_residual = INFINITY, length = 1.0;
        do {
            next_x = *x - length * sx;
            next_y = *y - length * sy;
            length *= 0.5;
            if (hypot(next_x, next_y) >= fold)
                continue;
            opencv(c, next_x, next_y, out, j);
            next_residual = hypot(out[0] - goal[0], out[1] - goal[1]);
        } while (!(next_residual < residual) && length > 1e-6);
        if (!(next_residual < residual))
            return false;
        *x = next_x;
        *y = next_y;
        residual = next_residual;
    }
    return residual <= tolerance && j[0] > 0.0 && j[0] * j[2] - j[1] * j[1] > 0.0;
}

/* As invert_opencv, for the angle t of a distorted angle: safeguarded by bisection, since t'(t)
 * grows on all of [0, fold). */
static bool invert_fisheye(const struct camera *c, double bent, double *t) {
    double low = 0.0, high = c->fold > 0.0f ? (double)c->fold : HALF_PI, derivative;
    if (!(bent <= fisheye(c, high, &derivative)))
        return false;
    *t = fmin(bent, 0.5 * high);
    double tolerance = NEWTON_PIXELS / (double)fmaxf(fabsf(c->fx), fabsf(c->fy));
    for (int i = 0; i < NEWTON_STEPS; i++) {
        double error = fisheye(c, *t, &derivative) - bent;
        if (fabs(error) <= tolerance)
            return *t < HALF_PI;
        if (error > 0.0)
            high = *t;
        else
            low = *t;
        double next = *t - error / derivative;
        *t = next > low && next < high ? next : 0.5 * (low + high);
    }
    return false;
}

bool camera_direction(const struct camera *c, float px, float py, vec3 *direction) {
    double x = ((double)px - (double)c->cx) / (double)c->fx;
    double y = ((double)py - (double)c->cy) / (double)c->fy, z = 1.0;
    if (c->model == CAMERA_OPENCV_FISHEYE) {
        double bent = hypot(x, y), t;
        if (!invert_fisheye(c, bent, &t))
            return false;
        double scale = bent > 1e-12 ? sin(t) / bent : 1.0;
        x *= scale;
        y *= scale;
        z = cos(t);
    } else if (has_distortion(c) && !invert_opencv(c, &x, &y)) {
        return false;
    }
    double length = sqrt(x * x + y * y + z * z);
    vec3 local = {(float)(x / length), (float)(y / length), (float)(z / length)};
    *direction = vec3_normalize(rigid_direction(&c->world_from_camera, local));
    return vec3_is_finite(*direction);
}
