/* bsdf.h -- the reflection model: the Disney principled subset of base colour, roughness and
 * specular (Burley 2012), as Mitsuba 3's `principled` evaluates it.
 *
 *   f(wo, wi) cos(wi) = base * diffuse(wo, wi) + specular(wo, wi)
 *
 *   diffuse:  Disney diffuse with retro-reflection, times the cosine
 *   specular: F D G / (4 cos(wo)); isotropic GGX, alpha = max(roughness^2, 0.001), separable
 *             Smith masking (Walter et al. 2007), dielectric Fresnel with
 *             eta = 2 / (1 - sqrt(0.08 specular)) - 1
 *
 * Directions are unit vectors in the shading frame, z = normal; wo points to the viewer and has
 * wo.z > 0, wi is where light comes from. Two-sidedness is the caller's choice of frame. All
 * functions are pure and branch-free where it matters, so that loops over them vectorise.
 *
 * Sampling mixes a cosine lobe and the distribution of visible GGX normals (Heitz 2018); the
 * choice and its density are ours, not Mitsuba's. */
#ifndef UNBAKE_RENDER_BSDF_H
#define UNBAKE_RENDER_BSDF_H

#include "common/vec.h"

#define BSDF_PI 3.14159265358979f
#define BSDF_MIN_ALPHA 1e-3f /* GGX width of the smoothest lobe, as Mitsuba 3 has it */

struct bsdf {
    rgb base_color;
    float roughness;
    float alpha;           /* GGX width */
    float eta;             /* index of refraction */
    float specular_chance; /* probability with which sampling takes the GGX lobe */
};

/* f cos = base * diffuse + specular, and the density of bsdf_sample. */
struct bsdf_value {
    float diffuse, specular;
    float pdf; /* by solid angle of wi */
};

/* bsdf_eval with its derivatives by the scalar parameters; `diffuse` is also the derivative of f cos by base colour,
 * per channel. */
struct bsdf_derivative {
    float diffuse, specular;
    float diffuse_by_roughness; /* times base_color */
    float specular_by_roughness;
    float specular_by_specular;
};

/* fmaxf without NaN handling, which prevents vectorisation. */
static inline float bsdf_max(float a, float b) { return a > b ? a : b; }

static inline float bsdf_eta(float specular) { return 2.0f / (1.0f - sqrtf(0.08f * specular)) - 1.0f; }

/* Schlick's weight (1 - c)^5. */
static inline float bsdf_schlick(float c) {
    float m = clampf(1.0f - c, 0.0f, 1.0f);
    float m2 = m * m;
    return m2 * m2 * m;
}

/* Dielectric Fresnel reflectance for the cosine c >= 0 outside, eta >= 1. */
static inline float bsdf_fresnel(float c, float eta) {
    float eta2 = eta * eta;
    float g = sqrtf(eta2 - 1.0f + c * c);
    float s = (c - g) / (c + g);
    float p = (eta2 * c - g) / (eta2 * c + g);
    return 0.5f * (s * s + p * p);
}

/* d bsdf_fresnel / d eta. */
static inline float bsdf_fresnel_by_eta(float c, float eta) {
    float eta2 = eta * eta;
    float g = sqrtf(eta2 - 1.0f + c * c), dg = eta / g;
    float s = (c - g) / (c + g), ds = -2.0f * c * dg / ((c + g) * (c + g));
    float m = eta2 * c + g;
    float p = (eta2 * c - g) / m, dp = 2.0f * eta * c * (2.0f * g - eta * dg) / (m * m);
    return s * ds + p * dp;
}

/* The probability of choosing a lobe follows estimates of its reflectance towards the viewer. The cosine lobe keeps a
 * share even where base colour is 0, since its derivative is not. */
static inline struct bsdf bsdf_make(rgb base_color, float roughness, float specular, float cos_wo) {
    struct bsdf b;
    b.base_color = base_color;
    b.roughness = roughness;
    b.alpha = bsdf_max(BSDF_MIN_ALPHA, roughness * roughness);
    b.eta = bsdf_eta(specular);
    float f0 = 0.08f * specular;
    float shiny = f0 > 0.0f ? f0 + (1.0f - f0) * bsdf_schlick(cos_wo) : 0.0f;
    float diffuse = bsdf_max(rgb_luminance(base_color), 0.1f);
    b.specular_chance = shiny / (shiny + diffuse);
    return b;
}

/* What the specular lobe of a metal reflects at the cosine c between the directions and the microfacet's normal:
 * Schlick 1994, as Mitsuba 3's `principled` has it. */
static inline rgb bsdf_metal_fresnel(rgb base_color, float c) {
    float w = bsdf_schlick(c);
    return (rgb){base_color.r + (1.0f - base_color.r) * w, base_color.g + (1.0f - base_color.g) * w,
                 base_color.b + (1.0f - base_color.b) * w};
}

/* bsdf_make of a surface of which a share is metal. For bsdf_eval's density and bsdf_sample; the values are those of
 * bsdf_metal. */
static inline struct bsdf bsdf_make_metal(rgb base_color, float roughness, float specular, float metallic,
                                          float cos_wo) {
    struct bsdf b = bsdf_make(base_color, roughness, specular, cos_wo);
    float metal = rgb_luminance(bsdf_metal_fresnel(base_color, cos_wo));
    float diffuse = bsdf_max(rgb_luminance(base_color), 0.1f) * (1.0f - metallic);
    float shiny = b.specular_chance / (1.0f - b.specular_chance) * bsdf_max(rgb_luminance(base_color), 0.1f);
    shiny = shiny + (metal - shiny) * metallic;
    b.specular_chance = shiny / bsdf_max(shiny + diffuse, 1e-6f);
    return b;
}

/* The specular lobe alone, without base; only this lobe is sampled. */
static inline struct bsdf bsdf_lobe(float roughness, float specular) {
    struct bsdf b = bsdf_make(rgb_gray(0.0f), roughness, specular, 1.0f);
    b.specular_chance = 1.0f;
    return b;
}

/* GGX terms shared by eval, pdf and derivatives; h need not be normalised. */
struct bsdf_ggx {
    float cos_d;          /* wo . h = wi . h */
    float d;              /* D(h) */
    float q;              /* (hx^2 + hy^2 + alpha^2 hz^2) / |h|^2 */
    float hz2;            /* hz^2 / |h|^2 */
    float root_o, root_i; /* sqrt(z^2 + alpha^2 (x^2 + y^2)) of wo, wi */
};

static inline struct bsdf_ggx bsdf_ggx(float alpha, vec3 wo, vec3 wi) {
    struct bsdf_ggx t;
    float hx = wo.x + wi.x, hy = wo.y + wi.y, hz = wo.z + wi.z;
    float xy = hx * hx + hy * hy, length2 = xy + hz * hz;
    float a2 = alpha * alpha, over = 1.0f / length2;
    t.cos_d = (wo.x * hx + wo.y * hy + wo.z * hz) * sqrtf(over);
    t.hz2 = hz * hz * over;
    t.q = xy * over + a2 * t.hz2;
    t.d = a2 / (BSDF_PI * t.q * t.q);
    t.root_o = sqrtf(wo.z * wo.z + a2 * (wo.x * wo.x + wo.y * wo.y));
    t.root_i = sqrtf(wi.z * wi.z + a2 * (wi.x * wi.x + wi.y * wi.y));
    return t;
}

static inline float bsdf_diffuse(float roughness, float cos_d, float cos_o, float cos_i) {
    float fo = bsdf_schlick(cos_o), fi = bsdf_schlick(cos_i);
    float rr = 2.0f * roughness * cos_d * cos_d;
    float lambert = (1.0f - 0.5f * fo) * (1.0f - 0.5f * fi);
    float retro = rr * (fo + fi + fo * fi * (rr - 1.0f));
    return cos_i * (1.0f / BSDF_PI) * (lambert + retro);
}

/* 0 for wi at or below the horizon. */
static inline struct bsdf_value bsdf_eval(const struct bsdf *b, vec3 wo, vec3 wi) {
    float cos_i = bsdf_max(wi.z, 1e-12f); /* keeps the arithmetic finite below the horizon */
    vec3 above = {wi.x, wi.y, cos_i};
    struct bsdf_ggx t = bsdf_ggx(b->alpha, wo, above);
    float f = bsdf_fresnel(t.cos_d, b->eta);
    float over_o = 1.0f / (wo.z + t.root_o);
    struct bsdf_value v;
    v.diffuse = bsdf_diffuse(b->roughness, t.cos_d, wo.z, cos_i);
    v.specular = f * t.d * cos_i * over_o / (cos_i + t.root_i);
    v.pdf = (1.0f - b->specular_chance) * cos_i * (1.0f / BSDF_PI) + b->specular_chance * 0.5f * t.d * over_o;
    float lit = wi.z > 0.0f ? 1.0f : 0.0f;
    v.diffuse *= lit;
    v.specular *= lit;
    v.pdf *= lit;
    return v;
}

/* f cos of a surface of which a share is metal: the rest is bsdf_eval's, f. */
static inline rgb bsdf_metal(const struct bsdf *b, struct bsdf_value f, float metallic, vec3 wo, vec3 wi) {
    float cos_i = bsdf_max(wi.z, 1e-12f), rest = 1.0f - metallic;
    struct bsdf_ggx t = bsdf_ggx(b->alpha, wo, (vec3){wi.x, wi.y, cos_i});
    float lobe = metallic * t.d * cos_i / ((wo.z + t.root_o) * (cos_i + t.root_i));
    lobe = wi.z > 0.0f ? lobe : 0.0f;
    rgb metal = bsdf_metal_fresnel(b->base_color, t.cos_d);
    return (rgb){rest * (b->base_color.r * f.diffuse + f.specular) + lobe * metal.r,
                 rest * (b->base_color.g * f.diffuse + f.specular) + lobe * metal.g,
                 rest * (b->base_color.b * f.diffuse + f.specular) + lobe * metal.b};
}

/* Derivatives of bsdf_eval; `specular` is the parameter that b was made from. As specular -> 0 the lobe goes to 0
 * linearly while d eta / d specular diverges: below 1e-4 the derivative at 1e-4 is used, within 0.3 % of the limit
 * except near grazing. Where roughness^2 < 0.001, alpha is constant. */
static inline struct bsdf_derivative bsdf_backward(const struct bsdf *b, float specular, vec3 wo, vec3 wi) {
    float cos_i = bsdf_max(wi.z, 1e-12f);
    vec3 above = {wi.x, wi.y, cos_i};
    float alpha = b->alpha;
    struct bsdf_ggx t = bsdf_ggx(alpha, wo, above);
    float fo = bsdf_schlick(wo.z), fi = bsdf_schlick(cos_i);
    float rr_by_roughness = 2.0f * t.cos_d * t.cos_d;
    float rr = b->roughness * rr_by_roughness;
    float lambert = (1.0f - 0.5f * fo) * (1.0f - 0.5f * fi);
    float over_pi = cos_i * (1.0f / BSDF_PI);
    struct bsdf_derivative d;
    d.diffuse = over_pi * (lambert + rr * (fo + fi + fo * fi * (rr - 1.0f)));
    d.diffuse_by_roughness = over_pi * rr_by_roughness * (fo + fi + fo * fi * (2.0f * rr - 1.0f));

    float sum_o = wo.z + t.root_o, sum_i = cos_i + t.root_i;
    float v = cos_i / (sum_o * sum_i);
    float log_d = 2.0f / alpha - 4.0f * alpha * t.hz2 / t.q;
    float log_v =
        -alpha * ((wo.x * wo.x + wo.y * wo.y) / (t.root_o * sum_o) + (wi.x * wi.x + wi.y * wi.y) / (t.root_i * sum_i));
    float dv = t.d * v;
    d.specular = bsdf_fresnel(t.cos_d, b->eta) * dv;
    float alpha_by_roughness = b->roughness * b->roughness > BSDF_MIN_ALPHA ? 2.0f * b->roughness : 0.0f;
    d.specular_by_roughness = d.specular * (log_d + log_v) * alpha_by_roughness;

    float x = sqrtf(0.08f * bsdf_max(specular, 1e-4f)), one = 1.0f - x;
    float eta = 2.0f / one - 1.0f, eta_by_specular = 2.0f / (one * one) * 0.04f / x;
    d.specular_by_specular = dv * bsdf_fresnel_by_eta(t.cos_d, eta) * eta_by_specular;

    float lit = wi.z > 0.0f ? 1.0f : 0.0f;
    d.diffuse *= lit;
    d.specular *= lit;
    d.diffuse_by_roughness *= lit;
    d.specular_by_roughness *= lit;
    d.specular_by_specular *= lit;
    return d;
}

/* Unit vector at angle 2 pi u for u in [0, 1): polynomials over a quarter turn, accurate to 2e-7, without a call,
 * which would prevent vectorisation. */
static inline vec2 bsdf_circle(float u) {
    int quarter = (int)(4.0f * u + 0.5f);
    float x = (4.0f * u - (float)quarter) * (0.5f * BSDF_PI); /* in [-pi/4, pi/4] */
    float x2 = x * x;
    float s = x * (1.0f + x2 * (-1.6666667e-1f + x2 * (8.3333310e-3f + x2 * -1.9840874e-4f)));
    float c = 1.0f + x2 * (-0.5f + x2 * (4.1666645e-2f + x2 * (-1.3887316e-3f + x2 * 2.4433157e-5f)));
    bool odd = (quarter & 1) != 0;
    float sign = (quarter & 2) != 0 ? -1.0f : 1.0f;
    float cosine = odd ? -s : c, sine = odd ? c : s;
    return (vec2){sign * cosine, sign * sine};
}

/* Samples a direction for uniform numbers in [0, 1): `lobe` chooses the lobe, (u, v) the direction. It may lie below
 * the horizon (sampled microfacet facing away); such a sample has value 0. */
static inline vec3 bsdf_sample(const struct bsdf *b, vec3 wo, float lobe, float u, float v) {
    /* Both lobes start from a point in the unit disk. */
    vec2 circle = bsdf_circle(u);
    float r = sqrtf(v);
    float x = r * circle.x, y = r * circle.y;
    float z2 = bsdf_max(0.0f, 1.0f - x * x - y * y);
    vec3 cosine = {x, y, sqrtf(z2)};

    /* Visible normals (Heitz 2018): wo stretched to the unit hemisphere's configuration. */
    float a = b->alpha;
    vec3 stretched =
        vec3_scale((vec3){a * wo.x, a * wo.y, wo.z}, 1.0f / sqrtf(a * a * (wo.x * wo.x + wo.y * wo.y) + wo.z * wo.z));
    float across2 = stretched.x * stretched.x + stretched.y * stretched.y;
    float over = across2 > 1e-14f ? 1.0f / sqrtf(bsdf_max(across2, 1e-14f)) : 0.0f;
    vec3 t1 = {over > 0.0f ? -stretched.y * over : 1.0f, stretched.x * over, 0.0f};
    vec3 t2 = vec3_cross(stretched, t1);
    float s = 0.5f * (1.0f + stretched.z);
    float p = (1.0f - s) * sqrtf(bsdf_max(0.0f, 1.0f - x * x)) + s * y;
    float up = sqrtf(bsdf_max(0.0f, 1.0f - x * x - p * p));
    vec3 n = vec3_mad(vec3_mad(vec3_scale(t1, x), p, t2), up, stretched);
    vec3 h = {a * n.x, a * n.y, bsdf_max(0.0f, n.z)};
    h = vec3_scale(h, 1.0f / sqrtf(bsdf_max(vec3_dot(h, h), 1e-30f)));
    vec3 mirror = vec3_mad(vec3_neg(wo), 2.0f * vec3_dot(wo, h), h);

    bool shiny = lobe < b->specular_chance;
    return (vec3){shiny ? mirror.x : cosine.x, shiny ? mirror.y : cosine.y, shiny ? mirror.z : cosine.z};
}

#endif
