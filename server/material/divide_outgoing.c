/* divide_outgoing.c -- see divide_outgoing.h. */
#include "server/material/divide_outgoing.h"

#include "common/image.h"
#include "common/mem.h"
#include "server/gather/highlight.h"
#include "server/render/bsdf.h"
#include "server/scene/rgb_half.h"

/* Variance by light of other surfaces at which a measured base colour and the denoised one count alike in outgoing
 * radiance. */
#define MIXING_HALF 0.01f /* +25 %: 0 dB */

struct outgoing_job {
    const struct divide *divide;
    const float *specular_albedo; /* [segment_count] */
    const struct divide_outgoing *outgoing;
};

/* Outgoing radiance of a texel, mean over directions. (Photographs show more: they observe floors at grazing angles and
 * walls towards the light.) The more a measurement may be light of other surfaces, the more the denoised base colour
 * replaces it: a thin window frame would otherwise be as bright as the window. Mirrored sun is left to
 * sun_caustics.h. */
static void find_outgoing(const void *user, uint32_t texel) {
    const struct outgoing_job *job = user;
    const struct divide *d = job->divide;
    const struct measurement *m = &d->measured[texel];
    uint32_t segment = surface_segment(&d->surface, texel);
    struct surface_point at;
    struct irradiance light;
    if (d->is_emitter[segment] || !divide_light_without_sun(d, texel, &at, &light))
        return;
    bool mirrors = job->outgoing->lobe[segment].specular > 0.0f;
    rgb flux = irradiance_flux(&light);
    divide_add_sun(d, &at, sun_shadows_at(d->shadows, texel), &light);
    if (!mirrors)
        flux = irradiance_flux(&light);
    float known = m->weight > 0.0f ? MIXING_HALF / (MIXING_HALF + image_float_from_half(m->mixing)) : 0.0f;
    rgb measured = rgb_clamp(measurement_value(m), 0.0f, DIVIDE_MAX_ALBEDO), expected = divide_color(d, texel);
    rgb base = rgb_mad(rgb_scale(expected, 1.0f - known), known, measured);
    rgb unit_diffuse = irradiance_diffuse_mean(&light, at.shading, d->materials->roughness[segment]);
    rgb diffuse = rgb_mul(base, unit_diffuse);
    rgb total = rgb_mad(diffuse, job->specular_albedo[segment] * (1.0f / BSDF_PI), flux);
    rgb_to_half(job->outgoing->total[texel], total);
    rgb_to_half(job->outgoing->unmirrored[texel], mirrors ? diffuse : total);
}

void divide_outgoing_find(const struct divide *d, const struct divide_outgoing *outgoing) {
    const struct materials *m = d->materials;
    size_t segments = d->surface.segments->count;
    float *specular_albedo = mem_array(segments, sizeof *specular_albedo);
    for (uint32_t i = 0; i < segments; i++) {
        float roughness = m->roughness[i], specular = m->specular[i];
        bool mirrors = materials_is_polished(m, i) && !d->is_emitter[i];
        specular_albedo[i] = highlight_albedo(roughness, specular);
        outgoing->lobe[i] = (struct incident_lobe){roughness, mirrors ? specular : 0.0f};
    }
    divide_each(d, find_outgoing, &(struct outgoing_job){d, specular_albedo, outgoing});
    mem_free(specular_albedo);
}
