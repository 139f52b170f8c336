/* irradiance.c -- see irradiance.h. */
#include "server/gather/irradiance.h"

#include <math.h>
#include <string.h>

#include "server/render/bsdf.h"
#include "server/render/light.h"
#include "server/render/sampler.h"

enum { PAIR_DIRECTION }; /* sample dimension, before those of incident.c */
/* A point is inside a closed body when all of these rays meet a back; traced in batches, most points end with the
 * first. A point that sees the outside through 10 % of its sphere is taken for enclosed in one case of 30. */
#define ENCLOSED_RAYS 32 /* +25 %: 0 dB */
#define ENCLOSED_BATCH 4

/* Integrands of the moments for light from direction w at cosine c. */
static void moment_basis(vec3 w, float c, float basis[IRRADIANCE_MOMENTS]) {
    float f = c * bsdf_schlick(c);
    const float value[IRRADIANCE_MOMENTS] = {c,
                                             c * w.x,
                                             c * w.y,
                                             c * w.z,
                                             f,
                                             f * w.x,
                                             f * w.y,
                                             f * w.z,
                                             f * w.x * w.x,
                                             f * w.y * w.y,
                                             f * w.z * w.z,
                                             f * w.x * w.y,
                                             f * w.x * w.z,
                                             f * w.y * w.z};
    memcpy(basis, value, sizeof value);
}

/* Whether a point is inside a closed body, where no light arrives. Rays continued from back to back are costly there,
 * and radiance once attributed to such texels would never decay. */
static bool is_enclosed(struct incident *in, const struct light_field *field, const struct surface_point *at,
                        const vec3 frame[3], uint32_t key) {
    const struct world *world = field->world;
    for (uint32_t first = 0; first < ENCLOSED_RAYS; first += ENCLOSED_BATCH) {
        for (uint32_t i = 0; i < ENCLOSED_BATCH; i++) {
            vec3 direction = incident_cosine_direction(frame, sampler_pair(key, first + i, PAIR_DIRECTION));
            in->ray[i] =
                (struct accel_ray){accel_offset(at->position, at->normal, direction), 0.0f, direction, INFINITY};
        }
        accel_intersect_many(world->accel, ENCLOSED_BATCH, in->ray, in->hit);
        for (uint32_t i = 0; i < ENCLOSED_BATCH; i++) {
            uint32_t hit_triangle = in->hit[i].triangle;
            if (hit_triangle == ACCEL_NONE ||
                vec3_dot(world->triangle[hit_triangle].normal, in->ray[i].direction) < 0.0f)
                return false;
        }
    }
    return true;
}

/* The samples of a point, and those of them that are traced at once. */
struct irradiance_samples {
    size_t rays, lights;           /* of the point, in all */
    size_t rays_done, lights_done; /* in batches before this */
    size_t ray_count, light_count; /* in this one: rays first, then lights */
};

static void start_batch(struct irradiance_samples *s) {
    const size_t most = INCIDENT_CHUNK * 2 / 3; /* with half as many lights */
    s->ray_count = s->rays - s->rays_done < most ? s->rays - s->rays_done : most;
    s->light_count = s->lights * (s->rays_done + s->ray_count) / s->rays - s->lights_done;
}

/* Whether the i-th of the batch is in the first half of the rays or lights of the point. */
static bool is_early(const struct irradiance_samples *s, size_t i) {
    return i < s->ray_count ? s->rays_done + i < s->rays / 2 : s->lights_done + i - s->ray_count < s->lights / 2;
}

/* Adds the radiance of a batch to the moments, weighted by the balance heuristic over rays and lights, and to the
 * difference of the two halves. */
static void add_batch(const struct irradiance_samples *s, const struct incident *in, vec3 shading,
                      double sum[IRRADIANCE_MOMENTS][3], rgb *noise) {
    float batch[IRRADIANCE_MOMENTS][3] = {{0}};
    for (size_t i = 0; i < s->ray_count + s->light_count; i++) {
        float c = vec3_dot(in->direction[i], shading);
        if (!(c > 0.0f))
            continue;
        float density = (float)s->rays * c * (1.0f / BSDF_PI) + (float)s->lights * in->light_pdf[i];
        float basis[IRRADIANCE_MOMENTS];
        moment_basis(in->direction[i], c, basis);
        rgb l = rgb_scale(in->radiance[i], 1.0f / density);
        *noise = rgb_mad(*noise, is_early(s, i) ? c : -c, l);
        for (int m = 0; m < IRRADIANCE_MOMENTS; m++) {
            batch[m][0] += basis[m] * l.r;
            batch[m][1] += basis[m] * l.g;
            batch[m][2] += basis[m] * l.b;
        }
    }
    for (int m = 0; m < IRRADIANCE_MOMENTS; m++)
        for (int c = 0; c < 3; c++)
            sum[m][c] += (double)batch[m][c];
}

void irradiance_gather(struct irradiance *irradiance, struct incident *in, const struct light_field *field,
                       const struct surface_point *at, uint32_t key, size_t samples) {
    vec3 frame[3];
    frame[2] = at->shading;
    vec3_frame(at->shading, &frame[0], &frame[1]);
    *irradiance = (struct irradiance){0};
    if (is_enclosed(in, field, at, frame, key))
        return;
    struct irradiance_samples s = {.rays = samples, .lights = lights_any(field->world->lights) ? samples / 2 : 0};
    double sum[IRRADIANCE_MOMENTS][3] = {{0}};
    for (; s.rays_done < samples; s.rays_done += s.ray_count, s.lights_done += s.light_count) {
        start_batch(&s);
        for (size_t i = 0; i < s.ray_count; i++)
            in->direction[i] =
                incident_cosine_direction(frame, sampler_pair(key, (uint32_t)(s.rays_done + i), PAIR_DIRECTION));
        incident_trace(in, field, at, key, (uint32_t)s.rays_done, s.ray_count);
        incident_sample_lights(in, field, at, key, (uint32_t)s.lights_done, s.ray_count, s.light_count);
        add_batch(&s, in, at->shading, sum, &irradiance->noise);
    }
    for (int m = 0; m < IRRADIANCE_MOMENTS; m++)
        for (int c = 0; c < 3; c++)
            irradiance->moment[m][c] = (float)sum[m][c];
}

void irradiance_add(struct irradiance *irradiance, vec3 shading, vec3 direction, rgb flux) {
    float basis[IRRADIANCE_MOMENTS], c = vec3_dot(direction, shading);
    if (!(c > 0.0f))
        return;
    moment_basis(direction, c, basis);
    for (int m = 0; m < IRRADIANCE_MOMENTS; m++) {
        irradiance->moment[m][0] += basis[m] * flux.r;
        irradiance->moment[m][1] += basis[m] * flux.g;
        irradiance->moment[m][2] += basis[m] * flux.b;
    }
}

/* The moments of a channel contracted with d: m = w . d, F m and F m^2. */
struct along {
    float m, fm, fmm;
};

static struct along along(const float (*q)[3], vec3 d, int c) {
    return (struct along){q[1][c] * d.x + q[2][c] * d.y + q[3][c] * d.z, q[5][c] * d.x + q[6][c] * d.y + q[7][c] * d.z,
                          q[8][c] * d.x * d.x + q[9][c] * d.y * d.y + q[10][c] * d.z * d.z +
                              2.0f * (q[11][c] * d.x * d.y + q[12][c] * d.x * d.z + q[13][c] * d.y * d.z)};
}

/* bsdf_diffuse written out by powers of F(wi) and m = wi . wo: with cos_d^2 = (1 + m) / 2, its
 * rr is roughness (1 + m). */
rgb irradiance_diffuse(const struct irradiance *irradiance, vec3 shading, float roughness, vec3 wo) {
    const float(*q)[3] = irradiance->moment;
    float fo = bsdf_schlick(fmaxf(vec3_dot(shading, wo), 0.0f)), r = roughness;
    float lambert = 1.0f - 0.5f * fo;
    /* Coefficients of 1 and m without F(wi), then of 1, m and m^2 with it. */
    float one = lambert + r * fo, m1 = r * fo;
    float f0 = -0.5f * lambert + r * (1.0f - fo) + r * r * fo;
    float f1 = r * (1.0f - fo) + 2.0f * r * r * fo, f2 = r * r * fo;
    float out[3];
    for (int c = 0; c < 3; c++) {
        struct along a = along(q, wo, c);
        out[c] = fmaxf(0.0f, (one * q[0][c] + m1 * a.m + f0 * q[4][c] + f1 * a.fm + f2 * a.fmm) * (1.0f / BSDF_PI));
    }
    return rgb_make(out[0], out[1], out[2]);
}

/* irradiance_diffuse with F(wo) = 0 and m = c. */
float irradiance_matt(float cosine) { return 1.0f + bsdf_schlick(cosine) * (0.5f + cosine); }

/* The terms of irradiance_diffuse averaged over view directions of density cos / pi, under which 1, wo, F(wo), F(wo) wo
 * have means 1, 2/3 n, 1/21, 1/84 n, and F(wo) wo wo^T is 1/252 along n and 11/504 across it. */
rgb irradiance_diffuse_mean(const struct irradiance *irradiance, vec3 shading, float roughness) {
    const float(*q)[3] = irradiance->moment;
    const vec3 n = shading;
    float r = roughness, off = r - 0.5f;
    float one = 1.0f + off * (1.0f / 21.0f), m1 = r * (1.0f / 84.0f);
    float f0 = off + off * off * (1.0f / 21.0f), f1 = r * (2.0f / 3.0f) + 2.0f * r * off * (1.0f / 84.0f);
    float sideways = r * r * (11.0f / 504.0f), upwards = r * r * (1.0f / 252.0f);
    float out[3];
    for (int c = 0; c < 3; c++) {
        struct along a = along(q, n, c);
        float f2 = sideways * (q[4][c] - a.fmm) + upwards * a.fmm;
        out[c] = fmaxf(0.0f, (one * q[0][c] + m1 * a.m + f0 * q[4][c] + f1 * a.fm + f2) * (1.0f / BSDF_PI));
    }
    return rgb_make(out[0], out[1], out[2]);
}
