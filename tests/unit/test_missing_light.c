/* missing_light.h: a lamp is as bright as what it mainly lights tells, though far walls, each place of which it lights
 * a little, would be more alike if it were brighter. */
#include "server/light/sun/missing_light.h"

#include <math.h>

#include "tests/check.h"

#define WALL 4000
#define DESK 40
#define STRENGTH 2.0f

/* Base colour .5 everywhere. The lamp lights 16 places of a desk and, a little, the last 1600 of the wall, where what
 * is known of the light is up to a fifth too low. */
static void place_room(struct light_place place[WALL + DESK]) {
    for (size_t i = 0; i < WALL + DESK; i++) {
        bool is_desk = i >= WALL;
        float along = (float)(is_desk ? i - WALL : i) / (float)(is_desk ? DESK : WALL);
        float part = fmaxf(along - 0.6f, 0.0f) / 0.4f, known = 1.0f;
        float lit = is_desk ? (part > 0.0f ? 0.3f + part : 0.0f) : 0.01f * part;
        float light = known * (is_desk ? 1.0f : 1.0f + 0.2f * part) + STRENGTH * lit;
        place[i] = (struct light_place){.segment = is_desk,
                                        .observed = rgb_gray(0.5f * light),
                                        .lambert = rgb_gray(known),
                                        .weight = 1.0f,
                                        .response = lit};
    }
}

int main(void) {
    struct light_place place[WALL + DESK];
    struct light_places places = {.count = WALL + DESK, .place = place};
    struct missing_light missing;
    struct parallel *pool = parallel_new(1), *three = parallel_new(3);
    double explained, again;
    place_room(place);
    missing_light_init(&missing, &places, pool);
    float alike = missing_light_strength(&missing, MISSING_MEAN, &explained);
    CHECK_THAT(alike > 1.5f * STRENGTH, "the wall is most alike at %g", (double)alike);
    CHECK(explained > 0.0 && explained < WALL + DESK);
    rgb found = missing_light_color(&missing);
    CHECK_NEAR(found.r, STRENGTH, 0.1f * STRENGTH);
    CHECK_NEAR(found.g, STRENGTH, 0.1f * STRENGTH);
    CHECK_NEAR(found.b, STRENGTH, 0.1f * STRENGTH);
    missing_light_strength(&missing, MISSING_MEAN, &again);
    CHECK_THAT(again == explained, "all places count again after it");
    missing_light_release(&missing);
    missing_light_init(&missing, &places, three);
    CHECK(missing_light_strength(&missing, MISSING_MEAN, &again) == alike && again == explained);
    missing_light_release(&missing);
    parallel_free(three);
    parallel_free(pool);
    return check_result();
}
