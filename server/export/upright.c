/* upright.c -- see upright.h. */
#include "server/export/upright.h"

/* Without negative zeros, which would show in files of text. */
static double along(const double v[3], int axis, double sign) { return v[axis] != 0.0 ? sign * v[axis] : 0.0; }

void upright_turn(vec3 up, const double p[3], double turned[3]) {
    double sign = up.x + up.y + up.z < 0.0f ? -1.0 : 1.0;
    if (up.x != 0.0f) {
        turned[0] = along(p, 1, -sign);
        turned[1] = along(p, 0, sign);
        turned[2] = along(p, 2, 1.0);
    } else if (up.z != 0.0f) {
        turned[0] = along(p, 0, 1.0);
        turned[1] = along(p, 2, sign);
        turned[2] = along(p, 1, -sign);
    } else {
        turned[0] = along(p, 0, 1.0);
        turned[1] = along(p, 1, sign);
        turned[2] = along(p, 2, sign);
    }
}

const float *upright_quaternion(vec3 up) {
    static const float rotation[6][4] = {
        {0, 0, 0.70710678f, 0.70710678f},  {0, 0, 0, 1}, {-0.70710678f, 0, 0, 0.70710678f},
        {0, 0, -0.70710678f, 0.70710678f}, {1, 0, 0, 0}, {0.70710678f, 0, 0, 0.70710678f},
    };
    int axis = up.x != 0.0f ? 0 : up.z != 0.0f ? 2 : 1;
    return rotation[axis + (up.x + up.y + up.z < 0.0f ? 3 : 0)];
}
