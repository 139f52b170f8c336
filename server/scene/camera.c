/* camera.c -- see camera.h. The models are those of OpenCV's calib3d and fisheye pages, and of COLMAP's models.h:
 *
 *   OPENCV          r^2 = x^2 + y^2
 *                   s = (1 + k1 r^2 + k2 r^4 + k3 r^6 + k8 r^8) / (1 + k4 r^2 + k5 r^4 + k6 r^6)
 *                   x' = s x + 2 p1 x y + p2 (r^2 + 2 x^2),  y' = s y + p1 (r^2 + 2 y^2) + 2 p2 x y
 *   OPENCV_FISHEYE  t = atan r,  t' = t (1 + k1 t^2 + k2 t^4 + k3 t^6 + k4 t^8)
 *                   (x', y') = t' (x, y) / r
 *   THIN_PRISM_FISHEYE  (a, b) = t (x, y) / r,  s = 1 + k1 t^2 + k2 t^4 + k3 t^6 + k4 t^8
 *                   x' = s a + 2 p1 a b + p2 (t^2 + 2 a^2) + s1 t^2
 *                   y' = s b + 2 p2 a b + p1 (t^2 + 2 b^2) + s2 t^2
 *   FOV             r' = atan(2 r tan(w / 2)) / w,  (x', y') = r' (x, y) / r
 *   DIVISION        (x, y) = (x', y') / (1 + k1 r'^2), so that (x', y') = 2 (x, y) / (1 + sqrt(1 - 4 k1 r^2))
 *
 * with (x, y) = (X / Z, Y / Z). The Jacobian determinant is positive at the axis; where it stops being so, the picture
 * folds over. The radial part's fold is found once (camera_find_fold); the sign of the tangential and prism parts is
 * looked at point by point, since it costs nothing there. */
#include "server/scene/camera.h"

#include <math.h>

#define HALF_PI (0.5 * PI)
#define FOLD_STEPS 4096    /* of the march towards the fold */
#define FOV_MIN 1e-7       /* radians of FOV's angle; below it there is no distortion in single precision */
#define NEWTON_STEPS 50    /* at most, of lenses at which it does not converge */
#define NEWTON_PIXELS 1e-6 /* residual at which the inverse is taken as found */

bool camera_is_distorted(const struct camera *c) {
    float sum = fabsf(c->k8) + fabsf(c->p[0]) + fabsf(c->p[1]) + fabsf(c->s[0]) + fabsf(c->s[1]);
    for (int i = 0; i < 6; i++)
        sum += fabsf(c->k[i]);
    return sum != 0.0f;
}

/* Radial scale s and ds/d(r^2). */
static double radial(const struct camera *c, double r2, double *d_scale) {
    double k1 = (double)c->k[0], k2 = (double)c->k[1], k3 = (double)c->k[2];
    double k4 = (double)c->k[3], k5 = (double)c->k[4], k6 = (double)c->k[5];
    double k8 = (double)c->k8;
    double above = 1.0 + r2 * (k1 + r2 * (k2 + r2 * (k3 + r2 * k8)));
    double below = 1.0 + r2 * (k4 + r2 * (k5 + r2 * k6));
    double d_above = k1 + r2 * (2.0 * k2 + r2 * (3.0 * k3 + r2 * 4.0 * k8));
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

/* Distorted (x', y') and its Jacobian {dx'/dx, dx'/dy, dy'/dx, dy'/dy}. */
static void opencv(const struct camera *c, double x, double y, double out[2], double jacobian[4]) {
    double p1 = (double)c->p[0], p2 = (double)c->p[1], r2 = x * x + y * y, d_scale;
    double scale = radial(c, r2, &d_scale);
    out[0] = scale * x + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x);
    out[1] = scale * y + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y;
    jacobian[0] = scale + 2.0 * x * x * d_scale + 2.0 * p1 * y + 6.0 * p2 * x;
    jacobian[1] = jacobian[2] = 2.0 * x * y * d_scale + 2.0 * p1 * x + 2.0 * p2 * y;
    jacobian[3] = scale + 2.0 * y * y * d_scale + 6.0 * p1 * y + 2.0 * p2 * x;
}

/* The same of THIN_PRISM_FISHEYE, from (a, b). */
static void thin_prism(const struct camera *c, double a, double b, double out[2], double jacobian[4]) {
    double p1 = (double)c->p[0], p2 = (double)c->p[1], s1 = (double)c->s[0], s2 = (double)c->s[1];
    double t2 = a * a + b * b, scale = 1.0, d_scale = 0.0, power = 1.0; /* d_scale: by t^2 */
    for (int i = 0; i < 4; i++) {
        d_scale += (i + 1) * (double)c->k[i] * power;
        power *= t2;
        scale += (double)c->k[i] * power;
    }
    out[0] = scale * a + 2.0 * p1 * a * b + p2 * (t2 + 2.0 * a * a) + s1 * t2;
    out[1] = scale * b + 2.0 * p2 * a * b + p1 * (t2 + 2.0 * b * b) + s2 * t2;
    double mixed = 2.0 * a * b * d_scale + 2.0 * p1 * a + 2.0 * p2 * b;
    jacobian[0] = scale + 2.0 * a * a * d_scale + 2.0 * p1 * b + 6.0 * p2 * a + 2.0 * s1 * a;
    jacobian[1] = mixed + 2.0 * s1 * b;
    jacobian[2] = mixed + 2.0 * s2 * a;
    jacobian[3] = scale + 2.0 * b * b * d_scale + 2.0 * p2 * a + 6.0 * p1 * b + 2.0 * s2 * b;
}

static void distort(const struct camera *c, double x, double y, double out[2], double jacobian[4]) {
    (c->model == CAMERA_THIN_PRISM_FISHEYE ? thin_prism : opencv)(c, x, y, out, jacobian);
}

/* Whether the map keeps its orientation. */
static bool is_upright(const double jacobian[4]) {
    return jacobian[0] * jacobian[3] - jacobian[1] * jacobian[2] > 0.0 && jacobian[0] > 0.0;
}

static bool is_fisheye(const struct camera *c) {
    return c->model == CAMERA_OPENCV_FISHEYE || c->model == CAMERA_THIN_PRISM_FISHEYE;
}

/* Derivative of the distorted radius by the undistorted one, and that radius; not finite or not
 * positive where the model has broken down (a denominator that went through zero included). */
static double radial_growth(const struct camera *c, double r, double *distorted) {
    double derivative;
    if (is_fisheye(c)) {
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
    if (!camera_is_distorted(c) || c->model == CAMERA_FOV || c->model == CAMERA_DIVISION)
        return;
    /* March over the angle in even steps to just below 90 degrees. Twice the picture's corner leaves room for the
     * tangential part. */
    double dx = fmax(fabs((double)c->cx), fabs((double)c->width - (double)c->cx)) / (double)c->fx;
    double dy = fmax(fabs((double)c->cy), fabs((double)c->height - (double)c->cy)) / (double)c->fy;
    double reach = 2.0 * hypot(dx, dy), inside = 0.0, outside = 0.0, distorted;
    for (int i = 1; i < FOLD_STEPS; i++) {
        double angle = HALF_PI * i / FOLD_STEPS, r = is_fisheye(c) ? angle : tan(angle);
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
    float above = 1.0f + r2 * (k[0] + r2 * (k[1] + r2 * (k[2] + r2 * c->k8)));
    float below = 1.0f + r2 * (k[3] + r2 * (k[4] + r2 * k[5]));
    float scale = above / below;
    if (p1 != 0.0f || p2 != 0.0f) {
        double out[2], jacobian[4];
        opencv(c, (double)x, (double)y, out, jacobian);
        if (!is_upright(jacobian))
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

static bool project_thin_prism(const struct camera *c, float x, float y, float *u, float *v) {
    double r = hypot((double)x, (double)y), t = atan(r), scale = r > 1e-8 ? t / r : 1.0, out[2], jacobian[4];
    if (c->fold > 0.0f && !(t < (double)c->fold))
        return false;
    thin_prism(c, scale * (double)x, scale * (double)y, out, jacobian);
    *u = (float)out[0];
    *v = (float)out[1];
    return is_upright(jacobian);
}

static bool project_fov(const struct camera *c, float x, float y, float *u, float *v) {
    double r = hypot((double)x, (double)y), omega = (double)c->k[0], scale = 1.0;
    if (r > 1e-12 && fabs(omega) > FOV_MIN)
        scale = atan(2.0 * r * tan(0.5 * omega)) / (omega * r);
    else if (fabs(omega) > FOV_MIN)
        scale = 2.0 * tan(0.5 * omega) / omega;
    *u = (float)(scale * (double)x);
    *v = (float)(scale * (double)y);
    return true;
}

/* False beyond the radius that is the edge of the picture's plane, or its fold where k1 is positive. */
static bool project_division(const struct camera *c, float x, float y, float *u, float *v) {
    double root = 1.0 - 4.0 * (double)c->k[0] * ((double)x * (double)x + (double)y * (double)y);
    double scale = 2.0 / (1.0 + sqrt(fmax(root, 0.0)));
    *u = (float)(scale * (double)x);
    *v = (float)(scale * (double)y);
    return root > 0.0;
}

/* The lens, from the plane at distance 1 to the distorted one. */
static bool project_lens(const struct camera *c, float x, float y, float *u, float *v) {
    switch (c->model) {
    case CAMERA_OPENCV_FISHEYE: return project_fisheye(c, x, y, u, v);
    case CAMERA_THIN_PRISM_FISHEYE: return project_thin_prism(c, x, y, u, v);
    case CAMERA_FOV: return project_fov(c, x, y, u, v);
    case CAMERA_DIVISION: return project_division(c, x, y, u, v);
    case CAMERA_PANORAMA: /* see camera_project */
    case CAMERA_OPENCV: break;
    }
    return project_opencv(c, x, y, u, v);
}

/* The depth of a panorama is the distance. */
static bool project_panorama(const struct camera *c, vec3 p, float *x, float *y, float *depth_m) {
    double distance = sqrt((double)vec3_dot(p, p));
    if (!(distance > 0.0))
        return false;
    double around = 0.5 + atan2((double)p.x, (double)p.z) / (2.0 * PI), down = acos(-(double)p.y / distance) / PI;
    *x = fminf((float)(around * c->width), (float)c->width * 0x1.fffffep-1f);
    *y = fminf((float)(down * c->height), (float)c->height * 0x1.fffffep-1f);
    *depth_m = (float)distance;
    return true;
}

bool camera_project(const struct camera *c, vec3 point, float *x, float *y, float *depth_m) {
    vec3 p = rigid_point(&c->camera_from_world, point);
    if (c->model == CAMERA_PANORAMA)
        return project_panorama(c, p, x, y, depth_m);
    if (!(p.z > 0.0f))
        return false;
    float u, v;
    if (!project_lens(c, p.x / p.z, p.y / p.z, &u, &v))
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
static bool invert_plane(const struct camera *c, double *x, double *y) {
    double goal[2] = {*x, *y}, out[2], j[4];
    double fold = c->fold > 0.0f ? (double)c->fold : INFINITY;
    double scale = fmin(1.0, 0.99 * fold / fmax(hypot(*x, *y), 1e-30));
    *x *= scale;
    *y *= scale;
    distort(c, *x, *y, out, j);
    double tolerance = NEWTON_PIXELS / (double)fmaxf(fabsf(c->fx), fabsf(c->fy));
    double residual = hypot(out[0] - goal[0], out[1] - goal[1]);
    for (int i = 0; i < NEWTON_STEPS && residual > tolerance; i++) {
        double det = j[0] * j[3] - j[1] * j[2];
        if (!(fabs(det) > 1e-12))
            return false;
        double ex = out[0] - goal[0], ey = out[1] - goal[1];
        double sx = (j[3] * ex - j[1] * ey) / det, sy = (j[0] * ey - j[2] * ex) / det;
        double next_x, next_y, next_residual = INFINITY, length = 1.0;
        do {
            next_x = *x - length * sx;
            next_y = *y - length * sy;
            length *= 0.5;
            if (hypot(next_x, next_y) >= fold)
                continue;
            distort(c, next_x, next_y, out, j);
            next_residual = hypot(out[0] - goal[0], out[1] - goal[1]);
        } while (!(next_residual < residual) && length > 1e-6);
        if (!(next_residual < residual))
            return false;
        *x = next_x;
        *y = next_y;
        residual = next_residual;
    }
    return residual <= tolerance && is_upright(j);
}

/* As invert_plane, for the angle t of a distorted angle: safeguarded by bisection, since t'(t)
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

static bool invert_fov(const struct camera *c, double *x, double *y) {
    double bent = hypot(*x, *y), omega = (double)c->k[0], angle = bent * fabs(omega);
    if (!(fabs(omega) > FOV_MIN) || bent == 0.0)
        return true;
    if (!(angle < HALF_PI))
        return false;
    double scale = tan(angle) / (2.0 * tan(0.5 * fabs(omega)) * bent);
    *x *= scale;
    *y *= scale;
    return true;
}

static bool invert_division(const struct camera *c, double *x, double *y) {
    double bent = (double)c->k[0] * (*x * *x + *y * *y);
    if (!(bent > -1.0 && bent < 1.0)) /* the plane's edge, and the fold */
        return false;
    *x /= 1.0 + bent;
    *y /= 1.0 + bent;
    return true;
}

/* From the distorted plane to the direction (x, y, *z), of any length. */
static bool invert_lens(const struct camera *c, double *x, double *y, double *z) {
    *z = 1.0;
    if (c->model == CAMERA_FOV)
        return invert_fov(c, x, y);
    if (c->model == CAMERA_DIVISION)
        return invert_division(c, x, y);
    if (c->model == CAMERA_OPENCV)
        return !camera_is_distorted(c) || invert_plane(c, x, y);
    double bent = hypot(*x, *y), t = bent;
    if (c->model == CAMERA_THIN_PRISM_FISHEYE) {
        if (camera_is_distorted(c) && !invert_plane(c, x, y))
            return false;
        bent = t = hypot(*x, *y);
    } else if (!invert_fisheye(c, bent, &t)) {
        return false;
    }
    if (!(t < HALF_PI))
        return false;
    double scale = bent > 1e-12 ? sin(t) / bent : 1.0;
    *x *= scale;
    *y *= scale;
    *z = cos(t);
    return true;
}

static vec3 panorama_direction(const struct camera *c, float px, float py) {
    double around = 2.0 * PI * ((double)px / c->width - 0.5), down = PI * (double)py / c->height;
    vec3 local = {(float)(sin(down) * sin(around)), (float)-cos(down), (float)(sin(down) * cos(around))};
    return vec3_normalize(rigid_direction(&c->world_from_camera, local));
}

bool camera_direction(const struct camera *c, float px, float py, vec3 *direction) {
    if (c->model == CAMERA_PANORAMA) {
        *direction = panorama_direction(c, px, py);
        return vec3_is_finite(*direction);
    }
    double x = ((double)px - (double)c->cx) / (double)c->fx;
    double y = ((double)py - (double)c->cy) / (double)c->fy, z;
    if (!invert_lens(c, &x, &y, &z))
        return false;
    double length = sqrt(x * x + y * y + z * z);
    vec3 local = {(float)(x / length), (float)(y / length), (float)(z / length)};
    *direction = vec3_normalize(rigid_direction(&c->world_from_camera, local));
    return vec3_is_finite(*direction);
}
