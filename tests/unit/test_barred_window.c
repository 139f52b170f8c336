/* emitters.h: bars before a window that the mesh lacks take their part of its light, wherever they stand in each
 * photograph; most of the looks at each place show the window alone. */
#include "server/light/emitters.h"

#include "tests/unit/plane_rig.h"

#define PHOTOGRAPHS 16
#define WINDOW 30.0f
#define PITCH_M 4.0f /* of the bars, which are .5 m wide: an eighth of the window */
#define BAR_M 0.5f

struct bars {
    float at_m; /* of the first one, as this photograph shows it before the plane */
    float width_m;
};

static rgb window(void *user, vec3 place) {
    const struct bars *bars = user;
    float along = fmodf(place.x - bars->at_m + 100.0f * PITCH_M, PITCH_M);
    return rgb_gray(along < bars->width_m ? 0.02f : WINDOW);
}

/* Radiance of the plane, of which PHOTOGRAPHS show bars of some width, each at another place. */
static struct emitter_evidence look_through(float width_m) {
    struct plane_rig rig;
    plane_rig_init(&rig, PHOTOGRAPHS, 2);
    for (int i = 0; i < PHOTOGRAPHS; i++) {
        struct bars bars = {PITCH_M * (float)i / PHOTOGRAPHS, width_m};
        float x = 0.3f * (float)(i % 4), y = 0.3f * (float)(i / 4);
        plane_rig_add(&rig, (vec3){x, y, 9.0f}, (vec3){0.1f, 0.2f, 0.0f}, 0.5f, window, &bars);
    }
    plane_rig_look(&rig, 0.01f);
    emitters_observe(&rig.r, &rig.views, rig.r.evidence);
    struct emitter_evidence found = rig.r.evidence[0];
    plane_rig_release(&rig);
    return found;
}

int main(void) {
    struct emitter_evidence clear = look_through(0.0f), barred = look_through(BAR_M);
    CHECK(clear.radiance.g == clear.observed.g);
    CHECK_NEAR(clear.radiance.g, WINDOW, 0.02f);
    CHECK_NEAR(barred.observed.g, WINDOW, 0.02f);
    CHECK_NEAR(barred.radiance.g, WINDOW * (1.0f - BAR_M / PITCH_M), 0.02f * WINDOW);
    return check_result();
}
