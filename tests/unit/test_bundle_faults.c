/* test_bundle_faults.c -- bundles of each kind where a call of the system fails, once or from then on: what is left is
 * the whole scene, or the disk is blamed for what it did, never the bundle. And folders where files must be, which are
 * the bundle's own fault. */
#include "server/ingest/bundle.h"

#include "common/file.h"
#include "common/image.h"
#include "common/mem.h"
#include "server/ingest/archive.h"
#include "server/ingest/mapping.h"
#include "server/ingest/transforms.h"
#include "tests/check.h"
#include "tests/system_faults.h"

/* Not once: what then is opened in vain is not there, as far as anybody can tell. */
SYSTEM_CALL(int, access, -1, system_faults_stay, (const char *path, int mode), path, mode)
SYSTEM_CALL(int, mkdirat, -1, true, (int folder, const char *path, mode_t mode), folder, path, mode)
SYSTEM_CALL(int, stat, -1, true, (const char *path, struct stat *info), path, info)

static struct error err;
#define OK(call) CHECK_THAT((call) == STATUS_OK, "%s", err.message)

#define POSE "1 0 0 0.5 0 1 0 0.5 0 0 1 -2 0 0 0 1"
#define MATRIX "\"transform_matrix\":[[1,0,0,0.5],[0,1,0,0.5],[0,0,1,2],[0,0,0,1]]"
#define CLOUD                                                                                                          \
    "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float z\nend_header\n0 0 0\n"
#define OBJ "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"
#define GLTF                                                                                                           \
    "{\"asset\":{\"version\":\"2.0\"},\"buffers\":[{\"byteLength\":36,\"uri\":\"room.bin\"}],\"bufferViews\":"         \
    "[{\"buffer\":0,\"byteLength\":36}],\"accessors\":[{\"bufferView\":0,\"componentType\":5126,\"count\":3,"          \
    "\"type\":\"VEC3\"}],\"meshes\":[{\"primitives\":[{\"attributes\":{\"POSITION\":0}}]}],\"nodes\":[{\"mesh\":0}]}"

enum kind { TRANSFORMS, INNER, COLMAP, REPLICA, SCANNET, KIND_COUNT };

static char dir[] = "/tmp/unbake-test-bundle-XXXXXX";
static char *root; /* the bundle's folder */
static struct parallel *pool;

static void put(const char *name, const char *text) {
    char *path = file_join(root, name), *slash = strrchr(path, '/');
    *slash = '\0';
    OK(file_make_dirs(path, &err));
    *slash = '/';
    OK(file_replace(path, text, strlen(text), &err));
    mem_free(path);
}

static void put_picture(const char *name) {
    struct image image;
    char *path = file_join(root, name);
    put(name, "");
    image_init_rgb(&image, 4, 3);
    OK(image_write_png(path, &image, 1.0f, &err));
    image_release(&image);
    mem_free(path);
}

/* Three photographs, by their poses of one kind, and one triangle. */
static void put_bundle(enum kind kind) {
    static const char *const pictures[KIND_COUNT] = {"images/%d.png", "images/%d.png", "%d.png",
                                                     "results/frame00000%d.png", "color/%d.png"};
    faults_are_off = true;
    OK(file_remove_tree(root, &err));
    for (int i = 0; i < 3; i++) {
        char name[64], pose[64];
        snprintf(name, sizeof name, pictures[kind], i);
        put_picture(name);
        snprintf(pose, sizeof pose, "pose/%d.txt", i);
        if (kind == SCANNET)
            put(pose, POSE);
    }
    if (kind == TRANSFORMS || kind == INNER) {
        static const float points[9] = {[3] = 1.0f, [7] = 1.0f};
        char *path = file_join(root, "room.bin");
        OK(file_replace(path, points, sizeof points, &err));
        mem_free(path);
        put("room.gltf", GLTF);
        put("cloud.ply", CLOUD);
        put_picture("mask.png");
        put("transforms.json",
            "{\"fl_x\":3,\"ply_file_path\":\"cloud.ply\",\"frames\":[{\"file_path\":\"images/0\"," MATRIX
            "},{\"file_path\":\"images/1\"," MATRIX
            ",\"mask_path\":\"mask.png\"},{\"file_path\":\"images/2.png\"," MATRIX "}]}");
    } else {
        put("room.obj", OBJ);
    }
    if (kind == COLMAP) {
        put("cloud.ply", CLOUD);
        put("cameras.txt", "1 PINHOLE 4 3 3 3 2 1.5\n");
        put("images.txt", "1 1 0 0 0 0 0 2 1 0.png\n\n2 1 0 0 0 0 0 2 1 1.png\n\n3 1 0 0 0 0 0 2 1 2.png\n\n");
    }
    if (kind == REPLICA) {
        put("traj.txt", POSE "\n" POSE "\n" POSE "\n");
        put("cam_params.json", "{\"camera\":{\"w\":4,\"h\":3,\"fx\":3,\"fy\":3,\"cx\":2,\"cy\":1}}");
    }
    if (kind == SCANNET)
        put("intrinsic/intrinsic_color.txt", "3 0 2 0 0 3 1 0 0 0 1 0 0 0 0 1");
    faults_are_off = false;
}

/* What the file that is blamed first is, below. */
static enum status load(enum kind kind, struct scene *scene, cJSON **problems) {
    struct bundle_limits limits = bundle_default_limits();
    *problems = cJSON_CreateArray();
    err = (struct error){0};
    return bundle_load(kind == INNER ? dir : root, NULL, &limits, pool, scene, *problems, &err);
}

/* --- the disk --------------------------------------------------------------------------------------- */

/* Whether a call was the n-th. */
static bool load_once(enum kind kind, long n, bool stays) {
    struct scene scene;
    cJSON *problems;
    system_faults_arm_only(NULL, n, stays);
    enum status status = load(kind, &scene, &problems);
    bool struck = system_faults_lift();
    bool is_whole = status == STATUS_OK && scene.photograph_count == 3 && scene.mesh.triangle_count == 1;
    CHECK_THAT(is_whole || struck, "bundle %d: %s", kind, err.message);
    bool is_blamed = status == STATUS_IO || status == STATUS_NO_SPACE || status == STATUS_NOT_FOUND;
    CHECK_THAT(is_whole || (is_blamed && *err.message), "bundle %d, call %ld (%s), %d: %s: %s", kind, n, system_failed,
               stays, status_name(status), err.message);
    scene_release(&scene);
    cJSON_Delete(problems);
    return struck;
}

static void check_loading(void) {
    for (enum kind kind = 0; kind < KIND_COUNT; kind++) {
        put_bundle(kind);
        for (int stays = 0; stays < 2; stays++)
            for (long n = 1; load_once(kind, n, stays) && check_failed_count == 0; n += stays ? 5 : 1)
                ;
    }
}

/* What was unpacked is whole, or nothing of it is left. */
static bool unpack_once(const char *archive, const char *only, long n, bool stays) {
    static const struct archive_limits limits = {100, 1 << 20, 1000.0};
    char *to = file_join(dir, "unpacked");
    err = (struct error){0};
    system_faults_arm_only(only, n, stays);
    system_fault = EIO; /* that a disk is full no read says */
    enum status status = archive_unpack(archive, "room.tar", to, &limits, &err);
    bool struck = system_faults_lift();
    uint64_t files = 0, bytes;
    faults_are_off = true;
    OK(file_tree_size(to, &files, &bytes, NULL));
    CHECK_THAT(status == STATUS_OK ? files == 8 : struck && (stays || files == 0), "call %ld: %s", n, err.message);
    CHECK_THAT(status == STATUS_OK || status == STATUS_IO || status == STATUS_NO_SPACE, "call %ld (%s): %s: %s", n,
               system_failed, status_name(status), err.message);
    CHECK(status == STATUS_OK || *err.message);
    OK(file_remove_tree(to, &err));
    faults_are_off = false;
    mem_free(to);
    return struck;
}

static void check_unpacking(void) {
    static const char *const ways[] = {"-cf", "-czf"};
    put_bundle(TRANSFORMS);
    for (int i = 0; i < 2; i++) {
        char *archive = mem_printf("%s/room.%d", dir, i);
        char *command = mem_printf("tar -C '%s' %s '%s' .", root, ways[i], archive);
        CHECK(system(command) == 0);
        for (int stays = 0; stays < 2; stays++)
            for (long n = 1; unpack_once(archive, NULL, n, stays) && check_failed_count == 0; n++)
                ;
        for (long n = 1; unpack_once(archive, " close ", n, false) && check_failed_count == 0; n++)
            ;
        for (long n = 1; unpack_once(archive, " write close ", n, true) && check_failed_count == 0; n++)
            ;
        OK(file_remove_tree(archive, &err));
        mem_free(command);
        mem_free(archive);
    }
}

/* A file that cannot be mapped: the kernel's own. */
static void check_mapping(void) {
    static const char online[] = "/sys/devices/system/cpu/online";
    struct mapping m;
    if (access(online, R_OK) != 0)
        printf("no %s here: no file that cannot be mapped\n", online);
    else
        CHECK(mapping_open(&m, online, "online", "a text", &err) == STATUS_IO &&
              strstr(err.message, "cannot map online"));
    CHECK(mapping_open(&m, dir, "folder", "a text", &err) == STATUS_INPUT);
    CHECK_STRING(err.message, "folder is not a text: it is no regular file");
}

/* --- folders ---------------------------------------------------------------------------------------- */

/* A problem that blames the file and says so, and tells nothing of where the server keeps it. */
static void check_blamed(enum kind kind, const char *file, const char *part) {
    struct scene scene;
    cJSON *problems, *problem;
    CHECK_THAT(load(kind, &scene, &problems) == STATUS_INPUT, "%s: %s", file, err.message);
    bool found = false;
    cJSON_ArrayForEach(problem, problems) {
        const char *reason = cJSON_GetStringValue(cJSON_GetObjectItem(problem, "reason"));
        found = found ||
                (strcmp(cJSON_GetStringValue(cJSON_GetObjectItem(problem, "file")), file) == 0 && strstr(reason, part));
    }
    char *text = json_text(problems);
    CHECK_THAT(found && !strstr(text, dir), "wanted is %s: %s, not %s", file, part, text);
    mem_free(text);
    scene_release(&scene);
    cJSON_Delete(problems);
}

/* In a file's place is a folder, or where a folder must be, a file. */
static void check_folders(void) {
    static const struct {
        enum kind kind;
        const char *name, *blamed, *part;
    } table[] = {
        {TRANSFORMS, "transforms.json", "images/0.png", "no cameras"},
        {TRANSFORMS, "room.gltf", "mesh.ply", "no mesh"},
        {TRANSFORMS, "room.bin", "room.gltf", "room.bin is not a buffer: it is no regular file"},
        {TRANSFORMS, "mask.png", "mask.png", "not a regular file"},
        {TRANSFORMS, "images/2.png", "images/2.png", "not a regular file"},
        {COLMAP, "cameras.txt", "0.png", "no cameras"},
        {COLMAP, "images.txt", "0.png", "no cameras"},
        {COLMAP, "room.obj", "mesh.ply", "no mesh"},
        {REPLICA, "traj.txt", "results/frame000000.png", "no cameras"},
        {SCANNET, "intrinsic/intrinsic_color.txt", "color/0.png", "no cameras"},
    };
    for (size_t i = 0; i < sizeof table / sizeof *table; i++) {
        put_bundle(table[i].kind);
        char *path = file_join(root, table[i].name);
        OK(file_remove_tree(path, &err));
        OK(file_make_dirs(path, &err));
        check_blamed(table[i].kind, table[i].blamed, table[i].part);
        mem_free(path);
    }
    put_bundle(SCANNET);
    char *poses = file_join(root, "pose");
    OK(file_remove_tree(poses, &err));
    put("pose", POSE);
    check_blamed(SCANNET, "color/0.png", "no cameras");
    mem_free(poses);

    put_bundle(TRANSFORMS);
    struct scene scene;
    struct bundle_limits limits = bundle_default_limits();
    struct reading reading = reading_default();
    reading.transforms = "./";
    CHECK(bundle_load(root, &reading, &limits, pool, &scene, NULL, &err) == STATUS_INPUT);
    scene_release(&scene);
    CHECK_STRING(err.message, "\"./\" is no name of a file");
    put("transforms.json",
        "{\"fl_x\":3,\"frames\":[{\"file_path\":\"images/0\"," MATRIX ",\"mask_path\":\"room.bin/other.png\"}]}");
    check_blamed(TRANSFORMS, "room.bin/other.png", "the mask is not in the bundle");
    put("room.gltf", "{\"asset\":{\"version\":\"2.0\"},\"buffers\":[{\"uri\":\"mask.png/room.bin\"}]}");
    check_blamed(TRANSFORMS, "room.gltf", "names the buffer mask.png/room.bin, which is not in the bundle");
}

/* --- what no program writes -------------------------------------------------------------------------- */

#define FRAMES(members) "{\"fl_x\":3," members "\"frames\":[]}"

static void check_content(void) {
    struct image image;
    char *path = file_join(root, "images/1.exr"), *transforms = file_join(root, "transforms.json");
    put_bundle(TRANSFORMS);
    image_init(&image, 4, 3, 1, (const char *const[]){"Z"});
    OK(image_write_exr(path, &image, IMAGE_HALF, false, &err));
    image_release(&image);
    put("transforms.json",
        "{\"fl_x\":3,\"frames\":[{\"file_path\":\"images/1.exr\"," MATRIX ",\"mask_path\":\"mask.png\"}]}");
    check_blamed(TRANSFORMS, "images/1.exr", "the EXR has no channels R, G and B, in no layer, and no Y");
    mem_free(path);

    put_bundle(TRANSFORMS);
    path = file_join(root, "mask.png");
    image_init_rgb(&image, 3, 4);
    OK(image_write_png(path, &image, 1.0f, &err));
    image_release(&image);
    check_blamed(TRANSFORMS, "mask.png", "the mask is 3 x 4 pixels, its photograph 4 x 3");
    mem_free(path);

    put_bundle(COLMAP);
    put("room.obj", "v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n");
    check_blamed(COLMAP, "room.obj", "none of its 1 faces has an area");
    put_bundle(TRANSFORMS);
    put("transforms.json", FRAMES("\"is_fisheye\":3,"));
    check_blamed(TRANSFORMS, "transforms.json", "at the top: \"is_fisheye\" must be true or false, found a number");
    struct buf many;
    buf_init(&many, 1 << 20);
    buf_puts(&many, "{\"frames\":[{}");
    for (int i = 0; i < FRAMES_MAX; i++)
        buf_puts(&many, ",{}");
    buf_puts(&many, "]}");
    put("transforms.json", buf_text(&many));
    check_blamed(TRANSFORMS, "transforms.json", "at the top: there are 20001 frames; 20000 are the limit");
    buf_release(&many);
    CHECK(truncate(transforms, TRANSFORMS_MAX_BYTES + 1) == 0);
    check_blamed(TRANSFORMS, "transforms.json", "is larger than 268435456 bytes");
    mem_free(transforms);
}

int main(void) {
    if (!mkdtemp(dir))
        return 1;
    root = file_join(dir, "room");
    pool = parallel_new(2);
    check_unpacking();
    check_folders();
    check_content();
    check_loading();
    check_mapping();
    parallel_free(pool);
    OK(file_remove_tree(dir, &err));
    mem_free(root);
    return check_result();
}
