/* bright_texels.c -- see bright_texels.h. */
#include "server/light/decision/bright_texels.h"

#include "common/spaced.h"
#include "server/state/evidence.h"

static bool is_bright(const struct reconstruction *r, uint32_t texel) {
    return evidence_is_as_bright(&r->evidence[reconstruction_segment(r, texel)], fused_radiance(&r->fused, texel));
}

size_t bright_texels_choose(const struct reconstruction *r, const uint32_t *texel, size_t count, size_t wanted,
                            uint32_t *chosen) {
    size_t bright = 0;
    for (size_t i = 0; i < count; i++)
        bright += is_bright(r, texel[i]);
    size_t all = bright > 0 ? bright : count;
    struct spacing spacing = {.all = all, .wanted = all < wanted ? all : wanted};
    for (size_t i = 0; i < count; i++) {
        size_t place = spacing.taken;
        if ((bright == 0 || is_bright(r, texel[i])) && spacing_takes(&spacing))
            chosen[place] = texel[i];
    }
    return spacing.taken;
}
