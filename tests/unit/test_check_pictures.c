/* test_check_pictures.c -- the pictures of a check: edges where the mesh has them, a plan, exposures. */
#include "common/file.h"
#include "server/check/check_pictures.h"
#include "server/check/overlay.h"
#include "tests/unit/fit_rig.h"

static bool is_edge(const struct image *image, long x, long y) {
    if (x < 0 || y < 0 || x >= (long)image->width || y >= (long)image->height)
        return false;
    const float *p = image->pixel + ((size_t)y * image->width + (size_t)x) * image->channel_count;
    return p[1] > 0.6f && p[1] > p[0] + 0.25f && p[1] > p[2] + 0.1f; /* the photographs are grey */
}

static bool is_edge_near(const struct image *image, float x, float y) {
    for (long dy = -5; dy <= 5; dy++)
        for (long dx = -5; dx <= 5; dx++)
            if (is_edge(image, (long)x + dx, (long)y + dy))
                return true;
    return false;
}

/* Visible points on the edges of the room and its boxes are drawn, and most of the picture is not. */
static void test_overlays(const struct scene_check *room) {
    size_t wanted = 0, found = 0, drawn = 0, all = 0;
    for (size_t i = 0; i < room->scene.photograph_count; i += 5) {
        const struct camera *c = &room->scene.photograph[i].camera;
        struct drawing drawing;
        overlay_draw(&drawing, &room->scene.photograph[i], c, room->accel);
        for (size_t k = 0; k < 32 * 3 * 20; k++) { /* edges along an axis from a corner of a box, in 20 steps */
            size_t corner = k / 60, axis = k / 20 % 3, other = corner ^ (size_t)1 << axis;
            vec3 a = room->scene.mesh.position[corner], b = room->scene.mesh.position[other];
            vec3 at = vec3_mad(a, (float)(k % 20) / 20.0f, vec3_sub(b, a)), way = vec3_sub(at, camera_origin(c));
            float x, y, depth, distance = vec3_length(way);
            if (!camera_project(c, at, &x, &y, &depth) || x < 4.0f || y < 4.0f || x > 92.0f || y > 68.0f ||
                accel_occluded(room->accel, camera_origin(c), vec3_scale(way, 1.0f / distance), 0.0f, 0.99f * distance))
                continue;
            wanted++;
            found += is_edge_near(&drawing.image, x * OVERLAY_SIZE / FIT_WIDTH, y * OVERLAY_SIZE / FIT_WIDTH);
        }
        for (long p = 0; p < (long)drawing.image.width * (long)drawing.image.height; p++)
            drawn += is_edge(&drawing.image, p % (long)drawing.image.width, p / (long)drawing.image.width);
        all += (size_t)drawing.image.width * drawing.image.height;
        drawing_release(&drawing);
    }
    CHECK_THAT(wanted > 200 && found * 100 > wanted * 90, "%zu of %zu points on edges", found, wanted);
    CHECK_THAT(drawn * 100 < all * 8, "%zu of %zu pixels", drawn, all);
}

static void test_files(const struct scene_check *room, struct parallel *pool) {
    char dir[] = "/tmp/unbake-pictures-XXXXXX";
    struct error err = {0};
    cJSON *previews = cJSON_CreateArray();
    CHECK(mkdtemp(dir) != NULL);
    CHECK_THAT(check_pictures_write(room, dir, pool, previews, NULL, NULL, &err) == STATUS_OK, "%s", err.message);
    CHECK(cJSON_GetArraySize(previews) == CHECK_OVERLAYS + 2);
    const cJSON *preview;
    cJSON_ArrayForEach(preview, previews) {
        struct image image;
        char *path = file_join(dir, cJSON_GetStringValue(cJSON_GetObjectItemCaseSensitive(preview, "name")));
        CHECK(cJSON_GetObjectItemCaseSensitive(preview, "caption") != NULL);
        CHECK_THAT(image_read(path, &image, NULL, &err) == STATUS_OK, "%s", err.message);
        CHECK(image.width == OVERLAY_SIZE || image.width == 800);
        image_release(&image);
        mem_free(path);
    }
    cJSON_Delete(previews);
    CHECK(file_remove_tree(dir, NULL) == STATUS_OK);
}

int main(void) {
    struct fit_rig rig;
    struct scene_check room = {.reading = reading_default(), .given_reading = reading_default()};
    fit_rig_init(&rig, 0.3f);
    room.scene = rig.scene;
    CHECK(accel_new(&room.accel, &room.scene.mesh, rig.pool, NULL) == STATUS_OK);
    fit_judge(&room.fit, &room.scene, room.accel, rig.pool);
    test_overlays(&room);
    test_files(&room, rig.pool);
    scene_check_release(&room);
    parallel_free(rig.pool);
    return check_result();
}
