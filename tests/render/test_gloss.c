/* gloss.h: a small room with a polished floor, a satin wall and matt ones, photographed by our own path
 * tracer, and what the solve stage tells of each. */
#include "server/reconstruct/reconstruct.h"
#include "tests/render/small_room.h"
#include "tests/render/shell.h"

#define FLOOR 0
#define SATIN 4

int main(void) {
    struct parallel *pool = parallel_new(0);
    struct scene scene = {0};
    struct settings s = shell_settings("{\"texture_size\":256,\"iterations\":1,\"report_samples\":1,"
                                       "\"gather_samples\":512}");
    struct shell shell = {.polls_until_stop = -1};
    struct reconstruction r;
    wall_roughness[FLOOR] = 0.15f;
    wall_roughness[SATIN] = 0.3f;
    wall_specular[FLOOR] = wall_specular[SATIN] = 0.5f;
    make_mesh(&scene.mesh);
    photograph_mesh(&scene, lamp_radiance, NULL, look_anywhere, pool);
    CHECK(shell_run(&scene, &s, 0, &shell, &r) == STATUS_OK);
    for (size_t i = 0; i < OBJECTS; i++) {
        float roughness = r.materials.roughness[i], specular = r.materials.specular[i];
        printf("object %zu: %.3f %.3f, true %.3f %.3f\n", i, (double)roughness, (double)specular,
               (double)wall_roughness[i], (double)wall_specular[i]);
        if (i == LAMP)
            continue;
        CHECK_NEAR(roughness, wall_roughness[i], 0.05);
        CHECK_NEAR(specular, wall_specular[i], 0.1);
    }
    reconstruct_release(&r);
    shell_release(&shell);
    settings_release(&s);
    scene_release(&scene);
    parallel_free(pool);
    return 0;
}
