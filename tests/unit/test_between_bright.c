/* emitters.h: a surface three pixels wide at which photographs saturate shines if what is around it is dark, also where
 * a tube goes on; between a white sky on both sides nobody knows whose light it is, though one pixel near it is
 * dark. */
#include "server/light/emitters.h"

#include "tests/unit/plane_rig.h"

#define PHOTOGRAPHS 16
#define PIXEL_M (PLANE_METRES / 3.0f)
#define CLIP 0.75f
#define DARK 0.1f

enum around { AROUND_DARK, AROUND_TUBE, AROUND_SKY };

/* The dark pixel of the sky is below. */
static rgb shown(void *user, vec3 place) {
    bool is_own = fabsf(place.x) < 5.0f && fabsf(place.y) < 5.0f;
    bool along = fabsf(place.x) < 5.0f;
    switch (*(const enum around *)user) {
    case AROUND_TUBE: return rgb_gray(along ? 1.0f : DARK);
    case AROUND_SKY: return rgb_gray(along && place.y < -5.0f ? DARK : 1.0f);
    default: return rgb_gray(is_own ? 1.0f : DARK);
    }
}

static struct emitter_evidence look(enum around around) {
    struct plane_rig rig;
    plane_rig_init(&rig, PHOTOGRAPHS, 1);
    for (int i = 0; i < PHOTOGRAPHS; i++) {
        float x = 0.5f * (float)(i % 4 - 2), y = 0.5f * (float)(i / 4 - 2);
        plane_rig_add(&rig, (vec3){x, y, 90.0f}, (vec3){0.1f, 0.2f, 0.0f}, PIXEL_M, shown, &around)->clip = CLIP;
    }
    plane_rig_look(&rig, 0.01f);
    emitters_observe(&rig.r, &rig.views, rig.r.evidence);
    struct emitter_evidence found = rig.r.evidence[0];
    plane_rig_release(&rig);
    return found;
}

int main(void) {
    struct emitter_evidence dark = look(AROUND_DARK), tube = look(AROUND_TUBE), sky = look(AROUND_SKY);
    CHECK(dark.is_seen && dark.saturated[0]);
    CHECK(tube.is_seen && tube.saturated[0]);
    CHECK(!sky.is_seen && sky.is_outshone);
    return check_result();
}
