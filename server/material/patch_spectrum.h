/* patch_spectrum.h -- Wiener filter of a picture's details, by the spectra of its patches.
 *
 * Patches of 16 x 16 samples that overlap by half are transformed (patch_transform.h). Noise has much the same power
 * at all frequencies of one length, but for blocks of samples that share it, while texture has its own in few:
 * stripes, joints, weaves. So a coefficient is kept by its share of texture (Wiener 1949), whose power is that of
 * the coefficient over the patches around less that of a sample of the noise; or, where there is much more of it in
 * this patch alone than noise explains, by that (as hard thresholds do; Yaroslavsky, Egiazarian and Astola 2001).
 *
 * Samples that are less certain than those around count for less: what they lack is taken from what a first filter
 * kept there, and all is filtered again. */
#ifndef UNBAKE_MATERIAL_PATCH_SPECTRUM_H
#define UNBAKE_MATERIAL_PATCH_SPECTRUM_H

#include <stddef.h>

/* Steps within which lies all that what is kept of a sample depends on. In a first filter 64: patches around those that
 * hold it, and those around them, which tell their noise. In the second 40: patches around, filled in by the first. */
#define PATCH_SPECTRUM_REACH 104

/* Planes are [height][width]; the caller's. Samples that are missing have trust 0 and value 0. */
struct patch_spectrum {
    size_t width, height;
    size_t step;           /* between samples of a patch: each of the step x step lattices is filtered alone */
    size_t block;          /* samples a side that share a measurement, hence its noise */
    float *value[3];       /* by channel: details, which are replaced by what is kept of them */
    float *noise[3];       /* a sample of their noise; overwritten */
    const float *trust;    /* in [0, 1] */
    const float *variance; /* of noise, summed over channels, up to a factor that `noise` tells */
    const float *mixing;   /* the same of errors that neighbours share, which `noise` lacks */
    float *error;          /* to which the expected squared error of what is kept is added, over channels */
};

/* Deterministic; of one thread. */
void patch_spectrum_filter(struct patch_spectrum *p);

#endif
