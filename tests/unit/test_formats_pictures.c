/* test_formats_pictures.c -- lamps that show a picture, in the files of an export. */
#include "server/export/emission_texture.h"
#include "server/export/pictures.h"
#include "tests/unit/formats_rig.h"
#include "tests/unit/glb_view.h"

static void check_text(const char *dir, const char *name, const char *wanted, size_t times) {
    struct buf file;
    struct error err;
    char *path = file_join(dir, name);
    size_t count = 0;
    buf_init(&file, 1 << 26);
    CHECK(file_read(path, &file, &err) == STATUS_OK);
    for (const char *at = buf_text(&file); (at = strstr(at, wanted)) != NULL; at++)
        count++;
    CHECK_THAT(count == times, "%s: %zu times %s", name, count, wanted);
    buf_release(&file);
    mem_free(path);
}

/* A lamp that shows a picture has a texture of its own, scaled to its brightest texel; the other has none. */
static void test_picture(const char *dir, struct room *room, const struct export_input *input,
                         const struct parts *parts) {
    struct export_input in = *input;
    struct materials *m = &room->materials;
    struct error err;
    struct glb g;
    char *png = file_join(dir, FORMATS_EMISSION), *path = file_join(dir, "scene.glb");
    in.inverse = &room->inverse;
    materials_start_emission_pattern(m);
    for (size_t i = 0; i < room->inverse.valid_count; i++) {
        uint32_t texel = room->inverse.valid[i];
        if (room->segments.of_triangle[room->inverse.triangle[texel]] == ROOM_WALL_EMITTER)
            materials_set_emission_pattern(m, texel, rgb_gray(texel % 2 ? 1.5f : 0.5f), rgb_gray(1.0f));
    }
    CHECK(formats[0].write(dir, &in, parts, &err) != STATUS_OK && strstr(err.message, FORMATS_EMISSION));
    struct image picture;
    uint32_t *source = picture_margin(&room->inverse);
    float *scales = emission_texture_scales(&in), white = 1.5f * rgb_max(m->emission[ROOM_WALL_EMITTER]);
    CHECK_NEAR(scales[ROOM_WALL_EMITTER], white, 2e-3f * white);
    CHECK(scales[ROOM_CEILING_EMITTER] == 0.0f && scales[ROOM_FLOOR] == 0.0f);
    emission_texture(&in, source, scales, &picture);
    CHECK(image_write_png(png, &picture, 1.0f, &err) == STATUS_OK);
    for (size_t f = 0; f < FORMATS_COUNT; f++)
        CHECK(formats[f].write(dir, &in, parts, &err) == STATUS_OK);
    read_glb(path, &g);
    for (size_t p = 0; p < parts->count; p++) {
        const cJSON *material = item(&g, "materials", (double)p);
        bool varies = parts->part[p].segment == ROOM_WALL_EMITTER;
        CHECK((cJSON_GetObjectItem(material, "emissiveTexture") != NULL) == varies);
        double strength = number(member(material, "extensions", "KHR_materials_emissive_strength"), "emissiveStrength");
        CHECK(!varies || fabs(strength - (double)white) < 2e-3 * (double)white);
    }
    check_picture(&g, 1, png);
    check_text(dir, "scene.mtl", "map_Ke emission.png", 1);
    check_text(dir, "scene.xml", "name=\"radiance\" id=\"emission\"", 1);
    check_text(dir, "scene.xml", "emission.exr", 1);
    check_text(dir, "scene.xml", "<rgb name=\"radiance\"", 1);
    materials_drop_emission_pattern(m);
    release_glb(&g);
    image_release(&picture);
    mem_free(scales);
    mem_free(source);
    mem_free(path);
    mem_free(png);
}

int main(void) {
    struct formats_rig r;
    formats_rig_open(&r);
    test_picture(r.dir, &r.room, &r.in, &r.parts);
    formats_rig_close(&r);
    return check_result();
}
