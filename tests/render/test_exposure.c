/* exposure.h: gains that nobody told are found from what frames share. */
#include "server/reconstruct/exposure.h"

#include "tests/render/small_room.h"

int main(void) {
    struct parallel *pool = parallel_new(0);
    struct scene scene;
    struct segments segments;
    struct atlas atlas;
    struct inverse_uv inverse;
    struct accel *accel;
    struct views views;
    struct error err = {0};
    make_scene(&scene, pool);
    segments_from_object_id(&segments, &scene.mesh);
    CHECK(atlas_make(&atlas, &scene.mesh, &segments, 64, 0.0f, &err) == STATUS_OK);
    inverse_uv_make(&inverse, &atlas, scene.mesh.triangle_count, pool);
    CHECK(accel_new(&accel, &scene.mesh, pool, &err) == STATUS_OK);
    views_init(&views, &scene, &segments, accel, pool);

    /* Every frame gets a gain of its own between 1/4 and 4, and only the first tells it. The frames
     * are small and noisy (the logarithm of a noisy value is low on average), hence the limit. */
    float truth[FRAMES];
    for (int f = 0; f < FRAMES; f++) {
        struct photograph *photo = &scene.photograph[f];
        truth[f] = f == 0 ? 1.0f : powf(4.0f, 2.0f * fmodf((float)f * 0.618f, 1.0f) - 1.0f);
        photo->exposure_known = f == 0;
        for (size_t i = 0; i < WIDTH * HEIGHT; i++) {
            for (int c = 0; c < 3; c++)
                photo->pixel[i][c] =
                    image_half_from_float(truth[f] * image_float_from_half(photo->pixel[i][c]));
        }
    }
    CHECK(exposure_solve(&scene, &views, &atlas, &inverse) == views.train_count - 1);
    for (size_t t = 0; t < views.train_count; t++) {
        uint32_t f = views.train[t];
        double error = log((double)(scene.photograph[f].exposure / truth[f]));
        CHECK_THAT(fabs(error) < 0.15, "frame %u: off by %.3f", f, error);
    }
    /* A held-out frame is not touched. */
    CHECK(scene.photograph[4].is_test && scene.photograph[4].exposure == 1.0f);

    views_release(&views);
    accel_free(accel);
    inverse_uv_release(&inverse);
    atlas_release(&atlas);
    segments_release(&segments);
    scene_release(&scene);
    parallel_free(pool);
    return check_result();
}
