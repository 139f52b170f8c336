/* grey_card.h -- a point of the surface whose reflectance the user knows, by a pixel that shows it.
 *
 * Photographs tell the product of light and base colour. Where light is seen it is measured; where it is not (a ceiling
 * with lamps that nobody scanned), its scale is a guess, and this fixes it. */
#ifndef UNBAKE_CAPTURE_GREY_CARD_H
#define UNBAKE_CAPTURE_GREY_CARD_H

#include "common/settings.h"
#include "server/render/accel.h"
#include "server/scene/scene.h"
#include "server/scene/surface.h"

struct grey_card {
    bool is_given;
    struct pixel_setting pixel; /* its value is the reflectance, (0, 1] */
    vec3 point;                 /* metres */
    uint32_t triangle, texel;
    double light_factor; /* by which estimated light was scaled for it; 0: it was not */
};

/* Finds the point that the pixel shows. STATUS_INPUT: there is no such photograph or pixel, or it shows nothing of the
 * mesh. The accelerator is of the surface's mesh. */
enum status grey_card_find(struct grey_card *card, const struct pixel_setting *pixel, const struct scene *scene,
                           const struct surface *surface, const struct accel *accel, struct error *err);

#endif
