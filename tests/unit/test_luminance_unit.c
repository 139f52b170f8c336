/* test_luminance_unit.c -- the luminance of radiance 1 by the cameras' settings: of photographs alone, then of a whole
 * job, its report and its scene.usda. */
#include "server/capture/luminance_unit.h"
#include "tests/unit/tiny_scene.h"

/* cd/m2 of a white pixel at 1 s, f/1, ISO 100: 10 lx s / ISO give level 118 of sRGB, .1812 of white; q = .65. */
#define WHITE (10.0 / 100.0 / 0.65 / 0.18116)

static struct luminance_unit find(struct photograph *photo, size_t count) {
    return luminance_unit_find(&(struct scene){.photograph = photo, .photograph_count = count});
}

static void test_photographs(void) {
    struct photograph p[5];
    for (int i = 0; i < 5; i++) /* exposures told by a factor twice that of the settings */
        p[i] = (struct photograph){.exposure_known = true,
                                   .exposure = 2.0f * (float)(1 << i),
                                   .settings_exposure = (float)(1 << i),
                                   .gain = rgb_gray(1.0f)};
    struct luminance_unit unit = find(p, 5);
    CHECK(unit.photographs == 5);
    CHECK_THAT(fabs(unit.cd_per_m2 / (2.0 * WHITE) - 1.0) < 1e-4, "%g", unit.cd_per_m2);
    CHECK_NEAR(unit.within_factor, 1.5, 1e-6);

    p[0].exposure *= 100.0f; /* one that is wrong does not move the median of five */
    CHECK_NEAR(find(p, 5).cd_per_m2, unit.cd_per_m2, 1e-6);
    p[1].exposure *= 1.2f;
    p[2].exposure /= 1.2f;
    CHECK(find(p, 5).within_factor > 1.51); /* they scatter */

    p[0].is_hdr = true; /* no white */
    p[1].is_test = true;
    CHECK(find(p, 5).photographs == 3);
    p[2].settings_exposure = 0.0f;
    CHECK(find(p, 5).cd_per_m2 == 0.0); /* too few */
}

static void check_usd(const char *unit) {
    struct buf layer;
    char *path = mem_printf("%s/out/scene.usda", dir), *wanted = mem_printf("radianceUnit = \"%s", unit);
    buf_init(&layer, 1 << 20);
    OK(file_read(path, &layer, &err));
    CHECK_THAT(strstr(buf_text(&layer), wanted), "%s", wanted);
    buf_release(&layer);
    mem_free(wanted);
    mem_free(path);
}

/* Runs the job with these settings of the camera; what its report says. */
static double job(const char *camera, const char *more, const char *source) {
    char *transforms = mem_printf("{\"fl_x\":8,%s\"frames\":[" TINY_FRAME("a") "," TINY_FRAME("b") "," TINY_FRAME(
                                      "c") "," TINY_FRAME("d") "]}",
                                  camera),
         *settings = mem_printf("{" TINY_SETTINGS ",\"quality\":\"draft\",\"hold_out_every\":0%s}", more);
    put("scene/transforms.json", transforms);
    OK(reconstruct(settings, scene, ""));
    cJSON *json = read_report();
    const cJSON *unit = cJSON_GetObjectItem(json, "luminance_per_unit");
    const cJSON *found = cJSON_GetObjectItem(unit, "cd_per_m2");
    double value = found ? found->valuedouble : 0.0;
    if (found)
        CHECK_STRING(cJSON_GetStringValue(cJSON_GetObjectItem(unit, "source")), source);
    check_usd(found ? "nits" : "relative, not nits");
    cJSON_Delete(json);
    mem_free(settings);
    mem_free(transforms);
    return value;
}

static void test_jobs(void) {
    const char *complete = "\"exposure_time\":0.02,\"iso\":400,\"f_number\":2,";
    tiny_scene_make("luminance");
    double found = job(complete, "", "camera settings");
    CHECK_THAT(fabs(found / WHITE - 1.0) < 1e-3, "%g",
               found); /* pixels are 1/50 of the radiance; so are those of 1 s */
    found = job("\"exposure\":0.5,\"exposure_time\":0.02,\"iso\":400,\"f_number\":2,", "", "camera settings");
    CHECK_THAT(fabs(found / (WHITE * 0.5 / 0.02) - 1.0) < 1e-3, "%g", found);
    CHECK(job("\"exposure_time\":0.02,\"iso\":400,", "", "") == 0.0); /* no f-number */
    CHECK(job(complete, ",\"luminance_per_unit\":120", "setting") == 120.0);
    tiny_scene_remove();
}

int main(void) {
    test_photographs();
    test_jobs();
    return check_result();
}
