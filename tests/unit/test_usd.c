/* test_usd.c -- scene.usda and scene.usdz: what can be said of them without USD's own library, which test_usd.sh asks.
 *
 * test_usd DIR writes the files for that test to DIR; test_usd DIR render a room in which the models of reflection
 * agree (no specular lobe, and a roughness at which the diffuse one reflects as Lambert's), and our picture of it. */
#include <zlib.h>

#include "common/buf.h"
#include "common/file.h"
#include "common/image.h"
#include "common/mem.h"
#include "common/output_names.h"
#include "server/demo/room.h"
#include "server/export/emission_texture.h"
#include "server/export/formats.h"
#include "server/export/pictures.h"
#include "server/export/sky.h"
#include "server/render/film.h"
#include "server/scene/latlong.h"
#include "tests/check.h"

#define LAMBERT_ROUGHNESS 0.42f /* where the albedo of Burley's diffuse lobe is 1 */
#define SKY_RADIANCE 2.0f

static void read_file(const char *dir, const char *name, struct buf *file) {
    struct error err;
    char *path = file_join(dir, name);
    buf_init(file, 1 << 26);
    CHECK(file_read(path, file, &err) == STATUS_OK);
    mem_free(path);
}

static void write_picture(const char *dir, const char *name, const struct image *image) {
    struct error err;
    char *path = file_join(dir, name);
    bool is_png = strstr(name, ".png") != NULL;
    CHECK((is_png ? image_write_png(path, image, 1.0f, &err)
                  : image_write_exr(path, image, IMAGE_FLOAT, false, &err)) == STATUS_OK);
    mem_free(path);
}

static void write_formats(const char *dir, const struct export_input *in, const struct parts *parts) {
    struct error err = {.message = ""};
    for (size_t f = 0; f < FORMATS_COUNT; f++)
        if (strncmp(formats[f].name, "scene.usd", 9) == 0)
            CHECK_THAT(formats[f].write(dir, in, parts, &err) == STATUS_OK, "%s", err.message);
}

static uint32_t u32_at(const char *p) {
    const unsigned char *b = (const unsigned char *)p;
    return (uint32_t)b[0] | (uint32_t)b[1] << 8 | (uint32_t)b[2] << 16 | (uint32_t)b[3] << 24;
}
static uint32_t u16_at(const char *p) { return u32_at(p) & 0xffff; }

/* The files of the archive are those of the folder, stored, each from a multiple of 64 bytes on, the layer first. */
static void test_archive(const char *dir) {
    static const char *const wanted[] = {"scene.usda", "base_color.png", "emission.png", "sky.exr"};
    struct buf zip;
    read_file(dir, "scene.usdz", &zip);
    size_t at = 0, count = 0;
    for (; at + 30 < zip.length && u32_at(zip.data + at) == 0x04034b50; count++) {
        const char *head = zip.data + at;
        uint32_t size = u32_at(head + 22), name_length = u16_at(head + 26);
        size_t data = at + 30 + name_length + u16_at(head + 28);
        struct buf file;
        if (count >= 4)
            break;
        CHECK(name_length == strlen(wanted[count]) && memcmp(head + 30, wanted[count], name_length) == 0);
        CHECK(u16_at(head + 8) == 0 && u32_at(head + 18) == size && data % 64 == 0);
        read_file(dir, wanted[count], &file);
        CHECK(file.length == size && memcmp(file.data, zip.data + data, size) == 0);
        CHECK(u32_at(head + 14) == (uint32_t)crc32_z(0, (const Bytef *)file.data, file.length));
        buf_release(&file);
        at = data + size;
    }
    CHECK(count == 4 && u32_at(zip.data + at) == 0x02014b50);
    buf_release(&zip);
}

/* The sun is gone, and nothing else. */
static void test_sky(const struct export_input *in, const struct image *sky) {
    const struct image *map = in->environment;
    for (size_t i = 0; i < (size_t)map->width * map->height; i++)
        CHECK_NEAR(sky->pixel[3 * i], SKY_RADIANCE, 1e-5);
    CHECK(sky->width == map->width && sky->channel_count == 3);
}

/* A layer that had no room leaves no archive without it. */
static void test_left_out(const char *dir, const struct export_input *in, const struct parts *parts) {
    struct error err = {.message = ""};
    char *layer = file_join(dir, FORMATS_USD_LAYER), *archive = file_join(dir, "scene.usdz");
    CHECK(unlink(layer) == 0 && unlink(archive) == 0);
    CHECK(formats[FORMATS_COUNT - 1].write(dir, in, parts, &err) == STATUS_LIMIT);
    CHECK(strstr(err.message, FORMATS_USD_LAYER) != NULL && access(archive, F_OK) != 0);
    mem_free(archive);
    mem_free(layer);
}

/* Lights in nits are those of relative radiance times the luminance of its unit. */
static void test_nits(const char *dir, struct export_input *in, const struct parts *parts) {
    struct error err;
    char *layer = file_join(dir, FORMATS_USD_LAYER);
    for (int pass = 0; pass < 2; pass++) {
        struct buf text;
        in->luminance_per_unit = pass ? 100.0 : 0.0;
        CHECK(formats[FORMATS_COUNT - 2].write(dir, in, parts, &err) == STATUS_OK);
        read_file(dir, FORMATS_USD_LAYER, &text);
        const char *at = buf_text(&text);
        CHECK((strstr(at, "radianceUnit = \"nits\"") != NULL) == pass);
        CHECK(strstr(at, pass ? "intensity = 300\n" : "intensity = 3\n") != NULL); /* the sun */
        CHECK(strstr(at, pass ? "intensity = 100\n" : "intensity = 1\n") != NULL); /* the sky */
        CHECK(strstr(at, pass ? "emissiveColor = (1650, 1500, 1275)" : "emissiveColor = (16.5, 15, 12.75)") != NULL);
        CHECK(strstr(at, pass ? "inputs:scale = (2430.0" : "inputs:scale = (24.3") != NULL); /* a pattern */
        buf_release(&text);
    }
    in->luminance_per_unit = 0.0;
    mem_free(layer);
}

static void set_pattern(struct room *room) {
    materials_start_emission_pattern(&room->materials);
    for (size_t i = 0; i < room->inverse.valid_count; i++) {
        uint32_t texel = room->inverse.valid[i];
        if (room->segments.of_triangle[room->inverse.triangle[texel]] == ROOM_WALL_EMITTER)
            materials_set_emission_pattern(&room->materials, texel, rgb_gray(texel % 2 ? 1.5f : 0.5f), rgb_gray(1.0f));
    }
}

/* A sky of one radiance, with a sun of the input's irradiance in it. */
static void make_sky(struct image *map, const struct export_sun *sun) {
    double angle = 0.0;
    image_init_rgb(map, 64, 33);
    for (int pass = 0; pass < 2; pass++)
        for (size_t i = 0; i < 64 * 33; i++) {
            uint32_t x = (uint32_t)(i % 64), y = (uint32_t)(i / 64);
            bool inside = vec3_dot(latlong_pixel(64, 33, x, y), sun->direction) > cosf((float)PI / 32.0f);
            angle += pass == 0 && inside ? latlong_pixel_angle(64, 33, y) : 0.0;
            for (size_t c = 0; c < 3 && pass == 1; c++)
                map->pixel[3 * i + c] = SKY_RADIANCE + (inside ? sun->irradiance.r / (float)angle : 0.0f);
        }
}

static void write_base_color(const char *dir, const struct export_input *in, const uint32_t *source) {
    struct image color;
    picture_texture(in, PICTURE_BASE_COLOR, source, &color);
    write_picture(dir, FORMATS_BASE_COLOR, &color);
    image_release(&color);
}

static void test_files(const char *dir, struct room *room, struct export_input *in, const struct parts *parts,
                       bool is_kept) {
    char *name[ROOM_OBJECT_COUNT] = {"floor \"oak\"\n", "", "\xe5\xa2\x99-1"};
    struct image map, sky, pattern;
    uint32_t *source = picture_margin(&room->inverse);
    write_base_color(dir, in, source);
    set_pattern(room);
    float *scales = emission_texture_scales(in);
    emission_texture(in, source, scales, &pattern);
    write_picture(dir, FORMATS_EMISSION, &pattern);
    in->sun = (struct export_sun){true, vec3_normalize((vec3){1.0f, 1.0f, 0.0f}), 0.0047f, {3.0f, 3.0f, 3.0f}};
    make_sky(&map, &in->sun);
    in->environment = &map;
    in->up = (vec3){0.0f, 0.0f, 1.0f};
    room->mesh.offset[1] = 1000.0;
    room->mesh.name = name;
    room->mesh.name_count = 3;
    room->segments.is_given = true;
    sky_without_sun(in, &sky);
    test_sky(in, &sky);
    write_picture(dir, OUTPUT_ENVIRONMENT, &map);
    write_picture(dir, OUTPUT_SKY, &sky);
    write_formats(dir, in, parts);
    test_archive(dir);
    if (!is_kept)
        test_nits(dir, in, parts);
    if (!is_kept)
        test_left_out(dir, in, parts);
    room->mesh.name = NULL;
    room->mesh.name_count = 0;
    image_release(&pattern);
    image_release(&sky);
    image_release(&map);
    mem_free(scales);
    mem_free(source);
}

/* The room and our picture of it, ours.exr, for Blender to be compared with. */
static void write_render(const char *dir, struct room *room, struct export_input *in, const struct parts *parts,
                         struct parallel *pool) {
    struct path_settings path = {.max_depth = 16, .roulette_depth = 4, .seed = 1};
    struct image film, picture;
    uint32_t *source = picture_margin(&room->inverse);
    for (size_t s = 0; s < room->segments.count; s++) {
        room->materials.specular[s] = 0.0f;
        room->materials.roughness[s] = LAMBERT_ROUGHNESS;
    }
    write_base_color(dir, in, source);
    write_formats(dir, in, parts);
    film_render(&room->world, in->comparison->camera, 256, &path, 0, pool, &film);
    image_take_rgb(&film, &picture);
    write_picture(dir, "ours.exr", &picture);
    image_release(&picture);
    image_release(&film);
    mem_free(source);
}

int main(int argc, char **argv) {
    char own[] = "/tmp/unbake-usd-XXXXXX";
    const char *dir = argc > 1 ? argv[1] : mkdtemp(own);
    struct parallel *pool = parallel_new(argc > 2 ? 0 : 1);
    struct room room;
    struct parts parts;
    struct error err;
    CHECK(dir != NULL &&
          room_init(&room, &(struct room_look){256, 15.0f, 15.0f, ROOM_LAMPS_FRAMED}, pool, &err) == STATUS_OK);
    struct camera camera = {.width = 160, .height = 120, .fx = 100.0f, .fy = 104.0f, .cx = 76.0f, .cy = 63.0f};
    camera.world_from_camera = (struct rigid){{{0, 0, 1}, {0, -1, 0}, {1, 0, 0}}, {0.4f, 1.4f, 2.0f}};
    if (argc > 2) { /* Blender reads neither uneven pixels nor an offset of the principal point from USD */
        camera.fy = camera.fx;
        camera.cx = 80.0f;
        camera.cy = 60.0f;
    }
    struct export_comparison comparison = {"images/003.exr", NULL, NULL, &camera};
    struct export_input in = {.title = "a \"room\"",
                              .mesh = &room.mesh,
                              .segments = &room.segments,
                              .atlas = &room.atlas,
                              .inverse = &room.inverse,
                              .materials = &room.materials,
                              .comparison_count = 1,
                              .comparison = &comparison};
    CHECK(parts_make(&parts, &room.mesh, &room.segments, &room.atlas, &err) == STATUS_OK);
    if (argc > 2)
        write_render(dir, &room, &in, &parts, pool);
    else
        test_files(dir, &room, &in, &parts, argc > 1);
    parts_release(&parts);
    room_release(&room);
    parallel_free(pool);
    CHECK(argc > 1 || file_remove_tree(dir, NULL) == STATUS_OK);
    return check_result();
}
