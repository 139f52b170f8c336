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
    mem_free(scene->source);
    *scene = (struct scene){0};
}

vec3 scene_up(const struct scene *scene) {
    vec3 sum = {0.0f, 0.0f, 0.0f};
    for (size_t i = 0; i < scene->photograph_count; i++) {
        const struct rigid *pose = &scene->photograph[i].camera.world_from_camera;
        sum = vec3_add(sum, rigid_direction(pose, (vec3){0.0f, -1.0f, 0.0f}));
    }
    float x = fabsf(sum.x), y = fabsf(sum.y), z = fabsf(sum.z);
    if (x > y && x > z)
        return (vec3){copysignf(1.0f, sum.x), 0.0f, 0.0f};
    if (z > y)
        return (vec3){0.0f, 0.0f, copysignf(1.0f, sum.z)};
    return (vec3){0.0f, y > 0.0f ? copysignf(1.0f, sum.y) : 1.0f, 0.0f};
}
