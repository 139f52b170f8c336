/* noise.h -- how far the pixels of a capture are from what they should show.
 *
 * Measured on the photographs themselves. Where three pixels in a row show one smooth surface, the
 * middle one differs from the mean of the others by noise alone; the difference is small over most of
 * any picture, so a low quantile of it tells the noise and not the texture. Noise is told as a share of
 * the stored value (exposure x radiance), by that value: of light that arrives as photons, and of
 * a renderer's samples, the share only falls as the value rises. Around that it differs from place to
 * place (a renderer's samples are worse in one corner, a camera's processing smooths another). There
 * texture is told from noise by how the difference grows with the distance between the pixels:
 * what is left at distance 0, the nugget of a variogram (Matheron 1963), is noise.
 *
 * The darkest values of 8 bits of which noise can be told give its deviation at black, where it does not fall further. */
#ifndef UNBAKE_CAPTURE_NOISE_H
#define UNBAKE_CAPTURE_NOISE_H

#include "common/vec.h"
#include "server/capture/views.h"

#define NOISE_OCTAVES 40 /* of stored values */
#define NOISE_BLOCK 16   /* pixels */

struct noise {
    float share[NOISE_OCTAVES]; /* standard deviation over value, of each octave */
    float black;                /* see photograph.h; of pictures of 8 bits */
    size_t train_count;
    float **scale; /* [train_count][rows][columns] of the blocks of a photograph: what the share is
                    * multiplied by there; owned */
};

void noise_measure(struct noise *noise, const struct views *views);
/* Sets `black` of the photographs of 8 bits that are not held out. */
void noise_set_black(const struct noise *noise, struct scene *scene);
void noise_release(struct noise *noise);

/* Standard deviation of the radiance that the pixel at the view's place tells, where it should tell
 * `radiance`. Above 0 where the radiance is. */
rgb noise_deviation(const struct noise *noise, const struct views *views, const struct view *view, rgb radiance);

/* The same at a place of a picture that stores `value` there, of that value. */
float noise_deviation_of_value(const struct noise *noise, uint32_t train, const struct camera *camera, float x, float y,
                               float value);

/* The same of black, where 8 bits have noise as well; of those alone. */
float noise_deviation_of_black(const struct noise *noise);

/* What a look-up there counts beside others of the same point that should all tell `radiance`: the inverse of
 * its variance, as a share of the radiance squared, by noise and by light of other surfaces
 * (views_mixing). */
float noise_weight(const struct noise *noise, const struct views *views, const struct view *view, rgb radiance,
                   float mixing);

/* The same by how brightly the photograph shows that radiance, wherever in it and without others' light: where texture is
 * fine some of it is taken for noise. */
float noise_weight_of_brightness(const struct noise *noise, const struct photograph *photo, rgb radiance);

/* What a bilinear or cubic look-up in a picture of independent noise of deviation 1 reads at the view's
 * place: the same for the same pixels, so that texels which share pixels share their noise. */
float noise_draw(const struct view *view, bool cubic);

#endif
