/* The demo room: a small one, generated and read back. */
#include "common/file.h"
#include "common/image.h"
#include "common/json.h"
#include "common/mem.h"
#include "common/parallel.h"
#include "server/demo/generate.h"
#include "server/demo/room.h"
#include "tests/check.h"

static float pixel(const struct image *image, const char *channel, size_t i) {
    int c = image_channel(image, channel);
    CHECK_THAT(c >= 0, "no channel %s", channel);
    return image->pixel[i * image->channel_count + (size_t)(c < 0 ? 0 : c)];
}

/* What a ray from outside meets first that comes in where the emitter on the wall is. */
static void test_behind_panel(const struct room *room, enum room_object wanted) {
    struct accel_hit hit;
    vec3 outside = {-1.0f, 1.5f, 2.1f}, in = {1.0f, 0.0f, 0.0f};
    CHECK(accel_intersect(room->world.accel, outside, in, 0.0f, 10.0f, &hit));
    CHECK_THAT(room->mesh.object_id[hit.triangle] == wanted, "object %d", (int)room->mesh.object_id[hit.triangle]);
}

/* Where a ray from the middle of the room meets the surface: nothing stands out of flush lamps. */
static void test_flush(const struct room *room) {
    static const struct {
        vec3 to;
        enum room_object wanted;
    } at[] = {
        {{0.0f, 1.5f, 2.1f}, ROOM_WALL_EMITTER},        {{0.0f, 1.07f, 2.1f}, ROOM_LAMP_FRAMES},
        {{0.0f, 1.0f, 2.1f}, ROOM_WALL_WEST},           {{2.5f, ROOM_HEIGHT, 2.1f}, ROOM_CEILING_EMITTER},
        {{2.07f, ROOM_HEIGHT, 2.1f}, ROOM_LAMP_FRAMES}, {{2.0f, ROOM_HEIGHT, 2.1f}, ROOM_CEILING},
    };
    vec3 centre = {2.5f, 1.4f, 3.0f};
    for (size_t i = 0; i < sizeof at / sizeof *at; i++) {
        vec3 way = vec3_sub(at[i].to, centre);
        struct accel_hit hit;
        bool met = accel_intersect(room->world.accel, centre, vec3_normalize(way), 0.0f, 10.0f, &hit);
        CHECK_THAT(met && room->mesh.object_id[hit.triangle] == at[i].wanted, "place %zu: object %d", i,
                   met ? (int)room->mesh.object_id[hit.triangle] : -1);
        CHECK_NEAR(met ? hit.distance_m : 0.0f, vec3_length(way), 1e-4);
    }
}

/* The room is closed, its normals look inwards, its colours are reflectances. The panel of a window closes it, too. */
static void test_room(enum room_lamps lamps, struct parallel *pool) {
    struct room room;
    struct error err;
    CHECK(room_init(&room, &(struct room_look){256, 15.0f, 10.0f, lamps}, pool, &err) == STATUS_OK);
    test_behind_panel(&room, lamps == ROOM_LAMPS_FRAMED ? ROOM_WALL_WEST : ROOM_WALL_EMITTER);
    if (lamps == ROOM_LAMPS_FLUSH)
        test_flush(&room);
    vec3 centre = {2.5f, 1.4f, 3.0f};
    for (int i = 0; i < 2000; i++) {
        float y = 1.0f - 2.0f * ((float)i + 0.5f) / 2000.0f, r = sqrtf(1.0f - y * y);
        float turn = 2.399963f * (float)i;
        vec3 direction = {r * cosf(turn), y, r * sinf(turn)};
        struct accel_hit hit;
        bool met = accel_intersect(room.world.accel, centre, direction, 0.0f, 10.0f, &hit);
        CHECK_THAT(met, "a ray leaves the room at (%g, %g, %g)", (double)direction.x, (double)direction.y,
                   (double)direction.z);
        CHECK_THAT(!met || vec3_dot(mesh_cross(&room.mesh, hit.triangle), direction) < 0.0f,
                   "triangle %u shows its back", hit.triangle);
    }
    size_t seen[ROOM_OBJECT_COUNT] = {0};
    for (size_t i = 0; i < room.inverse.valid_count; i++) {
        const float *c = room.materials.base_color.texel[room.inverse.valid[i]];
        seen[room.mesh.object_id[room.inverse.triangle[room.inverse.valid[i]]]]++;
        for (int k = 0; k < 3; k++)
            CHECK_THAT(c[k] > 0.003f && c[k] < 0.96f, "base colour %g", (double)c[k]);
    }
    for (int o = 0; o < ROOM_OBJECT_COUNT; o++)
        CHECK_THAT(seen[o] > 4, "%s has %zu texels", room_object_name((enum room_object)o), seen[o]);
    CHECK_NEAR(rgb_mean(room.materials.emission[ROOM_WALL_EMITTER]), 15.0, 1e-4);
    CHECK_NEAR(rgb_mean(room.materials.emission[ROOM_CEILING_EMITTER]), 10.0 * 2.95 / 3.0, 1e-4);
    room_release(&room);
}

static void test_truth(const char *path, double *emitting) {
    struct image image;
    struct error err;
    CHECK(image_read(path, &image, NULL, &err) == STATUS_OK);
    for (size_t i = 0; i < (size_t)image.width * image.height; i++) {
        float object = pixel(&image, "object_id", i);
        CHECK(object == floorf(object) && object >= 0.0f && object < (float)ROOM_OBJECT_COUNT);
        CHECK_THAT(pixel(&image, "depth", i) > 0.2f && pixel(&image, "depth", i) < 7.0f, "depth %g",
                   (double)pixel(&image, "depth", i));
        CHECK(pixel(&image, "base_color.G", i) > 0.0f && pixel(&image, "base_color.G", i) < 1.0f);
        CHECK(pixel(&image, "roughness", i) > 0.0f && pixel(&image, "roughness", i) <= 1.0f);
        *emitting += pixel(&image, "emission.G", i) > 0.0f;
    }
    image_release(&image);
}

/* What was written reads back: cameras, splits, exposures, pictures that agree with them. */
static void test_bundle(const char *dir, bool sdr, struct parallel *pool) {
    struct demo_settings s = demo_default_settings();
    struct error err;
    cJSON *root = NULL;
    double emitting = 0.0;
    s.width = 32, s.height = 24, s.train_count = 3, s.test_count = 6, s.spp = 4, s.test_spp = 4;
    s.max_depth = 4, s.texture_size = 256, s.sdr = sdr;
    CHECK(demo_generate(dir, &s, pool, NULL, NULL, &err) == STATUS_OK);
    char *path = file_join(dir, "transforms.json");
    CHECK(json_read(path, 1 << 20, &root, &err) == STATUS_OK);
    mem_free(path);
    int index = 0;
    for (const cJSON *f = cJSON_GetObjectItem(root, "frames")->child; f; f = f->next, index++) {
        const char *split = cJSON_GetStringValue(cJSON_GetObjectItem(f, "split"));
        CHECK_STRING(split, index < 3 ? "train" : "test");
        CHECK(cJSON_HasObjectItem(f, "exposure") == sdr);
        struct image image;
        path = file_join(dir, cJSON_GetStringValue(cJSON_GetObjectItem(f, "file_path")));
        CHECK(image_read(path, &image, NULL, &err) == STATUS_OK);
        CHECK(image.width == 32 && image.height == 24 && image.channel_count == 3);
        image_release(&image);
        mem_free(path);
        if (index >= 3) {
            path = mem_printf("%s/truth/%03d.exr", dir, index);
            test_truth(path, &emitting);
            mem_free(path);
        }
    }
    CHECK(index == 9);
    CHECK_THAT(emitting > 0.0, "no test view sees a lamp");
    cJSON_Delete(root);
    path = mem_printf("%s/truth/objects.json", dir);
    CHECK(json_read(path, 1 << 20, &root, &err) == STATUS_OK);
    CHECK(cJSON_GetArraySize(root) == ROOM_OBJECT_COUNT);
    cJSON_Delete(root);
    mem_free(path);
}

int main(void) {
    char dir[] = "/tmp/unbake-demo-XXXXXX";
    struct parallel *pool = parallel_new(2);
    CHECK(mkdtemp(dir) != NULL);
    for (int lamps = ROOM_LAMPS_FRAMED; lamps <= ROOM_LAMPS_FLUSH; lamps++)
        test_room((enum room_lamps)lamps, pool);
    test_bundle(dir, false, pool);
    test_bundle(dir, true, pool);
    CHECK(file_remove_tree(dir, NULL) == STATUS_OK);
    parallel_free(pool);
    return check_result();
}
