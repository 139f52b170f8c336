/* Renders against closed forms (relight.h): a furnace with a wall taken away, lamps over a plane, a panorama against
 * six perspectives, sources alone against all of them, direct and indirect light, sun and sky apart. */
#include <sys/stat.h>

#include "common/file.h"
#include "server/relight/virtual_objects.h"
#include "server/render/bsdf.h"
#include "tests/render/relight_rig.h"

/* Black walls of radiance 1, and the same light where one of them is taken
 * away: radiance 1 in every pixel. */
static void test_furnace(void) {
    struct relit_quad walls[6];
    struct image image, map;
    relit_cube(walls, rgb_gray(0.0f), rgb_gray(1.0f));
    char *dir = relit_outputs(walls, 6, CENTRE_VIEW), *sky = file_join(dir, "sky.exr");
    image_init_rgb(&map, 16, 9);
    for (int i = 0; i < 16 * 9 * 3; i++)
        map.pixel[i] = 1.0f;
    CHECK(image_write_exr(sky, &map, IMAGE_FLOAT, false, NULL) == STATUS_OK);
    char *settings = mem_printf("{\"remove\":\"4\",\"environment\":\"%s\","
                                "\"format\":\"exr\",\"spp\":4,\"view\":\"a\"}",
                                sky);
    picture(dir, settings, &image);
    for (size_t i = 0; i < (size_t)image.width * image.height * 3; i++)
        CHECK_NEAR(image.pixel[i], 1.0, 1e-5);
    image_release(&image);
    picture(dir, "{\"remove\":\"4\",\"format\":\"exr\",\"spp\":4}", &image); /* nothing outside */
    CHECK(relit_mean(&image) < 0.9 && image.pixel[3 * (8 * 16 + 8)] == 0.0f);
    image_release(&image);
    image_release(&map);
    mem_free(settings);
    mem_free(sky);
    relit_remove(dir);
}

/* --- lamps over a plane ------------------------------------------------------------------------------------------ */

static const vec3 eye = {0.0f, 1.0f, 1.0f};

/* Radiance that leaves the origin of the plane y = 0 towards the eye for light
 * of radiance 1 from a small solid angle. */
static double reflected(vec3 toward, double solid_angle) {
    vec3 normal = {0.0f, 1.0f, 0.0f}, s, t, out = vec3_normalize(eye);
    vec3_frame(normal, &s, &t);
    vec3 wo = {vec3_dot(out, s), vec3_dot(out, t), out.y}, wi = {vec3_dot(toward, s), vec3_dot(toward, t), toward.y};
    struct bsdf bsdf = bsdf_make(rgb_gray(0.5f), 0.5f, 0.0f, wo.z);
    struct bsdf_value f = bsdf_eval(&bsdf, wo, wi);
    return (0.5 * (double)f.diffuse + (double)f.specular) * solid_angle;
}

#define GRID 64

/* A rectangle at height 1 over the origin, shining down. */
static double from_area(double width, double height) {
    double sum = 0.0, part = width * height / (GRID * GRID);
    for (int i = 0; i < GRID * GRID; i++) {
        vec3 to = {(float)(width * ((i % GRID + 0.5) / GRID - 0.5)), 1.0f,
                   (float)(height * ((i / GRID + 0.5) / GRID - 0.5))};
        double distance = (double)vec3_length(to);
        sum += reflected(vec3_normalize(to), part / pow(distance, 3.0)); /* cosine over square of distance */
    }
    return sum;
}

/* A ball seen from outside: a disc of even radiance. */
static double from_ball(double height, double radius) {
    double least = sqrt(1.0 - radius * radius / (height * height)), sum = 0.0;
    for (int i = 0; i < GRID * GRID; i++) {
        double cosine = 1.0 - (1.0 - least) * (i / GRID + 0.5) / GRID, around = 2.0 * PI * (i % GRID + 0.5) / GRID;
        double sine = sqrt(1.0 - cosine * cosine);
        vec3 toward = {(float)(sine * cos(around)), (float)cosine, (float)(sine * sin(around))};
        sum += reflected(toward, 2.0 * PI * (1.0 - least) / (GRID * GRID));
    }
    return sum;
}

/* Mean of the few pixels that look at the origin. */
static double rendered(const char *dir, const char *lamp) {
    struct image image;
    char *settings = mem_printf("{\"format\":\"exr\",\"spp\":1024,\"max_depth\":"
                                "2,\"environment\":\"none\",%s}",
                                lamp);
    picture(dir, settings, &image);
    double mean = relit_mean(&image);
    image_release(&image);
    mem_free(settings);
    return mean;
}

/* Lumen and nits where the reconstruction's report knows how bright radiance 1 is, and where nothing does. */
static void test_unit(const char *dir, double area) {
    static const char report[] = "{\"luminance_per_unit\":{\"cd_per_m2\":100,\"source\":\"camera settings\","
                                 "\"within_factor\":1.5}}";
    static const char lamp[] = "\"lamp.1.kind\":\"area\",\"lamp.1.position\":\"0,1,0\",\"lamp.1.direction\":\"0,-1,0\","
                               "\"lamp.1.size\":\"0.5,0.25\",\"lamp.1.lumen\":39.26991,\"unit\":\"nits\"";
    struct error err;
    struct image image;
    char *path = file_join(dir, "report.json"), *nits = mem_printf("%s,\"luminance_per_unit\":200", lamp),
         *whole = mem_printf("{\"format\":\"exr\",%s}", lamp);
    CHECK(relit_picture(dir, whole, pool, &image, &err) == STATUS_INPUT && strstr(err.hint, "luminance_per_unit"));
    CHECK(file_replace(path, report, strlen(report), NULL) == STATUS_OK);
    double found = rendered(dir, lamp);
    CHECK_THAT(fabs(found / (100.0 * area) - 1.0) < 0.01, "nits: %g, not %g", found, 100.0 * area);
    found = rendered(dir, nits); /* told: half the radiance, of twice the luminance */
    CHECK_THAT(fabs(found / (100.0 * area) - 1.0) < 0.01, "nits of a unit told: %g, not %g", found, 100.0 * area);
    CHECK(remove(path) == 0);
    mem_free(whole);
    mem_free(nits);
    mem_free(path);
}

static void test_lamps(void) {
    const struct relit_quad plane = {{-5, 0, -5}, {0, 0, 10}, {10, 0, 0}, {0.5f, 0.5f, 0.5f}, {0, 0, 0}, 0.5f, 0.0f};
    char *dir = relit_outputs(&plane, 1,
                              "{\"w\":4,\"h\":4,\"fl_x\":4000,\"fl_y\":4000,"
                              "\"cx\":2,\"cy\":2,\"frames\":[{\"file_path\":"
                              "\"a\",\"transform_matrix\":[[1,0,0,0],[0,0."
                              "70710678,0.70710678,1],[0,-0.70710678,"
                              "0.70710678,1],[0,0,0,1]]}]}");
    double area = from_area(0.5, 0.25), ball = from_ball(1.5, 0.2);
    double found = rendered(dir, "\"lamp.1.kind\":\"area\",\"lamp.1.position\":\"0,1,0\",\"lamp.1."
                                 "direction\":\"0,-1,0\","
                                 "\"lamp.1.size\":\"0.5,0.25\",\"lamp.1.radiance\":\"1,1,1\"");
    CHECK_THAT(fabs(found / area - 1.0) < 0.01, "area: %g, not %g", found, area);
    found = rendered(dir, "\"lamp.1.kind\":\"sphere\",\"lamp.1.position\":\"0,1."
                          "5,0\",\"lamp.1.radius\":0.2,"
                          "\"lamp.1.radiance\":\"1,1,1\"");
    CHECK_THAT(fabs(found / ball - 1.0) < 0.01, "ball: %g, not %g", found, ball);
    /* A spot: as a small area along the axis, nothing outside of the cone. */
    double spot = reflected((vec3){0.0f, 1.0f, 0.0f}, PI * 0.01 * 0.01 / (2.0 * 2.0));
    found = rendered(dir, "\"lamp.1.kind\":\"spot\",\"lamp.1.position\":\"0,2,"
                          "0\",\"lamp.1.direction\":\"0,-1,0\","
                          "\"lamp.1.radius\":0.01,\"lamp.1.radiance\":\"1,1,1\"");
    CHECK_THAT(fabs(found / spot - 1.0) < 0.01, "spot: %g, not %g", found, spot);
    found = rendered(dir, "\"lamp.1.kind\":\"spot\",\"lamp.1.position\":\"0,2,0\",\"lamp.1."
                          "direction\":\"1,-1,0\","
                          "\"lamp.1.radius\":0.01,\"lamp.1.angle\":60,\"lamp.2.kind\":\"sphere\","
                          "\"lamp.2.position\":\"0,-3,0\"");
    CHECK_THAT(found == 0.0, "outside of the cone: %g", found);
    /* Lumen: an area of luminance L and size A gives pi L A. */
    found = rendered(dir, "\"lamp.1.kind\":\"area\",\"lamp.1.position\":\"0,1,"
                          "0\",\"lamp.1.direction\":\"0,-1,0\","
                          "\"lamp.1.size\":\"0.5,0.25\",\"luminance_per_unit\":"
                          "100,\"lamp.1.lumen\":39.26991");
    CHECK_THAT(fabs(found / area - 1.0) < 0.01, "lumen: %g, not %g", found, area);
    test_unit(dir, area);
    CHECK_NEAR(virtual_objects_spot_flux((struct emission_cone){0.5f, 0.5f}), PI, 1e-6);
    relit_remove(dir);
}

/* --- cameras, sources, parts of light ---------------------------------------------------------------------------- */

/* Of 4 x 4 pixels. */
static double mean_blue(const struct image *image, uint32_t x0, uint32_t y0) {
    double sum = 0.0;
    for (uint32_t i = 0; i < 16; i++)
        sum += (double)image->pixel[3 * ((size_t)(y0 + i / 4) * image->width + x0 + i % 4) + 2] / 16.0;
    return sum;
}

/* Light from all directions is the same by either, and comes from the same directions. */
static void test_panorama(void) {
    static const char views[] = "{\"w\":24,\"h\":24,\"fl_x\":12,\"fl_y\":12,"
                                "\"cx\":12,\"cy\":12,\"frames\":["
                                "{\"file_path\":\"f\",\"transform_matrix\":[[1,0,"
                                "0,0.2],[0,1,0,0.1],[0,0,1,0.3],[0,0,0,1]]},"
                                "{\"file_path\":\"b\",\"transform_matrix\":[[-1,"
                                "0,0,0.2],[0,1,0,0.1],[0,0,-1,0.3],[0,0,0,1]]},"
                                "{\"file_path\":\"l\",\"transform_matrix\":[[0,0,"
                                "1,0.2],[0,1,0,0.1],[-1,0,0,0.3],[0,0,0,1]]},"
                                "{\"file_path\":\"r\",\"transform_matrix\":[[0,0,"
                                "-1,0.2],[0,1,0,0.1],[1,0,0,0.3],[0,0,0,1]]},"
                                "{\"file_path\":\"u\",\"transform_matrix\":[[1,0,"
                                "0,0.2],[0,0,-1,0.1],[0,1,0,0.3],[0,0,0,1]]},"
                                "{\"file_path\":\"d\",\"transform_matrix\":[[1,0,"
                                "0,0.2],[0,0,1,0.1],[0,-1,0,0.3],[0,0,0,1]]}]}";
    struct relit_quad walls[6];
    relit_cube(walls, rgb_make(0.3f, 0.1f, 0.2f), rgb_gray(0.0f));
    for (int i = 0; i < 6; i++)
        walls[i].emission = rgb_make(1.0f, 6.0f - (float)i, 1.0f + (float)i);
    char *dir = relit_outputs(walls, 6, views), *out;
    struct error err;
    struct image image;
    double six[3] = {0, 0, 0}, whole[3] = {0, 0, 0}, middle[6];
    CHECK(relit_run(dir, "{\"view\":\"all\",\"format\":\"exr\",\"spp\":64,\"up\":\"y\"}", pool, &out, &err) ==
          STATUS_OK);
    for (int v = 0; v < 6; v++) {
        char name[32];
        snprintf(name, sizeof name, "%05d_radiance.exr", v);
        CHECK(relit_read(out, name, &image, &err) == STATUS_OK);
        for (int i = 0; i < 24 * 24; i++) {
            double x = (i % 24 + 0.5) / 12.0 - 1.0, y = (i / 24 + 0.5) / 12.0 - 1.0;
            for (int c = 0; c < 3; c++)
                six[c] += (double)image.pixel[3 * i + c] * pow(1.0 + x * x + y * y, -1.5) / 144.0;
        }
        middle[v] = mean_blue(&image, 10, 10);
        image_release(&image);
    }
    relit_remove(out);
    picture(dir,
            "{\"panorama\":true,\"size\":\"64x32\",\"format\":\"exr\",\"spp\":64,"
            "\"up\":\"y\"}",
            &image);
    for (uint32_t i = 0; i < image.width * image.height; i++) {
        double top = PI * (i / image.width) / image.height, bottom = PI * (i / image.width + 1) / image.height;
        for (int c = 0; c < 3; c++)
            whole[c] += (double)image.pixel[3 * i + (uint32_t)c] * (cos(top) - cos(bottom)) * 2.0 * PI / image.width;
    }
    for (int c = 0; c < 3; c++)
        CHECK_THAT(fabs(whole[c] / six[c] - 1.0) < 0.01, "channel %d: %g, not %g", c, whole[c], six[c]);
    /* The middle of the picture is where the camera looks, its right half what is to the right of it, its first row
     * above. Each of the six views has its own wall in the middle, none of them as bright as another. */
    static const uint32_t place[6][2] = {{30, 14}, {0, 14}, {14, 14}, {46, 14}, {30, 0}, {30, 28}};
    for (int v = 0; v < 6; v++) {
        double found = mean_blue(&image, place[v][0], place[v][1]);
        CHECK_THAT(fabs(found / middle[v] - 1.0) < 0.05, "view %d: %g, not %g", v, found, middle[v]);
    }
    image_release(&image);
    relit_remove(dir);
}

static void test_sums(void) {
    char *dir = lit_room(CENTRE_VIEW), *out;
    struct error err;
    struct image image;
    CHECK_THAT(relit_run(dir,
                         "{\"format\":\"exr\",\"spp\":256,\"per_light\":true,"
                         "\"passes\":\"radiance,direct,indirect\","
                         "\"lamp.1.kind\":\"sphere\",\"lamp.1.position\":\"0.5,0,"
                         "-0.5\",\"lamp.1.radius\":0.1}",
                         pool, &out, &err) == STATUS_OK,
               "%s", err.message);
    static const char *const name[] = {"radiance", "direct", "indirect", "light_1", "light_2", "lamp_1"};
    double mean[6];
    for (int i = 0; i < 6; i++) {
        char *file = mem_printf("00000_%s.exr", name[i]);
        CHECK_THAT(relit_read(out, file, &image, &err) == STATUS_OK, "%s", err.message);
        mean[i] = image.pixel ? relit_mean(&image) : 0.0;
        image_release(&image);
        mem_free(file);
    }
    CHECK_NEAR((mean[3] + mean[4] + mean[5]) / mean[0], 1.0, 0.01);
    CHECK_NEAR((mean[1] + mean[2]) / mean[0], 1.0, 1e-4);
    relit_remove(out);
    /* Direct light alone is what paths of two segments find. */
    picture(dir,
            "{\"format\":\"exr\",\"spp\":256,\"max_depth\":2,\"lamp.1.kind\":"
            "\"sphere\","
            "\"lamp.1.position\":\"0.5,0,-0.5\",\"lamp.1.radius\":0.1}",
            &image);
    CHECK_NEAR(relit_mean(&image) / mean[1], 1.0, 0.01);
    image_release(&image);
    relit_remove(dir);
}

static double mean_of(const char *out, const char *name) {
    struct error err;
    struct image image;
    if (relit_read(out, name, &image, &err) != STATUS_OK)
        return 0.0;
    double mean = relit_mean(&image);
    image_release(&image);
    return mean;
}

#define OPEN_ROOM "\"format\":\"exr\",\"spp\":256,\"max_depth\":4,\"remove\":\"1\","
#define NOON                                                                                                           \
    "\"environment\":\"sky\",\"date\":\"2024-06-21\",\"latitude\":47,\"longitude\":8.5,\"time\":\"12:00\",\"up\":\"y\""

/* A room without a ceiling under a sky: sun and sky apart are what they are alone, under their own settings, in half
 * precision too; and what was found has a sun of its own where sky.exr is beside it. */
static void test_sun_apart(void) {
    char *dir = lit_room(CENTRE_VIEW), *out, *path;
    struct error err;
    struct image image, map;
    CHECK_THAT(relit_run(dir, "{" OPEN_ROOM NOON ",\"per_light\":true,\"precision\":\"half\"}", pool, &out, &err) ==
                   STATUS_OK,
               "%s", err.message);
    double whole = mean_of(out, "00000_radiance.exr"), sky = mean_of(out, "00000_sky.exr"),
           sun = mean_of(out, "00000_sun.exr"), lamp = mean_of(out, "00000_light_2.exr");
    CHECK(sky > 0.0 && sun > 0.0);
    CHECK_NEAR((sky + sun + lamp) / whole, 1.0, 0.02);
    relit_remove(out);
    picture(dir, "{" OPEN_ROOM NOON ",\"lights\":\"off\",\"sun\":\"off\",\"sky\":\"2\"}", &image);
    CHECK_NEAR(relit_mean(&image) / sky, 2.0, 0.04);
    image_release(&image);
    picture(dir, "{" OPEN_ROOM NOON ",\"lights\":\"off\",\"sun\":\"0,0,1\",\"sky\":\"off\"}", &image);
    CHECK(image.pixel[0] == 0.0f && relit_mean(&image) > 0.0);
    image_release(&image);
    CHECK(relit_picture(dir, "{" OPEN_ROOM "\"sun\":\"off\"}", pool, &image, &err) == STATUS_INPUT);
    CHECK_STRING(err.message, "setting sun: the reconstruction found none");
    image_init_rgb(&map, 16, 9);
    for (size_t i = 0; i < 16 * 9 * 3; i++)
        map.pixel[i] = 1.0f;
    path = file_join(dir, "sky.exr");
    CHECK(image_write_exr(path, &map, IMAGE_FLOAT, false, NULL) == STATUS_OK);
    mem_free(path);
    for (size_t i = 0; i < 3; i++)
        map.pixel[3 * (16 * 2 + 4) + i] = 50.0f;
    path = file_join(dir, "environment.exr");
    CHECK(image_write_exr(path, &map, IMAGE_FLOAT, false, NULL) == STATUS_OK);
    mem_free(path);
    CHECK_THAT(relit_run(dir, "{" OPEN_ROOM "\"per_light\":true}", pool, &out, &err) == STATUS_OK, "%s", err.message);
    whole = mean_of(out, "00000_radiance.exr");
    sky = mean_of(out, "00000_sky.exr");
    sun = mean_of(out, "00000_sun.exr");
    lamp = mean_of(out, "00000_light_2.exr");
    CHECK(sky > 0.0 && sun > 0.0);
    CHECK_NEAR((sky + sun + lamp) / whole, 1.0, 0.02);
    relit_remove(out);
    image_release(&map);
    relit_remove(dir);
}

int main(void) {
    pool = parallel_new(2);
    test_furnace();
    test_lamps();
    test_panorama();
    test_sums();
    test_sun_apart();
    parallel_free(pool);
    return check_result();
}
