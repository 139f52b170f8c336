/* photograph.h -- a posed photograph: linear pixels, exposure, mask.
 *
 * A stored value is exposure x gain x radiance: radiance L shows as min(L * exposure * gain,
 * clip), clip being infinite for HDR frames. */
#ifndef UNBAKE_SCENE_PHOTOGRAPH_H
#define UNBAKE_SCENE_PHOTOGRAPH_H

#include <stdbool.h>
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
    float clip;             /* value at which a pixel is saturated; INFINITY for HDR */
    uint16_t (*pixel)[3];   /* [height][width] linear half-precision values; owned */
    uint8_t *mask;          /* [height][width] 0 where the pixel must not be used, or NULL; owned */
};

struct photograph_sample {
    rgb radiance;           /* value / (exposure * gain) */
    bool saturated[3];      /* per channel: the value is a lower bound */
    rgb clip_radiance;      /* radiance at which this frame saturates; INFINITY for HDR */
};

void photograph_release(struct photograph *photo);

/* Bilinear look-up at pixel place (x, y) inside the picture; a channel is saturated when a tap
 * of weight is. False when a tap is masked or not finite. */
bool photograph_sample(const struct photograph *photo, float x, float y,
                       struct photograph_sample *sample);

#endif
