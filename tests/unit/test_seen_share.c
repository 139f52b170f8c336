/* test_seen_share.c -- a job that could measure next to nothing ends at once, and says why. */
#include "server/capture/seen_share.h"
#include "tests/unit/fit_rig.h"

static enum status require(struct fit_rig *rig, bool ignored, struct seen_share *share, struct error *err) {
    struct accel *accel;
    struct segments segments;
    struct views views;
    room_one_segment(&segments, &rig->scene.mesh);
    CHECK(accel_new(&accel, &rig->scene.mesh, rig->pool, NULL) == STATUS_OK);
    views_init(&views, &rig->scene, &segments, accel, rig->pool);
    *share = seen_share_measure(&views, rig->pool);
    *err = (struct error){0};
    enum status status = seen_share_require(share, ignored, err);
    views_release(&views);
    segments_release(&segments);
    accel_free(accel);
    return status;
}

static void move_cameras(struct scene *scene, float up_m) {
    for (size_t i = 0; i < scene->photograph_count; i++) {
        struct camera *c = &scene->photograph[i].camera;
        c->world_from_camera.translation.z += up_m;
        c->camera_from_world = rigid_inverse(&c->world_from_camera);
    }
}

int main(void) {
    struct fit_rig rig;
    struct seen_share share;
    struct error err;
    fit_rig_init(&rig, 0.5f);
    fit_turn_inside(&rig.scene.mesh);
    CHECK_THAT(require(&rig, false, &share, &err) == STATUS_OK, "%s", err.message);
    CHECK_THAT(share.surface > 0.5 && share.open == 0.0, "%g %g", share.surface, share.open);

    move_cameras(&rig.scene, 20.0f); /* above the ceiling, which is seen from behind at best */
    CHECK(require(&rig, false, &share, &err) == STATUS_INPUT);
    CHECK_THAT(share.surface == 0.0 && share.open > 0.5, "%g %g", share.surface, share.open);
    CHECK(strstr(err.message, "see nothing of the mesh's surface") != NULL);
    CHECK(strstr(err.hint, "two places, axes or units") != NULL && strstr(err.hint, "fit=ignore") == NULL);
    CHECK(require(&rig, true, &share, &err) == STATUS_INPUT); /* 0 texels never succeed */
    move_cameras(&rig.scene, -20.0f);

    for (int i = 0; i < 3; i++) /* the last box becomes a floor of 100 x 100 m below the room */
        for (size_t v = 24; v < 32; v++)
            (&rig.scene.mesh.position[v].x)[i] = i < 2 ? (v >> i & 1 ? 50.0f : -50.0f) : v & 4 ? -1.0f : -2.0f;
    CHECK(require(&rig, false, &share, &err) == STATUS_INPUT);
    CHECK_THAT(share.surface > 0.0 && share.surface < SEEN_SHARE_MIN, "%g", share.surface);
    CHECK(strstr(err.hint, "crop") != NULL && strstr(err.hint, "fit=ignore") != NULL);
    CHECK(require(&rig, true, &share, &err) == STATUS_OK);
    fit_rig_release(&rig);
    return check_result();
}
