/* survey.c -- see survey.h. */
#include "server/light/survey.h"

#include <string.h>

#include "common/mem.h"
#include "common/spaced.h"
#include "server/gather/sun.h"
#include "server/light/emitters.h"
#include "server/render/sampler.h"
#include "server/state/evidence.h"

#define KEY_SURVEY 29 /* keeps the random numbers of points apart from others of the texel */
/* The texels around one, each way as far as this part of the atlas's width, give its observed radiance. */
#define AROUND 640
/* Part of the way to the middle of its triangle by which a point is moved. */
#define INSIDE 1e-3f

/* What was fused, and of those that no photograph shows the mean of their segment, or of the room. */
static void fill_radiance(struct survey *s) {
    const struct reconstruction *r = s->r;
    size_t segments = r->segments.count;
    double(*sum)[4] = mem_calloc(segments + 1, sizeof *sum);
    for (size_t i = 0; i < r->inverse.valid_count; i++) {
        uint32_t texel = r->inverse.valid[i];
        rgb radiance = fused_radiance(&r->fused, texel);
        if (!(r->fused.count[texel] > 0.0f))
            continue;
        for (size_t to = reconstruction_segment(r, texel), k = 0; k < 2; to = segments, k++) {
            sum[to][0] += (double)radiance.r;
            sum[to][1] += (double)radiance.g;
            sum[to][2] += (double)radiance.b;
            sum[to][3] += 1.0;
        }
    }
    for (size_t i = 0; i < r->inverse.valid_count; i++) {
        uint32_t texel = r->inverse.valid[i], segment = reconstruction_segment(r, texel);
        const double *from = sum[segment][3] > 0.0 ? sum[segment] : sum[segments];
        for (int c = 0; c < 3 && !(r->fused.count[texel] > 0.0f) && from[3] > 0.0; c++)
            s->radiance[texel][c] = image_half_from_float((float)(from[c] / from[3]));
    }
    mem_free(sum);
}

static void make_lights(struct reconstruction *r, const struct views *views, const bool *without) {
    struct emitter_evidence *evidence = mem_array(r->segments.count, sizeof *evidence);
    memcpy(evidence, r->evidence, r->segments.count * sizeof *evidence);
    emitters_observe(r, views, evidence);
    for (size_t i = 0; i < r->segments.count && without; i++) {
        if (without[i])
            evidence[i] = (struct emitter_evidence){0};
    }
    emitters_light_bright(r, views, evidence);
    mem_free(evidence);
}

/* Segments of `without` are as bright as they are by now, to those who see them in a mirror. */
static void leave_out(struct survey *s, const bool *without) {
    const struct reconstruction *r = s->r;
    s->field.specular_only = without;
    for (size_t i = 0; i < r->inverse.valid_count; i++) {
        uint32_t texel = r->inverse.valid[i], segment = reconstruction_segment(r, texel);
        if (without[segment])
            rgb_to_half(s->radiance[texel], r->evidence[segment].radiance);
    }
}

/* Observed, by more than a lower bound, and no lamp; with bounds any that has one. */
static bool is_usable(const struct reconstruction *r, const bool *without, bool with_bounds, uint32_t texel) {
    uint32_t segment = reconstruction_segment(r, texel);
    bool is_dark = rgb_is_black(r->materials.emission[segment]) && r->fused.count[texel] > 0.0f;
    return is_dark && (r->fused.is_bound[texel] ? with_bounds : !(without && without[segment]));
}

static void choose_points(struct survey *s, const bool *without, bool with_bounds, size_t points) {
    const struct reconstruction *r = s->r;
    size_t seen = 0;
    for (size_t i = 0; i < r->inverse.valid_count; i++)
        seen += is_usable(r, without, with_bounds, r->inverse.valid[i]);
    struct spacing spacing = {.all = seen, .wanted = seen < points ? seen : points};
    s->texel = mem_array(spacing.wanted + 1, sizeof *s->texel);
    for (size_t i = 0; i < r->inverse.valid_count; i++) {
        uint32_t texel = r->inverse.valid[i];
        if (is_usable(r, without, with_bounds, texel) && spacing_takes(&spacing))
            s->texel[s->count++] = texel;
    }
}

void survey_init(struct survey *s, struct reconstruction *r, const struct views *views, const struct light_field *field,
                 const bool *without, bool with_bounds, size_t points) {
    size_t texels = (size_t)r->fused.width * r->fused.height;
    *s =
        (struct survey){.r = r, .has_lights = views != NULL, .radiance = mem_calloc_large(texels, sizeof *s->radiance)};
    if (views)
        make_lights(r, views, without);
    memcpy(s->radiance, field ? field->radiance : (const uint16_t(*)[3])r->fused.radiance,
           texels * sizeof *s->radiance);
    if (!field)
        fill_radiance(s);
    s->field = (struct light_field){.world = &r->world, .radiance = (const uint16_t(*)[3])s->radiance};
    if (field)
        s->field.lobe = field->lobe;
    if (without)
        leave_out(s, without);
    choose_points(s, without, with_bounds, points);
    s->scratch = mem_array((size_t)parallel_thread_count(r->pool), sizeof *s->scratch);
}

void survey_release(struct survey *s) {
    struct reconstruction *r = s->r;
    if (s->has_lights) {
        memset(r->materials.emission, 0, r->segments.count * sizeof *r->materials.emission);
        world_update_lights(&r->world);
    }
    mem_free(s->scratch);
    mem_free(s->texel);
    mem_free(s->radiance);
}

bool survey_gather(const struct survey *s, uint32_t texel, size_t rays, int thread, struct surface_point *at,
                   struct irradiance *light) {
    const struct reconstruction *r = s->r;
    const struct mesh *mesh = &r->scene->mesh;
    struct incident *in = &s->scratch[thread];
    if (!surface_at_texel(mesh, &r->atlas, &r->inverse, texel, at))
        return false;
    vec3 middle = mesh_point(mesh, at->triangle, 1.0f / 3.0f, 1.0f / 3.0f);
    at->position = vec3_mad(at->position, INSIDE, vec3_sub(middle, at->position));
    memset(in->escapes, 0, rays * sizeof *in->escapes); /* inside closed bodies no ray is traced */
    irradiance_gather(light, in, &s->field, at, sampler_key(KEY_SURVEY, texel, 0), rays);
    sun_add_light(&r->sun, r->world.accel, at, light);
    return true;
}

rgb survey_lambert(const struct surface_point *at, const struct irradiance *light) {
    return irradiance_diffuse(light, at->shading, 1.0f, at->shading);
}

rgb survey_observed(const struct survey *s, const struct fused *fused, uint32_t texel) {
    return fused_around(fused, &s->r->atlas, &s->r->inverse, texel, s->r->atlas.width / AROUND);
}
