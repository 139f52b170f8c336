/* score.c against figures worked out by hand; evaluate.c on outputs that are the truth itself,
 * and on outputs that are off by a known amount. */
#include "common/file.h"
#include "common/image.h"
#include "common/json.h"
#include "common/mem.h"
#include "common/parallel.h"
#include "common/rng.h"
#include "server/demo/generate.h"
#include "server/demo/room.h"
#include "server/evaluate/evaluate.h"
#include "server/evaluate/score.h"
#include "server/export/outputs.h"
#include "server/relight/recovered.h"
#include "tests/check.h"

enum { BASE = 0, ROUGHNESS = 3, SPECULAR = 4, EMISSION = 5, OBJECT = 8, CHANNELS = 9 };
static const char *const channels[CHANNELS] = {"base_color.R", "base_color.G", "base_color.B", "roughness", "specular",
                                               "emission.R",   "emission.G",   "emission.B",   "object_id"};

/* A row of six pixels: objects 0 0 0 0 1 1. */
static void test_score(void) {
    struct image truth, found;
    struct score score = {0};
    image_init(&truth, 6, 1, CHANNELS, channels);
    image_init(&found, 6, 1, CHANNELS, channels);
    for (size_t i = 0; i < 6; i++) {
        float *t = truth.pixel + i * CHANNELS, *f = found.pixel + i * CHANNELS;
        for (int c = 0; c < 3; c++)
            t[BASE + c] = 0.5f, f[BASE + c] = 0.6f;
        t[ROUGHNESS] = 0.4f, f[ROUGHNESS] = 0.5f;
        t[SPECULAR] = 0.5f, f[SPECULAR] = 0.5f;
        t[OBJECT] = i < 4 ? 0.0f : 1.0f;
    }
    float *f = found.pixel, *t = truth.pixel;
    f[2 * CHANNELS + BASE] = 1.5f;         /* clamped to 1: off by 0.5 */
    t[4 * CHANNELS + EMISSION] = 2.0f;     /* emits in truth alone */
    t[5 * CHANNELS + EMISSION + 1] = 1.0f; /* emits in both */
    f[5 * CHANNELS + EMISSION + 1] = 3.0f;
    f[0 * CHANNELS + EMISSION + 2] = 1.0f; /* emits in ours alone */
    const uint8_t plain = SCORE_PLAIN, both = SCORE_PLAIN | SCORE_SEEN;
    const uint8_t flags[6] = {both, both, both, plain, 0, 0};
    score_add(&score, &found, &truth, flags);

    CHECK(score.pixels == 6 && score.plain_pixels == 4 && score.seen_pixels == 3);
    /* 9 values of which 8 are off by 0.1 and one by 0.5; 12 of which 11 and one */
    CHECK_NEAR(score_mean(score.base_color_seen), (8 * 0.01 + 0.25) / 9, 1e-8);
    CHECK_NEAR(score_mean(score.base_color_all), (11 * 0.01 + 0.25) / 12, 1e-8);
    CHECK_NEAR(score_psnr_db(score.base_color_seen), 14.3573, 1e-4);
    CHECK_NEAR(score_base_color_ratio(&score), (8 * 0.6 + 1.0) / (9 * 0.5), 1e-7); /* pixel 3 is not seen */
    /* Pixel 3 borders on another object, pixels 0 to 2 do not. */
    CHECK(score.roughness.count == 3);
    CHECK(score.base_color_inside.count == 9);
    CHECK_NEAR(score_mean(score.base_color_inside), (8 * 0.01 + 0.25) / 9, 1e-8);
    CHECK_NEAR(score_psnr_db(score.roughness), 20.0, 1e-4);
    CHECK(isinf(score_psnr_db(score.specular)));
    CHECK_NEAR(score_emission_iou(&score), 1.0 / 3.0, 1e-12);
    /* log 3, log 4 - log 2, log 2, squared, over 18 values */
    CHECK_NEAR(score_mean(score.emission_log), (log(3) * log(3) + log(2) * log(2) + log(2) * log(2)) / 18, 1e-7);
    struct score nothing = {0};
    CHECK(isnan(score_base_color_ratio(&nothing)));
    CHECK(isnan(score_psnr_db(nothing.roughness)) && score_emission_iou(&nothing) == 1.0);
    image_release(&truth);
    image_release(&found);
}

/* Two pixels of one radiance and another, of which flat renders are off by a tenth and a fifth; one is masked. */
static void test_noise_floor(const char *dir) {
    static const char *const flat_channels[6] = {"B", "G", "R", "err.B", "err.G", "err.R"};
    struct image photograph, flat, render;
    struct noise_floor floor = {0};
    struct error err;
    char *path = mem_printf("%s/flat.exr", dir);
    image_init_rgb(&photograph, 3, 1);
    image_init(&flat, 3, 1, 6, flat_channels);
    for (size_t i = 0; i < 3; i++)
        for (size_t c = 0; c < 3; c++) {
            photograph.pixel[3 * i + c] = i == 0 ? 2.0f : i == 1 ? 1.0f : NAN;
            flat.pixel[6 * i + c] = i == 0 ? 4.0f : 0.5f;
            flat.pixel[6 * i + 3 + c] = i == 0 ? 0.4f : 0.1f;
        }
    /* 4 x (.2^2 / (4 + .01) + .2^2 / (1 + .01)) / 2 */
    CHECK_NEAR(noise_floor_of(&photograph, &flat, 1.0), 2.0 * (0.04 / 4.01 + 0.04 / 1.01), 1e-6);
    CHECK(noise_floor_add(&floor, path, &photograph, 0.5, 1.0, &err) == STATUS_OK && floor.count == 0);
    CHECK(image_write_exr(path, &flat, IMAGE_FLOAT, false, &err) == STATUS_OK);
    CHECK(noise_floor_add(&floor, path, &photograph, 0.5, 1.0, &err) == STATUS_OK && floor.count == 1);
    CHECK_NEAR(floor.floor, 2.0 * (0.04 / 4.01 + 0.04 / 1.01), 1e-6);
    CHECK(floor.msre == 0.5);
    image_init_rgb(&render, 3, 1); /* has no errors */
    CHECK(image_write_exr(path, &render, IMAGE_FLOAT, false, &err) == STATUS_OK);
    CHECK(noise_floor_add(&floor, path, &photograph, 0.5, 1.0, &err) == STATUS_INPUT);
    image_release(&render);
    image_release(&flat);
    image_release(&photograph);
    mem_free(path);
}

/* A photograph of a wall under light that falls off, each pixel a tenth too bright or too dark, beside another object;
 * a shiny and a striped one tell nothing. */
static void test_even(void) {
    enum { WIDTH = 96, HEIGHT = 64, OTHER = 80 }; /* from that column on it is the other object */
    struct image truth, photograph, halves;
    struct smooth_areas even = {0}, shiny = {0}, striped = {0};
    image_init(&truth, WIDTH, HEIGHT, CHANNELS, channels);
    image_init_rgb(&photograph, WIDTH, HEIGHT);
    image_init(&halves, WIDTH, HEIGHT, 6, (const char *const[]){"a.R", "a.G", "a.B", "b.R", "b.G", "b.B"});
    for (uint32_t i = 0; i < WIDTH * HEIGHT; i++) {
        float x = (float)(i % WIDTH), *t = truth.pixel + (size_t)i * CHANNELS;
        float right = 1.0f + 0.01f * x + 0.0005f * x * x;
        t[ROUGHNESS] = 1.0f;
        t[OBJECT] = i % WIDTH < OTHER ? 0.0f : 1.0f;
        for (uint32_t c = 0; c < 3; c++) {
            t[BASE + c] = 0.5f;
            photograph.pixel[3 * i + c] = right * (rng_mix32(3 * i + c) % 2 ? 1.1f : 0.9f);
            halves.pixel[6 * i + c] = halves.pixel[6 * i + 3 + c] = right * 1.2f;
        }
    }
    smooth_areas_add(&even, &photograph, &halves, &truth, 0.0);
    CHECK_THAT(even.count == (OTHER - 6 + WIDTH - OTHER - 6) * (HEIGHT - 6), "%zu", even.count);
    /* (.1 / 1.1)^2 or (.1 / .9)^2; and .1 or .3 of these */
    CHECK_NEAR(even.noise / (double)even.count, 0.5 * (0.01 / 1.21 + 0.01 / 0.81), 0.0003);
    CHECK_NEAR(even.render / (double)even.count, 0.5 * (0.01 / 1.21 + 0.09 / 0.81), 0.002);
    for (size_t i = 0; i < WIDTH * HEIGHT; i++)
        truth.pixel[i * CHANNELS + ROUGHNESS] = 0.2f;
    smooth_areas_add(&shiny, &photograph, &halves, &truth, 0.0);
    for (size_t i = 0; i < WIDTH * HEIGHT; i++) {
        truth.pixel[i * CHANNELS + ROUGHNESS] = 1.0f;
        truth.pixel[i * CHANNELS + BASE + 1] = i % WIDTH % 7 == 0 ? 0.3f : 0.5f;
    }
    smooth_areas_add(&striped, &photograph, &halves, &truth, 0.0);
    CHECK(shiny.count == 0 && striped.count == 0);
    image_release(&truth);
    image_release(&photograph);
    image_release(&halves);
}

/* Writes a room's own materials as if a job had found them. */
static void export_room(const char *dir, const struct room *room) {
    struct error err;
    size_t texels = (size_t)room->atlas.width * room->atlas.height;
    float *zero = mem_calloc(texels, sizeof *zero);
    bool is_emitter[ROOM_OBJECT_COUNT] = {false};
    cJSON *report = cJSON_CreateObject();
    struct export_input in = {"room",
                              &room->mesh,
                              &room->segments,
                              &room->atlas,
                              &room->inverse,
                              &room->materials,
                              zero,
                              is_emitter,
                              NULL,
                              NULL,
                              0,
                              NULL,
                              report,
                              {0.0f, 1.0f, 0.0f},
                              true,
                              NULL,
                              {0},
                              0,
                              NULL,
                              .baked = NULL};
    enum status status = export_outputs(dir, &in, NULL, NULL, &err);
    CHECK_THAT(status == STATUS_OK, "%s", err.message);
    cJSON_Delete(report);
    mem_free(zero);
}

static struct evaluation evaluate(const char *room, const char *outputs, struct parallel *pool) {
    struct evaluate_settings settings = evaluate_default_settings();
    struct evaluation v = {0};
    struct error err = {0};
    settings.spp = 64;
    enum status status = evaluate_outputs(room, outputs, &settings, pool, &v, &err);
    CHECK_THAT(status == STATUS_OK, "%s", err.message);
    return v;
}

/* The truth's figures are as good as half precision and sampling allow; moving every base colour
 * by 0.1 costs what arithmetic says; a lamp that is off is missed, a wall that glows is false. */
static void test_known(const char *dir, struct parallel *pool) {
    struct demo_settings demo = demo_default_settings();
    struct room room;
    struct error err;
    char *outputs = file_join(dir, "out");
    demo.width = 32, demo.height = 24, demo.train_count = 6, demo.test_count = 2;
    demo.spp = 16, demo.test_spp = 128, demo.texture_size = 256, demo.max_depth = 6;
    CHECK(demo_generate(dir, &demo, pool, NULL, NULL, &err) == STATUS_OK);
    CHECK(file_make_dirs(outputs, &err) == STATUS_OK);
    CHECK(room_init(&room, &(struct room_look){256, demo.wall_radiance, demo.ceiling_radiance, ROOM_LAMPS_FRAMED}, pool,
                    &err) == STATUS_OK);

    export_room(outputs, &room);
    struct evaluation v = evaluate(dir, outputs, pool);
    CHECK(v.view_count == 2 && v.emitters.count == 2 && v.emitters.found == 2);
    CHECK(v.emitters.missed == 0 && v.emitters.unfounded == 0);
    CHECK_THAT(score_psnr_db(v.score.base_color_all) > 35.0, "%g dB", /* samples differ */
               score_psnr_db(v.score.base_color_all));
    CHECK_THAT(score_psnr_db(v.score.roughness) > 50.0, "%g dB", score_psnr_db(v.score.roughness));
    CHECK_THAT(score_emission_iou(&v.score) > 0.95, "%g", score_emission_iou(&v.score));
    CHECK_THAT(v.msre < 0.1, "MSRE %g", v.msre);
    CHECK_THAT(v.score.seen_pixels > v.score.plain_pixels / 10 && v.score.seen_pixels < v.score.plain_pixels,
               "%zu of %zu", v.score.seen_pixels, v.score.plain_pixels); /* photographs are small */

    for (size_t i = 0; i < room.inverse.valid_count; i++)
        for (int c = 0; c < 3; c++) {
            float *value = &room.materials.base_color.texel[room.inverse.valid[i]][c];
            *value += *value < 0.5f ? 0.1f : -0.1f;
        }
    for (int o = 0; o < ROOM_OBJECT_COUNT; o++)
        room.materials.specular[o] = 0.0f;
    room.materials.emission[ROOM_CEILING_EMITTER] = rgb_gray(0.0f);
    room.materials.emission[ROOM_FLOOR] = rgb_gray(0.5f);
    export_room(outputs, &room);
    struct evaluation w = evaluate(dir, outputs, pool);
    CHECK(w.emitters.found == 1 && w.emitters.missed == 1 && w.emitters.unfounded == 1);
    /* A little more than 20: within a pixel, raised and lowered values partly cancel. */
    CHECK_NEAR(score_psnr_db(w.score.base_color_all), 20.5, 1.0);
    CHECK(score_emission_iou(&w.score) < 0.9);
    CHECK(w.msre > 3.0 * v.msre);

    room_release(&room);
    mem_free(outputs);
}

/* A lamp that shows a picture is read back as it was, texel by texel, in half precision. */
static void test_picture(const char *dir, struct parallel *pool) {
    struct room room;
    struct recovered r;
    struct error err;
    char *outputs = file_join(dir, "picture");
    CHECK(file_make_dirs(outputs, &err) == STATUS_OK);
    CHECK(room_init(&room, &(struct room_look){256, 15.0f, 15.0f, ROOM_LAMPS_FRAMED}, pool, &err) == STATUS_OK);
    struct materials *m = &room.materials;
    materials_start_emission_pattern(m);
    for (size_t i = 0; i < room.inverse.valid_count; i++) {
        uint32_t texel = room.inverse.valid[i];
        if (room.segments.of_triangle[room.inverse.triangle[texel]] == ROOM_WALL_EMITTER)
            materials_set_emission_pattern(m, texel, rgb_make(texel % 7 ? 1.5f : 0.1f, 1.0f, texel % 3 ? 0.5f : 0.0f),
                                           rgb_gray(1.0f));
    }
    export_room(outputs, &room);
    CHECK_THAT(recovered_load(outputs, &room.mesh, pool, &r, &err) == STATUS_OK, "%s", err.message);
    CHECK(r.materials.emission_pattern != NULL);
    CHECK_NEAR(r.materials.emission[ROOM_CEILING_EMITTER].g, m->emission[ROOM_CEILING_EMITTER].g, 0.01);
    for (size_t i = 0; i < room.inverse.valid_count; i++) {
        uint32_t texel = room.inverse.valid[i], s = room.segments.of_triangle[room.inverse.triangle[texel]];
        rgb wanted = materials_emission_of_texel(m, s, texel),
            found = materials_emission_of_texel(&r.materials, s, texel);
        CHECK_NEAR(found.r, wanted.r, 2e-3f * wanted.r);
        CHECK_NEAR(found.g, wanted.g, 2e-3f * wanted.g);
        CHECK_NEAR(found.b, wanted.b, 2e-3f * wanted.b + 0.01f); /* its least is a share of a mean that is another */
    }
    recovered_release(&r);
    room_release(&room);
    mem_free(outputs);
}

/* Outputs of another room, and no outputs at all, are refused with a sentence. */
static void test_refused(const char *dir, struct parallel *pool) {
    struct evaluate_settings settings = evaluate_default_settings();
    struct evaluation v;
    struct error err;
    CHECK(evaluate_outputs(dir, "/nonexistent", &settings, pool, &v, &err) == STATUS_NOT_FOUND);
    char *path = file_join(dir, "out/scene.ply");
    CHECK(file_replace(path, "ply\n", 4, &err) == STATUS_OK);
    char *outputs = file_join(dir, "out");
    CHECK(evaluate_outputs(dir, outputs, &settings, pool, &v, &err) == STATUS_INPUT);
    mem_free(outputs);
    mem_free(path);
}

int main(void) {
    char dir[] = "/tmp/unbake-evaluate-XXXXXX";
    struct parallel *pool = parallel_new(2);
    CHECK(mkdtemp(dir) != NULL);
    test_score();
    test_even();
    test_noise_floor(dir);
    test_known(dir, pool);
    test_refused(dir, pool);
    test_picture(dir, pool);
    CHECK(file_remove_tree(dir, NULL) == STATUS_OK);
    parallel_free(pool);
    return check_result();
}
