/* sunlit.h -- what saturates in the light of a sun that is not measured: how strong the sun is at least, what it sends
 * on, and what it would show in the shade.
 *
 * Of a sunlit place no photograph shows how bright it is, but the rest of its segment tells its albedo, and what it
 * shows in the shade. So it is a source of light of one unknown, the strength of the sun, which the joint fit finds: by
 * what measured places get from it and from the sun itself. */
#ifndef UNBAKE_LIGHT_SUN_SUNLIT_H
#define UNBAKE_LIGHT_SUN_SUNLIT_H

#include "server/capture/views.h"
#include "server/light/segment_light.h"
#include "server/state/reconstruction.h"

struct sunlit_texel {
    uint32_t texel;
    float part; /* Lambert radiance of albedo 1 by the sun, at a strength (irradiance / pi) of 1 */
    rgb shade;  /* radiance in its shade: the mean of what is measured of its segment, at most the bound */
    rgb bound;  /* lower bound of its radiance */
};

struct sunlit {
    struct reconstruction *r;  /* borrowed */
    const struct views *views; /* borrowed */
    size_t count;
    struct sunlit_texel *texel; /* [count] saturated, and reached by r->sun; owned */
    float *visibility;          /* of its disc, at the points of sunlit_look; owned */
};

void sunlit_init(struct sunlit *s, struct reconstruction *r, const struct views *views);
void sunlit_release(struct sunlit *s);

/* Sets is_sunlit of the evidence of each segment of which more than half of what saturates is sunlit. */
void sunlit_mark(const struct sunlit *s);

/* Sets these texels of radiance[height][width] to what they would show in the shade. */
void sunlit_shade(const struct sunlit *s, uint16_t (*radiance)[3]);

/* The strength at which half of them would saturate if all were white paint: a lower bound. */
rgb sunlit_least(const struct sunlit *s);

/* How much of the sun each point sees. False in is_told[count] where photographs show the blurred edge of a shadow
 * (sun_blur.h) that they measure: what does not saturate there is what is dark. What saturates there may get all of the
 * sun. */
void sunlit_look(struct sunlit *s, const struct light_point *point, size_t count, bool *is_told);

/* Adds to column[count] what a surface of albedo 1 at each point would send of the sun at strength 1, and of what these
 * texels reflect of it. After sunlit_look. */
void sunlit_respond(const struct sunlit *s, const struct segment_light *light, const struct light_point *point,
                    size_t count, const float *albedo, float *column);

#endif
