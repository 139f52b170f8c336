/* divide.h -- base colour in closed form: reflected radiance over that of a Lambertian surface of albedo 1.
 *
 * Each observation of a texel gives a base colour, (observed - highlight) / lambert. Their robust mean is taken,
 * weighted as in fuse.h, and lower where the highlight is a large part of the observation. What the sun adds to lambert
 * is averaged over what each photograph averages (sun_shadows.h). Of more than
 * MEASUREMENT_OBSERVATIONS photographs those of the greatest weights are used, without regard to highlights. The
 * result is denoised (denoise.h); texels that were not measured are filled in from their neighbours or their prior
 * (color_prior.h). */
#ifndef UNBAKE_MATERIAL_DIVIDE_H
#define UNBAKE_MATERIAL_DIVIDE_H

#include <stdbool.h>
#include <stdint.h>

#include "server/capture/noise.h"
#include "server/capture/views.h"
#include "server/gather/incident.h"
#include "server/gather/irradiance.h"
#include "server/gather/probes.h"
#include "server/gather/sun.h"
#include "server/material/denoise.h"
#include "server/material/sun_shadows.h"
#include "server/scene/materials.h"
#include "server/scene/surface.h"

/* Borrowed, all pointers. */
struct divide {
    struct surface surface;
    const struct views *views;
    const struct fused *fused;       /* observed radiance */
    const struct noise *noise;       /* of the photographs */
    const struct probes *probes;     /* light that arrives, but for the sun's */
    const struct light_field *field; /* for highlights */
    const struct sun *sun;
    const struct sun_shadows *shadows; /* of it, on all texels */
    const struct accel *accel;         /* for its shadows elsewhere */
    const bool *is_emitter;            /* [segment_count] */
    struct materials *materials;       /* base_color and deviation are written, roughness and specular are read */
    struct parallel *pool;
    bool denoises;                /* else base colour is as measured */
    size_t highlight_samples;     /* directions of one highlight (divide_highlight_samples) */
    uint32_t stride;              /* one texel of each chart is measured in every stride x stride */
    float *typical;               /* [segment_count] mean base colour, by the last divide_finish; .5 before */
    struct incident *scratch;     /* [threads] */
    struct measurement *measured; /* [height][width] base colour by the photographs */
};

/* Directions of one highlight where a pixel covers that many texels. */
size_t divide_highlight_samples(double texels_per_pixel);

/* Measures texel[count], which are valid. Emitters, whose own light hides it, get a neutral base colour. */
void divide_texels(struct divide *d, const uint32_t *texel, size_t count);

/* *diffuse: radiance of the measured texels towards their normals, without highlights; count is 0 for all others. Its
 * spread is NULL. To be released by the caller. */
void divide_diffuse(const struct divide *d, struct fused *diffuse);

/* Radiance of a Lambertian surface of albedo 1 at the texel; false where the texel is not valid. */
bool divide_lambert(const struct divide *d, uint32_t texel, rgb *lambert);

/* The same for all measured texels, [height][width]; 0 where it is too dark to divide by. */
void divide_lambert_all(const struct divide *d, uint16_t (*lambert)[3]);

/* After all texels: writes materials->base_color, and its deviation where there is room for that. */
void divide_finish(struct divide *d);

/* --- for divide_outgoing.h --- */

/* Bound of one observation's base colour, against division by almost nothing. */
#define DIVIDE_MAX_ALBEDO 4.0f /* +25 %: 0 dB */

/* Base colour of a texel as it is. */
rgb divide_color(const struct divide *d, uint32_t texel);

/* The point of a texel and its irradiance without the sun's; false where the texel is not valid. */
bool divide_light_without_sun(const struct divide *d, uint32_t texel, struct surface_point *at,
                              struct irradiance *light);

/* Adds a fraction of the sun's light to the irradiance at a point. */
void divide_add_sun(const struct divide *d, const struct surface_point *at, float fraction, struct irradiance *light);

/* Calls of(job, texel) for each valid texel, in any order and on all threads. */
void divide_each(const struct divide *d, void (*of)(const void *job, uint32_t texel), const void *job);

#endif
