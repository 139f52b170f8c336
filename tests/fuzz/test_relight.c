/* test_relight.c -- what `unbaked relight` is given: the outputs of a job, whose files may be anybody's,
 * cameras and an environment. The first byte says which of them the rest is:
 *
 *   s  scene.ply      c  the cameras      e  the environment      t  a texture */
#include "server/relight/relight.h"

#include <math.h>
#include <unistd.h>

#include "common/file.h"
#include "common/image.h"
#include "common/mem.h"
#include "server/ingest/transforms.h"
#include "tests/fuzz/fuzz.h"

#define CAMERAS                                                                                                        \
    "{\"w\":3,\"h\":2,\"fl_x\":4,\"frames\":[{\"file_path\":\"a\",\"transform_matrix\":"                               \
    "[[1,0,0,0.3],[0,1,0,0.3],[0,0,1,3],[0,0,0,1]]}]}"
#define TEXELS 8       /* a side */
#define PICTURE_MAX 64 /* pixels a side */

static struct parallel *pool;
static char *outputs;
static uint8_t scene_ply[1024];
static size_t scene_size;

/* Two triangles of two segments, as export/mesh_ply.c writes them. */
static void make_scene(void) {
    static const float vertex[4][5] = {{0, 0, 0, 0, 0}, {1, 0, 0, 1, 0}, {1, 1, 0, 1, 1}, {0, 1, 0, 0, 1}};
    static const uint32_t face[2][5] = {{0, 1, 2, 0, 0}, {0, 2, 3, 1, 1}}; /* corners, segment, face */
    scene_size = (size_t)snprintf(
        (char *)scene_ply, sizeof scene_ply,
        "ply\nformat binary_little_endian 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n"
        "property float s\nproperty float t\nelement face 2\nproperty list uchar int vertex_indices\n"
        "property int segment\nproperty int face\nend_header\n");
    memcpy(scene_ply + scene_size, vertex, sizeof vertex);
    scene_size += sizeof vertex;
    for (int f = 0; f < 2; f++) {
        scene_ply[scene_size++] = 3;
        memcpy(scene_ply + scene_size, face[f], sizeof face[f]);
        scene_size += sizeof face[f];
    }
}

static void put(const char *name, const void *data, size_t size) {
    char *path = file_join(outputs, name);
    fuzz_write(path, data, size);
    mem_free(path);
}

static void put_texture(const char *name, float value) {
    struct image image;
    char *path = file_join(outputs, name);
    image_init_rgb(&image, TEXELS, TEXELS);
    for (size_t i = 0; i < (size_t)TEXELS * TEXELS * 3; i++)
        image.pixel[i] = value;
    MUST(image_write_exr(path, &image, IMAGE_HALF, false, NULL) == STATUS_OK);
    image_release(&image);
    mem_free(path);
}

/* The good files that inputs take the place of. */
static void put_good(char kind) {
    if (kind == 's')
        put("scene.ply", scene_ply, scene_size);
    else if (kind == 'c')
        put("views.json", CAMERAS, strlen(CAMERAS));
    else if (kind == 't')
        put_texture("emission.exr", 0.2f);
}

static void start(void) {
    outputs = file_join(fuzz_folder(), "outputs");
    MUST(file_make_dirs(outputs, NULL) == STATUS_OK);
    pool = parallel_new(1);
    make_scene();
    put_good('s');
    put_good('c');
    put_good('t');
    put_texture("base_color.exr", 0.5f);
    put_texture("roughness.exr", 0.5f);
    put_texture("specular.exr", 0.5f);
}

/* Large pictures and large views only take time. */
static bool is_small(char kind, const char *name) {
    char *path = file_join(outputs, name);
    struct image image = {0};
    cJSON *tree = NULL;
    bool is = true;
    if (kind == 'e' || kind == 't') {
        is = image_probe(path, &image, NULL, NULL) != STATUS_OK ||
             (image.width <= PICTURE_MAX && image.height <= PICTURE_MAX);
    } else if (kind == 'c' && json_read(path, 1 << 20, &tree, NULL) == STATUS_OK) {
        struct findings findings = {.problems = cJSON_CreateArray()};
        struct frames t;
        transforms_read(tree, name, &t, &findings);
        for (size_t i = 0; i < t.frame_count; i++)
            is = is && !(fmax(t.frame[i].lens.width, t.frame[i].lens.height) > PICTURE_MAX &&
                         fmin(t.frame[i].lens.width, t.frame[i].lens.height) < IMAGE_MAX_SIDE);
        frames_release(&t);
        cJSON_Delete(findings.problems);
        findings_release(&findings);
    }
    cJSON_Delete(tree);
    image_release(&image);
    mem_free(path);
    return is;
}

static void render(const char *environment) {
    struct error err = {.message = ""};
    cJSON *settings = cJSON_CreateObject();
    char *out = file_join(fuzz_folder(), "relit");
    MUST(file_make_dirs(out, NULL) == STATUS_OK);
    json_add_int(settings, "spp", 1);
    json_add_int(settings, "max_depth", 3);
    json_add_string(settings, "environment", environment ? environment : "found");
    MUST(render_settings_check(settings, RENDER_FILES_ANYWHERE, NULL, NULL) == STATUS_OK);
    struct relight_job job = {.outputs = outputs, .settings = settings, .out = out};
    if (relight_run(&job, NULL, pool, &err) == STATUS_OK)
        MUST(file_is_in(out, "views.json"));
    else
        MUST(err.message[0] != '\0');
    MUST(file_remove_tree(out, NULL) == STATUS_OK);
    cJSON_Delete(settings);
    mem_free(out);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    if (size < 1)
        return 0;
    if (!outputs)
        start();
    const char *names[] = {['s'] = "scene.ply", ['c'] = "views.json", ['e'] = "light", ['t'] = "emission.exr"};
    const char *name = data[0] < sizeof names / sizeof *names ? names[data[0]] : NULL;
    if (!name)
        return 0;
    put(name, data + 1, size - 1);
    char *light = file_join(outputs, "light");
    if (is_small((char)data[0], name))
        render(data[0] == 'e' ? light : NULL);
    mem_free(light);
    put_good((char)data[0]);
    return 0;
}

void fuzz_seeds(struct seeds *s) {
    static const char sky[] = "e#?RGBE\n\n-Y 2 +X 4\nabc\200\1\1\1\3bcd\201\1\1\1\1abc\200\1\1\1\3bcd\201\1\1\1\1";
    uint8_t text[SEED_MAX_BYTES];
    struct buf file;
    s->mutants = 150;
    start();
    seeds_text(s, "c" CAMERAS);
    seeds_add(s, sky, sizeof sky - 1);
    text[0] = 's';
    memcpy(text + 1, scene_ply, scene_size);
    seeds_add(s, text, scene_size + 1);
    char *path = file_join(outputs, "emission.exr");
    buf_init(&file, sizeof text);
    MUST(file_read(path, &file, NULL) == STATUS_OK);
    text[0] = 't';
    memcpy(text + 1, file.data, file.length);
    seeds_add(s, text, file.length + 1);
    buf_release(&file);
    mem_free(path);
}
