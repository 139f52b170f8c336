/* emitters.h: a surface three pixels wide at which photographs saturate shines if what is around it is dark, also where
 * a tube goes on, or the poses of some photographs are wrong; between a white sky on both sides nobody knows whose
 * light it is, though one pixel near it is dark. Nor does it shine where photographs from near saturate in all of it,
 * but others, which do not, show that the sky is brighter. What is looked at too seldom for any distance from its edges
 * shines if all its looks together are enough. */
#include "server/light/emitters.h"

#include "tests/unit/plane_rig.h"

#define PHOTOGRAPHS 16
#define PIXEL_M (PLANE_METRES / 3.0f)
#define CLIP 0.75f
#define DARK 0.1f

#define NEAR 3.0f /* times */
#define BRIGHT 4.0f

#define OFF_PX 3.0f

#define WIDE 7.0f /* pixels of a segment with a middle away from its edges */

/* Texels of the wide segment: one of its middle, and one a pixel and one two pixels off. */
static uint32_t few[] = {16 * PLANE_SIDE + 16, 16 * PLANE_SIDE + 20, 16 * PLANE_SIDE + 25};

enum around { AROUND_DARK, AROUND_DARK_BY_WRONG_POSES, AROUND_TUBE, AROUND_SKY, AROUND_BRIGHT, AROUND_FEW };

/* The dark pixel of the sky is below. */
static rgb shown(void *user, vec3 place) {
    bool is_own = fabsf(place.x) < 5.0f && fabsf(place.y) < 5.0f;
    bool along = fabsf(place.x) < 5.0f;
    switch (*(const enum around *)user) {
    case AROUND_TUBE: return rgb_gray(along ? 1.0f : DARK);
    case AROUND_SKY: return rgb_gray(along && place.y < -5.0f ? DARK : 1.0f);
    case AROUND_BRIGHT: return rgb_gray(is_own ? 1.0f : BRIGHT);
    default: return rgb_gray(is_own ? 1.0f : DARK);
    }
}

static struct emitter_evidence look(enum around around) {
    struct plane_rig rig;
    float pixel_m = around == AROUND_FEW ? PLANE_METRES / WIDE : PIXEL_M;
    plane_rig_init(&rig, PHOTOGRAPHS, 1);
    for (int i = 0; i < PHOTOGRAPHS; i++) {
        float x = 0.5f * (float)(i % 4 - 2), y = 0.5f * (float)(i / 4 - 2);
        bool is_near = around == AROUND_BRIGHT && i % 2 == 0, is_short = around == AROUND_BRIGHT && !is_near;
        plane_rig_add(&rig, (vec3){x, y, 90.0f}, (vec3){0.1f, 0.2f, 0.0f}, is_near ? PIXEL_M / NEAR : pixel_m, shown,
                      &around)
            ->clip = is_short ? 2.0f * BRIGHT : CLIP;
        if (around == AROUND_DARK_BY_WRONG_POSES && i % 4 == 0)
            rig.scene.photograph[i].camera.cx += OFF_PX; /* and what is dark beside it is taken for it */
    }
    plane_rig_look(&rig, 0.01f);
    if (around == AROUND_FEW) {
        memcpy(rig.r.inverse.valid, few, sizeof few);
        rig.r.inverse.valid_count = sizeof few / sizeof *few;
    }
    emitters_observe(&rig.r, &rig.views, rig.r.evidence);
    struct emitter_evidence found = rig.r.evidence[0];
    plane_rig_release(&rig);
    return found;
}

int main(void) {
    struct emitter_evidence dark = look(AROUND_DARK), tube = look(AROUND_TUBE), sky = look(AROUND_SKY);
    struct emitter_evidence bright = look(AROUND_BRIGHT), wrong = look(AROUND_DARK_BY_WRONG_POSES);
    CHECK(dark.is_seen && dark.saturated[0]);
    CHECK(wrong.is_seen && wrong.saturated[0]);
    CHECK(tube.is_seen && tube.saturated[0]);
    struct emitter_evidence seldom = look(AROUND_FEW);
    CHECK(seldom.is_seen && seldom.saturated[0]);
    CHECK(!sky.is_seen && sky.is_outshone);
    CHECK(!bright.is_seen && bright.is_outshone && rgb_is_black(bright.radiance));
    return check_result();
}
