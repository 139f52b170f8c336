/* photograph.h -- a posed photograph: linear pixels, exposure, mask.
 *
 * Image formation: pixel = min(exposure * gain * falloff * radiance, clip), where clip is infinite for HDR images.
 * The falloff (vignette) is exp(v0 s + v1 s^2 + v2 s^3), with s the squared distance from the principal point over
 * the squared half diagonal; the exponential keeps it positive. Each lookup divides by it; stored pixels keep it,
 * since they are clipped.
 *
 * An 8-bit image has no values below black, so noise in nearly black areas is one-sided and its mean is biased
 * upwards. A stored 0 therefore reads as slightly negative, by the mean of the clipped noise. */
#ifndef UNBAKE_SCENE_PHOTOGRAPH_H
#define UNBAKE_SCENE_PHOTOGRAPH_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "common/spill.h"
#include "common/vec.h"
#include "server/scene/camera.h"

/* Bytes a pixel that a photograph takes when it is loaded, and that the reconstruction adds for each one that it uses:
 * saturated, firefly, and three of capture/views.h. */
#define PHOTOGRAPH_PIXEL_BYTES 6
#define PHOTOGRAPH_LATER_BYTES 5

struct photograph {
    struct spill *spill; /* of which the arrays of pixels are; NULL: memory; borrowed */
    char *name;          /* as in transforms.json; owned */
    struct camera camera;
    bool is_test; /* held out: never used to reconstruct */
    bool is_hdr;
    bool is_straight; /* the camera's tone curve was found and is taken off its pixels (capture/tone_curve.h) */
    bool exposure_known;
    float exposure;          /* pixel value per radiance; 1 until it is solved where not known */
    float settings_exposure; /* seconds ISO / 100 / f-number^2 of the camera, where all three are told; else 0 */
    rgb gain;                /* per channel, 1 by default */
    float vignette[3];       /* v0 v1 v2 of the falloff; 0: none */
    float blur_px;           /* motion blur in excess of the neighbouring frames', standard deviation; 0: none */
    float black;             /* a stored 0 reads as minus this value; 0 until the noise is known, and for HDR */
    float clip;              /* saturation value; INFINITY for HDR */
    uint16_t (*pixel)[3];    /* [height][width] linear, half precision; owned */
    uint8_t *saturated;      /* [height][width] bit c: channel c is saturated, judged with its neighbourhood
                                 * (clip.h); NULL: where the value is at the clip; owned */
    bool *firefly;           /* [height][width] isolated bright pixel of Monte Carlo or sensor noise; NULL: not
                               * detected; owned */
    uint8_t *clipped;        /* [height][width] bit c: channel c had its largest value in the file; NULL: where the
                             * value is at the clip. In a file of primaries wider than Rec. 709, unclipped values may
                             * exceed the clip; owned */
    char *color_space;       /* name of the file's colour space if it was converted ("Display P3"), else NULL; owned */
    uint8_t *mask;           /* [height][width] 0: the pixel is excluded; NULL: none is; owned */
    struct {
        uint32_t step;          /* its pixels, in each direction, of which each of these is the mean; 0 and 1: one */
        uint32_t width, height; /* of it; set where step is more than 1 */
        bool has_mask;          /* it came with a mask, or transparent */
    } file;
};

struct photograph_sample {
    rgb radiance;      /* value / (exposure * gain * falloff); may be negative */
    bool saturated[3]; /* per channel: the value is a lower bound */
    rgb clip_radiance; /* radiance at which this frame saturates; INFINITY for HDR */
};

/* Whether any channel is a lower bound. */
static inline bool photograph_sample_saturates(const struct photograph_sample *sample) {
    return sample->saturated[0] || sample->saturated[1] || sample->saturated[2];
}

void photograph_release(struct photograph *photo);

/* The camera of the picture in the file, before it was reduced. */
struct camera photograph_file_camera(const struct photograph *photo);

/* Whether the file clips this channel of pixel number `at`, given its value. */
static inline bool photograph_clips(const struct photograph *photo, size_t at, int channel, float value) {
    return photo->clipped ? photo->clipped[at] >> channel & 1 : value >= photo->clip;
}

/* A channel's stored value of pixel number `at`: slightly negative for a stored 0, no less than the clip where it is
 * saturated, which *is_saturated says. */
float photograph_value(const struct photograph *photo, size_t at, int channel, bool *is_saturated);

/* s of the falloff at pixel coordinates (x, y): 1 in the corners. */
static inline float photograph_radius(const struct photograph *photo, float x, float y) {
    const struct camera *c = &photo->camera;
    float w = (float)c->width, h = (float)c->height, dx = x - c->cx, dy = y - c->cy;
    return 4.0f * (dx * dx + dy * dy) / (w * w + h * h);
}

/* Falloff at pixel coordinates (x, y). */
float photograph_falloff(const struct photograph *photo, float x, float y);

/* Tells photo->spill that `count` pixels of a row, from number `at` on, are looked at or written next. */
void photograph_use(const struct photograph *photo, size_t at, size_t count);

/* Weight of a lookup relative to one in a sharp photograph. */
static inline float photograph_weight(const struct photograph *photo) {
    return 1.0f / (1.0f + photo->blur_px * photo->blur_px);
}

/* Bilinear lookup at pixel coordinates (x, y) inside the picture; a channel is saturated if a tap with weight is.
 * False when a tap is masked or not finite. */
bool photograph_sample(const struct photograph *photo, float x, float y, struct photograph_sample *sample);

/* Whether a tap of the bilinear lookup is a firefly. */
bool photograph_has_firefly(const struct photograph *photo, float x, float y);

/* Cubic lookup (Keys 1981, a = -1/2): sharper than bilinear by about a pixel, with twice the noise. False when one of
 * the 4 x 4 taps is outside, masked, saturated, not finite or a firefly: the ringing would be taken for texture. */
bool photograph_sample_cubic(const struct photograph *photo, float x, float y, rgb *radiance);

/* Its four weights along one axis, for position `t` in [0, 1) between the second and the third tap. */
static inline void photograph_cubic(float t, float weight[4]) {
    weight[0] = -0.5f * t * (1.0f - t) * (1.0f - t);
    weight[1] = 1.0f + t * t * (1.5f * t - 2.5f);
    weight[2] = t * (0.5f + t * (2.0f - 1.5f * t));
    weight[3] = -0.5f * t * t * (1.0f - t);
}

/* Brightness (mean of the channels) at eight points on a circle; those outside the picture or masked are left out. With
 * no point left `darkest` is infinite and all else 0. */
struct photograph_ring {
    float brightest, darkest, sum, count;
    int saturated_pairs; /* of points opposite to each other, both saturate */
};
struct photograph_ring photograph_ring(const struct photograph *photo, float x, float y, float radius_px);

#endif
