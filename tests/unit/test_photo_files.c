/* test_photo_files.c -- photographs as people have them: formats, sizes and orientations other than those stated,
 * broken files among good ones, names of other machines. Bundles made here; test_captures.c has the shared ones. */
#include <sys/stat.h>

#include "common/file.h"
#include "common/image.h"
#include "common/mem.h"
#include "server/ingest/bundle.h"
#include "server/ingest/facts.h"
#include "server/ingest/photos.h"
#include "tests/check.h"
#include "tests/unit/told.h"

static char work[64];
static struct parallel *pool;
static struct scene scene;
static double kept_pixels;  /* of a photograph; 0: all */
static struct spill *spill; /* NULL: memory */
static char told[16384];    /* problems and warnings of the last bundle, a line each */

static bool load(const char *dir) {
    struct bundle_limits limits = bundle_default_limits();
    limits.kept_pixels = kept_pixels;
    limits.spill = spill;
    return load_told(dir, &limits, pool, &scene, told, sizeof told) == STATUS_OK;
}

/* --- a bundle made here ----------------------------------------------------------------------- */

#define POSE "\"transform_matrix\":[[1,0,0,0.5],[0,1,0,0.5],[0,0,1,2],[0,0,0,1]]"
#define FRAME(name) "{\"file_path\":\"" name "\"," POSE "}"
#define MESH                                                                                                           \
    "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n"                  \
    "element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n"

static void put(const char *name, const char *data, size_t size) {
    char *path = file_join(work, name);
    CHECK(file_replace(path, data, size, NULL) == STATUS_OK);
    mem_free(path);
}

static void put_copy(const char *name, const char *from, size_t most) {
    struct buf bytes;
    buf_init(&bytes, 1 << 20);
    CHECK(file_read(from, &bytes, NULL) == STATUS_OK);
    put(name, bytes.data, bytes.length < most ? bytes.length : most);
    buf_release(&bytes);
}

/* Five copies of a picture, with the lens in `top`. */
static bool load_copies(const char *picture, const char *top) {
    static const char *const names[] = {"0.jpg", "1.jpg", "2.jpg", "3.jpg", "4.jpg"};
    for (size_t i = 0; i < 5; i++)
        put_copy(names[i], picture, SIZE_MAX);
    char *text = mem_printf("{%s,\"frames\":[" FRAME("0.jpg") "," FRAME("1.jpg") "," FRAME("2.jpg") "," FRAME(
                                "3.jpg") "," FRAME("4.jpg") "]}",
                            top);
    put("transforms.json", text, strlen(text));
    mem_free(text);
    return load(work);
}

#define JPEG "tests/data/image/exif_little.jpg"  /* 24 x 16, orientation 6 */
#define PLAIN "tests/data/image/progressive.jpg" /* 24 x 16, none */

static void check_lens(double fx, double fy, double cx, double cy) {
    for (size_t i = 0; i < scene.photograph_count; i++) {
        const struct camera *c = &scene.photograph[i].camera;
        CHECK_NEAR(c->fx, fx, 1e-4);
        CHECK_NEAR(c->fy, fy, 1e-4);
        CHECK_NEAR(c->cx, cx, 1e-4);
        CHECK_NEAR(c->cy, cy, 1e-4);
    }
}

static void turned(void) {
    struct image image;
    CHECK(image_read_photograph(JPEG, &image, NULL, NULL) == STATUS_OK);
    CHECK(load_copies(JPEG, "\"w\":24,\"h\":16,\"fl_x\":20,\"cx\":12,\"cy\":8"));
    CHECK_THAT(strstr(told, "the EXIF orientation of 5 photographs was ignored"), "%s", told);
    CHECK(load_copies(JPEG, "\"w\":16,\"h\":24,\"fl_x\":20,\"cx\":8,\"cy\":12"));
    CHECK_THAT(strstr(told, "5 photographs were turned by their EXIF orientation") && !strstr(told, "ignored"), "%s",
               told);
    const struct photograph *p = &scene.photograph[0];
    CHECK(scene.photograph_count == 5 && p->camera.width == 16 && p->camera.height == 24);
    size_t wrong = 0; /* orientation 6: the stored first row is the right side, the first column the top */
    for (uint32_t y = 0; y < 24 && p->camera.width == 16; y++)
        for (uint32_t x = 0; x < 16; x++) {
            float stored = image.pixel[((size_t)(15 - x) * 24 + y) * 3 + 1];
            wrong += fabsf(image_float_from_half(p->pixel[y * 16 + x][1]) - image_srgb_to_linear(stored)) > 1e-3f;
        }
    CHECK_THAT(wrong == 0, "%zu pixels are elsewhere", wrong);
    image_release(&image);
    CHECK(load_copies(JPEG, "\"w\":32,\"h\":48,\"fl_x\":40,\"cx\":16,\"cy\":24"));
    CHECK(scene.photograph[0].camera.width == 16 && strstr(told, "multiplied by 0.5"));
    check_lens(20, 20, 8, 12);
    CHECK(load_copies(JPEG, "\"fl_x\":20,\"cx\":7.9,\"cy\":12.1")); /* no size: by the principal point */
    CHECK_THAT(scene.photograph[0].camera.width == 16 && strstr(told, "turned by"), "%s", told);
    CHECK(load_copies(JPEG, "\"fl_x\":20,\"cx\":12,\"cy\":8") && scene.photograph[0].camera.width == 24);
    CHECK(load_copies(JPEG, "\"fl_x\":20") && scene.photograph[0].camera.width == 24);
}

/* Photographs of more pixels than are kept are means of theirs, in a file as in memory; the camera of the file stays
 * known. */
static void reduced(void) {
    struct image image;
    CHECK(image_read_photograph(PLAIN, &image, NULL, NULL) == STATUS_OK);
    for (int is_in_file = 0; is_in_file < 2; is_in_file++) {
        struct spill_limits limits = {.memory_bytes = 1};
        kept_pixels = 96.0;
        spill = is_in_file ? spill_new(work, &limits) : NULL;
        CHECK(load_copies(PLAIN, "\"w\":24,\"h\":16,\"fl_x\":20,\"cx\":11.5,\"cy\":8.25") &&
              scene.photograph_count == 5);
        check_lens(10, 10, 5.75, 4.125);
        for (size_t i = 0; i < scene.photograph_count; i++) {
            const struct photograph *p = &scene.photograph[i];
            struct camera file = photograph_file_camera(p);
            CHECK(p->camera.width == 12 && p->camera.height == 8 && p->name && !p->saturated && p->clipped);
            CHECK(file.width == 24 && file.height == 16 && file.fx == 20.0f && file.cx == 11.5f && file.cy == 8.25f);
            size_t wrong = 0;
            for (uint32_t y = 0; y < 8; y++)
                for (uint32_t x = 0; x < 12; x++) {
                    float mean = 0.0f;
                    for (uint32_t k = 0; k < 4; k++)
                        mean += 0.25f * image_srgb_to_linear(
                                            image.pixel[((size_t)(2 * y + k / 2) * 24 + 2 * x + k % 2) * 3 + 1]);
                    wrong += fabsf(image_float_from_half(p->pixel[y * 12 + x][1]) - mean) > 1e-3f;
                }
            CHECK_THAT(wrong == 0, "%zu pixels are no means", wrong);
        }
        cJSON *facts = facts_of(&scene); /* tell of the files */
        CHECK_NEAR(cJSON_GetNumberValue(cJSON_GetObjectItem(facts, "pixel_count")), 5 * 24 * 16, 0.0);
        CHECK_NEAR(cJSON_GetNumberValue(cJSON_GetObjectItem(facts, "mask_count")), 0.0, 0.0);
        cJSON_Delete(facts);
        kept_pixels = 383.0;
        CHECK(load_copies(PLAIN, "\"fl_x\":20") && scene.photograph[0].camera.width == 12);
        kept_pixels = 384.0;
        CHECK(load_copies(PLAIN, "\"fl_x\":20") && scene.photograph[0].camera.width == 24);
        CHECK(scene.photograph[0].file.step <= 1 && photograph_file_camera(&scene.photograph[0]).width == 24);
        scene_release(&scene);
        spill_free(spill);
    }
    kept_pixels = 0.0;
    spill = NULL;
    image_release(&image);
}

/* All eight orientations against the definition of each: where the stored first row and first column are seen. */
static void orientations(void) {
    static const char *const seen[9] = {NULL,       "top left",  "top right",    "bottom right", "bottom left",
                                        "left top", "right top", "right bottom", "left bottom"};
    for (int o = 1; o <= 8; o++) {
        struct image image;
        image_init_rgb(&image, 5, 3);
        image.pixel[0] = 1;                     /* row 0, column 0 */
        image.pixel[(size_t)4 * 3 + 1] = 1;     /* row 0, last column */
        image.pixel[(size_t)2 * 5 * 3 + 2] = 1; /* last row, column 0 */
        image_orient(&image, o);
        uint32_t w = image.width, h = image.height;
        bool swaps = o >= 5;
        CHECK(w == (swaps ? 3u : 5u) && h == (swaps ? 5u : 3u));
        bool is_right = strstr(seen[o], "right") != NULL, is_bottom = strstr(seen[o], "bottom") != NULL;
        uint32_t x = is_right ? w - 1 : 0, y = is_bottom ? h - 1 : 0;
        uint32_t other_x = w - 1 - x, other_y = h - 1 - y;
        size_t origin = ((size_t)y * w + x) * 3;
        size_t along_row = swaps ? ((size_t)other_y * w + x) * 3 : ((size_t)y * w + other_x) * 3;
        size_t along_column = swaps ? ((size_t)y * w + other_x) * 3 : ((size_t)other_y * w + x) * 3;
        CHECK_THAT(image.pixel[origin] == 1 && image.pixel[along_row + 1] == 1 && image.pixel[along_column + 2] == 1,
                   "orientation %d", o);
        image_release(&image);
    }
}

static void scaled(void) {
    CHECK(load_copies(PLAIN, "\"w\":24,\"h\":16,\"fl_x\":20,\"cx\":12,\"cy\":8") && told[0] == '\0');
    CHECK(load_copies(PLAIN, "\"w\":\"48\",\"h\":\"32\",\"fl_x\":\"40\",\"cx\":24,\"cy\":\"16.0\""));
    CHECK_THAT(strstr(told, "24 x 16 instead of 48 x 32") && strstr(told, "multiplied by 0.5"), "%s", told);
    check_lens(20, 20, 12, 8);
    CHECK(load_copies(PLAIN, "\"w\":97,\"h\":65,\"fl_x\":80,\"fl_y\":81,\"cx\":48,\"cy\":32")); /* rounded down */
    check_lens(80 * 24 / 97.0, 81 * 16 / 65.0, 48 * 24 / 97.0, 32 * 16 / 65.0);
    CHECK(load_copies(PLAIN, "\"fl_x\":80,\"cx\":48.5,\"cy\":31.8"));
    CHECK_THAT(strstr(told, "no w and h") && strstr(told, "4 times"), "%s", told);
    check_lens(20, 20, 48.5 / 4, 31.8 / 4);
    CHECK(load_copies(PLAIN, "\"fl_x\":20,\"cx\":11,\"cy\":9") && told[0] == '\0'); /* a usual principal point */
    CHECK(!load_copies(PLAIN, "\"w\":25,\"h\":16,\"fl_x\":20") && strstr(told, "24 x 16"));
    CHECK(!load_copies(PLAIN, "\"w\":48,\"h\":36,\"fl_x\":40") && strstr(told, "48 x 36"));
    CHECK(!load_copies(PLAIN, "\"w\":16,\"h\":24,\"fl_x\":20"));
    CHECK_THAT(strstr(told, "w and h are exchanged"), "%s", told);
    CHECK(!load_copies(PLAIN, "\"w\":\"24px\",\"h\":16,\"fl_x\":20") && strstr(told, "\"w\" must be a number"));
    CHECK(!load_copies(PLAIN, "\"w\":\"0x18\",\"h\":16,\"fl_x\":20") && strstr(told, "\"w\" must be a number"));
}

/* nerfstudio's circle of a fisheye, in the pixels of the stated size: what is outside is masked. */
static void cropped(void) {
    CHECK(load_copies(PLAIN,
                      "\"w\":48,\"h\":32,\"fl_x\":40,\"camera_model\":\"OPENCV_FISHEYE\",\"fisheye_crop_radius\":14"));
    const uint8_t *mask = scene.photograph[4].mask;
    CHECK(mask != NULL);
    for (size_t y = 0; y < 16 && mask; y++)
        for (size_t x = 0; x < 24; x++) {
            bool is_inside = hypot((double)x - 11.5, (double)y - 7.5) <= 7.0;
            CHECK((mask[y * 24 + x] > 0) == is_inside);
        }
    CHECK(!load_copies(PLAIN, "\"w\":24,\"h\":16,\"fl_x\":20,\"fisheye_crop_radius\":-1"));
    CHECK_THAT(strstr(told, "fisheye_crop_radius"), "%s", told);
}

/* Two of five may be broken; three may not. */
static void broken(void) {
    static const char top[] = "\"w\":24,\"h\":16,\"fl_x\":20";
    CHECK(load_copies(PLAIN, top));
    put_copy("1.jpg", PLAIN, 300);
    put("3.jpg", "<html>404</html>", 16);
    CHECK_THAT(load(work) && scene.photograph_count == 3, "%s", told);
    CHECK_THAT(strstr(told, "1.jpg: damaged JPEG: the file is cut short; it was left out") &&
                   strstr(told, "3.jpg: not a picture"),
               "%s", told);
    put("0.jpg", "", 0);
    CHECK(!load(work));
    CHECK_THAT(strstr(told, "file: 0.jpg") && strstr(told, "file: 1.jpg") && strstr(told, "file: 3.jpg"), "%s", told);
}

/* An EXR whose data window is smaller than its picture: what it leaves out is no observation. */
static void data_window(void) {
    CHECK(load_copies("tests/data/image/zip.exr", "\"w\":25,\"h\":15,\"fl_x\":20"));
    const struct photograph *p = &scene.photograph[0];
    CHECK_THAT(strstr(told, "675 pixels of 5 photographs lie outside") && !strstr(told, "no numbers"), "%s", told);
    CHECK(isnan(image_float_from_half(p->pixel[2 * 25 + 2][0])) &&
          !isnan(image_float_from_half(p->pixel[2 * 25 + 3][0])));
    CHECK(!load_copies("tests/data/image/zip.exr", "\"w\":20,\"h\":12,\"fl_x\":20"));
    CHECK_THAT(strstr(told, "data window"), "%s", told);
}

/* --- names ------------------------------------------------------------------------------------ */

static void put_frames(const char *one, const char *two, const char *three, const char *mask) {
    char *text = mem_printf("{\"w\":24,\"h\":16,\"fl_x\":20,\"frames\":[{\"file_path\":\"%s\",%s%s%s" POSE "},"
                            "{\"file_path\":\"%s\"," POSE "},{\"file_path\":\"%s\"," POSE "}]}",
                            one, mask ? "\"mask_path\":\"" : "", mask ? mask : "", mask ? "\"," : "", two, three);
    put("transforms.json", text, strlen(text));
    mem_free(text);
}

static void make_folder(const char *name) {
    char *path = file_join(work, name);
    CHECK(mkdir(path, 0700) == 0);
    mem_free(path);
}

static void check_names(const char *one, const char *two, const char *three) {
    const char *const wanted[3] = {one, two, three};
    CHECK_THAT(scene.photograph_count == 3, "%zu: %s", scene.photograph_count, told);
    for (size_t i = 0; i < 3 && scene.photograph_count == 3; i++)
        CHECK_THAT(strcmp(scene.photograph[i].name, wanted[i]) == 0, "%s, not %s", scene.photograph[i].name, wanted[i]);
}

/* Names that differ from those on the disk in case, in their extension, in folders before them, in the spelling of
 * letters. */
static void check_found(const char *mask) {
    struct image black;
    image_init_rgb(&black, 24, 16);
    CHECK(image_write_png(mask, &black, 1, NULL) == STATUS_OK);
    image_release(&black);
    put_frames("images/A.JPG", "images/b.jpg", "images/c.png", NULL);
    CHECK_THAT(load(work), "%s", told);
    check_names("images/a.jpg", "images/b.JPG", "images/c.jpeg");
    put_frames("C:\\\\scan\\\\images\\\\a.jpg", "C:\\\\scan\\\\images\\\\b.jpg", "C:\\\\scan\\\\images\\\\c.jpg",
               "C:\\\\scan\\\\masks\\\\A.PNG");
    CHECK_THAT(load(work), "%s", told);
    check_names("images/a.jpg", "images/b.JPG", "images/c.jpeg");
    CHECK(scene.photograph[0].mask && scene.photograph[0].mask[0] == 0 && !scene.photograph[1].mask);
}

/* A mask may be of a photograph twice as large; one that is missing is no photograph of its name. */
static void check_masks(const char *mask) {
    struct image large;
    image_init_rgb(&large, 48, 32); /* its left half is white */
    for (size_t i = 0; i < (size_t)48 * 32; i++)
        large.pixel[3 * i] = large.pixel[3 * i + 1] = large.pixel[3 * i + 2] = i % 48 < 24;
    CHECK(image_write_png(mask, &large, 1, NULL) == STATUS_OK);
    image_release(&large);
    put_frames("images/a.jpg", "images/b.JPG", "images/c.jpeg", "masks/a.png");
    CHECK_THAT(load(work) && scene.photograph[0].mask, "%s", told);
    for (size_t i = 0; i < (size_t)24 * 16 && scene.photograph[0].mask; i++)
        CHECK(scene.photograph[0].mask[i] == (i % 24 < 12 ? 255 : 0));
    put_frames("../in/images/a.jpg", "../in/images/b.jpg", "../in/images/c.jpeg", "masks/a.png");
    CHECK_THAT(load(work) && scene.photograph[0].mask, "%s", told);
    CHECK(unlink(mask) == 0);
    put_frames("images/a.jpg", "images/b.JPG", "images/c.jpeg", "masks/a.jpg");
    CHECK_THAT(!load(work) && strstr(told, "the mask is not in the bundle"), "%s", told);
}

static void check_spelling(void) {
    /* "a" and a combining diaeresis on the disk, as macOS writes it, one letter in the list; upper case */
    put_copy("images/a\xcc\x88.jpg", PLAIN, SIZE_MAX);
    put_copy("images/a\xcc\x8a.jpg", PLAIN, SIZE_MAX);
    put_frames("images/\xc3\xa4.jpg", "images/\xc3\x85.JPG", "images/c.jpeg", NULL);
    CHECK_THAT(load(work), "%s", told);
    check_names("images/a\xcc\x88.jpg", "images/a\xcc\x8a.jpg", "images/c.jpeg");
    /* not UTF-8 */
    put_copy("images/\xe4.jpg", PLAIN, SIZE_MAX);
    put_frames("images/a.jpg", "images/b.JPG", "images/c.png", NULL);
    CHECK_THAT(load(work), "%s", told);
}

/* What is not found, and the reason that is told. */
static void check_reasons(void) {
    /* a mesh that is a link */
    char *mesh = file_join(work, "mesh.ply"), *other = file_join(work, "mesh");
    CHECK(rename(mesh, other) == 0 && symlink("mesh", mesh) == 0);
    CHECK_THAT(!load(work) && strstr(told, "links are not searched, mesh.ply for one (1 in all)"), "%s", told);
    CHECK(rename(other, mesh) == 0);
    mem_free(other);
    mem_free(mesh);
    /* a list of frames by another name */
    char *list = file_join(work, "transforms.json"), *renamed = file_join(work, "frames_b.json");
    CHECK(rename(list, renamed) == 0);
    CHECK_THAT(!load(work) && strstr(told, "frames_b.json has frames") && strstr(told, "transforms=PATH"), "%s", told);
    CHECK(rename(renamed, list) == 0);
    mem_free(renamed);
    mem_free(list);
    /* two files that a name may mean */
    put_copy("images/c.tif", PLAIN, SIZE_MAX);
    put_frames("images/a.jpg", "images/b.JPG", "images/c.png", NULL);
    CHECK_THAT(!load(work) && strstr(told, "images/c.jpeg or images/c.tif"), "%s", told);
}

static void names(void) {
    CHECK(file_remove_tree(work, NULL) == STATUS_OK && mkdir(work, 0700) == 0);
    put("mesh.ply", MESH, strlen(MESH));
    make_folder("images");
    make_folder("masks");
    put_copy("images/a.jpg", PLAIN, SIZE_MAX);
    put_copy("images/b.JPG", PLAIN, SIZE_MAX);
    put_copy("images/c.jpeg", PLAIN, SIZE_MAX);
    put("images/c.dng", "II*", 4); /* beside the picture, as cameras write them */
    char *mask = file_join(work, "masks/a.png");
    check_found(mask);
    check_masks(mask);
    check_spelling();
    check_reasons();
    mem_free(mask);
}

int main(void) {
    snprintf(work, sizeof work, "%s/unbake-test-photo-files-%d", access("/dev/shm", W_OK) == 0 ? "/dev/shm" : "/tmp",
             (int)getpid());
    pool = parallel_new(2);
    CHECK(mkdir(work, 0700) == 0);
    put("mesh.ply", MESH, strlen(MESH));
    orientations();
    turned();
    reduced();
    scaled();
    cropped();
    broken();
    data_window();
    names();
    scene_release(&scene);
    file_remove_tree(work, NULL);
    parallel_free(pool);
    return check_result();
}
