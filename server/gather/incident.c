/* incident.c -- see incident.h. */
#include "server/gather/incident.h"

#include <math.h>

#include "server/render/bsdf.h"
#include "server/render/light.h"
#include "server/render/sampler.h"
#include "server/scene/rgb_half.h"

/* Sample dimensions; 0 is that of irradiance.c, those of highlight.c begin at 8. */
enum {
    PAIR_PICK = 1,
    PAIR_LIGHT,
    PAIR_CONTINUE = 32,
    PAIR_REFLECTED_PICK = 40,
    PAIR_REFLECTED_LIGHT = 48,
    PAIR_ROULETTE = 56
};
/* Continuations of a ray, from backs and specular fronts: after four of a dielectric .04^4 is left. */
#define MAX_BOUNCES 4 /* +25 %: 0 dB */
/* To a normal, 89.94 degrees; more grazing rays are not continued by the lobe; +25 %: no change. */
#define MIN_COSINE 1e-3f
/* Probability to continue by the lobe over the specular share of what is reflected: above 1, since what a lobe meets
 * (lamps, windows) varies more than the diffuse part, which is looked up. */
#define ROULETTE_FACTOR 2.0f /* +25 %: no change */
/* Least roughness of the lobe that reflects lights: narrower ones leave fireflies. A lobe of .5 is 30 degrees wide,
 * about what probes of irradiance resolve. */
#define WIDE_ROUGHNESS 0.5f /* +25 %: no change */

vec3 incident_cosine_direction(const vec3 frame[3], vec2 u) {
    vec2 circle = bsdf_circle(u.x);
    float r = sqrtf(u.y);
    vec3 d = vec3_scale(frame[2], sqrtf(fmaxf(0.0f, 1.0f - u.y)));
    d = vec3_mad(d, r * circle.x, frame[0]);
    return vec3_mad(d, r * circle.y, frame[1]);
}

void incident_cosine_rays(const struct surface_point *at, uint32_t key, size_t count, struct accel_ray *ray) {
    vec3 frame[3] = {[2] = at->shading};
    vec3_frame(at->shading, &frame[0], &frame[1]);
    for (uint32_t i = 0; i < count; i++) {
        vec3 direction = incident_cosine_direction(frame, sampler_pair(key, i, 0));
        ray[i] = (struct accel_ray){accel_offset(at->position, at->normal, direction), 0.0f, direction, INFINITY};
    }
}

/* --- radiance along a ray ---------------------------------------------------------------------------- */

/* Position of a hit in the texture, texels. */
static vec2 place_at(const struct world *world, const struct accel_hit *hit) {
    const vec2 *c = world->triangle[hit->triangle].corner;
    float b0 = 1.0f - hit->b1 - hit->b2;
    return (vec2){b0 * c[0].x + hit->b1 * c[1].x + hit->b2 * c[2].x, b0 * c[0].y + hit->b1 * c[1].y + hit->b2 * c[2].y};
}

size_t incident_texel(const struct world *world, const struct accel_hit *hit) {
    vec2 at = place_at(world, hit);
    uint32_t width = world->atlas->width, height = world->atlas->height;
    uint32_t column = at.x > 0.0f ? (uint32_t)at.x : 0, row = at.y > 0.0f ? (uint32_t)at.y : 0;
    column = column < width ? column : width - 1;
    row = row < height ? row : height - 1;
    return (size_t)row * width + column;
}

static bool is_light(const struct world *world, const struct world_triangle *t) {
    return world->lights->area_density[t->segment] > 0.0f;
}

/* Radiance along a ray that escapes or meets a front, and the density with which the light sampler draws it. */
static rgb incoming_radiance(const struct light_field *field, const struct accel_ray *ray, const struct accel_hit *hit,
                             float *light_pdf) {
    const struct world *world = field->world;
    *light_pdf = 0.0f;
    if (hit->triangle == ACCEL_NONE) {
        *light_pdf = lights_pdf_environment(world->lights, ray->direction);
        return lights_environment(world->lights, ray->direction);
    }
    const struct world_triangle *t = &world->triangle[hit->triangle];
    if (!is_light(world, t))
        return rgb_from_half(field->radiance[incident_texel(world, hit)]);
    *light_pdf = lights_pdf_segment(world->lights, t->segment, hit->distance_m, -vec3_dot(t->normal, ray->direction));
    vec2 at = place_at(world, hit);
    return materials_emission(world->materials, t->segment, at.x, at.y);
}

/* Weight of the radiance that a ray finds; t is NULL where it escapes. Emitters found by a lobe sample are weighted by
 * the balance heuristic against the light sample taken where the ray was reflected. */
static rgb weight_of(const struct light_field *field, const struct world_triangle *t, const struct incident_path *path,
                     float light_pdf) {
    if (path->is_specular && (!t || is_light(field->world, t)))
        return rgb_scale(path->light_beta, 1.0f / (path->pdf + light_pdf));
    bool is_black = path->is_first && t && field->specular_only && field->specular_only[t->segment];
    return is_black ? rgb_gray(0.0f) : path->beta;
}

/* --- continuation --------------------------------------------------------------------------------------- */

/* Ray from a surface with this normal to a sampled light. */
static struct accel_ray shadow_ray(vec3 position, vec3 normal, const struct light_sample *light) {
    vec3 origin = accel_offset(position, normal, light->direction);
    if (light->segment == LIGHT_ENVIRONMENT)
        return (struct accel_ray){origin, 0.0f, light->direction, light->distance_m};
    vec3 to_light = vec3_sub(accel_offset(light->point, light->normal, vec3_neg(light->direction)), origin);
    float far_m = vec3_length(to_light);
    return (struct accel_ray){origin, 0.0f, vec3_scale(to_light, 1.0f / fmaxf(far_m, 1e-20f)), far_m};
}

/* The rays of one bounce, and the lights sampled where they were reflected. */
struct wavefront {
    struct incident *in;
    const struct light_field *field;
    uint32_t key, first_sample, bounce;
    size_t ray_count, light_count;
};

/* Appends a ray of the next bounce; the normal points to the side that it leaves on. */
static void spawn_ray(struct wavefront *w, vec3 position, vec3 normal, vec3 direction, struct incident_path path) {
    w->in->ray[w->ray_count] = (struct accel_ray){accel_offset(position, normal, direction), 0.0f, direction, INFINITY};
    w->in->path[w->ray_count++] = path;
}

static vec3 position_at(const struct world_triangle *t, const struct accel_ray *ray, const struct accel_hit *hit) {
    vec3 p = vec3_mad(ray->origin, hit->distance_m, ray->direction);
    return vec3_mad(p, t->plane - vec3_dot(t->normal, p), t->normal);
}

/* Continues from a back by a cosine-distributed direction. */
static void spawn_from_back(struct wavefront *w, const struct accel_ray *ray, const struct accel_hit *hit,
                            struct incident_path path) {
    const struct world *world = w->field->world;
    const struct world_triangle *t = &world->triangle[hit->triangle];
    const float *base = world->materials->base_color.texel[incident_texel(world, hit)];
    vec3 frame[3] = {[2] = vec3_neg(t->normal)};
    vec3_frame(frame[2], &frame[0], &frame[1]);
    vec2 random = sampler_pair(w->key, w->first_sample + path.index, PAIR_CONTINUE + w->bounce);
    spawn_ray(
        w, position_at(t, ray, hit), frame[2], incident_cosine_direction(frame, random),
        (struct incident_path){path.index, rgb_mul(path.beta, rgb_make(base[0], base[1], base[2])), .is_first = false});
}

/* A specular reflection. Lights are reflected by a widened lobe: a small light found by chance would leave fireflies
 * (path-space regularisation, Kaplanyan and Dachsbacher 2013). */
struct reflection {
    vec3 position, normal;
    vec3 frame[3]; /* about the shading normal */
    vec3 wo;       /* towards the ray's origin, in this frame */
    struct bsdf lobe, wide;
};

/* Both lobes for one direction, and the density of sample_reflection there. */
struct lobe_values {
    float lobe, wide, pdf;
};

static struct lobe_values reflect(const struct reflection *m, vec3 wi) {
    struct bsdf_value lobe = bsdf_eval(&m->lobe, m->wo, wi), wide = bsdf_eval(&m->wide, m->wo, wi);
    return (struct lobe_values){lobe.specular, wide.specular, 0.5f * (lobe.pdf + wide.pdf)};
}

static vec3 sample_reflection(const struct reflection *m, vec2 u) {
    return u.x < 0.5f ? bsdf_sample(&m->lobe, m->wo, 0.0f, 2.0f * u.x, u.y)
                      : bsdf_sample(&m->wide, m->wo, 0.0f, 2.0f * u.x - 1.0f, u.y);
}

/* Samples a light to be reflected; added later unless it is occluded. */
static void sample_light(struct wavefront *w, const struct reflection *m, struct incident_path path) {
    uint32_t sample = w->first_sample + path.index;
    vec2 pick = sampler_pair(w->key, sample, PAIR_REFLECTED_PICK + w->bounce);
    vec2 place = sampler_pair(w->key, sample, PAIR_REFLECTED_LIGHT + w->bounce);
    struct light_sample light = {.pdf = 0.0f};
    if (lights_any(w->field->world->lights))
        lights_sample(w->field->world->lights, m->position, pick.x, place.x, place.y, &light);
    if (!(light.pdf > 0.0f) || !(vec3_dot(light.direction, m->normal) > 0.0f))
        return;
    struct lobe_values r = reflect(m, vec3_to_frame(m->frame, light.direction));
    rgb weight = rgb_scale(path.beta, r.wide / (light.pdf + r.pdf));
    w->in->shadow[w->light_count] = shadow_ray(m->position, m->normal, &light);
    w->in->light_sample[w->light_count++] = (struct incident_light_sample){path.index, rgb_mul(weight, light.radiance)};
}

/* Russian roulette: the probability to continue, small where the specular share of the reflected light is. */
static float continuation_probability(const struct world *world, const struct incident_lobe *lobe,
                                      const struct accel_hit *hit, float cosine) {
    const float *base = world->materials->base_color.texel[incident_texel(world, hit)];
    float diffuse = (base[0] + base[1] + base[2]) * (1.0f / 3.0f);
    float fresnel = bsdf_fresnel(cosine, bsdf_eta(lobe->specular));
    return fminf(1.0f, ROULETTE_FACTOR * fresnel / (fresnel + diffuse));
}

/* Continues from a front by its specular lobe. */
static void spawn_specular(struct wavefront *w, const struct accel_ray *ray, const struct accel_hit *hit,
                           struct incident_path path) {
    const struct world *world = w->field->world;
    const struct world_triangle *t = &world->triangle[hit->triangle];
    const struct incident_lobe *lobe = &w->field->lobe[t->segment];
    struct reflection m = {position_at(t, ray, hit), t->normal,
                           .frame[2] = surface_shading(world->mesh, hit->triangle, hit->b1, hit->b2, t->normal),
                           .lobe = bsdf_lobe(lobe->roughness, lobe->specular),
                           .wide = bsdf_lobe(fmaxf(lobe->roughness, WIDE_ROUGHNESS), lobe->specular)};
    vec3_frame(m.frame[2], &m.frame[0], &m.frame[1]);
    m.wo = vec3_to_frame(m.frame, vec3_neg(ray->direction));
    if (!(m.wo.z > MIN_COSINE))
        return;
    float probability = continuation_probability(world, lobe, hit, m.wo.z);
    if (!(sampler_pair(w->key, w->first_sample + path.index, PAIR_ROULETTE + w->bounce).x < probability))
        return;
    path.beta = rgb_scale(path.beta, 1.0f / probability);
    sample_light(w, &m, path);
    vec3 wi = sample_reflection(&m, sampler_pair(w->key, w->first_sample + path.index, PAIR_CONTINUE + w->bounce));
    vec3 direction = vec3_from_frame(m.frame, wi);
    struct lobe_values r = reflect(&m, wi);
    if (r.pdf > 0.0f && vec3_dot(direction, m.normal) > 0.0f)
        spawn_ray(w, m.position, m.normal, direction,
                  (struct incident_path){path.index, rgb_scale(path.beta, r.lobe / r.pdf), false, true,
                                         rgb_scale(path.beta, r.wide), r.pdf});
}

/* Adds the radiance that ray `k` finds and continues it; escapes and light_pdf are those of the first hit. */
static void shade_hit(struct wavefront *w, size_t k) {
    const struct light_field *field = w->field;
    const struct world *world = field->world;
    struct incident *in = w->in;
    const struct accel_ray ray = in->ray[k];
    const struct accel_hit hit = in->hit[k];
    const struct incident_path path = in->path[k];
    const struct world_triangle *t = hit.triangle == ACCEL_NONE ? NULL : &world->triangle[hit.triangle];
    if (t && !(vec3_dot(t->normal, ray.direction) < 0.0f)) {
        spawn_from_back(w, &ray, &hit, path);
        return;
    }
    float light_pdf;
    rgb found = incoming_radiance(field, &ray, &hit, &light_pdf), weight = weight_of(field, t, &path, light_pdf);
    in->radiance[path.index] = rgb_add(in->radiance[path.index], rgb_mul(weight, found));
    if (path.is_first) {
        in->light_pdf[path.index] = light_pdf;
        in->escapes[path.index] = !t;
    }
    if (t && field->lobe && field->lobe[t->segment].specular > 0.0f)
        spawn_specular(w, &ray, &hit, path);
}

/* Adds the lights that are not occluded. */
static void add_unoccluded_lights(const struct wavefront *w) {
    struct incident *in = w->in;
    accel_occluded_many(w->field->world->accel, w->light_count, in->shadow, in->occluded);
    for (size_t i = 0; i < w->light_count; i++) {
        rgb *to = &in->radiance[in->light_sample[i].index];
        if (!in->occluded[i])
            *to = rgb_add(*to, in->light_sample[i].radiance);
    }
}

void incident_trace(struct incident *in, const struct light_field *field, const struct surface_point *at, uint32_t key,
                    uint32_t first_sample, size_t count) {
    struct wavefront w = {in, field, key, first_sample, 0, 0, 0};
    for (size_t i = 0; i < count; i++) {
        spawn_ray(&w, at->position, at->normal, in->direction[i],
                  (struct incident_path){(uint32_t)i, rgb_gray(1.0f), .is_first = true});
        in->radiance[i] = rgb_gray(0.0f);
        in->light_pdf[i] = 0.0f;
        in->escapes[i] = false;
    }
    for (; w.bounce <= MAX_BOUNCES && w.ray_count > 0; w.bounce++) {
        size_t ray_count = w.ray_count;
        accel_intersect_many(field->world->accel, ray_count, in->ray, in->hit);
        w.ray_count = w.light_count = 0;
        for (size_t k = 0; k < ray_count; k++)
            shade_hit(&w, k);
        add_unoccluded_lights(&w);
    }
}

void incident_sample_lights(struct incident *in, const struct light_field *field, const struct surface_point *at,
                            uint32_t key, uint32_t first_sample, size_t from, size_t count) {
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
        in->ray[i] = any ? shadow_ray(at->position, at->normal, &light)
                         : (struct accel_ray){at->position, 0.0f, at->normal, 0.0f};
    }
    accel_occluded_many(world->accel, count, in->ray, in->occluded);
    for (size_t i = 0; i < count; i++) {
        if (in->occluded[i])
            in->radiance[from + i] = rgb_gray(0.0f);
    }
}
