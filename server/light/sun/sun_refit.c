/* sun_refit.c -- see sun_refit.h. */
#include "server/light/sun/sun_refit.h"

#include <math.h>

#include "common/mem.h"
#include "common/spaced.h"
#include "server/gather/sun.h"
#include "server/light/sun/missing_light.h"
#include "server/render/bsdf.h"
#include "server/scene/surface.h"

/* Greatest factor by which a channel is changed; a greater one means another error. */
#define MAX_CHANGE 2.0f

static bool is_usable(const struct divide *d, uint32_t texel) {
    return d->fused->count[texel] > 0.0f && !d->fused->is_bound[texel] &&
           !d->is_emitter[surface_segment(&d->surface, texel)];
}

/* Evenly spread; returns their number. */
static size_t choose_texels(const struct divide *d, uint32_t texel[LIGHT_PLACES]) {
    const struct inverse_uv *inverse = d->surface.inverse;
    size_t all = 0, count = 0;
    for (size_t i = 0; i < inverse->valid_count; i++)
        all += is_usable(d, inverse->valid[i]);
    struct spacing spacing = {.all = all, .wanted = all < LIGHT_PLACES ? all : LIGHT_PLACES};
    for (size_t i = 0; i < inverse->valid_count; i++) {
        if (is_usable(d, inverse->valid[i]) && spacing_takes(&spacing))
            texel[count++] = inverse->valid[i];
    }
    return count;
}

struct placing {
    const struct divide *divide;
    const uint32_t *texel;
    struct light_place *place;
};

/* Diffuse radiance, Lambert radiance without the sun, and response to the sun; weight 0 where base colour was not
 * measured, or is only bounded. */
static void place_texel(void *user, size_t index, int thread) {
    (void)thread;
    const struct placing *job = user;
    const struct divide *d = job->divide;
    const struct surface *s = &d->surface;
    const struct measurement *m = &d->measured[job->texel[index]];
    struct light_place *p = &job->place[index];
    struct irradiance light = {0};
    rgb lambert;
    *p = (struct light_place){.segment = surface_segment(s, job->texel[index])};
    if (!(m->weight > 0.0f) || m->bounds != 0 || !divide_lambert(d, job->texel[index], &lambert) ||
        !surface_at_texel(s->mesh, s->atlas, s->inverse, job->texel[index], &p->at))
        return;
    sun_add_light(d->sun, d->accel, &p->at, &light);
    rgb of_sun = irradiance_diffuse(&light, p->at.shading, 1.0f, p->at.shading);
    p->weight = 1.0f;
    p->observed = rgb_clamp(rgb_mul(measurement_value(m), lambert), 0.0f, INFINITY);
    p->lambert = rgb_clamp(rgb_sub(lambert, of_sun), 0.0f, INFINITY);
    p->visible = sun_visibility(d->sun, d->accel, &p->at, 0);
    float cosine = vec3_dot(d->sun->direction, p->at.shading);
    p->response = p->visible * cosine * irradiance_matt(cosine);
}

static void find_places(struct divide *d, struct light_places *places) {
    uint32_t *texel = mem_array(LIGHT_PLACES, sizeof *texel);
    size_t count = choose_texels(d, texel), known = 0;
    struct light_place *place = mem_array(count + 1, sizeof *place);
    divide_texels(d, texel, count);
    parallel_for(d->pool, count, place_texel, &(struct placing){d, texel, place});
    for (size_t i = 0; i < count; i++) {
        if (place[i].weight > 0.0f)
            place[known++] = place[i];
    }
    light_places_take(places, place, known);
    mem_free(texel);
}

void sun_refit(struct divide *d, struct sun *sun) {
    struct light_places places;
    struct missing_light missing;
    if (!sun->is_there || sun->is_measured || sun->is_clipped)
        return;
    find_places(d, &places);
    missing_light_init(&missing, &places, d->pool);
    rgb fitted = rgb_scale(missing_light_color(&missing), BSDF_PI);
    for (int c = 0; c < 3; c++) {
        float *irradiance = &(&sun->irradiance.r)[c], before = *irradiance;
        *irradiance = clampf((&fitted.r)[c], before / MAX_CHANGE, before * MAX_CHANGE);
    }
    missing_light_release(&missing);
    light_places_release(&places);
}
