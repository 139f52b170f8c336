/* path.c -- see path.h.
 *
 * A batch advances all of its paths one surface at a time. Vertex k of a path is kept with what
 * the backward walk needs; with the names of struct vertex, the radiance that leaves it is
 *
 *   L_k = emission_weight * Le + f(light) * incident + f(wi) * scale * L_(k+1)
 *
 * where f includes the cosine, `incident` holds the light sample's radiance, density, weight and
 * visibility, and scale = 1 / (density of wi * chance of going on). Derivatives follow term by
 * term, with d L_(k+1) = d L_k * f(wi) * scale.
 *
 * Invariants:
 *   1. vertices of one depth are in the order of their paths, so what a path logs and adds does
 *      not depend on the other paths in the batch;
 *   2. weights and densities are constants of the derivative (detached sampling). No path ends
 *      because its throughput is 0, only because the sampled direction is below the horizon or
 *      by roulette with a chance of at least MIN_CHANCE: where a base colour is 0 its derivative
 *      is not;
 *   3. multiple importance sampling by the power heuristic (Veach 1997, section 9.2.4). */
#include "server/render/path.h"

#include <assert.h>
#include <math.h>
#include <string.h>

#include "common/mem.h"
#include "server/render/accel.h"
#include "server/render/bsdf.h"
#include "server/render/light.h"
#include "server/render/sampler.h"

#define MAX_DEPTH 32
#define MIN_CHANCE 0.05f
#define MAX_CHANCE 0.95f

/* Random numbers of a vertex: pairs 4 k + these. Pairs below 4 are the camera's. */
enum { PAIR_CHOICES, PAIR_LIGHT, PAIR_DIRECTION, PAIR_ROULETTE, PAIRS_PER_VERTEX };

struct vertex {
    uint32_t path;
    uint32_t parent;               /* number in the depth before */
    uint32_t segment;
    uint32_t light_segment;        /* of the light sample, LIGHT_ENVIRONMENT where none */
    rgb beta;                      /* from the camera to here */
    float emission_weight;         /* 0 on the back */
    struct gradient_entry taps;    /* where base_color came from; d is the backward walk's */
    rgb base_color;
    vec3 wo, light, wi;            /* in the shading frame */
    rgb incident;                  /* 0: no light sample */
    float light_factor;            /* incident = light_factor * emission of light_segment */
    float scale;                   /* 0: the path ends here */
    rgb next;                      /* L_(k+1) */
};

/* A path under way to its next surface. */
struct flight {
    uint32_t path, parent;
    rgb beta;
    float pdf; /* of its direction by solid angle; 0 for a camera ray */
};

struct path_batch {
    size_t capacity, count;
    int max_depth, depth_count;       /* depths used by the last trace */
    size_t vertex_count[MAX_DEPTH];
    struct vertex *vertex[MAX_DEPTH]; /* [capacity] each, owned */
    vec3 *point, *normal;             /* [capacity] of the present depth's vertices: world place,
                                       * geometric normal */
    vec3 (*frame)[3];                 /* [capacity] shading frame, third is the normal */
    struct flight *flight;            /* [capacity] */
    struct accel_ray *ray, *shadow_ray;
    struct accel_hit *hit;
    uint8_t *occluded;
    uint32_t *shadow;                 /* vertices whose light sample waits for its shadow ray */
    uint32_t *key;                    /* [capacity] sampler key per path */
    uint32_t *sample;
    bool *dropped;                    /* [capacity] the path's estimate was not finite */
    uint64_t ray_count, dropped_count;
};

struct path_batch *path_batch_new(size_t capacity, int max_depth) {
    assert(max_depth >= 1 && max_depth <= MAX_DEPTH);
    struct path_batch *b = mem_calloc(1, sizeof *b);
    b->capacity = capacity;
    b->max_depth = max_depth;
    for (int k = 0; k < max_depth; k++)
        b->vertex[k] = mem_array(capacity, sizeof *b->vertex[k]);
    b->point = mem_array(capacity, sizeof *b->point);
    b->normal = mem_array(capacity, sizeof *b->normal);
    b->frame = mem_array(capacity, sizeof *b->frame);
    b->flight = mem_array(capacity, sizeof *b->flight);
    b->ray = mem_array(capacity, sizeof *b->ray);
    b->shadow_ray = mem_array(capacity, sizeof *b->shadow_ray);
    b->hit = mem_array(capacity, sizeof *b->hit);
    b->occluded = mem_array(capacity, sizeof *b->occluded);
    b->shadow = mem_array(capacity, sizeof *b->shadow);
    b->key = mem_array(capacity, sizeof *b->key);
    b->sample = mem_array(capacity, sizeof *b->sample);
    b->dropped = mem_array(capacity, sizeof *b->dropped);
    return b;
}

void path_batch_free(struct path_batch *b) {
    if (!b)
        return;
    for (int k = 0; k < b->max_depth; k++)
        mem_free(b->vertex[k]);
    mem_free(b->point);
    mem_free(b->normal);
    mem_free(b->frame);
    mem_free(b->flight);
    mem_free(b->ray);
    mem_free(b->shadow_ray);
    mem_free(b->hit);
    mem_free(b->occluded);
    mem_free(b->shadow);
    mem_free(b->key);
    mem_free(b->sample);
    mem_free(b->dropped);
    mem_free(b);
}

static float power_heuristic(float a, float b) {
    return a * a / (a * a + b * b);
}

static vec3 to_local(const vec3 frame[3], vec3 v) {
    return (vec3){vec3_dot(frame[0], v), vec3_dot(frame[1], v), vec3_dot(frame[2], v)};
}

static vec3 to_world(const vec3 frame[3], vec3 v) {
    return vec3_mad(vec3_mad(vec3_scale(frame[0], v.x), v.y, frame[1]), v.z, frame[2]);
}

/* The interpolated normal, turned to the viewer's side (materials are two-sided). */
static vec3 shading_normal(const struct world_triangle *t, float b1, float b2, vec3 to_viewer) {
    vec3 n = t->normal;
    if (!t->flat) {
        float b0 = 1.0f - b1 - b2, v[3];
        for (int c = 0; c < 3; c++)
            v[c] = b0 * (float)t->shading[0][c] + b1 * (float)t->shading[1][c] +
                   b2 * (float)t->shading[2][c];
        vec3 sum = {v[0], v[1], v[2]};
        float length = vec3_length(sum);
        if (length > 1.0f)
            n = vec3_scale(sum, 1.0f / length);
    }
    return vec3_dot(n, to_viewer) < 0.0f ? vec3_neg(n) : n;
}

static rgb look_up(const struct texture *texture, float x, float y, struct gradient_entry *e) {
    struct texture_taps taps;
    texture_taps(texture, x, y, &taps);
    rgb value = texture_gather(texture, &taps);
    float right = (float)texture->width - 1.0f, bottom = (float)texture->height - 1.0f;
    uint32_t i = (uint32_t)clampf(x - 0.5f, 0.0f, right), j = (uint32_t)clampf(y - 0.5f, 0.0f, bottom);
    e->first = j * texture->width + i;
    memcpy(e->weight, taps.weight, sizeof e->weight);
    return value;
}

/* What a ray that meets nothing brings. */
static void meet_nothing(struct path_batch *b, const struct world *world, int depth,
                         const struct flight *f, vec3 direction, rgb *radiance) {
    const struct lights *lights = world->lights;
    if (!(lights->environment_chance > 0.0f))
        return;
    rgb value = lights_environment(lights, direction);
    if (depth > 0) {
        value = rgb_scale(value, power_heuristic(f->pdf, lights_pdf_environment(lights, direction)));
        b->vertex[depth - 1][f->parent].next = value;
    }
    radiance[f->path] = rgb_add(radiance[f->path], rgb_mul(f->beta, value));
}

/* Makes vertex number `at` of this depth from a hit; adds its emission. */
static void meet_surface(struct path_batch *b, const struct world *world, size_t at, int depth,
                         const struct flight *f, const struct accel_ray *ray,
                         const struct accel_hit *hit, rgb *radiance) {
    const struct world_triangle *t = &world->triangle[hit->triangle];
    const struct materials *m = world->materials;
    struct vertex *v = &b->vertex[depth][at];
    v->path = f->path;
    v->parent = f->parent;
    v->segment = t->segment;
    v->beta = f->beta;
    v->next = (rgb){0.0f, 0.0f, 0.0f};
    v->scale = 0.0f;
    v->incident = (rgb){0.0f, 0.0f, 0.0f};

    vec3 to_viewer = vec3_neg(ray->direction);
    float facing = vec3_dot(t->normal, to_viewer);
    v->emission_weight = 0.0f;
    if (facing > 0.0f) {
        float pdf = lights_pdf_segment(world->lights, t->segment, hit->distance_m, facing);
        v->emission_weight = depth == 0 ? 1.0f : power_heuristic(f->pdf, pdf);
        rgb emitted = rgb_scale(m->emission[t->segment], v->emission_weight);
        radiance[f->path] = rgb_add(radiance[f->path], rgb_mul(f->beta, emitted));
    }

    /* The distance's rounding is taken out along the normal. */
    vec3 p = vec3_mad(ray->origin, hit->distance_m, ray->direction);
    b->point[at] = vec3_mad(p, t->plane - vec3_dot(t->normal, p), t->normal);
    b->normal[at] = t->normal;
    vec3 *frame = b->frame[at];
    frame[2] = shading_normal(t, hit->b1, hit->b2, to_viewer);
    vec3_frame(frame[2], &frame[0], &frame[1]);
    v->wo = to_local(frame, to_viewer);
    v->wo.z = fmaxf(v->wo.z, 1e-6f);

    float b0 = 1.0f - hit->b1 - hit->b2;
    float x = b0 * t->corner[0].x + hit->b1 * t->corner[1].x + hit->b2 * t->corner[2].x;
    float y = b0 * t->corner[0].y + hit->b1 * t->corner[1].y + hit->b2 * t->corner[2].y;
    v->base_color = look_up(&m->base_color, x, y, &v->taps);
}

static rgb reflect(const struct bsdf_value *f, rgb base_color, rgb light) {
    return (rgb){(base_color.r * f->diffuse + f->specular) * light.r,
                 (base_color.g * f->diffuse + f->specular) * light.g,
                 (base_color.b * f->diffuse + f->specular) * light.b};
}

/* Picks a point on the lights; true when a shadow ray must decide. */
static bool sample_light(const struct path_batch *b, const struct world *world, struct vertex *v,
                         size_t at, const struct bsdf *bsdf, float pick, vec2 place,
                         struct accel_ray *ray) {
    struct light_sample light;
    lights_sample(world->lights, b->point[at], pick, place.x, place.y, &light);
    if (!(light.pdf > 0.0f))
        return false;
    v->light = to_local(b->frame[at], light.direction);
    struct bsdf_value f = bsdf_eval(bsdf, v->wo, v->light);
    if (!(f.pdf > 0.0f))
        return false;
    v->light_factor = power_heuristic(light.pdf, f.pdf) / light.pdf;
    v->light_segment = light.segment;
    v->incident = rgb_scale(light.radiance, v->light_factor);
    ray->origin = accel_offset(b->point[at], b->normal[at], light.direction);
    ray->near_m = 0.0f;
    ray->direction = light.direction;
    ray->far_m = INFINITY;
    if (light.segment != LIGHT_ENVIRONMENT) {
        vec3 target = accel_offset(light.point, light.normal, vec3_neg(light.direction));
        vec3 to = vec3_sub(target, ray->origin);
        ray->far_m = vec3_length(to);
        ray->direction = vec3_scale(to, 1.0f / ray->far_m);
    }
    return true;
}

/* Samples light and the way on at every vertex of this depth. Returns the number of paths that
 * go on; *shadow_count shadow rays wait. */
static size_t scatter(struct path_batch *b, const struct world *world,
                      const struct path_settings *settings, int depth, size_t *shadow_count) {
    const struct materials *m = world->materials;
    size_t flights = 0, shadows = 0;
    bool lit = lights_any(world->lights);
    bool roulette = depth + 2 >= settings->roulette_depth;
    for (size_t at = 0; at < b->vertex_count[depth]; at++) {
        struct vertex *v = &b->vertex[depth][at];
        uint32_t key = b->key[v->path], sample = b->sample[v->path];
        uint32_t pair = (uint32_t)(depth + 1) * PAIRS_PER_VERTEX;
        struct bsdf bsdf = bsdf_make(v->base_color, m->roughness[v->segment],
                                     m->specular[v->segment], v->wo.z);
        vec2 choices = sampler_pair(key, sample, pair + PAIR_CHOICES);
        if (lit) {
            vec2 place = sampler_pair(key, sample, pair + PAIR_LIGHT);
            if (sample_light(b, world, v, at, &bsdf, choices.x, place, &b->shadow_ray[shadows]))
                b->shadow[shadows++] = (uint32_t)at;
        }
        vec2 direction = sampler_pair(key, sample, pair + PAIR_DIRECTION);
        v->wi = bsdf_sample(&bsdf, v->wo, choices.y, direction.x, direction.y);
        struct bsdf_value f = bsdf_eval(&bsdf, v->wo, v->wi);
        if (!(f.pdf > 0.0f))
            continue;
        float scale = 1.0f / f.pdf;
        rgb beta = rgb_scale(reflect(&f, v->base_color, v->beta), scale);
        if (roulette) {
            float chance = clampf(rgb_max(beta), MIN_CHANCE, MAX_CHANCE);
            if (sampler_number(key, sample, pair + PAIR_ROULETTE) >= chance)
                continue;
            scale /= chance;
            beta = rgb_scale(beta, 1.0f / chance);
        }
        v->scale = scale;
        vec3 way = to_world(b->frame[at], v->wi);
        b->flight[flights] = (struct flight){v->path, (uint32_t)at, beta, f.pdf};
        b->ray[flights++] =
            (struct accel_ray){accel_offset(b->point[at], b->normal[at], way), 0.0f, way, INFINITY};
    }
    *shadow_count = shadows;
    return flights;
}

/* Traces the shadow rays; light samples that are hidden lose their radiance. */
static void gather_light(struct path_batch *b, const struct world *world, int depth,
                         size_t shadow_count, rgb *radiance) {
    const struct materials *m = world->materials;
    accel_occluded_many(world->accel, shadow_count, b->shadow_ray, b->occluded);
    b->ray_count += shadow_count;
    for (size_t i = 0; i < shadow_count; i++) {
        struct vertex *v = &b->vertex[depth][b->shadow[i]];
        if (b->occluded[i]) {
            v->incident = (rgb){0.0f, 0.0f, 0.0f};
            v->light_factor = 0.0f;
            continue;
        }
        struct bsdf bsdf = bsdf_make(v->base_color, m->roughness[v->segment],
                                     m->specular[v->segment], v->wo.z);
        struct bsdf_value f = bsdf_eval(&bsdf, v->wo, v->light);
        rgb got = rgb_mul(v->beta, reflect(&f, v->base_color, v->incident));
        radiance[v->path] = rgb_add(radiance[v->path], got);
    }
}

void path_batch_trace(struct path_batch *b, const struct world *world,
                      const struct path_settings *settings, size_t count, const struct ray *ray,
                      const struct path_key *key, rgb *radiance) {
    assert(count <= b->capacity && settings->max_depth <= b->max_depth);
    for (size_t i = 0; i < count; i++) {
        b->key[i] = sampler_key(settings->seed, key[i].index, key[i].iteration);
        b->sample[i] = key[i].sample;
        b->flight[i] = (struct flight){(uint32_t)i, 0, {1.0f, 1.0f, 1.0f}, 0.0f};
        b->ray[i] = (struct accel_ray){ray[i].origin, 0.0f, ray[i].direction, INFINITY};
        radiance[i] = (rgb){0.0f, 0.0f, 0.0f};
    }
    b->count = count;
    b->depth_count = 0;
    size_t flights = count;
    for (int depth = 0; depth < settings->max_depth && flights > 0; depth++) {
        accel_intersect_many(world->accel, flights, b->ray, b->hit);
        b->ray_count += flights;
        size_t at = 0;
        for (size_t i = 0; i < flights; i++) {
            if (b->hit[i].triangle == ACCEL_NONE)
                meet_nothing(b, world, depth, &b->flight[i], b->ray[i].direction, radiance);
            else
                meet_surface(b, world, at++, depth, &b->flight[i], &b->ray[i], &b->hit[i], radiance);
        }
        b->vertex_count[depth] = at;
        b->depth_count = depth + 1;
        if (depth + 1 == settings->max_depth)
            break;
        size_t shadow_count;
        flights = scatter(b, world, settings, depth, &shadow_count);
        gather_light(b, world, depth, shadow_count, radiance);
    }
    for (size_t i = 0; i < count; i++) {
        b->dropped[i] = !rgb_is_finite(radiance[i]);
        if (b->dropped[i]) {
            radiance[i] = (rgb){0.0f, 0.0f, 0.0f};
            b->dropped_count++;
        }
    }
}

/* Adds f's derivative for light `light` from `wi`, times `adjoint`, to what is logged. */
static void scatter_backward(const struct bsdf *bsdf, float specular, const struct vertex *v,
                             vec3 wi, rgb light, rgb adjoint, rgb *d_base_color,
                             struct gradient_segment *d) {
    struct bsdf_derivative by = bsdf_backward(bsdf, specular, v->wo, wi);
    rgb both = rgb_mul(adjoint, light);
    *d_base_color = rgb_mad(*d_base_color, by.diffuse, both);
    float sum = both.r + both.g + both.b;
    float tinted = both.r * v->base_color.r + both.g * v->base_color.g + both.b * v->base_color.b;
    d->d_roughness += (double)(tinted * by.diffuse_by_roughness + sum * by.specular_by_roughness);
    d->d_specular += (double)(sum * by.specular_by_specular);
}

static void add_emission(struct gradient_segment *d, rgb amount) {
    d->d_emission[0] += (double)amount.r;
    d->d_emission[1] += (double)amount.g;
    d->d_emission[2] += (double)amount.b;
}

/* The derivatives at one vertex; returns L_k for the vertex before. */
static rgb vertex_backward(struct vertex *v, const struct materials *m, rgb d_radiance,
                           struct gradient_log *log, struct gradient_entry *entry) {
    rgb adjoint = rgb_mul(d_radiance, v->beta);
    struct gradient_segment *d = &log->segment[v->segment];
    rgb out = rgb_scale(m->emission[v->segment], v->emission_weight);
    add_emission(d, rgb_scale(adjoint, v->emission_weight));
    rgb d_base_color = {0.0f, 0.0f, 0.0f};
    float specular = m->specular[v->segment];
    struct bsdf bsdf = bsdf_make(v->base_color, m->roughness[v->segment], specular, v->wo.z);
    if (!rgb_is_black(v->incident)) {
        struct bsdf_value f = bsdf_eval(&bsdf, v->wo, v->light);
        out = rgb_add(out, reflect(&f, v->base_color, v->incident));
        scatter_backward(&bsdf, specular, v, v->light, v->incident, adjoint, &d_base_color, d);
        if (v->light_segment != LIGHT_ENVIRONMENT) {
            rgb factor = rgb_scale(adjoint, v->light_factor);
            add_emission(&log->segment[v->light_segment], reflect(&f, v->base_color, factor));
        }
    }
    if (v->scale > 0.0f && !rgb_is_black(v->next)) {
        struct bsdf_value f = bsdf_eval(&bsdf, v->wo, v->wi);
        rgb light = rgb_scale(v->next, v->scale);
        out = rgb_add(out, reflect(&f, v->base_color, light));
        scatter_backward(&bsdf, specular, v, v->wi, light, adjoint, &d_base_color, d);
    }
    *entry = v->taps;
    entry->d = d_base_color;
    return out;
}

void path_batch_backward(struct path_batch *b, const struct world *world, const rgb *d_radiance,
                         struct gradient_log *log) {
    for (int depth = b->depth_count - 1; depth >= 0; depth--) {
        struct gradient_entry *entry = gradient_log_reserve(log, b->vertex_count[depth]);
        size_t used = 0;
        for (size_t i = 0; i < b->vertex_count[depth]; i++) {
            struct vertex *v = &b->vertex[depth][i];
            if (b->dropped[v->path])
                continue;
            rgb out = vertex_backward(v, world->materials, d_radiance[v->path], log, &entry[used]);
            if (depth > 0)
                b->vertex[depth - 1][v->parent].next = out;
            if (!rgb_is_black(entry[used].d))
                used++;
        }
        log->entry_count += used;
    }
}

void path_batch_counts(const struct path_batch *b, uint64_t *ray_count, uint64_t *dropped_count) {
    *ray_count = b->ray_count;
    *dropped_count = b->dropped_count;
}
