/* COLMAP's files: text and binary say the same; what is refused names the file and the place. */
#include "server/ingest/source/colmap_images.h"

#include "common/buf.h"
#include "common/mem.h"
#include "server/ingest/source/sources.h"
#include "tests/check.h"
#include "tests/unit/source_rig.h"

#define CAMERAS                                                                                                        \
    "# Camera list\n7 PINHOLE 640 480 500 510 320 240\n\n3 OPENCV 640 480 500 510 321 241 -0.1 0.02 "                  \
    "0.001 -0.002\r\n9 SIMPLE_RADIAL_FISHEYE 64 48 50 32 24 0.01\n"
/* A turn by 90 degrees around x, twice as long as a unit: world y is the camera's forward. */
#define IMAGES                                                                                                         \
    "# Image list\n# two lines each\n12 1.4142135623730951 -1.4142135623730951 0 0 1 2 3 7 b b.png\n"                  \
    "10.5 20.5 -1 30 40 5\n4 1 0 0 0 0 0 0 3 a.png\n\n5 1 0 0 0 -1 0 0 9 sub/c.jpg\r\n\n"

static struct colmap_cameras *cameras_of(const char *text, struct error *err) {
    return colmap_cameras_parse(text, strlen(text), "cameras.txt", false, err);
}

static void put(struct buf *out, uint64_t value, size_t bytes) { buf_append(out, &value, bytes); }

static void put_doubles(struct buf *out, const double *value, size_t count) {
    buf_append(out, value, count * sizeof *value);
}

static void make_cameras(struct buf *out) {
    buf_init(out, 4096);
    put(out, 3, 8);
    put(out, 7, 4), put(out, 1, 4), put(out, 640, 8), put(out, 480, 8);
    put_doubles(out, (double[]){500, 510, 320, 240}, 4);
    put(out, 3, 4), put(out, 4, 4), put(out, 640, 8), put(out, 480, 8);
    put_doubles(out, (double[]){500, 510, 321, 241, -0.1, 0.02, 0.001, -0.002}, 8);
    put(out, 9, 4), put(out, 8, 4), put(out, 64, 8), put(out, 48, 8);
    put_doubles(out, (double[]){50, 32, 24, 0.01}, 4);
}

static void make_images(struct buf *out) {
    buf_init(out, 4096);
    put(out, 3, 8);
    put(out, 12, 4), put_doubles(out, (double[]){1.4142135623730951, -1.4142135623730951, 0, 0, 1, 2, 3}, 7),
        put(out, 7, 4);
    buf_append(out, "b b.png", 8), put(out, 2, 8), put_doubles(out, (double[]){10.5, 20.5, 0, 30, 40, 0}, 6);
    put(out, 4, 4), put_doubles(out, (double[]){1, 0, 0, 0, 0, 0, 0}, 7), put(out, 3, 4);
    buf_append(out, "a.png", 6), put(out, 0, 8);
    put(out, 5, 4), put_doubles(out, (double[]){1, 0, 0, 0, -1, 0, 0}, 7), put(out, 9, 4);
    buf_append(out, "sub/c.jpg", 10), put(out, 0, 8);
}

static void check_frames(const struct frames *t) {
    CHECK(t->frame_count == 3 && t->named_count == 3);
    if (t->frame_count != 3)
        return;
    const struct frame *a = &t->frame[0], *b = &t->frame[1], *c = &t->frame[2];
    CHECK_STRING(a->file, "images/a.png");
    CHECK_STRING(b->file, "images/b b.png");
    CHECK_STRING(c->file, "images/sub/c.jpg");
    CHECK(a->number == 1 && b->number == 0 && !a->mask && !a->is_test && a->exposure_source == EXPOSURE_UNKNOWN);
    CHECK(a->lens.model == CAMERA_OPENCV && a->lens.fl_x == 500 && a->lens.fl_y == 510 && a->lens.cy == 241);
    CHECK(a->lens.k[0] == -0.1 && a->lens.k[1] == 0.02 && a->lens.p[0] == 0.001 && a->lens.p[1] == -0.002);
    CHECK(c->lens.model == CAMERA_OPENCV_FISHEYE && c->lens.fl_y == 50 && c->lens.k[0] == 0.01 && c->lens.width == 64);
    CHECK_NEAR(c->world_from_camera.translation[0], 1, 0); /* -R^T t */
    /* x_camera = R x_world + t for the first of the file */
    struct rigid forward, inverse;
    pose_to_rigid(&b->world_from_camera, (double[3]){0.0}, &forward, &inverse);
    vec3 p = rigid_point(&inverse, (vec3){0.5f, 4.0f, 7.0f});
    CHECK_NEAR(p.x, 1.5, 1e-6);
    CHECK_NEAR(p.y, 2.0 + 7.0, 1e-5);
    CHECK_NEAR(p.z, 3.0 - 4.0, 1e-5);
}

static void test_both(void) {
    struct error err = {.message = ""};
    struct findings f = {.problems = cJSON_CreateArray()};
    struct frames t;
    struct buf cameras, images;
    struct colmap_cameras *c = cameras_of(CAMERAS, &err);
    CHECK_THAT(c != NULL, "%s", err.message);
    CHECK(colmap_images_parse(IMAGES, strlen(IMAGES), "images.txt", false, c, "images/", &t, &f, &err) == STATUS_OK);
    check_frames(&t);
    frames_release(&t);
    colmap_cameras_free(c);

    make_cameras(&cameras);
    make_images(&images);
    c = colmap_cameras_parse(cameras.data, cameras.length, "cameras.bin", true, &err);
    CHECK_THAT(c != NULL, "%s", err.message);
    CHECK(colmap_images_parse(images.data, images.length, "images.bin", true, c, "images/", &t, &f, &err) == STATUS_OK);
    check_frames(&t);
    frames_release(&t);
    CHECK(f.problem_count == 0);
    for (size_t length = 0; length < images.length; length++) {
        CHECK(colmap_images_parse(images.data, length, "images.bin", true, c, "", &t, &f, &err) == STATUS_INPUT);
        CHECK(strstr(err.message, "images.bin is cut off at byte"));
        frames_release(&t);
    }
    for (size_t length = 0; length < cameras.length; length++)
        CHECK(!colmap_cameras_parse(cameras.data, length, "cameras.bin", true, &err) && err.status == STATUS_INPUT);
    images.data[8 + 4 + 56 + 4 + 8 + 7] = 127; /* points without number */
    CHECK(colmap_images_parse(images.data, images.length, "images.bin", true, c, "", &t, &f, &err) == STATUS_INPUT);
    frames_release(&t);
    colmap_cameras_free(c);
    cameras.data[12] = 99;
    CHECK(!colmap_cameras_parse(cameras.data, cameras.length, "cameras.bin", true, &err));
    CHECK_STRING(err.message, "cameras.bin: unknown camera model number 99");
    buf_release(&cameras);
    buf_release(&images);
    cJSON_Delete(f.problems);
    findings_release(&f);
}

/* The file is refused, with `part` in the message. */
static void check_bad_image(const struct colmap_cameras *c, const char *text, const char *part) {
    struct error err;
    struct findings f = {.problems = cJSON_CreateArray()};
    struct frames t;
    CHECK(colmap_images_parse(text, strlen(text), "images.txt", false, c, "", &t, &f, &err) == STATUS_INPUT);
    CHECK_THAT(strstr(err.message, part) && t.frame_count == 0, "%s", err.message);
    frames_release(&t);
    cJSON_Delete(f.problems);
    findings_release(&f);
}

/* The one frame of the file is left out, with `part` in the problem. */
static void check_problem(const struct colmap_cameras *c, const char *text, const char *part) {
    struct error err;
    struct findings f = {.problems = cJSON_CreateArray()};
    struct frames t;
    CHECK(colmap_images_parse(text, strlen(text), "images.txt", false, c, "", &t, &f, &err) == STATUS_OK);
    CHECK(f.problem_count == 1 && t.frame_count == 0 && t.named_count == 1);
    char *problem = cJSON_PrintUnformatted(f.problems);
    CHECK_THAT(strstr(problem, part) != NULL, "%s", problem);
    free(problem);
    frames_release(&t);
    cJSON_Delete(f.problems);
    findings_release(&f);
}

static void test_refused(void) {
    static const char *const bad_cameras[][2] = {
        {"1 ACME 640 480 500 510 320 240 1\n", "unknown camera model ACME"},
        {"1\n", "line 1: there is no camera model"},
        {"x PINHOLE 640 480 1 1 1 1\n", "not a number"},
        {"-1 PINHOLE 640 480 1 1 1 1\n", "no id"},
        {"4294967295 PINHOLE 640 480 1 1 1 1\n", "no id"},
        {"1.5 PINHOLE 640 480 1 1 1 1\n", "line 1: there is a number that is no id"},
        {"nan PINHOLE 640 480 1 1 1 1\n", "no id"},
        {"\n# x\n1 PINHOLE 640 480 500 510 320\n", "line 3: there are fewer values"},
        {"1 PINHOLE 640 480 500 510 320 two\n", "not a number"},
        {"1 PINHOLE 640 480 500 nan 320 2\n", "camera 1 has a parameter that is not finite"},
        {"1 PINHOLE 0 480 500 510 320 2\n", "0 x 480 pixels"},
        {"1 PINHOLE 64.5 480 500 510 320 2\n", "64.5 x 480 pixels"},
        {"1 SIMPLE_PINHOLE 4 4 5 2 2\n1 SIMPLE_PINHOLE 4 4 5 2 2\n", "two cameras 1"},
    };
    static const char *const bad_images[][2] = {
        {"1 1 0 0 0 0 0 0 7\n\n", "line 1: there is no name"},
        {"1 1 0 0 0 0 0\n\n", "line 1: there are fewer"},
        {"0.5 1 0 0 0 0 0 0 7 a.png\n\n", "line 1: there is a number that is no id"},
        {"1 1 0 0 0 0 0 0 -7 a.png\n\n", "line 1: there is a number that is no id"},
        {"1 1 0 0 0 0 0 zero 7 a.png\n\n", "line 1: there is a value"},
    };
    static const char *const problems[][2] = {
        {"1 1 0 0 0 0 0 0 8 a.png\n\n", "image a.png: there is no camera 8"},
        {"1 0 0 0 0 0 0 0 7 a.png\n\n", "image a.png: the pose holds a number that is not finite"},
        {"1 1 0 0 0 inf 0 0 7 a.png\n\n", "image a.png: the pose holds a number that is not finite"},
        {"1 1 0 0 0 0 0 0 7 ..\n\n", "is no name of a file"},
    };
    struct error err;
    struct colmap_cameras *c;
    for (size_t i = 0; i < sizeof bad_cameras / sizeof *bad_cameras; i++) {
        c = cameras_of(bad_cameras[i][0], &err);
        CHECK_THAT(!c && strstr(err.message, bad_cameras[i][1]) && strstr(err.message, "cameras.txt"), "%s",
                   err.message);
    }
    c = cameras_of(CAMERAS, &err);
    for (size_t i = 0; i < sizeof bad_images / sizeof *bad_images; i++)
        check_bad_image(c, bad_images[i][0], bad_images[i][1]);
    for (size_t i = 0; i < sizeof problems / sizeof *problems; i++)
        check_problem(c, problems[i][0], problems[i][1]);
    colmap_cameras_free(c);
}

/* One more than may be, in each of the kinds of file. */
static void test_many(void) {
    struct findings f = {.problems = cJSON_CreateArray()};
    struct frames t;
    struct error err;
    struct buf cameras, text, binary;
    buf_init(&cameras, 1 << 22);
    buf_init(&text, 1 << 22);
    buf_init(&binary, 1 << 22);
    put(&binary, FRAMES_MAX + 1, 8);
    for (uint64_t i = 0; i <= FRAMES_MAX; i++) {
        buf_printf(&cameras, "%d SIMPLE_PINHOLE 4 4 5 2 2\n", (int)i);
        buf_printf(&text, "1 1 0 0 0 0 0 0 7 a.png\n\n");
        put(&binary, 1, 4), put_doubles(&binary, (double[]){1, 0, 0, 0, 0, 0, 0}, 7), put(&binary, 7, 4);
        buf_append(&binary, "a.png", 6), put(&binary, 0, 8);
    }
    CHECK(!colmap_cameras_parse(cameras.data, cameras.length, "cameras.txt", false, &err) &&
          err.status == STATUS_INPUT);
    CHECK_STRING(err.message, "cameras.txt has more than 20000 cameras");
    struct colmap_cameras *c = cameras_of(CAMERAS, &err);
    CHECK(colmap_images_parse(text.data, text.length, "images.txt", false, c, "", &t, &f, &err) == STATUS_INPUT);
    CHECK_STRING(err.message, "images.txt has more than 20000 frames");
    frames_release(&t);
    CHECK(colmap_images_parse(binary.data, binary.length, "images.bin", true, c, "", &t, &f, &err) == STATUS_INPUT);
    CHECK_STRING(err.message, "images.bin has more than 20000 frames");
    frames_release(&t);
    colmap_cameras_free(c);
    buf_release(&binary);
    buf_release(&text);
    buf_release(&cameras);
    cJSON_Delete(f.problems);
    findings_release(&f);
}

/* Which files are taken, and that photographs are looked for in images/. */
static void test_folder(void) {
    struct source_rig r;
    source_rig_start(&r, "COLMAP");
    source_rig_put(&r, "sparse/images.txt", IMAGES);
    source_rig_put(&r, "sparse/cameras.txt", CAMERAS);
    source_rig_put(&r, "sparse/0/images.bin", IMAGES); /* without cameras */
    source_rig_read(&r);
    CHECK_STRING(r.match.found, "sparse/images.txt");
    CHECK(r.t.frame_count == 3);
    CHECK_STRING(r.t.frame[0].file, "a.png");
    source_rig_put(&r, "images/a.png", "");
    source_rig_put(&r, "images/B b.PNG", "");
    source_rig_put(&r, "images/b b.txt", "");
    source_rig_put(&r, "images/sub/c.png", "");
    source_rig_put(&r, "images/d.jpg", "");
    source_rig_read(&r);
    CHECK_STRING(r.problems, "[]");
    CHECK(r.t.frame_count == 3);
    CHECK_STRING(r.t.frame[1].file, "images/B b.PNG");
    CHECK_STRING(r.t.frame[2].file, "images/sub/c.png");
    CHECK(source_rig_warned(&r, "1 photographs in images/ have no pose"));
    source_rig_stop(&r);
}

int main(void) {
    test_both();
    test_refused();
    test_many();
    test_folder();
    return check_result();
}
