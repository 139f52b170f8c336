/* A photograph at a fraction of its size: means, what is left out, the camera, the step. */
#include "server/scene/photograph_reduce.h"

#include <math.h>

#include "common/image.h"
#include "common/kept_pixels.h"
#include "common/mem.h"
#include "tests/check.h"

/* 7 x 5, red = column, green = row, blue = 0; with a lens. */
static struct photograph make(void) {
    struct photograph p = {.exposure = 2.0f, .gain = {1.0f, 1.0f, 1.0f}, .clip = 100.0f, .name = NULL};
    p.camera = (struct camera){.width = 7, .height = 5, .fx = 6.0f, .fy = 6.5f, .cx = 3.4f, .cy = 2.6f, .k = {0.05f}};
    p.camera.camera_from_world = p.camera.world_from_camera =
        (struct rigid){.rotation = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}};
    camera_find_fold(&p.camera);
    p.pixel = mem_calloc(35, sizeof *p.pixel);
    for (int i = 0; i < 35; i++) {
        p.pixel[i][0] = image_half_from_float((float)(i % 7));
        p.pixel[i][1] = image_half_from_float((float)(i / 7));
    }
    return p;
}

static void test_means(void) {
    struct photograph p = make(), small;
    photograph_reduce(&p, 2, NULL, &small);
    CHECK(small.camera.width == 3 && small.camera.height == 2);
    struct photograph_sample s;
    for (uint32_t y = 0; y < 2; y++) {
        for (uint32_t x = 0; x < 3; x++) {
            CHECK(photograph_sample(&small, (float)x + 0.5f, (float)y + 0.5f, &s));
            CHECK_NEAR(s.radiance.r, 0.5 * (2.0 * x + 0.5), 1e-6);
            CHECK_NEAR(s.radiance.g, 0.5 * (2.0 * y + 0.5), 1e-6);
            CHECK(s.radiance.b == 0.0f && !photograph_sample_saturates(&s));
        }
    }
    photograph_release(&small);
    p.black = 0.25f; /* read as the stored 0 is, once */
    photograph_reduce(&p, 2, NULL, &small);
    CHECK(photograph_sample(&small, 0.5f, 0.5f, &s));
    CHECK_NEAR(s.radiance.r, 0.5 * (0.5 - 0.125), 1e-6);
    CHECK_NEAR(s.radiance.b, 0.5 * -0.25, 1e-6);
    photograph_release(&small);
    photograph_release(&p);
}

/* A pixel is left out by one that is masked or not finite, or where few of its pixels are saturated. */
static void test_left_out(void) {
    struct photograph p = make(), small;
    struct photograph_sample s;
    p.mask = mem_array(35, 1);
    for (int i = 0; i < 35; i++)
        p.mask[i] = i != 1;
    p.pixel[3][2] = image_half_from_float(INFINITY);
    p.pixel[4][1] = image_half_from_float(100.0f);
    for (int y = 2; y < 4; y++)
        for (int x = 0; x < 2; x++)
            p.pixel[7 * y + x][0] = image_half_from_float(100.0f + (float)x);
    photograph_reduce(&p, 2, NULL, &small);
    for (int x = 0; x < 3; x++)
        CHECK(!photograph_sample(&small, (float)x + 0.5f, 0.5f, &s));
    CHECK(photograph_sample(&small, 0.5f, 1.5f, &s));
    CHECK(s.saturated[0] && !s.saturated[1] && !s.saturated[2]);
    CHECK(photograph_sample(&small, 1.5f, 1.5f, &s) && !photograph_sample_saturates(&s));
    photograph_release(&small);
    photograph_release(&p);
}

/* The middle of a pixel of the smaller picture is the middle of those it covers. */
static void test_camera(void) {
    struct photograph p = make();
    struct camera small = camera_reduced(&p.camera, 2);
    for (int y = 0; y < 2; y++) {
        for (int x = 0; x < 3; x++) {
            vec3 of_small, of_large;
            CHECK(camera_direction(&small, (float)x + 0.5f, (float)y + 0.5f, &of_small));
            CHECK(camera_direction(&p.camera, 2.0f * (float)x + 1.0f, 2.0f * (float)y + 1.0f, &of_large));
            CHECK_NEAR(vec3_length(vec3_sub(of_small, of_large)), 0.0, 1e-6);
        }
    }
    photograph_release(&p);
}

static void test_step(void) {
    CHECK(camera_step(&(struct camera){.width = 320, .height = 240}) == 1);
    CHECK(camera_step(&(struct camera){.width = 1440, .height = 1080}) == 1);
    CHECK(camera_step(&(struct camera){.width = 1920, .height = 1080}) == 2);
    CHECK(camera_step(&(struct camera){.width = 4000, .height = 3000}) == 3);
    CHECK(camera_step(&(struct camera){.width = 30000, .height = 2}) == 1);
    CHECK(camera_step(&(struct camera){.width = 300000000, .height = 2}) == 2);
    CHECK(camera_step_to(&(struct camera){.width = 4000, .height = 3000}, 3.2e6) == 2);
    CHECK(camera_step_to(&(struct camera){.width = 4000, .height = 3000}, 0.0) == 1);
}

/* As many times more of a large texture; all at the finest quality. */
static void test_kept(void) {
    static const struct {
        const char *settings;
        double pixels;
    } of[] = {{"{}", 3.2e6},
              {"{\"quality\":\"draft\",\"texture_size\":512}", 1.6e6},
              {"{\"quality\":\"fine\"}", 0.0},
              {"{\"texture_size\":4096}", 12.8e6},
              {"{\"photograph_megapixels\":0}", 0.0}};
    for (size_t i = 0; i < sizeof of / sizeof of[0]; i++) {
        struct settings settings;
        struct error err;
        cJSON *given = cJSON_Parse(of[i].settings);
        settings_init(&settings);
        CHECK(settings_apply(&settings, given, NULL, &err) == STATUS_OK);
        CHECK_NEAR(kept_pixels(&settings, settings_number(&settings, "texture_size")), of[i].pixels, 1.0);
        settings_release(&settings);
        cJSON_Delete(given);
    }
}

int main(void) {
    test_means();
    test_left_out();
    test_camera();
    test_step();
    test_kept();
    return check_result();
}
