/* Whole rooms with constant materials against Mitsuba 3: light transport, shading normals and
 * many emitters, by z-tests per pixel and on the mean. In the long form (UNBAKE_LONG) of twice the samples. */
#include "server/render/film.h"
#include "tests/render/room.h"

#define RUNS 6 /* independent estimates, from whose spread our error comes */
#define RUNS_LONG 12
#define RUN_SPP 4

static void check_view(const struct room *room, const char *name, const char *number) {
    char path[256], frame[64];
    snprintf(path, sizeof path, "rooms/%s/transforms.json", name);
    snprintf(frame, sizeof frame, "images/%s.exr", number);
    struct camera camera;
    room_camera(path, frame, &camera);
    struct room_picture picture;
    room_picture_init(&picture, camera.width, camera.height, getenv("UNBAKE_LONG") ? RUNS_LONG : RUNS);
    /* 16 bounces at most, like theirs. */
    struct path_settings settings = {.max_depth = 17, .roulette_depth = 6, .seed = 5};
    for (int run = 0; run < picture.estimates; run++) {
        struct image image;
        CHECK(film_render(&room->world, &camera, RUN_SPP, &settings, (uint32_t)run, room->pool, &image) == 0);
        for (size_t i = 0; i < picture.count; i++)
            for (int c = 0; c < 3; c++)
                room_picture_add(&picture, i, c, (double)image.pixel[i * 6 + (size_t)c]);
        image_release(&image);
    }
    struct image wanted;
    snprintf(path, sizeof path, "rooms/%s/truth/flat_%s.exr", name, number);
    room_read_image(path, &wanted);
    snprintf(path, sizeof path, "%s %s", name, number);
    room_compare(&picture, &wanted, path);
    image_release(&wanted);
    room_picture_release(&picture);
}

static void check_room(const char *name) {
    char ply[128], objects[128];
    snprintf(ply, sizeof ply, "rooms/%s/mesh.ply", name);
    snprintf(objects, sizeof objects, "rooms/%s/truth/objects.json", name);
    struct room room;
    room_load(&room, ply, objects, "flat_base_color", NULL, 0, NULL, 0);
    check_view(&room, name, "014");
    check_view(&room, name, "079");
    room_release(&room);
}

int main(void) {
    check_room("staircase2");
    check_room("bathroom");
    return check_result();
}
