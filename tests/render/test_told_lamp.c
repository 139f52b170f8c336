/* light_lamp.h: a lamp as white as the ceiling around it, at which all photographs saturate, may be a part of it; where
 * people say that it shines it does, as bright as what it lights tells. */
#include "server/state/evidence.h"
#include "tests/check.h"
#include "tests/render/shell.h"
#include "tests/render/small_room.h"

#define CEILING 1
#define CLIP 0.03125f

int main(void) {
    struct parallel *pool = parallel_new(0);
    struct scene scene = {0};
    struct reconstruction r;
    wall_color[CEILING] = rgb_gray(0.8f);
    for (int i = 2; i < OBJECTS; i++)
        wall_color[i] = rgb_gray(0.5f);
    wall_color[FLOOR] = rgb_gray(0.05f);
    make_scene(&scene, pool);
    for (size_t f = 0; f < scene.photograph_count; f++)
        saturate_photograph(&scene.photograph[f], CLIP);
    shell_solve_with("{" SHELL_COARSE_TEXTURE "," SHELL_LITTLE ",\"emitters.6\":\"on\"}", &scene, 0, &r);
    for (size_t s = 0; s < r.segments.count; s++) {
        bool is_lamp = r.segments.id[s] == LAMP;
        CHECK_THAT(r.is_emitter[s] == is_lamp, "object %d", (int)r.segments.id[s]);
        if (is_lamp)
            CHECK_THAT(r.materials.emission[s].r > 0.5f * lamp_radiance.r, "%g", (double)r.materials.emission[s].r);
    }
    reconstruct_release(&r);
    scene_release(&scene);
    parallel_free(pool);
    return check_result();
}
