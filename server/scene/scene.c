/* scene.c -- see scene.h. */
#include "server/scene/scene.h"

#include "common/mem.h"

void scene_release(struct scene *scene) {
    mesh_release(&scene->mesh);
    for (size_t i = 0; i < scene->photograph_count; i++)
        photograph_release(&scene->photograph[i]);
    mem_free(scene->photograph);
    for (size_t i = 0; i < scene->warning_count; i++)
        mem_free(scene->warning[i]);
    mem_free(scene->warning);
    *scene = (struct scene){0};
}
