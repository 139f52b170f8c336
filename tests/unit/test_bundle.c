/* test_bundle.c -- bundles: a small good one in several shapes. test_bundle_bad.c has bad ones, test_bundle_rooms.c
 * real ones. */
#include <zlib.h>

#include "server/ingest/facts.h"
#include "tests/unit/bundle_rig.h"

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

int main(void) {
    bundle_rig_begin();
    test_good();
    test_exif();
    test_variants();
    test_doubled();
    test_root();
    test_formats();
    test_colmap();
    test_single_folder();
    test_archive();
    bundle_rig_end();
    return check_result();
}
