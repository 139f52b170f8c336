/* photograph_reduce.h: a large photograph that is held out is compared at a fraction of its size, and
 * with its camera. */
#include "server/reconstruct/reconstruct.h"
#include "server/scene/photograph_reduce.h"
#include "tests/render/shell.h"
#include "tests/render/small_room.h"

/* Each pixel becomes `factor` x `factor` of the same value. */
static void enlarge(struct photograph *photo, uint32_t factor) {
    struct camera camera = photo->camera;
    size_t width = camera.width * factor, height = camera.height * factor;
    uint16_t(*pixel)[3] = mem_array(width * height, sizeof *pixel);
    for (size_t i = 0; i < width * height; i++)
        memcpy(pixel[i], photo->pixel[i / width / factor * camera.width + i % width / factor], sizeof *pixel);
    mem_free(photo->pixel);
    photo->pixel = pixel;
    photo->camera.width = (uint32_t)width;
    photo->camera.height = (uint32_t)height;
    photo->camera.fx *= (float)factor;
    photo->camera.fy *= (float)factor;
    photo->camera.cx *= (float)factor;
    photo->camera.cy *= (float)factor;
}

/* Of the first held-out view. */
static double compare(struct scene *scene, uint32_t *width, uint32_t *height) {
    struct settings s = shell_settings("{" SHELL_COARSE_TEXTURE ",\"iterations\":1,\"report_samples\":4,"
                                       "\"gather_samples\":64}");
    struct shell shell = {.polls_until_stop = -1};
    struct reconstruction r;
    CHECK(shell_run(scene, &s, 0, &shell, &r) == STATUS_OK);
    CHECK(r.held_out_count > 0);
    const struct held_out *view = &r.held_out[0];
    double msre = view->msre;
    *width = view->camera.width;
    *height = view->camera.height;
    CHECK(view->photograph.width == *width && view->render.width == *width && view->render.height == *height);
    reconstruct_release(&r);
    shell_release(&shell);
    settings_release(&s);
    return msre;
}

int main(void) {
    struct scene scene;
    struct parallel *pool = parallel_new(0);
    uint32_t width, height, large_width, large_height;
    make_scene(&scene, pool);
    parallel_free(pool);
    double small = compare(&scene, &width, &height);
    size_t i = 0;
    while (!scene.photograph[i].is_test)
        i++;
    CHECK(scene.photograph[i].camera.width == width);
    uint32_t factor = (uint32_t)ceil(sqrt(1.0 + 1.6e6 / ((double)width * (double)height)));
    enlarge(&scene.photograph[i], factor + factor % 2);
    double large = compare(&scene, &large_width, &large_height);
    CHECK_THAT(large_width == width * ((factor + 1) / 2) && large_height == height * ((factor + 1) / 2),
               "%u x %u of %u x %u", large_width, large_height, scene.photograph[i].camera.width,
               scene.photograph[i].camera.height);
    /* what is left is the steps between its pixels */
    CHECK_THAT(large < small + 0.01, "MSRE %.4f, at its size %.4f", large, small);
    scene_release(&scene);
    return check_result();
}
