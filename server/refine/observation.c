/* observation.c -- see observation.h. */
#include "server/refine/observation.h"

#include <math.h>

#include "common/mem.h"
#include "common/rng.h"

/* Weight of a pixel that mixes surfaces: it matters only where there is no clean observation, of which
 * one outweighs fifty. */
#define MIXED_WEIGHT 0.02f /* +25 %: -0.02 dB */

void observation_batch_init(struct observation_batch *b, const struct surface *surface, const struct world *world,
                            const struct views *views, const struct path_settings *path, int cameras, int samples,
                            size_t texels) {
    size_t observations = texels * (size_t)cameras, paths = observations * (size_t)samples;
    *b = (struct observation_batch){.surface = *surface,
                                    .world = world,
                                    .views = views,
                                    .path = *path,
                                    .cameras = cameras,
                                    .samples = samples,
                                    .observation_capacity = observations};
    b->observation = mem_array(observations, sizeof *b->observation);
    b->paths = path->derivatives ? path_batch_new(paths, path->max_depth) : path_batch_new_forward(paths);
    b->ray = mem_array(paths, sizeof *b->ray);
    b->key = mem_array(paths, sizeof *b->key);
    b->reference = mem_array(paths, sizeof *b->reference);
    b->radiance = mem_array(paths, sizeof *b->radiance);
    b->d_radiance = mem_array(paths, sizeof *b->d_radiance);
}

void observation_batch_release(struct observation_batch *b) {
    mem_free(b->observation);
    path_batch_free(b->paths);
    mem_free(b->ray);
    mem_free(b->key);
    mem_free(b->reference);
    mem_free(b->radiance);
    mem_free(b->d_radiance);
    *b = (struct observation_batch){0};
}

void observation_batch_clear(struct observation_batch *b) { b->observation_count = 0; }

/* Sets up the paths of observation `at`, whose first sample has number `sample_number`. False when one cannot be used:
 * outside the picture, masked, a firefly, or a mixed pixel while that of the texel's centre is clean. Nor can one at
 * the end of half precision: as a bound it would pull by 65504 where a renderer failed, and of a lamp that is so bright
 * the fit of light has it already. */
static bool connect(struct observation_batch *b, size_t at, const struct view *view, uint32_t texel, uint64_t iteration,
                    uint32_t sample_number) {
    const struct surface *s = &b->surface;
    const struct photograph *photo = &b->views->scene->photograph[b->views->train[view->train]];
    bool clean = views_clean(b->views, view);
    uint32_t x = texel % s->atlas->width, y = texel / s->atlas->width;
    for (int i = 0; i < b->samples; i++) {
        struct path_key key = {texel, (uint32_t)(2 * iteration) + (uint32_t)(i & 1), sample_number + (uint32_t)i / 2};
        /* A random place in the texel: the photograph shows all of it, not its centre. */
        uint64_t bits = rng_key(b->path.seed ^ key.iteration, key.index, key.sample);
        uint32_t triangle;
        float b1, b2, depth_m;
        struct view place = *view;
        if (!inverse_uv_lookup(s->inverse, s->atlas, (float)x + rng_to_float((uint32_t)bits),
                               (float)y + rng_to_float((uint32_t)(bits >> 32)), &triangle, &b1, &b2))
            return false;
        vec3 point = mesh_point(s->mesh, triangle, b1, b2);
        size_t path = at * (size_t)b->samples + (size_t)i;
        if (!camera_project(&photo->camera, point, &place.x, &place.y, &depth_m) ||
            (clean && !views_clean(b->views, &place)) || photograph_has_firefly(photo, place.x, place.y) ||
            !photograph_sample(photo, place.x, place.y, &b->reference[path]) ||
            (photo->is_hdr && photograph_sample_saturates(&b->reference[path])))
            return false;
        vec3 origin = camera_origin(&photo->camera);
        b->ray[path] = (struct ray){origin, vec3_normalize(vec3_sub(point, origin))};
        b->key[path] = key;
    }
    b->observation[at] =
        (struct observation){texel, surface_segment(s, texel), photo, *view, clean ? 1.0f : MIXED_WEIGHT};
    return true;
}

void observation_add(struct observation_batch *b, uint32_t texel, uint64_t iteration) {
    const struct surface *s = &b->surface;
    uint32_t triangle;
    float b1, b2;
    if (!inverse_uv_lookup(s->inverse, s->atlas, (float)(texel % s->atlas->width) + 0.5f,
                           (float)(texel / s->atlas->width) + 0.5f, &triangle, &b1, &b2))
        return;
    vec3 normal = vec3_normalize(mesh_cross(s->mesh, triangle));
    vec3 point = mesh_point(s->mesh, triangle, b1, b2);
    struct view view[VIEWS_PICK_MAX];
    uint32_t key = (uint32_t)rng_key(b->path.seed, iteration, texel);
    size_t seen = views_pick(b->views, point, normal, key, (size_t)b->cameras, view);
    uint32_t samples_a_half = ((uint32_t)b->samples + 1) / 2;
    for (size_t k = 0; k < seen && b->observation_count < b->observation_capacity; k++) {
        if (connect(b, b->observation_count, &view[k], texel, iteration, (uint32_t)k * samples_a_half))
            b->observation_count++;
    }
}

void observation_add_pixels(struct observation_batch *b, uint64_t number, uint64_t iteration) {
    const struct surface *s = &b->surface;
    uint32_t samples_a_half = ((uint32_t)b->samples + 1) / 2;
    for (int k = 0; k < b->cameras && b->observation_count < b->observation_capacity; k++) {
        uint64_t pick = rng_key(b->path.seed, iteration, number * VIEWS_PICK_MAX + (uint64_t)k);
        uint64_t place = rng_mix64(pick);
        struct view view = {.train = rng_below((uint32_t)pick, (uint32_t)b->views->train_count)};
        const struct camera *camera = &b->views->scene->photograph[b->views->train[view.train]].camera;
        struct accel_hit hit;
        vec3 direction;
        view.x = rng_to_float((uint32_t)place) * (float)camera->width;
        view.y = rng_to_float((uint32_t)(place >> 32)) * (float)camera->height;
        if (!camera_direction(camera, view.x, view.y, &direction) ||
            !accel_intersect(b->views->accel, camera_origin(camera), direction, 0.0f, INFINITY, &hit))
            continue;
        vec2 at = atlas_point(s->atlas, hit.triangle, hit.b1, hit.b2);
        uint32_t texel = (uint32_t)at.y * s->atlas->width + (uint32_t)at.x;
        if (s->inverse->triangle[texel] != INVERSE_UV_NONE &&
            connect(b, b->observation_count, &view, texel, iteration, (uint32_t)k * samples_a_half))
            b->observation_count++;
    }
}

void observation_trace(struct observation_batch *b) {
    size_t paths = b->observation_count * (size_t)b->samples;
    if (paths > 0)
        path_batch_trace(b->paths, b->world, &b->path, paths, b->ray, b->key, b->radiance);
}
