/* vec.h -- small by-value vectors and colours in single precision. */
#ifndef UNBAKE_COMMON_VEC_H
#define UNBAKE_COMMON_VEC_H

#include <math.h>
#include <stdbool.h>

#define PI 3.14159265358979323846

typedef struct vec2 {
    float x, y;
} vec2;
typedef struct vec3 {
    float x, y, z;
} vec3;
/* Linear Rec. 709 colour: radiance, reflectance or throughput. */
typedef struct rgb {
    float r, g, b;
} rgb;

static inline vec2 vec2_make(float x, float y) { return (vec2){x, y}; }
static inline vec2 vec2_add(vec2 a, vec2 b) { return (vec2){a.x + b.x, a.y + b.y}; }
static inline vec2 vec2_sub(vec2 a, vec2 b) { return (vec2){a.x - b.x, a.y - b.y}; }
static inline vec2 vec2_scale(vec2 a, float s) { return (vec2){a.x * s, a.y * s}; }

static inline vec3 vec3_make(float x, float y, float z) { return (vec3){x, y, z}; }
static inline vec3 vec3_add(vec3 a, vec3 b) { return (vec3){a.x + b.x, a.y + b.y, a.z + b.z}; }
static inline vec3 vec3_sub(vec3 a, vec3 b) { return (vec3){a.x - b.x, a.y - b.y, a.z - b.z}; }
static inline vec3 vec3_scale(vec3 a, float s) { return (vec3){a.x * s, a.y * s, a.z * s}; }
static inline vec3 vec3_neg(vec3 a) { return (vec3){-a.x, -a.y, -a.z}; }
/* a + s * b */
static inline vec3 vec3_mad(vec3 a, float s, vec3 b) { return (vec3){a.x + s * b.x, a.y + s * b.y, a.z + s * b.z}; }
static inline float vec3_dot(vec3 a, vec3 b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
static inline vec3 vec3_cross(vec3 a, vec3 b) {
    return (vec3){a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
static inline float vec3_length(vec3 a) { return sqrtf(vec3_dot(a, a)); }
/* The zero vector stays zero. */
static inline vec3 vec3_normalize(vec3 a) {
    float length = vec3_length(a);
    return length > 0.0f ? vec3_scale(a, 1.0f / length) : a;
}
static inline bool vec3_is_finite(vec3 a) { return isfinite(a.x) && isfinite(a.y) && isfinite(a.z); }

static inline float clampf(float v, float lo, float hi) { return v < lo ? lo : v > hi ? hi : v; }

static inline rgb rgb_make(float r, float g, float b) { return (rgb){r, g, b}; }
static inline rgb rgb_gray(float v) { return (rgb){v, v, v}; }
static inline rgb rgb_add(rgb a, rgb b) { return (rgb){a.r + b.r, a.g + b.g, a.b + b.b}; }
static inline rgb rgb_sub(rgb a, rgb b) { return (rgb){a.r - b.r, a.g - b.g, a.b - b.b}; }
static inline rgb rgb_mul(rgb a, rgb b) { return (rgb){a.r * b.r, a.g * b.g, a.b * b.b}; }
static inline rgb rgb_scale(rgb a, float s) { return (rgb){a.r * s, a.g * s, a.b * s}; }
/* a + s * b */
static inline rgb rgb_mad(rgb a, float s, rgb b) { return (rgb){a.r + s * b.r, a.g + s * b.g, a.b + s * b.b}; }
static inline rgb rgb_clamp(rgb a, float low, float high) {
    return (rgb){clampf(a.r, low, high), clampf(a.g, low, high), clampf(a.b, low, high)};
}
static inline float rgb_dot(rgb a, rgb b) { return a.r * b.r + a.g * b.g + a.b * b.b; }
static inline float rgb_max(rgb a) { return fmaxf(a.r, fmaxf(a.g, a.b)); }
static inline float rgb_mean(rgb a) { return (a.r + a.g + a.b) * (1.0f / 3.0f); }
/* Relative luminance (Rec. 709). */
static inline float rgb_luminance(rgb a) { return 0.2126f * a.r + 0.7152f * a.g + 0.0722f * a.b; }
static inline bool rgb_is_finite(rgb a) { return isfinite(a.r) && isfinite(a.g) && isfinite(a.b); }
static inline bool rgb_is_black(rgb a) { return a.r == 0.0f && a.g == 0.0f && a.b == 0.0f; }

/* An orthonormal frame around unit n (Duff et al. 2017). */
static inline void vec3_frame(vec3 n, vec3 *s, vec3 *t) {
    float sign = copysignf(1.0f, n.z);
    float a = -1.0f / (sign + n.z);
    float b = n.x * n.y * a;
    *s = (vec3){1.0f + sign * n.x * n.x * a, sign * b, -sign * n.x};
    *t = (vec3){b, sign + n.y * n.y * a, -n.y};
}

/* Between the world and an orthonormal frame. */
static inline vec3 vec3_to_frame(const vec3 frame[3], vec3 d) {
    return vec3_make(vec3_dot(frame[0], d), vec3_dot(frame[1], d), vec3_dot(frame[2], d));
}
static inline vec3 vec3_from_frame(const vec3 frame[3], vec3 d) {
    return vec3_mad(vec3_mad(vec3_scale(frame[0], d.x), d.y, frame[1]), d.z, frame[2]);
}

/* A rigid motion: y = rotation * x + translation, rows of the rotation first. */
struct rigid {
    float rotation[3][3];
    vec3 translation;
};

static inline vec3 rigid_direction(const struct rigid *m, vec3 v) {
    return (vec3){
        m->rotation[0][0] * v.x + m->rotation[0][1] * v.y + m->rotation[0][2] * v.z,
        m->rotation[1][0] * v.x + m->rotation[1][1] * v.y + m->rotation[1][2] * v.z,
        m->rotation[2][0] * v.x + m->rotation[2][1] * v.y + m->rotation[2][2] * v.z,
    };
}
static inline vec3 rigid_point(const struct rigid *m, vec3 p) {
    return vec3_add(rigid_direction(m, p), m->translation);
}
static inline struct rigid rigid_inverse(const struct rigid *m) {
    struct rigid r;
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            r.rotation[i][j] = m->rotation[j][i];
    r.translation = (vec3){0.0f, 0.0f, 0.0f};
    r.translation = vec3_neg(rigid_direction(&r, m->translation));
    return r;
}

#endif
