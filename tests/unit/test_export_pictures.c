/* pictures.c: what lies between the charts of a texture, level by level; photographs beside renders. */
#include "common/image.h"
#include "common/mem.h"
#include "common/settings.h"
#include "server/demo/room.h"
#include "server/export/pictures.h"
#include "tests/check.h"

/* Each texel within reach of a valid one shows one that is nearly the nearest. */
static void test_margin(void) {
    enum { SIZE = 64 };
    static uint32_t triangle[SIZE * SIZE];
    struct inverse_uv inverse = {.width = SIZE, .height = SIZE, .triangle = triangle};
    const uint32_t at[2] = {20 * SIZE + 20, 24 * SIZE + 50};
    for (size_t i = 0; i < SIZE * SIZE; i++)
        triangle[i] = INVERSE_UV_NONE;
    triangle[at[0]] = triangle[at[1]] = 0;
    uint32_t *source = picture_margin(&inverse);
    for (int y = 0; y < SIZE; y++) {
        for (int x = 0; x < SIZE; x++) {
            int a = (x - 20) * (x - 20) + (y - 20) * (y - 20);
            int b = (x - 50) * (x - 50) + (y - 24) * (y - 24);
            int nearest = a < b ? a : b, reach = EXPORT_MARGIN * EXPORT_MARGIN;
            uint32_t wanted = nearest > reach ? INVERSE_UV_NONE : a <= b ? at[0] : at[1];
            uint32_t found = source[y * SIZE + x];
            CHECK_THAT(found == wanted || (a == b && found == at[1]), "at %d %d", x, y);
        }
    }
    mem_free(source);
}

/* Texels of a mip level that cover a chart and have a value of another one. */
static size_t mixed_texels(const struct atlas *atlas, const struct inverse_uv *inverse, const uint32_t *source,
                           int level) {
    uint32_t side = atlas->width >> level;
    size_t mixed = 0;
    for (uint32_t i = 0; i < side * side; i++) {
        uint32_t first = UINT32_MAX;
        bool covers = false, mixes = false;
        for (uint32_t k = 0; k < 1u << (2 * level); k++) {
            size_t texel = (size_t)((i / side << level) + (k >> level)) * atlas->width + (i % side << level) +
                           (k & ((1u << level) - 1));
            if (source[texel] == INVERSE_UV_NONE)
                continue;
            uint32_t chart = atlas->chart_of_triangle[inverse->triangle[source[texel]]];
            covers |= source[texel] == texel;
            mixes |= first != UINT32_MAX && chart != first;
            first = chart;
        }
        mixed += covers && mixes;
    }
    return mixed;
}

/* The gutter between charts keeps the mip levels clean that the files name. */
static void test_clean_levels(struct parallel *pool) {
    static const struct {
        uint32_t padding;
        int level;
    } table[] = {{1, 0}, {ATLAS_PADDING, 1}, {ATLAS_AUTOMATIC_PADDING, 2}, {16, 3}};
    struct room room;
    struct error err;
    struct settings defaults;
    settings_init(&defaults);
    CHECK(settings_number(&defaults, "padding") == ATLAS_AUTOMATIC_PADDING);
    settings_release(&defaults);
    CHECK(room_init(&room, &(struct room_look){64, 0.0f, 0.0f, ROOM_LAMPS_FRAMED}, pool, &err) == STATUS_OK);
    for (size_t i = 0; i < sizeof table / sizeof *table; i++) {
        struct atlas atlas;
        struct inverse_uv inverse;
        CHECK(atlas_make(&atlas, &room.mesh, &room.segments, 1024, 0.0f, table[i].padding, &err) == STATUS_OK);
        CHECK_THAT(atlas_clean_level(atlas.padding) == table[i].level, "%u", atlas.padding);
        inverse_uv_make(&inverse, &atlas, room.mesh.triangle_count, pool);
        uint32_t *source = picture_margin(&inverse);
        printf("padding %u: utilisation %.3f, mixed at levels 1 to 3:", atlas.padding, atlas.utilisation);
        for (int level = 1; level <= 3; level++) {
            size_t mixed = mixed_texels(&atlas, &inverse, source, level);
            printf(" %zu", mixed);
            CHECK_THAT(mixed == 0 || level > table[i].level, "%zu texels of level %d mix charts", mixed, level);
        }
        printf("\n");
        mem_free(source);
        inverse_uv_release(&inverse);
        atlas_release(&atlas);
    }
    room_release(&room);
}

/* One exposure for both; equal pictures differ nowhere; signs by colour. */
static void test_comparison(void) {
    struct image photograph, render, picture;
    image_init_rgb(&photograph, 10, 1);
    image_init_rgb(&render, 10, 1);
    for (int i = 0; i < 30; i++)
        photograph.pixel[i] = render.pixel[i] = 2.0f;
    for (int c = 0; c < 3; c++) {
        render.pixel[c] = 4.0f;     /* first pixel too bright */
        render.pixel[3 + c] = 1.0f; /* second too dark */
        photograph.pixel[6 + c] = NAN;
    }
    struct export_comparison comparison = {"a", &photograph, &render, NULL};
    picture_comparison(&comparison, &picture);
    CHECK(picture.width == 38 && picture.height == 1);
    const float *p = picture.pixel, *r = p + 3 * 14, *d = p + 3 * 28;
    CHECK_NEAR(p[0], 0.6, 1e-6); /* the 80th percentile */
    CHECK_NEAR(r[0], 1.2, 1e-6);
    CHECK_NEAR(r[3], 0.3, 1e-6);
    CHECK(d[0] > d[1] && d[1] == d[2]);
    CHECK(d[5] > d[3] && d[3] == d[4]);
    CHECK(isnan(d[6]));
    CHECK(d[9] == d[10] && d[10] == d[11]);
    image_release(&photograph);
    image_release(&render);
    image_release(&picture);
}

int main(void) {
    struct parallel *pool = parallel_new(1);
    test_margin();
    test_clean_levels(pool);
    test_comparison();
    parallel_free(pool);
    return check_result();
}
