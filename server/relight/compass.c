/* compass.c -- see compass.h. */
#include "server/relight/compass.h"

struct compass compass_of(vec3 up) {
    struct compass c = {.up = up};
    if (up.x != 0.0f) {
        c.north = vec3_make(0.0f, 0.0f, -1.0f);
    } else if (up.z != 0.0f) {
        c.north = vec3_make(0.0f, up.z, 0.0f);
    } else {
        c.up = vec3_make(0.0f, up.y < 0.0f ? -1.0f : 1.0f, 0.0f);
        c.north = vec3_make(0.0f, 0.0f, -c.up.y);
    }
    c.east = vec3_cross(c.north, c.up);
    return c;
}
