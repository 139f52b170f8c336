/* Lenses as other tools define them: COLMAP's FOV and THIN_PRISM_FISHEYE against the formulas of its models.h, written
 * out once more, nerfstudio's k4, spellings of models, and what is written reads back. */
#include "common/mem.h"
#include "common/utf8.h"
#include "server/export/views_json.h"
#include "server/ingest/source/colmap_cameras.h"
#include "server/ingest/transforms.h"
#include "tests/check.h"

#define POSE "\"transform_matrix\":[[1,0,0,0],[0,-1,0,0],[0,0,-1,0],[0,0,0,1]]" /* looks along +z */

static struct camera finish(struct lens *lens) {
    struct frame frame = {.lens = *lens};
    struct camera c = {0};
    struct error err = {.message = ""};
    for (int i = 0; i < 3; i++)
        frame.world_from_camera.rotation[i][i] = 1.0;
    CHECK_THAT(frame_camera(&frame, 640, 480, (double[3]){0.0}, &c, &err) == STATUS_OK, "%s", err.message);
    return c;
}

static struct camera from_colmap(const char *line) {
    struct error err = {.message = ""};
    struct colmap_cameras *cameras = colmap_cameras_parse(line, strlen(line), "cameras.txt", false, &err);
    CHECK_THAT(cameras, "%s", err.message);
    struct camera c = {0};
    if (cameras) {
        struct lens lens = *colmap_cameras_find(cameras, 1);
        c = finish(&lens);
    }
    colmap_cameras_free(cameras);
    return c;
}

/* Pixels of a grid have a direction that projects back to them; the derivative that finds it is that of the lens, or
 * Newton's method would not have met. */
static void check_round_trip(const struct camera *c, const char *name) {
    for (int i = 0; i < 13 * 13; i++) {
        float px = 5.0f + 52.0f * (float)(i % 13), py = 5.0f + 39.0f * (float)(i / 13), x = NAN, y = NAN, depth_m;
        vec3 direction = {0.0f, 0.0f, 0.0f};
        CHECK_THAT(camera_direction(c, px, py, &direction), "%s: pixel %g, %g", name, (double)px, (double)py);
        CHECK(camera_project(c, vec3_scale(direction, 2.0f), &x, &y, &depth_m));
        CHECK_NEAR(x, px, 2e-3);
        CHECK_NEAR(y, py, 2e-3);
    }
}

static const double seen[4][2] = {{0.0, 0.0}, {0.3, -0.2}, {-0.7, 0.45}, {0.05, 0.6}};

static void test_fov(void) {
    struct camera c = from_colmap("1 FOV 640 480 400 390 318 243 0.9\n");
    CHECK(c.model == CAMERA_FOV && c.fy == 390.0f);
    for (int i = 0; i < 4; i++) {
        double u = seen[i][0], v = seen[i][1], radius = sqrt(u * u + v * v);
        double factor = radius > 0.0 ? atan(radius * 2.0 * tan(0.9 / 2.0)) / (radius * 0.9) : 0.0;
        float x = NAN, y = NAN, depth_m;
        CHECK(camera_project(&c, vec3_make((float)u, (float)v, 1.0f), &x, &y, &depth_m));
        CHECK_NEAR(x, 400.0 * factor * u + 318.0, 1e-3);
        CHECK_NEAR(y, 390.0 * factor * v + 243.0, 1e-3);
    }
    check_round_trip(&c, "FOV");
    c = from_colmap("1 FOV 640 480 400 390 318 243 0\n"); /* no distortion */
    check_round_trip(&c, "FOV 0");
    c = from_colmap("1 FOV 640 480 100 100 320 240 1.5\n"); /* the corners lie behind it: 4 * 1.5 > pi / 2 */
    CHECK(!camera_direction(&c, 1.0f, 1.0f, &(vec3){0}) && camera_direction(&c, 300.0f, 200.0f, &(vec3){0}));
}

/* Of a lens of 122 degrees, as RealityCapture has measured it. */
static void test_division(void) {
    struct camera c = {.model = CAMERA_DIVISION,
                       .width = 640,
                       .height = 480,
                       .fx = 281.0f,
                       .fy = 281.0f,
                       .cx = 322.0f,
                       .cy = 236.0f,
                       .k = {-0.2664f}};
    for (int i = 0; i < 3; i++)
        c.world_from_camera.rotation[i][i] = c.camera_from_world.rotation[i][i] = 1.0f;
    camera_find_fold(&c);
    CHECK(c.fold == 0.0f && camera_is_distorted(&c));
    for (int i = 0; i < 4; i++) {
        /* the model's own definition: from the picture outwards */
        double x = seen[i][0], y = seen[i][1], below = 1.0 - 0.2664 * (x * x + y * y);
        float px = NAN, py = NAN, depth_m;
        CHECK(camera_project(&c, vec3_make((float)(x / below), (float)(y / below), 1.0f), &px, &py, &depth_m));
        CHECK_NEAR(px, 281.0 * x + 322.0, 1e-3);
        CHECK_NEAR(py, 281.0 * y + 236.0, 1e-3);
    }
    check_round_trip(&c, "DIVISION");
    c.k[0] = 0.2f;
    check_round_trip(&c, "DIVISION with a cushion");
    CHECK(!camera_project(&c, vec3_make(2.0f, 0.0f, 1.0f), &(float){0}, &(float){0}, &(float){0})); /* its fold */
    c.k[0] = -2.0f;
    CHECK(!camera_direction(&c, 1.0f, 1.0f, &(vec3){0}) && camera_direction(&c, 300.0f, 200.0f, &(vec3){0}));
}

static void test_thin_prism(void) {
    const double k1 = 0.02, k2 = -0.011, p1 = 0.0013, p2 = -0.0021, k3 = 0.004, k4 = -0.0007, sx1 = 0.0031,
                 sy1 = -0.0017;
    struct camera c =
        from_colmap("1 THIN_PRISM_FISHEYE 640 480 400 390 318 243 .02 -.011 .0013 -.0021 .004 -.0007 .0031 "
                    "-.0017\n");
    CHECK(c.model == CAMERA_THIN_PRISM_FISHEYE);
    for (int i = 0; i < 4; i++) {
        double u = seen[i][0], v = seen[i][1], r = sqrt(u * u + v * v), theta = atan2(r, 1.0);
        if (r > 0.0)
            u = theta * u / r, v = theta * v / r;
        double u2 = u * u, uv = u * v, v2 = v * v, r2 = u2 + v2, r4 = r2 * r2, r6 = r4 * r2, r8 = r6 * r2;
        double radial = k1 * r2 + k2 * r4 + k3 * r6 + k4 * r8;
        double du = u * radial + 2.0 * p1 * uv + p2 * (r2 + 2.0 * u2) + sx1 * r2;
        double dv = v * radial + 2.0 * p2 * uv + p1 * (r2 + 2.0 * v2) + sy1 * r2;
        float x = NAN, y = NAN, depth_m;
        CHECK(camera_project(&c, vec3_make((float)seen[i][0], (float)seen[i][1], 1.0f), &x, &y, &depth_m));
        CHECK_NEAR(x, 400.0 * (u + du) + 318.0, 1e-3);
        CHECK_NEAR(y, 390.0 * (v + dv) + 243.0, 1e-3);
    }
    check_round_trip(&c, "THIN_PRISM_FISHEYE");
    c = from_colmap("1 THIN_PRISM_FISHEYE 640 480 400 390 318 243 0 0 0 0 0 0 0 0\n");
    check_round_trip(&c, "thin prism without distortion");
    c = from_colmap("1 THIN_PRISM_FISHEYE 640 480 400 390 318 243 -.9 0 0 0 0 0 .01 0\n"); /* folds */
    float x, y, depth_m;
    CHECK(!camera_project(&c, vec3_make(1.5f, 0.0f, 1.0f), &x, &y, &depth_m));
}

/* The lens of the only frame of a transforms.json; problems are in *found, the caller's. */
static struct camera from_json(const char *members, char **found) {
    char text[1024];
    cJSON *tree = NULL;
    struct error err;
    struct findings f = {.problems = cJSON_CreateArray()};
    struct frames t;
    struct camera c = {0};
    snprintf(text, sizeof text, "{\"w\":640,\"h\":480,\"fl_x\":400,%s\"frames\":[{\"file_path\":\"a.png\"," POSE "}]}",
             members);
    CHECK(json_parse(text, strlen(text), "t", &tree, &err) == STATUS_OK);
    transforms_read(tree, "t", &t, &f);
    if (t.frame_count == 1)
        c = finish(&t.frame[0].lens);
    *found = json_text(f.problems);
    frames_release(&t);
    cJSON_Delete(tree);
    cJSON_Delete(f.problems);
    findings_release(&f);
    return c;
}

static struct camera good(const char *members) {
    char *found;
    struct camera c = from_json(members, &found);
    CHECK_THAT(strcmp(found, "[]") == 0, "%s", found);
    mem_free(found);
    return c;
}

static void refused(const char *members, const char *part, const char *hint) {
    char *found;
    from_json(members, &found);
    CHECK_THAT(strstr(found, part) && strstr(found, hint), "%s", found);
    mem_free(found);
}

/* 1 + k1 r^2 + ... + k4 r^8, unless k5, k6 or the model's name make k4 OpenCV's. */
static void test_nerfstudio(void) {
    struct camera c = good("\"camera_model\":\"OPENCV\",\"k1\":0.1,\"k2\":-0.05,\"k3\":0.02,\"k4\":0.03,\"p1\":0.001,");
    CHECK(c.model == CAMERA_OPENCV && c.k8 == 0.03f && c.k[3] == 0.0f);
    float x, y, depth_m;
    CHECK(camera_project(&c, vec3_make(0.6f, 0.0f, 1.0f), &x, &y, &depth_m));
    double r2 = 0.36, d = 1.0 + r2 * (0.1 + r2 * (-0.05 + r2 * (0.02 + r2 * 0.03)));
    CHECK_NEAR(x, 320.0 + 400.0 * 0.6 * d, 1e-3);
    CHECK_NEAR(y, 240.0 + 400.0 * 0.001 * r2, 1e-3);
    check_round_trip(&c, "k8");
    c = good("\"k4\":0.03,\"k5\":0,");
    CHECK(c.k8 == 0.0f && c.k[3] == 0.03f);
    c = good("\"camera_model\":\"FULL_OPENCV\",\"k4\":0.03,");
    CHECK(c.k8 == 0.0f && c.k[3] == 0.03f);
    c = good("\"camera_model\":\"OPENCV_FISHEYE\",\"k4\":0.03,");
    CHECK(c.k8 == 0.0f && c.k[3] == 0.03f && c.model == CAMERA_OPENCV_FISHEYE);
}

static void test_spellings(void) {
    static const char *const fisheye[] = {"fisheye", "OPENCV_FISHEYE", "SIMPLE_RADIAL_FISHEYE", "RADIAL_FISHEYE"};
    for (size_t i = 0; i < 4; i++) {
        char *members = mem_printf("\"camera_model\":\"%s\",\"k1\":0.01,", fisheye[i]);
        CHECK(good(members).model == CAMERA_OPENCV_FISHEYE);
        mem_free(members);
    }
    CHECK(good("\"camera_model\":\"Pinhole\",").model == CAMERA_OPENCV);
    refused("\"camera_model\":\"EQUIRECTANGULAR\",", "unknown camera_model \\\"EQUIRECTANGULAR\\\"",
            "--camera-type equirectangular");
    refused("\"camera_model\":\"ACME\",", "\\\"ACME\\\"; known are PINHOLE", "image_undistorter");
    CHECK(good("\"camera_model\":\"FOV\",\"omega\":0.5,").k[0] == 0.5f);
}

/* Each model in views.json reads back as the same camera. */
static void test_views(void) {
    const struct camera cameras[] = {
        from_colmap("1 FOV 640 480 400 390 318 243 0.9\n"),
        from_colmap("1 THIN_PRISM_FISHEYE 640 480 400 390 318 243 .02 -.011 .0013 -.0021 .004 -.0007 .0031 -.0017\n"),
        from_colmap("1 OPENCV_FISHEYE 640 480 400 390 318 243 .02 -.011 .004 -.0007\n"),
        from_colmap("1 FULL_OPENCV 640 480 400 390 318 243 .1 .2 .001 .002 .03 .04 .05 .06\n"),
        good("\"k1\":0.1,\"k4\":0.03,\"p2\":0.001,"),
    };
    for (size_t i = 0; i < sizeof cameras / sizeof *cameras; i++) {
        struct export_comparison comparison = {.name = "a.png", .camera = &cameras[i]};
        cJSON *json = views_json(&comparison, 1, (double[3]){1.0, 2.0, 3.0});
        struct findings f = {.problems = cJSON_CreateArray()};
        struct frames t;
        transforms_read(json, "views.json", &t, &f);
        CHECK(f.problem_count == 0 && t.frame_count == 1);
        struct camera c = finish(&t.frame[0].lens);
        CHECK_THAT(c.model == cameras[i].model && memcmp(c.k, cameras[i].k, sizeof c.k) == 0 && c.k8 == cameras[i].k8 &&
                       memcmp(c.p, cameras[i].p, sizeof c.p) == 0 && memcmp(c.s, cameras[i].s, sizeof c.s) == 0 &&
                       c.fx == cameras[i].fx && c.fold == cameras[i].fold,
                   "case %zu", i);
        CHECK(t.frame[0].world_from_camera.translation[1] == 2.0);
        frames_release(&t);
        cJSON_Delete(json);
        cJSON_Delete(f.problems);
        findings_release(&f);
    }
}

static void check_utf16(const char *bytes, size_t size, const char *wanted) {
    size_t length;
    char *text = utf8_from_utf16(bytes, size, &length);
    if (wanted)
        CHECK_STRING(text, wanted);
    CHECK(wanted ? length == strlen(wanted) : text == NULL);
    mem_free(text);
}

static void test_utf16(void) {
    check_utf16("\xff\xfe{\0\xe4\0\xac\x20\x3d\xd8\x00\xde", 12, "{\xc3\xa4\xe2\x82\xac\xf0\x9f\x98\x80");
    check_utf16("\xfe\xff\0{\xd8\x3d", 6, "{\xef\xbf\xbd");
    check_utf16("\xff\xfe", 2, "");
    check_utf16("\xff\xfe{", 3, "");
    check_utf16("{}", 2, NULL);
    check_utf16("\xff", 1, NULL);
}

int main(void) {
    test_fov();
    test_division();
    test_thin_prism();
    test_nerfstudio();
    test_spellings();
    test_views();
    test_utf16();
    return check_result();
}
