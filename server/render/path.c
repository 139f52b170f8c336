/* path.c -- see path.h.
 *
 * A batch advances all of its paths one segment at a time: nearest hits of all, then block by block the shading of
 * the vertices (lanes.h, shade.c), then all shadow rays. Each vertex k of a path is stored for the backward pass
 * (path_backward.c). With the names of struct vertex_block, the radiance that leaves it is
 *
 *   L_k = emission_weight * emission + f(light) * incident + f(wi) * scale * L_(k+1)
 *
 * where f includes the cosine, `incident` is the light sample's radiance with its pdf, MIS weight and visibility, and
 * scale = 1 / (pdf of wi * probability of continuing). Derivatives follow term by term, with d L_(k+1) = d L_k *
 * f(wi) * scale.
 *
 * Invariants:
 *   1. the vertices of one depth are in the order of their paths, so sums and logs are independent of timing;
 *   2. weights and densities are constants of the derivative (detached sampling). No path and no light sample ends
 *      because its throughput is 0, since the derivative by base colour is not 0 where base colour is: a path ends
 *      only below the horizon or by Russian roulette with a probability of continuing that is never 0;
 *   3. multiple importance sampling by the power heuristic (Veach 1997, section 9.2.4). */
#include "server/render/path.h"

#include <assert.h>
#include <math.h>
#include <string.h>

#include "server/render/accel.h"
#include "server/render/light.h"
#include "server/render/path_batch.h"
#include "server/render/path_lights.h"
#include "server/render/sampler.h"
#include "server/render/shade.h"

#define MIN_CHANCE 0.05f /* bounds of the probability with which roulette lets a path go on */
#define MAX_CHANCE 0.95f
#define MIN_LIGHT_CHANCE 0.1f /* least probability of tracing a shadow ray */
#define EARLY_RR_SCALE 4.0f   /* before roulette_depth, paths of throughput below 1 / this may end */
/* The same from roulette_depth on, when derivatives are wanted. A value of 2 reduces the variance of the gradient at
 * equal time by 8 %, and the paths per second by a sixth. */
#define DERIVATIVE_RR_SCALE 1.25f
#define BUCKETS 256 /* of the counting sort of shadow rays */

/* The vertices of a block while it is shaded. */
static struct vertex_block *block_at(const struct path_batch *b, int depth, size_t block) {
    return b->keeps_vertices ? &b->vertex[depth][block] : b->vertex[0];
}

static void add(rgb *to, rgb amount) { *to = rgb_add(*to, amount); }

/* Adds the environment's radiance along a ray that left the scene. */
static void add_environment(struct path_batch *b, const struct world *world, int depth, const struct path_state *f,
                            vec3 direction, rgb *radiance) {
    const struct lights *lights = world->lights;
    if (!(lights->environment_chance > 0.0f))
        return;
    rgb value = lights_environment(lights, direction);
    if (depth > 0) {
        float other = lights_pdf_environment(lights, direction);
        value = rgb_scale(value, f->pdf * f->pdf / (f->pdf * f->pdf + other * other));
        if (b->keeps_vertices)
            lanes3_set_rgb(&b->vertex[depth - 1][f->parent / LANES].next, (int)(f->parent % LANES), value);
    }
    add(&radiance[f->path], rgb_mul(f->beta, value));
}

typedef float float4 __attribute__((vector_size(16)));
typedef int16_t short4 __attribute__((vector_size(8)));

static float4 corner_normal(const struct world_triangle *t, int corner) {
    short4 n;
    memcpy(&n, t->shading[corner], sizeof n); /* reads one value too many, which is not used */
    return __builtin_convertvector(n, float4);
}

/* Multiplies a lane's segment emission by the emission pattern at its point. */
static void apply_pattern(const struct materials *m, const struct shade_block *s, struct vertex_block *v, int lane) {
    rgb mean = lanes3_rgb(&v->emission, lane);
    rgb pattern =
        rgb_is_black(mean) ? rgb_gray(1.0f) : materials_emission_pattern(m, s->place_x[lane], s->place_y[lane]);
    lanes3_set_rgb(&v->pattern, lane, pattern);
    lanes3_set_rgb(&v->emission, lane, rgb_mul(mean, pattern));
}

/* Loads the hit of the path at `index` into a lane. */
static void load_lane(struct path_batch *b, const struct world *world, struct vertex_block *v, int lane, size_t index,
                      const rgb *radiance) {
    const struct path_state *f = &b->state[index];
    const struct accel_ray *ray = &b->ray[index];
    const struct accel_hit *hit = &b->hit[index];
    const struct world_triangle *t = &world->triangle[hit->triangle];
    const struct materials *m = world->materials;
    struct shade_block *s = b->shade;
    float b1 = hit->b1, b2 = hit->b2, b0 = 1.0f - b1 - b2;
    const vec2 *c = t->corner;
    s->place_x[lane] = b0 * c[0].x + b1 * c[1].x + b2 * c[2].x;
    s->place_y[lane] = b0 * c[0].y + b1 * c[1].y + b2 * c[2].y;
    v->path[lane] = f->path;
    v->parent[lane] = f->parent;
    lanes3_set_rgb(&v->beta, lane, f->beta);
    s->pdf[lane] = f->pdf;
    lanes3_set_rgb(&s->rr_beta, lane, f->rr_beta);
    s->path_radiance[lane] = rgb_max(radiance[f->path]);
    s->key[lane] = b->key[f->path];
    s->sample[lane] = b->sample[f->path];
    lanes3_set(&s->origin, lane, ray->origin);
    lanes3_set(&s->direction, lane, ray->direction);
    s->distance_m[lane] = hit->distance_m;
    lanes3_set(&s->normal, lane, t->normal);
    s->plane[lane] = t->plane;
    float4 n = b0 * corner_normal(t, 0) + b1 * corner_normal(t, 1) + b2 * corner_normal(t, 2);
    lanes3_set(&s->shading, lane, (vec3){n[0], n[1], n[2]});
    uint32_t segment = t->segment;
    v->segment[lane] = segment;
    v->roughness[lane] = m->roughness[segment];
    v->specular[lane] = m->specular[segment];
    if (m->metallic)
        materials_gloss(m, segment, s->place_x[lane], s->place_y[lane], &v->roughness[lane], &v->metallic[lane]);
    lanes3_set_rgb(&v->emission, lane, m->emission[segment]);
    if (b->has_pattern)
        apply_pattern(m, s, v, lane);
    if (m->cone) {
        float cone = materials_cone(m, segment, -vec3_dot(t->normal, ray->direction));
        lanes3_set_rgb(&v->emission, lane, rgb_scale(lanes3_rgb(&v->emission, lane), cone));
    }
    s->area_density[lane] = world->lights->area_density[segment];
    if (s->area_density[lane] > 0.0f && world->guide)
        s->area_density[lane] *=
            guide_density_factor(world->guide, f->row, lights_part(world->lights, hit->triangle, b1, b2));
}

static void add_emission(const struct vertex_block *v, int count, rgb *radiance) {
    for (int i = 0; i < count; i++) {
        rgb emission = lanes3_rgb(&v->emission, i);
        if (!rgb_is_black(emission))
            add(&radiance[v->path[i]], rgb_mul(lanes3_rgb(&v->beta, i), rgb_scale(emission, v->emission_weight[i])));
    }
}

/* Prefetches the texels that the block will read. A loop of its own keeps many misses in flight: most texels lie in
 * different pages, which costs a TLB miss each. */
static void prefetch_texels(const struct shade_block *s, const struct texture *texture, int count) {
    for (int i = 0; i < count; i++) {
        const float(*texel)[4] = (const float(*)[4])texture->texel + s->texel[i];
        __builtin_prefetch(texel, 0, 2);
        __builtin_prefetch(texel + 1, 0, 2);
        __builtin_prefetch(texel + texture->width, 0, 2);
        __builtin_prefetch(texel + texture->width + 1, 0, 2);
    }
}

/* Weighted sum over the four texels, r g b and weight in one vector: a texel's fourth value is 1 where it is valid
 * and 0 elsewhere. Same result as texture_taps and texture_gather. */
static void gather_texels(struct vertex_block *v, struct shade_block *s, const struct texture *texture, int count) {
    for (int i = 0; i < count; i++) {
        size_t down = v->y[i] + 1u < texture->height ? texture->width : 0;
        size_t right = v->x[i] + 1u < texture->width ? 1 : 0;
        const float(*texel)[4] = (const float(*)[4])texture->texel + s->texel[i];
        const float *at[4] = {texel[0], texel[right], texel[down], texel[down + right]};
        float x = s->column[i], y = s->row[i];
        const float weight[4] = {(1.0f - x) * (1.0f - y), x * (1.0f - y), (1.0f - x) * y, x * y};
        float4 sum = {0.0f, 0.0f, 0.0f, 0.0f};
        for (int k = 0; k < 4; k++) {
            float4 value;
            memcpy(&value, at[k], sizeof value);
            float valid = weight[k] * value[3];
            s->filter[k][i] = valid;
            sum += valid * value;
        }
        lanes3_set(&v->base_color, i, (vec3){sum[0], sum[1], sum[2]});
        s->filter_sum[i] = sum[3];
    }
}

/* Appends the shadow and continuation rays of the block. Each lane writes its rays and then counts them or not:
 * branching on it would be mispredicted. */
static void spawn_rays(struct path_batch *b, const struct vertex_block *v, uint32_t first, int count) {
    const struct shade_block *s = b->shade;
    size_t shadows = b->shadow_count, active = b->active_count;
    for (int i = 0; i < count; i++) {
        b->shadow_ray[shadows] = (struct accel_ray){lanes3_get(&s->shadow_origin, i), 0.0f,
                                                    lanes3_get(&s->shadow_direction, i), s->shadow_far[i]};
        b->shadow[shadows] = (struct shadow){v->path[i], first + (uint32_t)i, lanes3_rgb(&s->contribution, i)};
        b->bucket[shadows] = (uint8_t)(s->light[i] >> b->bucket_shift);
        shadows += s->has_shadow_ray[i];
    }
    for (int i = 0; i < count; i++) {
        b->ray[active] =
            (struct accel_ray){lanes3_get(&s->bounce_origin, i), 0.0f, lanes3_get(&s->bounce, i), INFINITY};
        b->state[active] = (struct path_state){
            v->path[i],      first + (uint32_t)i, lanes3_rgb(&s->bounce_beta, i), lanes3_rgb(&s->bounce_rr_beta, i),
            s->guide_row[i], s->bounce_pdf[i]};
        active += s->bounce_continues[i];
    }
    b->shadow_count = shadows;
    b->active_count = active;
}

/* Before roulette_depth, and when derivatives are wanted, only paths of low throughput may end. */
static struct shade_roulette roulette_at(const struct path_settings *settings, int segment) {
    bool any = settings->roulette_depth <= settings->max_depth;
    bool all = any && segment >= settings->roulette_depth;
    bool derivatives = settings->derivatives;
    return (struct shade_roulette){
        .scale = !all          ? EARLY_RR_SCALE
                 : derivatives ? DERIVATIVE_RR_SCALE
                               : 1.0f,
        .least = any ? MIN_CHANCE : 1.0f,
        .most = all && !derivatives ? MAX_CHANCE : 1.0f,
        .least_light = any ? MIN_LIGHT_CHANCE : 1.0f,
        .min_color = settings->min_color,
    };
}

/* Shades the `count` vertices of a block of this depth. */
static void shade(struct path_batch *b, const struct world *world, const struct path_settings *settings, int depth,
                  size_t block, int count, rgb *radiance) {
    struct vertex_block *v = block_at(b, depth, block);
    struct shade_block *s = b->shade;
    const struct texture *texture = &world->materials->base_color;
    bool scatters = depth + 1 < settings->max_depth;
    if (scatters) {
        shade_place(v, s, texture->width, texture->height);
        prefetch_texels(s, texture, count);
    }
    shade_surface(v, s);
    add_emission(v, count, radiance);
    if (!scatters)
        return;
    if (b->keeps_vertices)
        memset(&v->next, 0, sizeof v->next);
    shade_numbers(s, depth);
    if (path_lights_pick(s, v, world, count))
        shade_light(s);
    else
        memset(s->light_pdf, 0, sizeof s->light_pdf);
    if (world->materials->cone)
        path_lights_cones(s, v, world->materials, count);
    if (world->lights->environment_chance > 0.0f)
        path_lights_environment(s, v, world->lights, count);
    gather_texels(v, s, texture, count);
    shade_texture(v, s);
    if (world->materials->metallic)
        shade_scatter_metals(v, s, roulette_at(settings, depth + 2));
    else
        shade_scatter(v, s, roulette_at(settings, depth + 2));
    spawn_rays(b, v, (uint32_t)block * LANES, count);
}

/* Shades all hits of this depth and spawns the rays of the next. New rays overwrite those of blocks already loaded. */
static void shade_hits(struct path_batch *b, const struct world *world, const struct path_settings *settings, int depth,
                       rgb *radiance) {
    size_t arrived = b->active_count, block = 0;
    int lane = 0;
    b->active_count = b->shadow_count = 0;
    for (size_t i = 0; i < arrived; i++) {
        if (i + 24 < arrived && b->hit[i + 24].triangle != ACCEL_NONE)
            __builtin_prefetch(&world->triangle[b->hit[i + 24].triangle]);
        if (b->hit[i].triangle == ACCEL_NONE) {
            add_environment(b, world, depth, &b->state[i], b->ray[i].direction, radiance);
            continue;
        }
        load_lane(b, world, block_at(b, depth, block), lane++, i, radiance);
        if (lane == LANES) {
            shade(b, world, settings, depth, block++, LANES, radiance);
            lane = 0;
        }
    }
    b->vertex_count[depth] = block * LANES + (size_t)lane;
    if (lane > 0)
        shade(b, world, settings, depth, block, lane, radiance);
}

/* Sorts shadow rays by their light, for the cache: rays towards one light traverse the same nodes. The order does not
 * change results. */
static void sort_shadows(struct path_batch *b) {
    uint32_t place[BUCKETS + 1] = {0};
    for (size_t i = 0; i < b->shadow_count; i++)
        place[b->bucket[i] + 1]++;
    for (size_t k = 0; k < BUCKETS; k++)
        place[k + 1] += place[k];
    for (size_t i = 0; i < b->shadow_count; i++) {
        uint32_t to = place[b->bucket[i]]++;
        b->sorted_ray[to] = b->shadow_ray[i];
        b->sorted[to] = b->shadow[i];
    }
}

/* Traces the shadow rays; occluded light samples lose their radiance. */
static void trace_shadow_rays(struct path_batch *b, const struct world *world, int depth, rgb *radiance) {
    if (b->tap)
        b->tap(b->tap_user, true, b->shadow_count, b->shadow_ray);
    sort_shadows(b);
    accel_occluded_many(world->accel, b->shadow_count, b->sorted_ray, b->occluded);
    b->ray_count += b->shadow_count;
    for (size_t i = 0; i < b->shadow_count; i++) {
        const struct shadow *shadow = &b->sorted[i];
        if (!b->occluded[i]) {
            add(&radiance[shadow->path], shadow->contribution);
            continue;
        }
        if (!b->keeps_vertices)
            continue;
        struct vertex_block *v = &b->vertex[depth][shadow->vertex / LANES];
        int lane = (int)(shadow->vertex % LANES);
        lanes3_set(&v->incident, lane, (vec3){0.0f, 0.0f, 0.0f});
        v->light_factor[lane] = 0.0f;
    }
}

void path_batch_trace(struct path_batch *b, const struct world *world, const struct path_settings *settings,
                      size_t count, const struct ray *ray, const struct path_key *key, rgb *radiance) {
    assert(count <= b->capacity && settings->max_depth <= b->max_depth);
    for (size_t i = 0; i < count; i++) {
        b->key[i] = sampler_key(settings->seed, key[i].index, key[i].iteration);
        b->sample[i] = key[i].sample;
        b->state[i] = (struct path_state){(uint32_t)i, 0, {1.0f, 1.0f, 1.0f}, {1.0f, 1.0f, 1.0f}, 0, 0.0f};
        b->ray[i] = (struct accel_ray){ray[i].origin, 0.0f, ray[i].direction, INFINITY};
        radiance[i] = (rgb){0.0f, 0.0f, 0.0f};
    }
    for (b->bucket_shift = 0; world->lights->triangle_count > (size_t)BUCKETS << b->bucket_shift;)
        b->bucket_shift++;
    b->has_pattern = world->materials->emission_pattern != NULL;
    b->depth_count = 0;
    b->active_count = count;
    for (int depth = 0; depth < settings->max_depth && b->active_count > 0; depth++) {
        if (b->tap)
            b->tap(b->tap_user, false, b->active_count, b->ray);
        accel_intersect_many(world->accel, b->active_count, b->ray, b->hit);
        b->ray_count += b->active_count;
        shade_hits(b, world, settings, depth, radiance);
        if (depth == 1) /* what follows has been reflected more than once */
            memcpy(b->direct, radiance, count * sizeof *radiance);
        trace_shadow_rays(b, world, depth, radiance);
        b->depth_count = depth + 1;
    }
    b->ended = b->depth_count == settings->max_depth;
    if (b->depth_count < 2)
        memcpy(b->direct, radiance, count * sizeof *radiance);
    for (size_t i = 0; i < count; i++) {
        b->dropped[i] = !rgb_is_finite(radiance[i]);
        if (b->dropped[i]) {
            radiance[i] = b->direct[i] = (rgb){0.0f, 0.0f, 0.0f};
            b->dropped_count++;
        }
    }
}

const rgb *path_batch_direct(const struct path_batch *b) { return b->direct; }

void path_batch_counts(const struct path_batch *b, uint64_t *ray_count, uint64_t *dropped_count) {
    *ray_count = b->ray_count;
    *dropped_count = b->dropped_count;
}

void path_batch_set_tap(struct path_batch *b,
                        void (*tap)(void *user, bool shadow, size_t count, const struct accel_ray *ray), void *user) {
    b->tap = tap;
    b->tap_user = user;
}
