/* photograph.h -- a posed photograph: linear pixels, exposure, mask.
 *
 * A stored value is exposure x gain x falloff x radiance: radiance L shows as
 * min(L * exposure * gain * falloff, clip), clip being infinite for HDR frames. The falloff
 * (vignette) is exp(v0 s + v1 s^2 + v2 s^3), s being the squared distance from the principal
 * point over the squared half diagonal: never 0 or negative, whatever the coefficients. It is
 * divided out in each look-up and not in the stored pixels, since the clip is of those.
 *
 * A frame of 8 bits shows no pixel darker than black, so the noise of one that is nearly black is on one side, and the
 * mean of many too bright. A stored 0 therefore reads as a little below 0, by what the noise below black is in the mean. */
#ifndef UNBAKE_SCENE_PHOTOGRAPH_H
#define UNBAKE_SCENE_PHOTOGRAPH_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "common/vec.h"
#include "server/scene/camera.h"

struct photograph {
    char *name;             /* as in transforms.json; owned */
    struct camera camera;
    bool is_test;           /* held out: never used to reconstruct */
    bool is_hdr;
    bool exposure_known;
    float exposure;         /* pixel value per radiance; 1 until it is solved where not known */
    rgb gain;               /* per channel, 1 by default */
    float vignette[3];      /* v0 v1 v2 of the falloff; 0: none */
    float blur_px;          /* motion blur beyond that of its neighbours, standard deviation; 0: none */
    float black;            /* a stored 0 reads as minus this value; 0 until noise is known, and for HDR */
    float clip;             /* value at which a pixel is saturated; INFINITY for HDR */
    uint16_t (*pixel)[3];   /* [height][width] linear half-precision values; owned */
    uint8_t *white;         /* [height][width] bit c: channel c saturates, by what is around (clip.h); NULL: where its value
                             * is at the clip; owned */
    bool *spark;            /* [height][width] it shines by chance (sparks.h); NULL: not asked; owned */
    uint8_t *clipped;       /* [height][width] bit c: channel c was at its largest as the file stores it; NULL: where its
                             * value is at the clip. Of a file of wider primaries than Rec. 709 values may pass the clip
                             * without; owned */
    char *color_space;      /* of the file, which was converted, for people: "Display P3"; NULL: it was not; owned */
    uint8_t *mask;          /* [height][width] 0 where the pixel must not be used, or NULL; owned */
};

struct photograph_sample {
    rgb radiance;           /* value / (exposure * gain * falloff); may be below 0 */
    bool saturated[3];      /* per channel: the value is a lower bound */
    rgb clip_radiance;      /* radiance at which this frame saturates; INFINITY for HDR */
};

void photograph_release(struct photograph *photo);

/* Whether the file clips this channel of the pixel number `at`, whose value that is. */
static inline bool photograph_clips(const struct photograph *photo, size_t at, int channel, float value) {
    return photo->clipped ? photo->clipped[at] >> channel & 1 : value >= photo->clip;
}

/* s of the falloff at pixel place (x, y): 1 in the corners. */
static inline float photograph_radius(const struct photograph *photo, float x, float y) {
    const struct camera *c = &photo->camera;
    float w = (float)c->width, h = (float)c->height, dx = x - c->cx, dy = y - c->cy;
    return 4.0f * (dx * dx + dy * dy) / (w * w + h * h);
}

/* The share of light that the vignette leaves at pixel place (x, y). */
float photograph_falloff(const struct photograph *photo, float x, float y);

/* How far a look-up counts against one in a sharp photograph. */
static inline float photograph_trust(const struct photograph *photo) {
    return 1.0f / (1.0f + photo->blur_px * photo->blur_px);
}

/* Bilinear look-up at pixel place (x, y) inside the picture; a channel is saturated when a tap
 * of weight is. False when a tap is masked or not finite. */
bool photograph_sample(const struct photograph *photo, float x, float y,
                       struct photograph_sample *sample);

/* Whether one of the pixels that such a look-up reads shines by chance. */
bool photograph_sparks(const struct photograph *photo, float x, float y);

/* Cubic look-up (Keys 1981, a = -1/2), which does not blur by another pixel's width as a bilinear one
 * does and passes on twice its noise. False when one of the 4 x 4 taps is outside, masked, saturated, not
 * finite, or shines by chance: the dark ring that it would get would be taken for texture. */
bool photograph_sample_cubic(const struct photograph *photo, float x, float y, rgb *radiance);

/* Its four weights along a row or column, for a place `t` in [0, 1) from the second tap to the third. */
static inline void photograph_cubic(float t, float weight[4]) {
    weight[0] = -0.5f * t * (1.0f - t) * (1.0f - t);
    weight[1] = 1.0f + t * t * (1.5f * t - 2.5f);
    weight[2] = t * (0.5f + t * (2.0f - 1.5f * t));
    weight[3] = -0.5f * t * t * (1.0f - t);
}

/* How bright (mean of the channels) the picture is at eight places around one; those outside of it or masked
 * do not count. */
struct photograph_ring {
    float brightest, darkest, sum, count; /* without any the darkest is infinite, all others 0 */
};
struct photograph_ring photograph_ring(const struct photograph *photo, float x, float y, float radius_px);

#endif
