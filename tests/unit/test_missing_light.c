/* missing_light.h: a lamp is as bright as what it mainly lights tells, though far walls, each place of which it lights
 * a little, would be more alike if it were brighter. */
#include "server/light/missing_light.h"

#include <math.h>

#include "tests/check.h"

#define WALL 1000
#define DESK 40
#define STRENGTH 2.0f

/* Base colour .5 everywhere. What is known of the wall's light is a fifth too low towards the end that the lamp lights
 * more. The desk stands under the lamp. */
static void place_room(struct light_place place[WALL + DESK]) {
    for (size_t i = 0; i < WALL + DESK; i++) {
        bool is_desk = i >= WALL;
        float along = (float)(is_desk ? i - WALL : i) / (float)(is_desk ? DESK : WALL);
        float lit = is_desk ? 0.3f + along : 0.01f * along, known = 1.0f;
        float light = known * (is_desk ? 1.0f : 1.0f + 0.2f * along) + STRENGTH * lit;
        place[i] = (struct light_place){
            .segment = is_desk, .shown = rgb_gray(0.5f * light), .white = rgb_gray(known), .weight = 1.0f, .lit = lit};
    }
}

int main(void) {
    struct light_place place[WALL + DESK];
    struct light_places places = {.count = WALL + DESK, .place = place};
    struct missing_light missing;
    double explained;
    place_room(place);
    missing_light_init(&missing, &places, 1.2f, false);
    double misfit = missing_light_misfit(&missing);
    CHECK_THAT(missing_light_strength(&missing, MISSING_MEAN, &explained) > 1.5f * STRENGTH, "the wall agrees");
    CHECK(explained > 0.0 && explained <= misfit);
    rgb found = missing_light_color(&missing);
    CHECK_NEAR(found.r, STRENGTH, 0.1f * STRENGTH);
    CHECK_NEAR(found.g, STRENGTH, 0.1f * STRENGTH);
    CHECK_NEAR(found.b, STRENGTH, 0.1f * STRENGTH);
    CHECK_THAT(missing_light_misfit(&missing) == misfit, "all places count again after it");
    missing_light_release(&missing);
    return check_result();
}
