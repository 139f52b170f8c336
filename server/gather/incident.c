/* incident.c -- see incident.h. */
#include "server/gather/incident.h"

#include <assert.h>
#include <math.h>
#include <string.h>

#include "server/render/bsdf.h"
#include "server/render/light.h"
#include "server/render/sampler.h"
#include "server/scene/rgb_half.h"

enum { PAIR_WAY, PAIR_PICK, PAIR_LIGHT, PAIR_BACK = 32 };
#define BACKS 4 /* one after the other that a ray goes on from */
/* A place is inside a body when all of so many rays meet a back, asked a few at a time. */
#define ENCLOSED_RAYS 32
#define ENCLOSED_STEP 4

/* Where in the texture a hit is, texels. */
static vec2 place_at(const struct world *world, const struct accel_hit *hit) {
    const vec2 *c = world->triangle[hit->triangle].corner;
    float b0 = 1.0f - hit->b1 - hit->b2;
    return (vec2){b0 * c[0].x + hit->b1 * c[1].x + hit->b2 * c[2].x,
                  b0 * c[0].y + hit->b1 * c[1].y + hit->b2 * c[2].y};
}

/* The texel there. */
static size_t texel_at(const struct world *world, const struct accel_hit *hit) {
    vec2 at = place_at(world, hit);
    uint32_t width = world->atlas->width, height = world->atlas->height;
    uint32_t column = at.x > 0.0f ? (uint32_t)at.x : 0, row = at.y > 0.0f ? (uint32_t)at.y : 0;
    column = column < width ? column : width - 1;
    row = row < height ? row : height - 1;
    return (size_t)row * width + column;
}

/* What the field shows at a hit of a front, and the density of the light sampler there. */
static rgb look_at(const struct light_field *field, const struct accel_hit *hit, float facing, float *light_pdf) {
    const struct world *world = field->world;
    const struct world_triangle *t = &world->triangle[hit->triangle];
    *light_pdf = 0.0f;
    if (world->lights->area_density[t->segment] > 0.0f) {
        *light_pdf = lights_pdf_segment(world->lights, t->segment, hit->distance_m, facing);
        vec2 at = place_at(world, hit);
        return materials_emission(world->materials, t->segment, at.x, at.y);
    }
    return rgb_from_half(field->radiance[texel_at(world, hit)]);
}

/* The ray that goes on from a back, by its cosine. */
static struct accel_ray ray_behind(const struct world_triangle *t, const struct accel_ray *ray, float distance_m,
                                   vec2 u) {
    vec3 frame[3] = {[2] = vec3_neg(t->normal)};
    vec3_frame(frame[2], &frame[0], &frame[1]);
    vec3 p = vec3_mad(ray->origin, distance_m, ray->direction);
    p = vec3_mad(p, t->plane - vec3_dot(t->normal, p), t->normal);
    vec3 direction = incident_cosine_direction(frame, u);
    return (struct accel_ray){accel_offset(p, frame[2], direction), 0.0f, direction, INFINITY};
}

/* Takes what rays 0..count found, ray k being that of back[k]; those that met a back go on, from the first places of
 * in->ray and in->back. Returns how many. The densities are those of the light sampler at back[k].index. */
static size_t take_hits(struct incident *in, const struct light_field *field, size_t count, uint32_t key,
                        uint32_t first_sample, uint32_t backs) {
    const struct world *world = field->world;
    size_t going = 0;
    for (size_t k = 0; k < count; k++) {
        struct accel_ray ray = in->ray[k];
        struct accel_hit hit = in->hit[k];
        struct incident_back from = in->back[k];
        float light_pdf;
        rgb found;
        if (hit.triangle == ACCEL_NONE) {
            found = lights_environment(world->lights, ray.direction);
            light_pdf = lights_pdf_environment(world->lights, ray.direction);
        } else {
            const struct world_triangle *t = &world->triangle[hit.triangle];
            float facing = -vec3_dot(t->normal, ray.direction);
            if (!(facing > 0.0f)) {
                const float *base = world->materials->base_color.texel[texel_at(world, &hit)];
                vec2 u = sampler_pair(key, first_sample + from.index, PAIR_BACK + backs);
                in->ray[going] = ray_behind(t, &ray, hit.distance_m, u);
                in->back[going++] = (struct incident_back){
                    from.index, rgb_mul(from.weight, rgb_make(base[0], base[1], base[2]))};
                continue;
            }
            found = look_at(field, &hit, facing, &light_pdf);
        }
        in->radiance[from.index] = rgb_mul(from.weight, found);
        if (backs == 0) {
            in->light_pdf[from.index] = light_pdf;
            in->leaves[from.index] = hit.triangle == ACCEL_NONE;
        }
    }
    return going;
}

void incident_trace(struct incident *in, const struct light_field *field,
                    const struct surface_point *at, uint32_t key, uint32_t first_sample, size_t count) {
    for (size_t i = 0; i < count; i++) {
        in->ray[i] = (struct accel_ray){accel_offset(at->position, at->normal, in->direction[i]), 0.0f,
                                        in->direction[i], INFINITY};
        in->back[i] = (struct incident_back){(uint32_t)i, rgb_gray(1.0f)};
        in->radiance[i] = rgb_gray(0.0f);
        in->light_pdf[i] = 0.0f;
        in->leaves[i] = false;
    }
    for (uint32_t backs = 0; backs <= BACKS && count > 0; backs++) {
        accel_intersect_many(field->world->accel, count, in->ray, in->hit);
        count = take_hits(in, field, count, key, first_sample, backs);
    }
}

void incident_sample_lights(struct incident *in, const struct light_field *field,
                            const struct surface_point *at, uint32_t key, uint32_t first_sample,
                            size_t from, size_t count) {
    const struct world *world = field->world;
    for (size_t i = 0; i < count; i++) {
        uint32_t sample = first_sample + (uint32_t)i;
        vec2 pick = sampler_pair(key, sample, PAIR_PICK), place = sampler_pair(key, sample, PAIR_LIGHT);
        struct light_sample light = {.pdf = 0.0f};
        lights_sample(world->lights, at->position, pick.x, place.x, place.y, &light);
        bool any = light.pdf > 0.0f;
        in->direction[from + i] = any ? light.direction : at->normal;
        in->light_pdf[from + i] = light.pdf;
        in->radiance[from + i] = any ? light.radiance : rgb_gray(0.0f);
        vec3 origin = accel_offset(at->position, at->normal, in->direction[from + i]);
        float far_m = any ? light.distance_m : 0.0f;
        vec3 direction = in->direction[from + i];
        if (any && light.segment != LIGHT_ENVIRONMENT) {
            vec3 on = accel_offset(light.point, light.normal, vec3_neg(direction));
            vec3 ray = vec3_sub(on, origin);
            far_m = vec3_length(ray);
            direction = vec3_scale(ray, 1.0f / fmaxf(far_m, 1e-20f));
        }
        in->ray[i] = (struct accel_ray){origin, 0.0f, direction, far_m};
    }
    accel_occluded_many(world->accel, count, in->ray, in->occluded);
    for (size_t i = 0; i < count; i++) {
        if (in->occluded[i])
            in->radiance[from + i] = rgb_gray(0.0f);
    }
}

/* The weights of the moments for light from w at cosine c. */
static void moment_basis(vec3 w, float c, float basis[IRRADIANCE_MOMENTS]) {
    float f = c * bsdf_schlick(c);
    const float value[IRRADIANCE_MOMENTS] = {
        c,          c * w.x,       c * w.y,       c * w.z,       f,             f * w.x,       f * w.y,
        f * w.z,    f * w.x * w.x, f * w.y * w.y, f * w.z * w.z, f * w.x * w.y, f * w.x * w.z, f * w.y * w.z};
    memcpy(basis, value, sizeof value);
}

vec3 incident_cosine_direction(const vec3 frame[3], vec2 u) {
    vec2 circle = bsdf_circle(u.x);
    float r = sqrtf(u.y);
    vec3 d = vec3_scale(frame[2], sqrtf(fmaxf(0.0f, 1.0f - u.y)));
    d = vec3_mad(d, r * circle.x, frame[0]);
    return vec3_mad(d, r * circle.y, frame[1]);
}

/* Whether a place is inside a body, where no light comes and from where none gets out. Going on from back to back there
 * costs many rays, and what is once taken for light among them never fades. */
static bool is_enclosed(struct incident *in, const struct light_field *field, const struct surface_point *at,
                        const vec3 frame[3], uint32_t key) {
    const struct world *world = field->world;
    for (uint32_t first = 0; first < ENCLOSED_RAYS; first += ENCLOSED_STEP) {
        for (uint32_t i = 0; i < ENCLOSED_STEP; i++) {
            vec3 direction = incident_cosine_direction(frame, sampler_pair(key, first + i, PAIR_WAY));
            in->ray[i] = (struct accel_ray){accel_offset(at->position, at->normal, direction), 0.0f, direction, INFINITY};
        }
        accel_intersect_many(world->accel, ENCLOSED_STEP, in->ray, in->hit);
        for (uint32_t i = 0; i < ENCLOSED_STEP; i++) {
            uint32_t met = in->hit[i].triangle;
            if (met == ACCEL_NONE || vec3_dot(world->triangle[met].normal, in->ray[i].direction) < 0.0f)
                return false;
        }
    }
    return true;
}

void irradiance_gather(struct irradiance *irradiance, struct incident *in,
                       const struct light_field *field, const struct surface_point *at, uint32_t key,
                       size_t samples) {
    const size_t ways_a_chunk = INCIDENT_CHUNK * 2 / 3;
    vec3 frame[3];
    frame[2] = at->shading;
    vec3_frame(at->shading, &frame[0], &frame[1]);
    if (is_enclosed(in, field, at, frame, key)) {
        *irradiance = (struct irradiance){0};
        return;
    }
    size_t light_samples = lights_any(field->world->lights) ? samples / 2 : 0;
    double sum[IRRADIANCE_MOMENTS][3] = {{0}};
    rgb noise = {0.0f, 0.0f, 0.0f};
    size_t lights_done = 0;
    for (size_t done = 0; done < samples; done += ways_a_chunk) {
        size_t ways = samples - done < ways_a_chunk ? samples - done : ways_a_chunk;
        size_t lit = light_samples * (done + ways) / samples - lights_done;
        for (size_t i = 0; i < ways; i++)
            in->direction[i] = incident_cosine_direction(frame, sampler_pair(key, (uint32_t)(done + i), PAIR_WAY));
        incident_trace(in, field, at, key, (uint32_t)done, ways);
        incident_sample_lights(in, field, at, key, (uint32_t)lights_done, ways, lit);
        float chunk[IRRADIANCE_MOMENTS][3] = {{0}};
        for (size_t i = 0; i < ways + lit; i++) {
            float c = vec3_dot(in->direction[i], at->shading);
            if (!(c > 0.0f))
                continue;
            float density = (float)samples * c * (1.0f / BSDF_PI) + (float)light_samples * in->light_pdf[i];
            float basis[IRRADIANCE_MOMENTS];
            moment_basis(in->direction[i], c, basis);
            rgb l = rgb_scale(in->radiance[i], 1.0f / density);
            bool early = i < ways ? done + i < samples / 2 : lights_done + i - ways < light_samples / 2;
            noise = rgb_mad(noise, early ? c : -c, l);
            for (int m = 0; m < IRRADIANCE_MOMENTS; m++) {
                chunk[m][0] += basis[m] * l.r;
                chunk[m][1] += basis[m] * l.g;
                chunk[m][2] += basis[m] * l.b;
            }
        }
        for (int m = 0; m < IRRADIANCE_MOMENTS; m++)
            for (int c = 0; c < 3; c++)
                sum[m][c] += (double)chunk[m][c];
        lights_done += lit;
    }
    irradiance->noise = noise;
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

/* The moments of a channel along d: of m = w . d, F m and F m^2. */
struct along {
    float m, fm, fmm;
};

static struct along along(const float (*q)[3], vec3 d, int c) {
    return (struct along){
        q[1][c] * d.x + q[2][c] * d.y + q[3][c] * d.z,
        q[5][c] * d.x + q[6][c] * d.y + q[7][c] * d.z,
        q[8][c] * d.x * d.x + q[9][c] * d.y * d.y + q[10][c] * d.z * d.z +
            2.0f * (q[11][c] * d.x * d.y + q[12][c] * d.x * d.z + q[13][c] * d.y * d.z)};
}

/* bsdf_diffuse written out by powers of F(wi) and m = wi . wo: with cos_d^2 = (1 + m) / 2, its
 * rr is roughness (1 + m). */
rgb irradiance_diffuse(const struct irradiance *irradiance, vec3 shading, float roughness, vec3 wo) {
    const float(*q)[3] = irradiance->moment;
    float fo = bsdf_schlick(fmaxf(vec3_dot(shading, wo), 0.0f)), r = roughness;
    float lambert = 1.0f - 0.5f * fo;
    /* Factors of 1 and m without F(wi), then of 1, m and m^2 with it. */
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

/* The terms of irradiance_diffuse under a viewer's density cos / pi, in which 1, wo, F(wo), F(wo) wo have means
 * 1, 2/3 n, 1/21, 1/84 n, and F(wo) wo wo^T is 1/252 along n and 11/504 across it. */
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
