/* Bundles: a small good one in several shapes, a table of bad ones that must each name the file
 * and the place, and the real rooms. */
#include "server/ingest/bundle.h"
#include "server/ingest/facts.h"

#include <sys/stat.h>
#include <zlib.h>

#include "common/file.h"
#include "common/image.h"
#include "common/mem.h"
#include "tests/check.h"

static char work[64]; /* in memory where possible: unpacking syncs the file system */
static struct parallel *pool;

#define POSE "\"transform_matrix\":[[1,0,0,0.5],[0,1,0,0.5],[0,0,1,2],[0,0,0,1]]"
#define LENS "\"w\":8,\"h\":6,\"fl_x\":7,\"fl_y\":7.5,\"cx\":4,\"cy\":3"
#define FRAME(name) "{\"file_path\":\"" name "\"," POSE "}"
#define OTHER_POSE "\"transform_matrix\":[[1,0,0,0.5],[0,1,0,0.5],[0,0,1,2.001],[0,0,0,1]]"
#define FRAME_ELSEWHERE(name) "{\"file_path\":\"" name "\"," OTHER_POSE "}"
#define THREE FRAME("a.exr") "," FRAME("./b.png") "," FRAME("c.exr")
#define MESH                                                                                                           \
    "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n"                  \
    "element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n"
#define TURNED                                                                                                         \
    "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n"                  \
    "element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 2 1\n"
#define OBJ "v 0 0 0\nv 1 0 0\nv 0 1 0\no a\nf 1 2 3\no b\nf 1 3 2\n"
#define CLOUD                                                                                                          \
    "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float z\n"                  \
    "end_header\n0 0 0\n"

static void put(const char *name, const char *text) {
    char *path = file_join(work, name);
    CHECK(file_replace(path, text, strlen(text), NULL) == STATUS_OK);
    mem_free(path);
}

static bool make_folder(const char *name) {
    char *path = file_join(work, name);
    bool made = mkdir(path, 0700) == 0;
    mem_free(path);
    return made;
}

static void put_picture(const char *name, uint32_t width, uint32_t height, float value, bool exr) {
    struct image image;
    image_init_rgb(&image, width, height);
    for (size_t i = 0; i < (size_t)width * height * 3; i++)
        image.pixel[i] = value;
    char *path = file_join(work, name);
    CHECK((exr ? image_write_exr(path, &image, IMAGE_FLOAT, false, NULL) : image_write_png(path, &image, 1.0f, NULL)) ==
          STATUS_OK);
    mem_free(path);
    image_release(&image);
}

static void put_good(void) {
    CHECK(file_remove_tree(work, NULL) == STATUS_OK && mkdir(work, 0700) == 0);
    put("mesh.ply", MESH);
    put_picture("a.exr", 8, 6, 2.5f, true);
    put_picture("b.png", 8, 6, 0.5f, false);
    put_picture("c.exr", 8, 6, 2.5f, true);
    put("transforms.json", "{" LENS ",\"frames\":[" THREE "]}");
}

static enum status load(struct scene *scene, cJSON **problems, struct error *err) {
    struct bundle_limits limits = bundle_default_limits();
    limits.photograph_pixels = 1000000;
    *problems = cJSON_CreateArray();
    *err = (struct error){.message = ""};
    enum status status = bundle_load(work, NULL, &limits, pool, scene, *problems, err);
    if (status != STATUS_OK)
        scene_release(scene);
    return status;
}

static bool has_warning(const struct scene *scene, const char *part) {
    for (size_t i = 0; i < scene->warning_count; i++)
        if (strstr(scene->warning[i], part))
            return true;
    return false;
}

static void test_good(void) {
    struct scene scene;
    struct error err;
    cJSON *problems;
    put_good();
    put("points.ply", CLOUD); /* a sparse cloud beside the mesh is not a second mesh */
    CHECK_THAT(load(&scene, &problems, &err) == STATUS_OK, "%s", err.message);
    CHECK(scene.mesh.triangle_count == 1 && scene.photograph_count == 3);
    const struct photograph *a = &scene.photograph[0], *b = &scene.photograph[1], *c = &scene.photograph[2];
    CHECK_STRING(b->name, "b.png");
    CHECK(a->is_hdr && a->exposure_known && a->exposure == 1.0f && isinf(a->clip));
    CHECK(!b->is_hdr && !b->exposure_known && b->exposure == 1.0f && b->gain.g == 1.0f);
    CHECK_NEAR(b->clip, image_srgb_to_linear(250.0f / 255.0f), 5e-4);
    CHECK(image_float_from_half(a->pixel[47][2]) == 2.5f);
    CHECK_NEAR(image_float_from_half(b->pixel[0][0]), 0.5, 0.005);
    CHECK(c->is_hdr && isinf(c->clip));
    /* Looking along -z of the world from z = 2: right stays right, up becomes -y. */
    CHECK(a->camera.fx == 7.0f && a->camera.fy == 7.5f && a->camera.width == 8);
    float x, y, depth_m;
    CHECK(camera_project(&a->camera, vec3_make(0.7f, 0.6f, 0.0f), &x, &y, &depth_m));
    CHECK_NEAR(depth_m, 2.0, 1e-6);
    CHECK_NEAR(x, 4.0 + 7.0 * 0.1, 1e-5);
    CHECK_NEAR(y, 3.0 - 7.5 * 0.05, 1e-5);
    cJSON *facts = facts_of(&scene);
    CHECK(cJSON_GetObjectItem(facts, "frame_count")->valueint == 3);
    CHECK(cJSON_GetObjectItem(facts, "hdr_count")->valueint == 2);
    CHECK(cJSON_GetObjectItem(cJSON_GetObjectItem(facts, "exposure"), "unknown_count")->valueint == 1);
    cJSON_Delete(facts);
    scene_release(&scene);
    cJSON_Delete(problems);
}

/* Puts an eXIf chunk behind the header of a PNG: turned by 90 degrees, 1/50 s, f/2, ISO 400. */
static void add_exif(const char *name) {
    static const uint8_t tiff[] = {
        'I',  'I',  42,   0,    8, 0, 0, 0, 2,    0,    0x12, 0x01, 3, 0, 1, 0, 0, 0, 6, 0, 0, 0, /* Orientation */
        0x69, 0x87, 4,    0,    1, 0, 0, 0, 38,   0,    0,    0,    0, 0, 0, 0, /* where the Exif directory is */
        3,    0,    0x9a, 0x82, 5, 0, 1, 0, 0,    0,    80,   0,    0, 0,       /* ExposureTime */
        0x9d, 0x82, 5,    0,    1, 0, 0, 0, 88,   0,    0,    0,                /* FNumber */
        0x27, 0x88, 3,    0,    1, 0, 0, 0, 0x90, 0x01, 0,    0,                /* ISO */
        0,    0,    0,    0,    1, 0, 0, 0, 50,   0,    0,    0,    2, 0, 0, 0, 1, 0, 0, 0};
    uint8_t chunk[12 + sizeof tiff] = {0, 0, 0, sizeof tiff, 'e', 'X', 'I', 'f'};
    memcpy(chunk + 8, tiff, sizeof tiff);
    uint32_t sum = (uint32_t)crc32(0, chunk + 4, 4 + sizeof tiff);
    for (int i = 0; i < 4; i++)
        chunk[8 + sizeof tiff + (size_t)i] = (uint8_t)(sum >> (24 - 8 * i));
    char *path = file_join(work, name);
    struct buf old, longer;
    buf_init(&old, 1 << 20);
    buf_init(&longer, 1 << 20);
    CHECK(file_read(path, &old, NULL) == STATUS_OK);
    buf_append(&longer, old.data, 33); /* signature and IHDR */
    buf_append(&longer, chunk, sizeof chunk);
    buf_append(&longer, old.data + 33, old.length - 33);
    CHECK(file_replace(path, longer.data, longer.length, NULL) == STATUS_OK);
    buf_release(&old);
    buf_release(&longer);
    mem_free(path);
}

static void test_exif(void) {
    struct scene scene;
    struct error err;
    cJSON *problems;
    put_good();
    add_exif("b.png");
    CHECK_THAT(load(&scene, &problems, &err) == STATUS_OK, "%s", err.message);
    const struct photograph *b = &scene.photograph[1];
    CHECK(b->exposure_known && b->camera.width == 8);
    CHECK_NEAR(b->exposure, 1.0 / 50.0 * 4.0 / 4.0, 1e-8);
    CHECK_NEAR(b->settings_exposure, 1.0 / 50.0 * 4.0 / 4.0, 1e-8);
    CHECK(scene.photograph[0].settings_exposure == 0.0f);
    CHECK(has_warning(&scene, "EXIF orientation of 1"));
    scene_release(&scene);
    cJSON_Delete(problems);
}

/* Keys and shapes that other programs write. */
static void test_variants(void) {
    struct scene scene;
    struct error err;
    cJSON *problems;
    put_good();
    CHECK(make_folder("sub"));
    put("sub/other.ply", MESH);
    put("broken.ply", "ply\nnonsense");
    put_picture("mask.png", 8, 6, 0.0f, false);
    put("transforms.json",
        "{\"camera_angle_x\":1.5707963267948966,\"mesh\":\"sub\\\\other.ply\",\"iso\":200,\"f_number\":2,"
        "\"train_filenames\":[\"./a\"],\"test_filenames\":[\"b.png\"],\"frames\":["
        "{\"file_path\":\"a\",\"transform_matrix\":[[2,0,0,0],[0,2,0,0],[0,0,2,2]],\"exposure_time\":0.01},"
        "{\"file_path\":\"b.png\"," POSE ",\"exposure\":0.25,\"mask_path\":\"mask.png\",\"fl_x\":9,\"cx\":3.5,"
        "\"camera_model\":\"OPENCV_FISHEYE\",\"k4\":0.001},"
        "{\"file_path\":\"c.exr\"," POSE ",\"split\":\"val\"},"
        "{\"file_path\":\"gone.png\"," POSE ",\"split\":\"train\"},"
        "{\"file_path\":\"unlisted.png\"," POSE "}]}");
    CHECK_THAT(load(&scene, &problems, &err) == STATUS_OK, "%s", err.message);
    CHECK(scene.photograph_count == 3);
    const struct photograph *a = &scene.photograph[0], *b = &scene.photograph[1], *c = &scene.photograph[2];
    CHECK(!a->is_test && b->is_test && c->is_test);
    CHECK_NEAR(a->camera.fx, 4.0, 1e-5);
    CHECK_NEAR(a->camera.fy, 4.0, 1e-5);
    CHECK(a->camera.cx == 4.0f && a->camera.cy == 3.0f);
    CHECK_NEAR(a->camera.world_from_camera.rotation[0][0], 1.0, 1e-7);
    CHECK_NEAR(a->exposure, 0.01 * 2.0 / 4.0, 1e-9);
    CHECK(a->settings_exposure == a->exposure && b->settings_exposure == 0.0f);
    CHECK(b->exposure == 0.25f && b->camera.fx == 9.0f && b->camera.fy == 9.0f && b->camera.cx == 3.5f);
    CHECK(b->camera.model == CAMERA_OPENCV_FISHEYE && b->camera.k[3] == 0.001f);
    CHECK(b->mask && b->mask[0] == 0 && b->mask[47] == 0 && !a->mask);
    CHECK(has_warning(&scene, "frames[3] names gone.png"));
    CHECK(has_warning(&scene, "1 frames are in none"));
    CHECK(has_warning(&scene, "carries a scale"));
    CHECK(has_warning(&scene, "different sources"));
    scene_release(&scene);
    cJSON_Delete(problems);
}

/* A photograph that two frames name with one pose is used once: NeRF's test views are often copies of the others. */
static void test_doubled(void) {
    struct scene scene;
    struct error err;
    cJSON *problems;
    put_good();
    put("transforms.json", "{" LENS ",\"test_filenames\":[\"c.exr\"],\"frames\":[" FRAME("a.exr") "," FRAME(
                               "b.png") "," FRAME("c.exr") "],\"test_frames\":[" FRAME("./b") "," FRAME("c.exr") "]}");
    CHECK_THAT(load(&scene, &problems, &err) == STATUS_OK, "%s", err.message);
    CHECK(scene.photograph_count == 3 && scene.named_count == 5);
    CHECK(!scene.photograph[1].is_test && scene.photograph[2].is_test);
    CHECK(has_warning(&scene, "2 frames name a photograph that another one names with the same pose, b.png"));
    scene_release(&scene);
    cJSON_Delete(problems);
}

#define TOP(extra) "{" LENS "," extra "\"frames\":[" THREE "]}"
#define ONE_OF_THREE(frame) "{" LENS ",\"frames\":[" frame "," FRAME("b.png") "," FRAME("c.exr") "," FRAME("a.exr") "]}"
#define MATRIX(rows) ONE_OF_THREE("{\"file_path\":\"d.exr\",\"transform_matrix\":" rows "}")

struct bad {
    const char *transforms;        /* NULL: the good one */
    const char *file, *content;    /* another file to replace; content NULL: remove it */
    const char *blamed, *sentence; /* what a problem must say */
};

static const struct bad bad_bundles[] = {
    {NULL, "transforms.json", NULL, "a.exr", "no cameras: there are photographs and a mesh, but no poses"},
    {"{\"frames\": [}", NULL, NULL, "transforms.json", "line 1"},
    {"[]", NULL, NULL, "transforms.json", "array \"frames\""},
    {"{\"frames\": 3}", NULL, NULL, "transforms.json", "array \"frames\""},
    {"{" LENS ",\"frames\":[]}", NULL, NULL, "transforms.json", "holds no poses"},
    {"{" LENS ",\"frames\":[" FRAME("a.exr") "," FRAME("b.png") "," FRAME("x.png") "]}", NULL, NULL, "transforms.json",
     "only 2 of its 3 frames"},
    {NULL, "mesh.ply", NULL, "mesh.ply", "no mesh"},
    {NULL, "mesh.ply", CLOUD, "mesh.ply", "point clouds"},
    {NULL, "second.ply", TURNED, "second.ply", "two meshes: mesh.ply and second.ply, and neither is finer"},
    {NULL, "mesh.ply", "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\n", "mesh.ply", "line 4"},
    {NULL, "mesh.ply", "", "mesh.ply", "empty"},
    {TOP("\"mesh\":\"nowhere.ply\","), NULL, NULL, "transforms.json", "nowhere.ply"},
    {TOP("\"mesh\":\"../mesh.ply\","), NULL, NULL, "transforms.json", "\"..\""},
    {TOP("\"mesh\":\"/etc/mesh.ply\","), NULL, NULL, "transforms.json", "absolute"},
    {TOP("\"camera_model\":\"EQUIRECTANGULAR\","), NULL, NULL, "transforms.json", "unknown camera_model \"EQUI"},
    {"{" LENS ",\"fl_x\":1,\"frames\":[]}", NULL, NULL, "transforms.json", "\"fl_x\" twice"},
    {"{\"w\":8,\"h\":6,\"fl_x\":0,\"frames\":[" THREE "]}", NULL, NULL, "transforms.json", "fl_x is 0"},
    {"{\"w\":8,\"h\":6,\"fl_x\":-5,\"frames\":[" THREE "]}", NULL, NULL, "transforms.json", "fl_x is -5"},
    {"{\"w\":8,\"h\":6,\"fl_x\":1e9,\"frames\":[" THREE "]}", NULL, NULL, "a.exr", "focal length of 1e+09"},
    {"{\"w\":8,\"h\":6,\"frames\":[" THREE "]}", NULL, NULL, "transforms.json", "frames[0] (a.exr): no focal length"},
    {"{\"w\":8.5,\"fl_x\":7,\"frames\":[" THREE "]}", NULL, NULL, "transforms.json", "w is 8.5"},
    {"{\"w\":\"8px\",\"fl_x\":7,\"frames\":[" THREE "]}", NULL, NULL, "transforms.json", "\"w\" must be a number"},
    {"{\"fl_x\":7,\"camera_angle_x\":60,\"frames\":[" THREE "]}", NULL, NULL, "transforms.json", "radians"},
    {"{\"fl_x\":7,\"cx\":5000,\"frames\":[" THREE "]}", NULL, NULL, "a.exr", "principal point"},
    {"{\"w\":9,\"h\":6,\"fl_x\":7,\"frames\":[" THREE "]}", NULL, NULL, "b.png",
     "8 x 6 pixels, but frames[1] says 9 x 6"},
    {MATRIX("[[1,0,0,0],[0,1,0,0],[1,1,0,0],[0,0,0,1]]"), NULL, NULL, "transforms.json",
     "frames[0] (d.exr): transform_matrix is singular"},
    {MATRIX("[[0,0,0,0],[0,0,0,0],[0,0,0,0],[0,0,0,1]]"), NULL, NULL, "transforms.json", "singular"},
    {MATRIX("[[-1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]]"), NULL, NULL, "transforms.json", "mirrors"},
    {MATRIX("[[1,0,0,0],[0,2,0,0],[0,0,1,0],[0,0,0,1]]"), NULL, NULL, "transforms.json", "not a rotation"},
    {MATRIX("[[1,0.2,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]]"), NULL, NULL, "transforms.json", "not a rotation"},
    {MATRIX("[[1,0,0,1e999],[0,1,0,0],[0,0,1,0],[0,0,0,1]]"), NULL, NULL, "transforms.json", "row 1, column 4"},
    {MATRIX("[[1,0,0,0],[0,1,\"zero\",0],[0,0,1,0],[0,0,0,1]]"), NULL, NULL, "transforms.json", "row 2, column 3"},
    {MATRIX("[[1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,2]]"), NULL, NULL, "transforms.json", "last row"},
    {MATRIX("[[1,0,0],[0,1,0],[0,0,1]]"), NULL, NULL, "transforms.json", "4 (or 3) rows of 4"},
    {MATRIX("7"), NULL, NULL, "transforms.json", "4 (or 3) rows of 4"},
    {ONE_OF_THREE("{" POSE "}"), NULL, NULL, "transforms.json", "frames[0]: no file_path"},
    {ONE_OF_THREE("7"), NULL, NULL, "transforms.json", "frames[0]: must be an object"},
    {ONE_OF_THREE("{\"file_path\":\"../../a.exr\"," OTHER_POSE "}"), NULL, NULL, "transforms.json",
     "frames[0] and frames[3] both name a.exr"},
    {ONE_OF_THREE("{\"file_path\":\"\"," POSE "}"), NULL, NULL, "transforms.json", "file_path is empty"},
    {ONE_OF_THREE(FRAME_ELSEWHERE("./a.exr")), NULL, NULL, "transforms.json",
     "frames[0] and frames[3] both name a.exr"},
    {ONE_OF_THREE(FRAME_ELSEWHERE("c")), NULL, NULL, "transforms.json", "frames[0] and frames[2] both name c.exr"},
    {ONE_OF_THREE("{\"file_path\":\"d\"," POSE ",\"split\":\"dev\"}"), NULL, NULL, "transforms.json", "split must be"},
    {ONE_OF_THREE("{\"file_path\":\"d\"," POSE ",\"exposure\":-1}"), NULL, NULL, "transforms.json", "exposure is -1"},
    {"{" LENS ",\"frames\":[{\"file_path\":\"a.exr\"," POSE
     ",\"mask_path\":\"m.png\"}," FRAME("b.png") "," FRAME("c.exr") "]}",
     NULL, NULL, "m.png", "the mask is not in the bundle"},
    {"{" LENS ",\"test_filenames\":[\"a.exr\",\"b.png\",\"c.exr\"],\"frames\":[" THREE "]}", NULL, NULL,
     "transforms.json", "held out"},
    {NULL, "b.png", "\x89PNG\r\n\x1a\n and then nothing", "b.png", "PNG"},
    {NULL, "a.exr", "v/1\x01 and then nothing", "a.exr", "EXR"},
    {NULL, "c.exr", "text", "c.exr", "not a picture"},
};

static void test_bad(void) {
    for (size_t i = 0; i < sizeof bad_bundles / sizeof *bad_bundles; i++) {
        const struct bad *bad = &bad_bundles[i];
        put_good();
        if (bad->transforms)
            put("transforms.json", bad->transforms);
        char *path = file_join(work, bad->file ? bad->file : "");
        if (bad->file && bad->content)
            put(bad->file, bad->content);
        else if (bad->file)
            CHECK(remove(path) == 0);
        mem_free(path);
        struct scene scene;
        struct error err;
        cJSON *problems, *problem;
        CHECK_THAT(load(&scene, &problems, &err) == STATUS_INPUT, "case %zu: %s", i, err.message);
        CHECK(scene.photograph == NULL && scene.mesh.index == NULL && err.message[0] != '\0');
        bool found = false;
        cJSON_ArrayForEach(problem, problems) {
            const char *file = cJSON_GetStringValue(cJSON_GetObjectItem(problem, "file"));
            const char *reason = cJSON_GetStringValue(cJSON_GetObjectItem(problem, "reason"));
            found = found || (strcmp(file, bad->blamed) == 0 && strstr(reason, bad->sentence));
            CHECK_THAT(!strstr(reason, work), "case %zu tells where the server keeps it: %s", i, reason);
        }
        char *text = json_text(problems);
        CHECK_THAT(found, "case %zu wants %s \"%s\": %s", i, bad->blamed, bad->sentence, text);
        mem_free(text);
        cJSON_Delete(problems);
    }
}

static size_t triangles_of(const char **file, struct error *err) {
    struct scene scene;
    cJSON *problems;
    enum status status = load(&scene, &problems, err);
    size_t count = status == STATUS_OK ? scene.mesh.triangle_count : 0;
    static char blamed[64];
    const cJSON *first = cJSON_GetArrayItem(problems, 0);
    snprintf(blamed, sizeof blamed, "%s", first ? cJSON_GetObjectItem(first, "file")->valuestring : "");
    *file = blamed;
    scene_release(&scene);
    cJSON_Delete(problems);
    return count;
}

/* A folder alone at the top is the bundle's root, but not where it is part of a layout. */
static void test_root(void) {
    struct scene scene;
    struct error err;
    cJSON *problems;
    CHECK(file_remove_tree(work, NULL) == STATUS_OK && mkdir(work, 0700) == 0);
    CHECK(make_folder("keyframes") && make_folder("keyframes/cameras") && make_folder("keyframes/images"));
    put("keyframes/cameras/1.json", "{}");
    CHECK(load(&scene, &problems, &err) == STATUS_INPUT);
    char *text = json_text(problems);
    CHECK_THAT(strstr(text, "keyframes/cameras/1.json") != NULL && strstr(text, "no mesh"), "%s", text);
    mem_free(text);
    cJSON_Delete(problems);
}

/* Which of several meshes is taken: a PLY before others, one of a kind, or the one that is named. */
static void test_formats(void) {
    struct error err;
    const char *file;
    char *ply = file_join(work, "mesh.ply");
    put_good();
    put("room.obj", OBJ);
    CHECK(triangles_of(&file, &err) == 1);
    put("transforms.json", TOP("\"mesh\":\"room.obj\","));
    CHECK_THAT(triangles_of(&file, &err) == 1, "%s", err.message); /* the other side repeats it */
    put("transforms.json", TOP(""));
    CHECK(remove(ply) == 0 && triangles_of(&file, &err) == 1);
    put("mesh.ply", CLOUD);
    CHECK(triangles_of(&file, &err) == 1);
    put("room2.OBJ", OBJ);
    CHECK(triangles_of(&file, &err) == 1); /* the same file twice */
    put("room2.OBJ", "v 0 0 0\nv 1 0 0\nv 0 1 9\no a\nf 1 2 3\no b\nf 1 3 2\n");
    CHECK(triangles_of(&file, &err) == 0 && strstr(err.message, "two meshes: room.obj and room2.OBJ"));
    put("room2.OBJ", "");
    put("room.obj", "v 1 2");
    CHECK(triangles_of(&file, &err) == 0);
    mem_free(ply);
    put_good();
    ply = file_join(work, "mesh.ply");
    CHECK(remove(ply) == 0);
    put("room.obj", OBJ "f 1 2 9\n");
    CHECK(triangles_of(&file, &err) == 0 && strstr(err.message, "room.obj, line 8"));
    CHECK_STRING(file, "room.obj");
    put_good();
    CHECK(remove(ply) == 0);
    put("room.fbx", "Kaydara");
    CHECK(triangles_of(&file, &err) == 0 && strstr(err.message, "format of room.fbx is not read"));
    mem_free(ply);
}

/* A COLMAP reconstruction where transforms.json is not. */
static void test_colmap(void) {
    struct scene scene;
    struct error err;
    cJSON *problems;
    char *transforms = file_join(work, "transforms.json");
    put_good();
    CHECK(remove(transforms) == 0 && make_folder("sparse"));
    put("sparse/cameras.txt", "1 PINHOLE 8 6 7 7.5 4 3\n");
    put("sparse/images.txt", "1 0 1 0 0 -0.5 0.5 2 1 c.exr\n\n2 0 1 0 0 -0.5 0.5 2 1 a.exr\n1 2 -1\n"
                             "3 0 1 0 0 -0.5 0.5 2 1 b.png\n\n");
    CHECK_THAT(load(&scene, &problems, &err) == STATUS_OK, "%s", err.message);
    CHECK(scene.photograph_count == 3);
    float x, y, depth_m;
    CHECK_STRING(scene.photograph[0].name, "a.exr");
    CHECK(camera_project(&scene.photograph[0].camera, vec3_make(0.7f, 0.6f, 0.0f), &x, &y, &depth_m));
    CHECK_NEAR(depth_m, 2.0, 1e-6); /* the pose of POSE */
    CHECK_NEAR(x, 4.0 + 7.0 * 0.1, 1e-5);
    CHECK_NEAR(y, 3.0 - 7.5 * 0.05, 1e-5);
    scene_release(&scene);
    cJSON_Delete(problems);
    put("sparse/cameras.txt", "1 PINHOLE 9 6 7 7.5 4 3\n");
    CHECK(load(&scene, &problems, &err) == STATUS_INPUT &&
          strstr(err.message, "8 x 6 pixels, but frames[1] says 9 x 6"));
    cJSON_Delete(problems);
    put("sparse/cameras.txt", "1 PINHOLE 8 6 7\n");
    CHECK(load(&scene, &problems, &err) == STATUS_INPUT && strstr(err.message, "sparse/cameras.txt, line 1"));
    cJSON_Delete(problems);
    mem_free(transforms);
}

/* Everything at once, and more problems than are kept. */
static void test_many(void) {
    put_good();
    put("mesh.ply", "ply\nrubbish");
    put("b.png", "text");
    put("transforms.json", ONE_OF_THREE("{\"file_path\":\"d\",\"transform_matrix\":3}"));
    struct scene scene;
    struct error err;
    cJSON *problems;
    CHECK(load(&scene, &problems, &err) == STATUS_INPUT);
    CHECK(cJSON_GetArraySize(problems) == 4); /* that 2 of 4 frames are left is one, too */
    CHECK(strstr(err.message, "4 problems"));
    cJSON_Delete(problems);

    struct buf text;
    buf_init(&text, 1 << 20);
    buf_puts(&text, "{" LENS ",\"frames\":[");
    for (int i = 0; i < 300; i++)
        buf_printf(&text, "%s{\"file_path\":\"%d.png\"}", i ? "," : "", i);
    buf_puts(&text, "]}");
    put("transforms.json", buf_text(&text));
    buf_release(&text);
    CHECK(load(&scene, &problems, &err) == STATUS_INPUT);
    CHECK(cJSON_GetArraySize(problems) == 51 && strstr(err.message, "301 problems"));
    cJSON_Delete(problems);
}

/* A bundle in a folder of its own, unpacked beside what a Mac adds. */
static void test_single_folder(void) {
    put_good();
    char *outer = mem_printf("%s-outer", work), *inner = file_join(outer, "room"),
         *litter = file_join(outer, "__MACOSX");
    CHECK(mkdir(outer, 0700) == 0 && rename(work, inner) == 0 && mkdir(litter, 0700) == 0);
    struct scene scene;
    struct error err;
    struct bundle_limits limits = bundle_default_limits();
    cJSON *problems = cJSON_CreateArray();
    CHECK_THAT(bundle_load(outer, NULL, &limits, pool, &scene, problems, &err) == STATUS_OK, "%s", err.message);
    scene_release(&scene);
    limits.photograph_pixels = 40;
    CHECK(bundle_load(outer, NULL, &limits, pool, &scene, problems, &err) == STATUS_INPUT);
    scene_release(&scene);
    CHECK(strstr(err.message, "48 pixels"));
    struct reading reading = reading_default();
    reading.transforms = "../transforms.json";
    CHECK(bundle_load(outer, &reading, &limits, pool, &scene, problems, &err) == STATUS_INPUT);
    scene_release(&scene);
    cJSON_Delete(problems);
    file_remove_tree(outer, NULL);
    mem_free(outer);
    mem_free(inner);
    mem_free(litter);
}

/* From an archive to a scene. */
static void test_archive(void) {
    put_good();
    char *archive = mem_printf("%s.tar.gz", work), *dir = mem_printf("%s-files", work);
    char *command = mem_printf("tar -C '%s' -czf '%s' .", work, archive);
    struct bundle_limits limits = bundle_default_limits();
    struct scene scene;
    struct error err = {.message = ""};
    cJSON *problems = cJSON_CreateArray();
    CHECK(system(command) == 0);
    CHECK_THAT(bundle_unpack(archive, dir, &limits, &err) == STATUS_OK, "%s", err.message);
    CHECK_THAT(bundle_load(dir, NULL, &limits, pool, &scene, problems, &err) == STATUS_OK, "%s", err.message);
    CHECK(scene.photograph_count == 3);
    scene_release(&scene);
    file_remove_tree(dir, NULL);
    CHECK(truncate(archive, 200) == 0);
    CHECK(bundle_unpack(archive, dir, &limits, &err) == STATUS_INPUT && access(dir, F_OK) != 0);
    CHECK(strstr(err.message, "the archive"));
    cJSON_Delete(problems);
    unlink(archive);
    mem_free(archive);
    mem_free(command);
    mem_free(dir);
}

static const float *truth_pixel(const struct image *truth, float x, float y) {
    return truth->pixel + ((size_t)y * truth->width + (size_t)x) * truth->channel_count;
}

/* Whether the pixel and its eight neighbours show one object. */
static bool is_inside(const struct image *truth, float x, float y, size_t id) {
    if (x < 1.0f || y < 1.0f || x >= (float)truth->width - 1.0f || y >= (float)truth->height - 1.0f)
        return false;
    for (int k = 0; k < 9; k++)
        if (truth_pixel(truth, x + (float)(k % 3 - 1), y + (float)(k / 3 - 1))[id] != truth_pixel(truth, x, y)[id])
            return false;
    return true;
}

/* Poses, axes, pixel places and object_id against a renderer's pictures of the same room: where
 * a triangle's centre has the depth that the renderer saw, its object must be the one it saw. */
static void check_truth(const char *dir, const struct scene *scene) {
    size_t seen = 0, agreeing = 0;
    for (size_t i = 0; i < scene->photograph_count; i++) {
        const struct photograph *photo = &scene->photograph[i];
        if (!photo->is_test)
            continue;
        char *path = mem_printf("%s/truth/%.3s.exr", dir, strrchr(photo->name, '/') + 1);
        struct image truth;
        enum status status = image_read(path, &truth, NULL, NULL);
        mem_free(path);
        CHECK(status == STATUS_OK);
        if (status != STATUS_OK)
            continue;
        size_t depth = (size_t)image_channel(&truth, "depth"), id = (size_t)image_channel(&truth, "object_id");
        for (size_t t = 0; t < scene->mesh.triangle_count; t++) {
            const uint32_t *v = scene->mesh.index[t];
            const vec3 *p = scene->mesh.position;
            vec3 centre = vec3_scale(vec3_add(p[v[0]], vec3_add(p[v[1]], p[v[2]])), 1.0f / 3.0f);
            float x, y, depth_m;
            if (!camera_project(&photo->camera, centre, &x, &y, &depth_m))
                continue;
            const float *pixel = truth_pixel(&truth, x, y);
            float distance_m = vec3_length(vec3_sub(centre, camera_origin(&photo->camera)));
            if (fabsf(pixel[depth] - distance_m) > 0.002f * distance_m || !is_inside(&truth, x, y, id))
                continue;
            seen++;
            agreeing += (int64_t)pixel[id] == scene->mesh.object_id[t];
        }
        image_release(&truth);
    }
    printf("%zu triangle centres seen, %zu with the right object\n", seen, agreeing);
    /* Towels and the like have layers closer than the 0.2 % of depth that is told apart. */
    CHECK(seen > 500 && (double)agreeing > 0.9 * (double)seen);
}

static void test_real(const char *root, const char *room, const char *transforms, size_t frames, size_t triangles) {
    char *dir = mem_printf("%s/%s", root, room);
    if (access(dir, R_OK) != 0) {
        printf("%s is not here\n", dir);
        mem_free(dir);
        return;
    }
    struct scene scene;
    struct error err = {.message = ""};
    struct bundle_limits limits = bundle_default_limits();
    cJSON *problems = cJSON_CreateArray();
    struct reading reading = reading_default();
    reading.transforms = (char *)transforms;
    enum status status = bundle_load(dir, &reading, &limits, pool, &scene, problems, &err);
    CHECK_THAT(status == STATUS_OK, "%s: %s", room, err.message);
    if (status == STATUS_OK) {
        cJSON *facts = facts_of(&scene);
        char *text = json_text(facts);
        printf("%s %s: %s\n", room, transforms ? transforms : "", text);
        CHECK(scene.photograph_count >= frames && scene.mesh.triangle_count >= triangles);
        mem_free(text);
        cJSON_Delete(facts);
        if (strncmp(room, "rooms/", 6) == 0)
            check_truth(dir, &scene);
    }
    scene_release(&scene);
    cJSON_Delete(problems);
    mem_free(dir);
}

int main(void) {
    snprintf(work, sizeof work, "%s/unbake-test-bundle-XXXXXX", check_fast_dir());
    CHECK(mkdtemp(work) != NULL);
    pool = parallel_new(2);
    test_good();
    test_exif();
    test_variants();
    test_doubled();
    test_bad();
    test_root();
    test_formats();
    test_colmap();
    test_many();
    test_single_folder();
    test_archive();
    const char *root = getenv("UNBAKE_TEST_DATA");
    root = root ? root : "../shared/data";
    test_real(root, "rooms/staircase2", NULL, 80, 28000);
    test_real(root, "rooms/staircase2", "transforms_sdr.json", 80, 28000);
    test_real(root, "rooms/bathroom", NULL, 80, 360000);
    test_real(root, "redkitchen", NULL, 125, 290000);
    parallel_free(pool);
    file_remove_tree(work, NULL);
    return check_result();
}
