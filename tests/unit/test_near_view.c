/* views_weigh: a photograph from so near that a texel covers a hundred of its pixels tells no more of the texel than
 * one of them does, whose noise it has: it outvotes neither in fused radiance nor in base colour four that show the
 * texel with a pixel each. */
#include "tests/unit/plane_rig.h"

#define FAR_PIXEL_M 0.3f
#define NEAR_PIXEL_M 0.03f
#define FAR_COLOR 0.5f
#define NEAR_COLOR 0.6f

int main(void) {
    struct plane_rig rig;
    rgb far_shown = rgb_gray(FAR_COLOR), near_shown = rgb_gray(NEAR_COLOR);
    plane_rig_init(&rig, 5, 1);
    for (int k = 0; k < 4; k++)
        plane_rig_add(&rig, (vec3){0.1f * (float)k, 0.2f, 3.0f}, (vec3){0.15f, 0.15f, 0.0f}, FAR_PIXEL_M,
                      plane_paint_one, &far_shown);
    plane_rig_add(&rig, (vec3){0.15f, 0.15f, 0.3f}, (vec3){0.15f, 0.15f, 0.0f}, NEAR_PIXEL_M, plane_paint_one,
                  &near_shown);
    plane_rig_look(&rig, 0.2f);
    struct probes probes;
    float typical;
    struct divide divide;
    probes_init(&probes, 8, &rig.scene.mesh, &rig.r.atlas, &rig.r.inverse, &rig.r.fused);
    for (size_t i = 0; i < probes.count; i++)
        irradiance_add(&probes.probe[i].light, (vec3){0, 0, 1}, (vec3){0, 0, 1}, rgb_gray((float)PI));
    float fused = rgb_mean(fused_radiance(&rig.r.fused, PLANE_MIDDLE));
    float base = rgb_mean(measurement_value(plane_rig_divide(&rig, &probes, &typical, &divide)));
    printf("fused %.4f, base colour %.4f\n", (double)fused, (double)base);
    CHECK(rig.r.fused.count[PLANE_MIDDLE] == 5.0f);
    CHECK_THAT(fused > FAR_COLOR && fused < 0.55f, "%g", (double)fused);
    CHECK_THAT(base > FAR_COLOR && base < 0.55f, "%g", (double)base);
    mem_free(divide.measured);
    probes_release(&probes);
    plane_rig_release(&rig);
    return check_result();
}
