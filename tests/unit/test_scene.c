/* scene.c: which axis points up, by how the photographs are held. */
#include "server/scene/scene.h"

#include "common/mem.h"
#include "tests/check.h"

/* Three cameras that are held upright along `up` but for a tilt, the last of them turned on its side. */
static vec3 up_of(vec3 up) {
    struct photograph photo[3] = {0};
    struct scene scene = {.photograph_count = 3, .photograph = photo};
    vec3 side, front;
    vec3_frame(up, &side, &front);
    for (int i = 0; i < 3; i++) {
        float tilt = i == 2 ? 1.5f : i == 1 ? -0.3f : 0.4f;
        vec3 y = vec3_mad(vec3_scale(up, -cosf(tilt)), sinf(tilt), i == 0 ? side : front);
        struct rigid *pose = &photo[i].camera.world_from_camera;
        pose->rotation[0][1] = y.x;
        pose->rotation[1][1] = y.y;
        pose->rotation[2][1] = y.z;
    }
    return scene_up(&scene);
}

int main(void) {
    static const vec3 axes[] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {-1, 0, 0}, {0, -1, 0}, {0, 0, -1}};
    const struct scene none = {0};
    for (size_t i = 0; i < sizeof axes / sizeof *axes; i++) {
        vec3 up = up_of(axes[i]);
        CHECK_THAT(up.x == axes[i].x && up.y == axes[i].y && up.z == axes[i].z, "%zu: %g %g %g", i, (double)up.x,
                   (double)up.y, (double)up.z);
    }
    CHECK(scene_up(&none).y == 1.0f);
    return check_result();
}
