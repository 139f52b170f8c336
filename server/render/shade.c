/* shade.c -- see shade.h. Quantities are explained in lanes.h and path.c. */
#include "server/render/shade.h"

#include "server/render/accel.h"
#include "server/render/bsdf.h"
#include "server/render/kernel.h"
#include "server/render/sampler.h"

#define MIN_CONTRIBUTION_SHARE 0.1f /* of the path's radiance so far; smaller contributions undergo roulette */

/* Random numbers of a vertex: pairs 4 k + these. Pairs below 4 are the camera's. */
enum { PAIR_CHOICES, PAIR_LIGHT, PAIR_DIRECTION, PAIR_ROULETTE, PAIRS_PER_VERTEX };

#ifdef __clang__ /* clang does not know the pragma */
#define FOR_LANES for (int i = 0; i < LANES; i++)
#else
#define FOR_LANES _Pragma("GCC ivdep") for (int i = 0; i < LANES; i++)
#endif

static inline float power_heuristic(float a, float b) { return a * a / (a * a + b * b); }

/* clampf without branches. */
static inline float clamp_branchless(float a, float least, float most) {
    float up = a > least ? a : least;
    return up < most ? up : most;
}

/* accel_offset without calls. */
static inline vec3 offset(vec3 p, vec3 normal, vec3 direction) {
    float x = p.x < 0.0f ? -p.x : p.x, y = p.y < 0.0f ? -p.y : p.y, z = p.z < 0.0f ? -p.z : p.z;
    float size = x > y ? x : y;
    size = size > z ? size : z;
    float distance = (size + 1e-2f) * 0x1p-16f;
    float side = vec3_dot(normal, direction) < 0.0f ? -distance : distance;
    return vec3_mad(p, side, normal);
}

KERNEL void shade_surface(struct vertex_block *restrict v, struct shade_block *restrict s) {
    FOR_LANES {
        vec3 direction = lanes3_get(&s->direction, i), normal = lanes3_get(&s->normal, i);
        vec3 viewer = vec3_neg(direction);
        float facing = vec3_dot(normal, viewer);
        float distance = s->distance_m[i], pdf = s->pdf[i];
        float light_pdf = s->area_density[i] * distance * distance / bsdf_max(facing, 1e-6f);
        float weight = power_heuristic(pdf, light_pdf);
        weight = pdf > 0.0f ? weight : 1.0f;
        v->emission_weight[i] = facing > 0.0f ? weight : 0.0f;

        /* Removes the rounding error of the distance along the normal. */
        vec3 p = vec3_mad(lanes3_get(&s->origin, i), distance, direction);
        lanes3_set(&s->point, i, vec3_mad(p, s->plane[i] - vec3_dot(normal, p), normal));

        /* Interpolated normal, flipped to the viewer's side (materials are two-sided). */
        vec3 n = lanes3_get(&s->shading, i);
        float length2 = vec3_dot(n, n);
        float over = 1.0f / sqrtf(bsdf_max(length2, 1e-12f));
        bool smooth = length2 > 1.0f;
        n = (vec3){smooth ? n.x * over : normal.x, smooth ? n.y * over : normal.y, smooth ? n.z * over : normal.z};
        float side = vec3_dot(n, viewer) < 0.0f ? -1.0f : 1.0f;
        n = vec3_scale(n, side);
        lanes3_set(&s->frame_normal, i, n);
        vec3 a, b;
        vec3_frame(n, &a, &b);
        vec3 wo = {vec3_dot(a, viewer), vec3_dot(b, viewer), bsdf_max(vec3_dot(n, viewer), 1e-6f)};
        lanes3_set(&v->wo, i, wo);
    }
}

/* Same result as texture_taps. */
KERNEL void shade_place(struct vertex_block *restrict v, struct shade_block *restrict s, uint32_t width,
                        uint32_t height) {
    float right = (float)width - 1.0f, bottom = (float)height - 1.0f;
    FOR_LANES {
        float x = clamp_branchless(s->place_x[i] - 0.5f, 0.0f, right);
        float y = clamp_branchless(s->place_y[i] - 0.5f, 0.0f, bottom);
        int32_t column = (int32_t)x, row = (int32_t)y;
        s->column[i] = x - (float)column;
        s->row[i] = y - (float)row;
        s->texel[i] = (uint32_t)row * width + (uint32_t)column;
        v->x[i] = (uint16_t)column;
        v->y[i] = (uint16_t)row;
    }
}

KERNEL void shade_cells(struct shade_block *restrict s, const struct guide_grid *restrict grid) {
    const struct guide_grid g = *grid;
    FOR_LANES { s->cell[i] = guide_cell(&g, lanes3_get(&s->point, i), lanes3_get(&s->frame_normal, i)); }
}

KERNEL void shade_numbers(struct shade_block *restrict s, int depth) {
    uint32_t pair = (uint32_t)(depth + 1) * PAIRS_PER_VERTEX;
    FOR_LANES {
        uint32_t key = s->key[i], sample = s->sample[i];
        vec2 choices = sampler_pair(key, sample, pair + PAIR_CHOICES);
        vec2 light = sampler_pair(key, sample, pair + PAIR_LIGHT);
        vec2 bounce = sampler_pair(key, sample, pair + PAIR_DIRECTION);
        s->pick[i] = choices.x;
        s->lobe[i] = choices.y;
        s->light_u[i] = light.x;
        s->light_v[i] = light.y;
        s->bounce_u[i] = bounce.x;
        s->bounce_v[i] = bounce.y;
        s->roulette[i] = sampler_number(key, sample, pair + PAIR_ROULETTE);
        s->light_roulette[i] = sampler_number(~key, sample, pair + PAIR_ROULETTE);
    }
}

/* Two binary searches with a fixed number of steps, without branches: for the patch in the guide's row, then for the
 * triangle in the patch by power. Every lane's row must be valid. */
KERNEL void shade_pick(struct shade_block *restrict s, const struct guide *restrict guide,
                       const struct lights *restrict lights) {
    const float *restrict until = guide->cumulative, *restrict power = guide->power;
    const float *restrict by_power = lights->triangles.cumulative;
    const uint32_t *restrict first = guide->first;
    int32_t stride = (int32_t)guide->stride, start[LANES], patch[LANES], last[LANES];
    float at[LANES];
    FOR_LANES {
        at[i] = lights_rescale(lights, s->pick[i]);
        start[i] = (int32_t)s->guide_row[i] * stride;
        patch[i] = 0;
    }
    for (int32_t step = guide->row_step; step > 0; step /= 2) {
        FOR_LANES { patch[i] += until[start[i] + patch[i] + step - 1] <= at[i] ? step : 0; }
    }
    FOR_LANES {
        int32_t before = patch[i] > 0 ? start[i] + patch[i] - 1 : start[i];
        float low = patch[i] > 0 ? until[before] : 0.0f;
        float width = until[start[i] + patch[i]] - low, within = (at[i] - low) / width;
        uint32_t from = first[patch[i]], end = first[patch[i] + 1];
        s->density_factor[i] = width / power[patch[i]];
        at[i] = by_power[from] + within * (by_power[end] - by_power[from]);
        s->light[i] = (int32_t)from;
        last[i] = (int32_t)end - 1;
    }
    for (int32_t step = guide->patch_step; step > 0; step /= 2) {
        FOR_LANES {
            int32_t next = s->light[i] + step < last[i] ? s->light[i] + step : last[i];
            s->light[i] = by_power[next] <= at[i] ? next : s->light[i];
        }
    }
}

KERNEL void shade_texture(struct vertex_block *restrict v, struct shade_block *restrict s) {
    FOR_LANES {
        float sum = s->filter_sum[i];
        float over = sum > 0.0f ? 1.0f / bsdf_max(sum, 1e-20f) : 0.0f;
        v->base_color.x[i] *= over;
        v->base_color.y[i] *= over;
        v->base_color.z[i] *= over;
        v->weight[0][i] = s->filter[0][i] * over;
        v->weight[1][i] = s->filter[1][i] * over;
        v->weight[2][i] = s->filter[2][i] * over;
        v->weight[3][i] = s->filter[3][i] * over;
    }
}

KERNEL void shade_light(struct shade_block *restrict s) {
    FOR_LANES {
        float u = sqrtf(s->light_u[i]), w = s->light_v[i];
        vec3 edge1 = lanes3_get(&s->light_edge1, i), edge2 = lanes3_get(&s->light_edge2, i);
        vec3 normal = vec3_cross(edge1, edge2), point = lanes3_get(&s->point, i);
        normal = vec3_scale(normal, 1.0f / sqrtf(bsdf_max(vec3_dot(normal, normal), 1e-30f)));
        vec3 on = vec3_mad(lanes3_get(&s->light_corner, i), u * (1.0f - w), edge1);
        on = vec3_mad(on, u * w, edge2);
        vec3 to = vec3_sub(on, point);
        float distance2 = vec3_dot(to, to);
        float over = 1.0f / sqrtf(bsdf_max(distance2, 1e-30f));
        vec3 direction = vec3_scale(to, over);
        float cosine = -vec3_dot(direction, normal);
        lanes3_set(&s->light_direction, i, direction);
        float pdf = s->light_density[i] * distance2 / bsdf_max(cosine, 1e-6f);
        s->light_pdf[i] = cosine > 0.0f ? pdf : 0.0f;

        vec3 origin = offset(point, lanes3_get(&s->normal, i), direction);
        vec3 ray = vec3_sub(offset(on, normal, vec3_neg(direction)), origin);
        float length = sqrtf(vec3_dot(ray, ray));
        lanes3_set(&s->shadow_origin, i, origin);
        lanes3_set(&s->shadow_direction, i, vec3_scale(ray, 1.0f / bsdf_max(length, 1e-20f)));
        s->shadow_far[i] = length;
    }
}

static inline float max_channel(rgb c) { return bsdf_max(c.r, bsdf_max(c.g, c.b)); }

static inline rgb reflect(struct bsdf_value f, rgb base_color, rgb light) {
    return (rgb){(base_color.r * f.diffuse + f.specular) * light.r, (base_color.g * f.diffuse + f.specular) * light.g,
                 (base_color.b * f.diffuse + f.specular) * light.b};
}

/* f cos times light, of a lane's surface. */
static inline rgb reflect_lane(const struct bsdf *bsdf, struct bsdf_value f, bool has_metals, float metallic, vec3 wo,
                               vec3 wi, rgb color, rgb light) {
    return has_metals ? rgb_mul(bsdf_metal(bsdf, f, metallic, wo, wi), light) : reflect(f, color, light);
}

static inline __attribute__((always_inline)) void scatter(struct vertex_block *restrict v,
                                                          struct shade_block *restrict s,
                                                          struct shade_roulette roulette, bool has_metals) {
    FOR_LANES {
        vec3 n = lanes3_get(&s->frame_normal, i), a, b;
        vec3_frame(n, &a, &b);
        rgb base_color = lanes3_rgb(&v->base_color, i), beta = lanes3_rgb(&v->beta, i);
        vec3 wo = lanes3_get(&v->wo, i);
        float metallic = has_metals ? v->metallic[i] : 0.0f;
        struct bsdf bsdf = has_metals ? bsdf_make_metal(base_color, v->roughness[i], v->specular[i], metallic, wo.z)
                                      : bsdf_make(base_color, v->roughness[i], v->specular[i], wo.z);

        vec3 to = lanes3_get(&s->light_direction, i);
        vec3 light = {vec3_dot(a, to), vec3_dot(b, to), vec3_dot(n, to)};
        struct bsdf_value f = bsdf_eval(&bsdf, wo, light);
        float light_pdf = s->light_pdf[i];
        bool lit = light_pdf > 0.0f && f.pdf > 0.0f;
        float factor = lit ? power_heuristic(light_pdf, f.pdf) / bsdf_max(light_pdf, 1e-30f) : 0.0f;
        rgb unoccluded = rgb_scale(lanes3_rgb(&s->radiance, i), factor);
        rgb contribution =
            rgb_mul(beta, reflect_lane(&bsdf, f, has_metals, metallic, wo, light, base_color, unoccluded));
        /* Roulette for shadow rays whose contribution is small against what the path has gathered (Veach 1997,
         * section 10.4.1). */
        rgb path_rr_beta = lanes3_rgb(&s->rr_beta, i),
            color = {bsdf_max(base_color.r, roulette.min_color), bsdf_max(base_color.g, roulette.min_color),
                     bsdf_max(base_color.b, roulette.min_color)};
        float max_contribution = max_channel(
            rgb_mul(path_rr_beta, reflect_lane(&bsdf, f, has_metals, metallic, wo, light, color, unoccluded)));
        float chance = max_contribution / bsdf_max(MIN_CONTRIBUTION_SHARE * s->path_radiance[i], 1e-30f);
        chance = clamp_branchless(chance, roulette.least_light, 1.0f);
        bool is_traced = lit && s->light_roulette[i] < chance;
        float kept = is_traced ? 1.0f / chance : 0.0f;
        lanes3_set(&v->light, i, light);
        lanes3_set_rgb(&v->incident, i, rgb_scale(unoccluded, kept));
        v->light_factor[i] = factor * kept;
        lanes3_set_rgb(&s->contribution, i, rgb_scale(contribution, kept));
        s->has_shadow_ray[i] = is_traced ? 1 : 0;

        vec3 wi = bsdf_sample(&bsdf, wo, s->lobe[i], s->bounce_u[i], s->bounce_v[i]);
        f = bsdf_eval(&bsdf, wo, wi);
        float scale = f.pdf > 0.0f ? 1.0f / bsdf_max(f.pdf, 1e-30f) : 0.0f;
        rgb next_beta = rgb_scale(reflect_lane(&bsdf, f, has_metals, metallic, wo, wi, base_color, beta), scale);
        rgb rr_beta = rgb_scale(reflect_lane(&bsdf, f, has_metals, metallic, wo, wi, color, path_rr_beta), scale);
        chance = clamp_branchless(roulette.scale * max_channel(rr_beta), roulette.least, roulette.most);
        float over = 1.0f / chance;
        bool open = f.pdf > 0.0f && s->roulette[i] < chance;
        v->scale[i] = open ? scale * over : 0.0f;
        lanes3_set(&v->wi, i, wi);
        vec3 bounce = vec3_mad(vec3_mad(vec3_scale(a, wi.x), wi.y, b), wi.z, n);
        lanes3_set(&s->bounce, i, bounce);
        lanes3_set(&s->bounce_origin, i, offset(lanes3_get(&s->point, i), lanes3_get(&s->normal, i), bounce));
        lanes3_set_rgb(&s->bounce_beta, i, rgb_scale(next_beta, over));
        lanes3_set_rgb(&s->bounce_rr_beta, i, rgb_scale(rr_beta, over));
        s->bounce_pdf[i] = f.pdf;
        s->bounce_continues[i] = open ? 1 : 0;
    }
}

KERNEL void shade_scatter(struct vertex_block *restrict v, struct shade_block *restrict s,
                          struct shade_roulette roulette) {
    scatter(v, s, roulette, false);
}

KERNEL void shade_scatter_metals(struct vertex_block *restrict v, struct shade_block *restrict s,
                                 struct shade_roulette roulette) {
    scatter(v, s, roulette, true);
}

KERNEL void shade_backward(const struct vertex_block *restrict v, struct shade_derivative *restrict d) {
    FOR_LANES {
        rgb adjoint = rgb_mul(lanes3_rgb(&d->d_radiance, i), lanes3_rgb(&v->beta, i));
        rgb base_color = lanes3_rgb(&v->base_color, i);
        vec3 wo = lanes3_get(&v->wo, i);
        float specular = v->specular[i];
        struct bsdf bsdf = bsdf_make(base_color, v->roughness[i], specular, wo.z);

        rgb out = rgb_scale(lanes3_rgb(&v->emission, i), v->emission_weight[i]);
        lanes3_set_rgb(&d->d_emission, i, rgb_scale(adjoint, v->emission_weight[i]));

        /* The two reflected terms: light sample and continued path. */
        rgb from_light = lanes3_rgb(&v->incident, i);
        rgb from_bounce = rgb_scale(lanes3_rgb(&v->next, i), v->scale[i]);
        struct bsdf_derivative to_light = bsdf_backward(&bsdf, specular, wo, lanes3_get(&v->light, i));
        struct bsdf_derivative to_bounce = bsdf_backward(&bsdf, specular, wo, lanes3_get(&v->wi, i));
        struct bsdf_value light_value = {to_light.diffuse, to_light.specular, 0.0f};
        struct bsdf_value bounce_value = {to_bounce.diffuse, to_bounce.specular, 0.0f};
        out = rgb_add(out, reflect(light_value, base_color, from_light));
        out = rgb_add(out, reflect(bounce_value, base_color, from_bounce));
        lanes3_set_rgb(&d->out, i, out);
        lanes3_set_rgb(&d->d_light_emission, i,
                       reflect(light_value, base_color, rgb_scale(adjoint, v->light_factor[i])));

        rgb light = rgb_mul(adjoint, from_light), bounce = rgb_mul(adjoint, from_bounce);
        lanes3_set_rgb(&d->d_base_color, i, rgb_mad(rgb_scale(light, to_light.diffuse), to_bounce.diffuse, bounce));
        float light_sum = light.r + light.g + light.b, bounce_sum = bounce.r + bounce.g + bounce.b;
        rgb tinted_light = rgb_mul(light, base_color), tinted_bounce = rgb_mul(bounce, base_color);
        float light_tinted = tinted_light.r + tinted_light.g + tinted_light.b;
        float bounce_tinted = tinted_bounce.r + tinted_bounce.g + tinted_bounce.b;
        d->d_roughness[i] = light_tinted * to_light.diffuse_by_roughness + light_sum * to_light.specular_by_roughness +
                            bounce_tinted * to_bounce.diffuse_by_roughness +
                            bounce_sum * to_bounce.specular_by_roughness;
        d->d_specular[i] = light_sum * to_light.specular_by_specular + bounce_sum * to_bounce.specular_by_specular;
    }
}
