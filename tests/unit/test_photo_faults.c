/* photo_faults.h: pixels of linear photographs that say nothing or less than they seem to, by the file's format: what
 * is kept of them, what is told, and when a photograph is refused. */
#include "server/ingest/photo_faults.h"

#include <sys/stat.h>

#include "common/color.h"
#include "common/file.h"
#include "common/image_ceiling.h"
#include "common/mem.h"
#include "server/ingest/bundle.h"
#include "server/ingest/photo_pixels.h"
#include "tests/check.h"
#include "tests/unit/told.h"

#define WIDTH 60
#define HEIGHT 50
#define PIXELS ((size_t)WIDTH * HEIGHT)
#define FRAMES 4
#define LARGEST IMAGE_HALF_LARGEST

static char work[64];
static struct parallel *pool;
static struct scene scene;
static char told[8192]; /* problems and warnings of the last bundle */

/* --- bundles ---------------------------------------------------------------------------------- */

static void put(const char *name, const char *text) {
    char *path = file_join(work, name);
    CHECK(file_replace(path, text, strlen(text), NULL) == STATUS_OK);
    mem_free(path);
}

/* A photograph of .5 all over, but `count` pixels from number `first` on. */
static void put_photograph(int frame, enum image_exr_type type, size_t first, size_t count, float value) {
    struct image image;
    struct error err;
    image_init_rgb(&image, WIDTH, HEIGHT);
    for (size_t i = 0; i < 3 * PIXELS; i++)
        image.pixel[i] = i / 3 >= first && i / 3 < first + count ? value : 0.5f;
    char *name = mem_printf("%d.exr", frame), *path = file_join(work, name);
    CHECK_THAT(image_write_exr(path, &image, type, false, &err) == STATUS_OK, "%s", err.message);
    mem_free(name);
    mem_free(path);
    image_release(&image);
}

static void put_all(void) {
    CHECK(file_remove_tree(work, NULL) == STATUS_OK && mkdir(work, 0700) == 0);
    put("mesh.ply",
        "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
        "element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n");
    char *frames = mem_strdup("");
    for (int i = 0; i < FRAMES; i++) {
        char *more =
            mem_printf("%s%s{\"file_path\":\"%d.exr\",\"transform_matrix\":[[1,0,0,0.%d],[0,1,0,0.5],[0,0,1,2],"
                       "[0,0,0,1]]}",
                       frames, i > 0 ? "," : "", i, i + 1);
        mem_free(frames);
        frames = more;
        put_photograph(i, IMAGE_HALF, 0, 0, 0.0f);
    }
    char *text = mem_printf("{\"fl_x\":40,\"frames\":[%s]}", frames);
    put("transforms.json", text);
    mem_free(text);
    mem_free(frames);
}

static bool load(void) {
    struct bundle_limits limits = bundle_default_limits();
    return load_told(work, &limits, pool, &scene, told, sizeof told) == STATUS_OK;
}

#define TOLD(text) CHECK_THAT(strstr(told, text), "%s: in %s", text, told)
#define NOT_TOLD(text) CHECK_THAT(!strstr(told, text), "%s: in %s", text, told)

/* --- one photograph ----------------------------------------------------------------------------- */

/* What becomes of four pixels of grey values in a row of a file of so many bits. */
static void convert(int bits, const float value[4], struct photograph *photo, struct photo_faults *faults) {
    const struct image_info info = {.encoding = IMAGE_LINEAR, .bits = bits};
    struct image image;
    image_init_rgb(&image, 4, 1);
    for (size_t i = 0; i < 12; i++)
        image.pixel[i] = value[i / 3];
    *photo = (struct photograph){.is_hdr = true, .clip = INFINITY, .exposure = 1.0f, .gain = rgb_gray(1.0f)};
    photo->camera = (struct camera){.width = 4, .height = 1};
    photo->pixel = mem_array(4, sizeof *photo->pixel);
    photo_faults_begin(faults, "it", &image, &info);
    photo_pixels_from_linear(&image, &info, photo, faults);
    image_release(&image);
}

/* 'x': no observation, '>': a lower bound, '=': a value. */
static void check_kinds(int bits, const float value[4], const char *wanted) {
    struct photograph photo;
    struct photo_faults faults;
    char found[5] = "";
    convert(bits, value, &photo, &faults);
    for (size_t i = 0; i < 4; i++) {
        struct photograph_sample sample;
        bool is_usable = photograph_sample(&photo, (float)i + 0.5f, 0.5f, &sample);
        found[i] = !is_usable ? 'x' : photograph_sample_saturates(&sample) ? '>' : '=';
        CHECK(!is_usable || (sample.radiance.r >= 0.0f && sample.radiance.r <= LARGEST));
    }
    CHECK_STRING(found, wanted);
    CHECK(isinf(photo.clip) == !strchr(wanted, '>') || faults.beside > 0);
    photograph_release(&photo);
}

static void test_kinds(void) {
    check_kinds(16, (const float[]){1.0f, LARGEST, LARGEST - 32.0f, INFINITY}, "=>=>");
    check_kinds(32, (const float[]){1.0f, LARGEST, 1e30f, 0.5f}, "=>>=");
    check_kinds(32, (const float[]){INFINITY, 1.0f, -INFINITY, NAN}, "x=xx");
    check_kinds(16, (const float[]){NAN, 1.0f, 2.0f, -INFINITY}, "x==x");
    check_kinds(8, (const float[]){1.7e38f, 1.0f, 0.0f, 0x1p-30f}, ">==="); /* Radiance */
    check_kinds(16, (const float[]){-1.0f, -1e30f, 0x1p-24f, -0.0f}, "====");
    /* connected with what is no number, from both sides; those apart stay */
    check_kinds(16, (const float[]){LARGEST, LARGEST, NAN, LARGEST}, "xxxx");
    check_kinds(16, (const float[]){LARGEST, 1.0f, NAN, LARGEST}, ">=xx");
    check_kinds(32, (const float[]){LARGEST, 1e9f, INFINITY, 3.0f}, "xxx=");
}

/* One channel at the end of the file is a bound, the others are values. */
static void test_channels(void) {
    const struct image_info info = {.encoding = IMAGE_LINEAR, .bits = 16};
    struct photograph photo = {.is_hdr = true, .clip = INFINITY, .exposure = 1.0f, .gain = {1, 1, 1}};
    struct photograph_sample sample;
    struct photo_faults faults;
    struct image image;
    image_init_rgb(&image, 1, 1);
    memcpy(image.pixel, (const float[]){LARGEST, 3.0f, -0.5f}, 3 * sizeof(float));
    photo.camera = (struct camera){.width = 1, .height = 1};
    photo.pixel = mem_array(1, sizeof *photo.pixel);
    photo_faults_begin(&faults, "it", &image, &info);
    photo_pixels_from_linear(&image, &info, &photo, &faults);
    CHECK(photograph_sample(&photo, 0.5f, 0.5f, &sample));
    CHECK(sample.saturated[0] && !sample.saturated[1] && !sample.saturated[2]);
    CHECK(sample.radiance.g == 3.0f && sample.radiance.b == 0.0f);
    CHECK(faults.bounds == 1 && faults.not_finite == 0);
    CHECK_NEAR(faults.negative, 0.5, 1e-9);
    photograph_release(&photo);
    image_release(&image);
}

/* Other primaries: white that is cut off stays so; what is left of another colour is no observation. */
static void test_primaries(void) {
    static const float wide[3][3] = {{1.66f, -0.59f, -0.07f}, {-0.12f, 1.13f, -0.01f}, {-0.02f, -0.10f, 1.12f}};
    float pixel[4][3] = {
        {LARGEST, LARGEST, LARGEST}, {LARGEST, 3.0f, 1.0f}, {1.0f, 1.0f, 1.0f}, {INFINITY, 1.0f, 1.0f}};
    size_t outside = 0;
    color_multiply(wide, LARGEST, &pixel[0][0], 3, 4, &outside);
    CHECK(pixel[0][0] == LARGEST && pixel[0][1] == LARGEST && pixel[0][2] == LARGEST);
    CHECK(isnan(pixel[1][0]) && isnan(pixel[1][1]) && isnan(pixel[1][2]) && isnan(pixel[3][1]));
    CHECK_NEAR(pixel[2][0], 1.0, 1e-5);
    CHECK(outside == 0);
}

/* --- what is told ------------------------------------------------------------------------------ */

static void test_few(void) {
    put_all();
    CHECK(load() && scene.photograph_count == FRAMES);
    NOT_TOLD("half precision");
    NOT_TOLD("no numbers");
    put_photograph(1, IMAGE_HALF, 100, 1, NAN);
    put_photograph(2, IMAGE_HALF, 100, 2, NAN);
    put_photograph(3, IMAGE_HALF, 100, 2, INFINITY);
    CHECK(load() && scene.photograph_count == FRAMES);
    TOLD("3 pixels of 2 photographs are no numbers or infinite");
    TOLD("(0.067 % of 2.exr, the most)");
    TOLD("2 pixels of 1 photographs are at or above 65504");
    TOLD("(0.067 % of 3.exr)\n");
    NOT_TOLD("failed there");
    NOT_TOLD("becomes a lamp");
    CHECK(scene.photograph[3].clip == LARGEST && isinf(scene.photograph[2].clip));
}

static void test_many(void) {
    put_all();
    put_photograph(1, IMAGE_HALF, 0, PIXELS / 10, NAN);
    put_photograph(2, IMAGE_FLOAT, 0, PIXELS / 10, 1e9f);
    CHECK(load() && scene.photograph_count == FRAMES);
    TOLD("300 pixels of 1 photographs are no numbers or infinite");
    TOLD("(10 % of 1.exr); what wrote them failed there");
    TOLD("300 pixels of 1 photographs are at or above 65504");
    TOLD("(10 % of 2.exr); what is so in all photographs becomes a lamp");
    for (int i = 0; i < FRAMES; i++) /* little of each, but of all */
        put_photograph(i, IMAGE_HALF, 0, PIXELS / 200, NAN);
    CHECK(load());
    TOLD("60 pixels of 4 photographs");
    TOLD("failed there");
}

/* Most of one: it is left out. Of most: the bundle is refused, and says by what. */
static void test_most(void) {
    put_all();
    put_photograph(1, IMAGE_HALF, 0, PIXELS * 6 / 10, NAN);
    CHECK(load() && scene.photograph_count == FRAMES - 1);
    TOLD("1.exr: 60 % of its pixels are no numbers or infinite; it was left out");
    put_photograph(1, IMAGE_FLOAT, 0, PIXELS * 6 / 10, 7e4f);
    CHECK(load() && scene.photograph_count == FRAMES - 1);
    TOLD("1.exr: 60 % of its pixels are at or above 65504, the largest number of half precision; it was left out");
    for (int i = 0; i < FRAMES; i++)
        put_photograph(i, IMAGE_FLOAT, 0, PIXELS * 6 / 10, 7e4f);
    CHECK(!load());
    TOLD("file: 3.exr\nreason: 60 % of its pixels");
    TOLD("hint: multiply all photographs by a factor");
    for (int i = 0; i < FRAMES; i++)
        put_photograph(i, IMAGE_HALF, 0, PIXELS, NAN);
    CHECK(!load());
    TOLD("file: 0.exr\nreason: 100 % of its pixels are no numbers");
}

static void test_scale(void) {
    put_all();
    put_photograph(1, IMAGE_HALF, 0, PIXELS / 3, -0.5f);
    CHECK(load());
    TOLD("pixels below 0, which count as 0, are 8.3 % of the light of the photographs");
    NOT_TOLD("keeps so small values");
    for (int i = 0; i < FRAMES; i++)
        put_photograph(i, IMAGE_FLOAT, 0, PIXELS, 2e-6f);
    CHECK(load());
    TOLD("the mean of all linear photographs is 2e-06: half precision keeps so small values coarsely");
    NOT_TOLD("pixels below 0");
}

int main(void) {
    snprintf(work, sizeof work, "%s/unbake-test-photo-faults-XXXXXX", check_fast_dir());
    CHECK(mkdtemp(work) != NULL);
    pool = parallel_new(2);
    test_kinds();
    test_channels();
    test_primaries();
    test_few();
    test_many();
    test_most();
    test_scale();
    scene_release(&scene);
    parallel_free(pool);
    CHECK(file_remove_tree(work, NULL) == STATUS_OK);
    return check_result();
}
