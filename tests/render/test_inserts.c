/* Meshes of files that are put into a room with their own materials (mesh_object.h): an emissive one against a lamp,
 * metals in a furnace, pictures and several materials of GLB and OBJ by what the first hits see, and what is said of
 * the rest. */
#include "common/buf.h"
#include "server/relight/bake.h"
#include "tests/check.h"
#include "tests/relit_room.h"

/* Looks from (0, 0, 2) along -z; x to the right, y up. The square from -1 to 1 in the plane z = 0 fills the picture. */
#define VIEW                                                                                                           \
    "{\"w\":8,\"h\":8,\"fl_x\":8,\"fl_y\":8,\"cx\":4,\"cy\":4,\"frames\":[{\"file_path\":\"a\","                       \
    "\"transform_matrix\":[[1,0,0,0],[0,1,0,0],[0,0,1,2],[0,0,0,1]]}]}"
#define COMMON "\"format\":\"exr\",\"up\":\"y\",\"view\":\"a\",\"environment\":\"none\""

static struct parallel *pool;
static struct error err;

/* --- files -------------------------------------------------------------------------------------------------------- */

static void put_file(const char *dir, const char *name, const void *data, size_t size) {
    char *path = file_join(dir, name);
    CHECK(file_replace(path, data, size, NULL) == STATUS_OK);
    mem_free(path);
}

/* Writes a picture of 2 x 2 texels, in sRGB codes by rows. */
static void put_picture(const char *dir, const char *name, const float code[4][3]) {
    struct image image;
    char *path = file_join(dir, name);
    image_init_rgb(&image, 2, 2);
    for (int i = 0; i < 12; i++)
        image.pixel[i] = image_srgb_to_linear(code[i / 3][i % 3]);
    CHECK(image_write_png(path, &image, 1.0f, NULL) == STATUS_OK);
    image_release(&image);
    mem_free(path);
}

/* Two squares side by side, x from -1 to 0 and 0 to 1, y from -1 to 1, z = 0, which face +z; each has texture
 * coordinates from 0 to 1 to the right and downwards. `rest` is the rest of the JSON; the squares have materials 0 and
 * 1. */
static void put_gltf(const char *dir, const char *name, const char *rest) {
    static const float corner[8][5] = {{-1, -1, 0, 0, 1}, {0, -1, 0, 1, 1}, {0, 1, 0, 1, 0}, {-1, 1, 0, 0, 0},
                                       {0, -1, 0, 0, 1},  {1, -1, 0, 1, 1}, {1, 1, 0, 1, 0}, {0, 1, 0, 0, 0}};
    static const uint8_t index[6] = {0, 1, 2, 0, 2, 3};
    uint8_t data[sizeof corner + sizeof index];
    memcpy(data, corner, sizeof corner);
    memcpy(data + sizeof corner, index, sizeof index);
    put_file(dir, "squares.bin", data, sizeof data);
    char *json = mem_printf(
        "{\"asset\":{\"version\":\"2.0\"},\"buffers\":[{\"byteLength\":166,\"uri\":\"squares.bin\"}],"
        "\"bufferViews\":[{\"buffer\":0,\"byteLength\":80,\"byteStride\":20},{\"buffer\":0,\"byteOffset\":80,"
        "\"byteLength\":80,\"byteStride\":20},{\"buffer\":0,\"byteOffset\":160,\"byteLength\":6}],\"accessors\":["
        "{\"bufferView\":0,\"componentType\":5126,\"count\":4,\"type\":\"VEC3\"},"
        "{\"bufferView\":0,\"byteOffset\":12,\"componentType\":5126,\"count\":4,\"type\":\"VEC2\"},"
        "{\"bufferView\":1,\"componentType\":5126,\"count\":4,\"type\":\"VEC3\"},"
        "{\"bufferView\":1,\"byteOffset\":12,\"componentType\":5126,\"count\":4,\"type\":\"VEC2\"},"
        "{\"bufferView\":2,\"componentType\":5121,\"count\":6,\"type\":\"SCALAR\"}],"
        "\"meshes\":[{\"primitives\":["
        "{\"attributes\":{\"POSITION\":0,\"TEXCOORD_0\":1},\"indices\":4,\"material\":0},"
        "{\"attributes\":{\"POSITION\":2,\"TEXCOORD_0\":3},\"indices\":4,\"material\":1}]}],"
        "\"nodes\":[{\"mesh\":0}],%s}",
        rest);
    put_file(dir, name, json, strlen(json));
    mem_free(json);
}

/* --- pictures ----------------------------------------------------------------------------------------------------- */

static char said[1024];

static void hear(void *user, const char *text) {
    (void)user;
    strncat(said, text, sizeof said - strlen(said) - 1);
}

/* Renders one pass with an inserted file. */
static void pass(const char *dir, const char *file, const char *settings, const char *which, struct image *image) {
    char *text = mem_printf("{" COMMON ",\"insert.1.file\":\"%s/%s\",\"passes\":\"%s\"%s}", dir, file, which, settings),
         out[] = "/tmp/unbake-insert-XXXXXX", *name = mem_printf("00000_%s.exr", which);
    cJSON *tree = cJSON_Parse(text);
    struct relight_watch watch = {.message = hear};
    CHECK(mkdtemp(out) != NULL);
    said[0] = '\0';
    err = (struct error){.message = ""};
    CHECK_THAT(render_settings_check(tree, RENDER_FILES_ANYWHERE, NULL, &err) == STATUS_OK, "%s", err.message);
    struct relight_job job = {.outputs = dir, .settings = tree, .out = out};
    *image = (struct image){0};
    CHECK_THAT(relight_run(&job, &watch, pool, &err) == STATUS_OK && relit_read(out, name, image, &err) == STATUS_OK,
               "%s: %s", text, err.message);
    if (!image->pixel)
        image_init_rgb(image, 8, 8);
    file_remove_tree(out, NULL);
    cJSON_Delete(tree);
    mem_free(name);
    mem_free(text);
}

static void is_near(const struct image *image, int x, int y, rgb wanted, double tolerance, const char *what) {
    const float *p = image->pixel + (size_t)(y * 8 + x) * image->channel_count;
    const float v[3] = {p[0], image->channel_count > 2 ? p[1] : p[0], image->channel_count > 2 ? p[2] : p[0]};
    CHECK_THAT(fabs((double)(v[0] - wanted.r)) < tolerance && fabs((double)(v[1] - wanted.g)) < tolerance &&
                   fabs((double)(v[2] - wanted.b)) < tolerance,
               "%s at %d, %d: %g %g %g, not %g %g %g", what, x, y, (double)v[0], (double)v[1], (double)v[2],
               (double)wanted.r, (double)wanted.g, (double)wanted.b);
}

/* A dark room far around the squares. */
static char *dark_room(void) {
    struct relit_quad walls[6];
    relit_cube(walls, rgb_gray(0.0f), rgb_gray(0.0f));
    for (int i = 0; i < 6; i++) {
        walls[i].corner = vec3_scale(walls[i].corner, 8.0f);
        walls[i].edge1 = vec3_scale(walls[i].edge1, 8.0f);
        walls[i].edge2 = vec3_scale(walls[i].edge2, 8.0f);
    }
    return relit_outputs(walls, 6, VIEW);
}

/* --- tests -------------------------------------------------------------------------------------------------------- */

static void test_gltf(void) {
    static const float color[4][3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {1, 1, 1}};
    static const float gloss[4][3] = {{0, 1, 0}, {0, 1, 1}, {0, 0.2f, 0}, {0, 0.2f, 1}};
    struct image image;
    char *dir = dark_room();
    put_picture(dir, "c.png", color);
    put_picture(dir, "g.png", gloss);
    put_gltf(
        dir, "two.gltf",
        "\"images\":[{\"uri\":\"c.png\"},{\"uri\":\"g.png\"}],"
        "\"samplers\":[{\"wrapS\":33071,\"wrapT\":33071}],"
        "\"textures\":[{\"source\":0,\"sampler\":0},{\"source\":1,\"sampler\":0}],\"materials\":["
        "{\"pbrMetallicRoughness\":{\"baseColorTexture\":{\"index\":0},\"baseColorFactor\":[0.5,1,1,1],"
        "\"metallicRoughnessTexture\":{\"index\":1},\"roughnessFactor\":0.5},\"emissiveTexture\":{\"index\":0},"
        "\"emissiveFactor\":[1,1,1],\"extensions\":{\"KHR_materials_emissive_strength\":{\"emissiveStrength\":4}}},"
        "{\"pbrMetallicRoughness\":{\"baseColorFactor\":[0.1,0.2,0.3,1],\"metallicFactor\":0,"
        "\"roughnessFactor\":0.25},\"normalTexture\":{\"index\":0},\"extensions\":"
        "{\"KHR_materials_clearcoat\":{}}}]");
    pass(dir, "two.gltf", "", "base_color", &image); /* the left square's quarters, then the plain right one */
    is_near(&image, 0, 0, rgb_make(0.5f, 0.0f, 0.0f), 0.03, "base colour");
    is_near(&image, 3, 0, rgb_make(0.0f, 1.0f, 0.0f), 0.03, "base colour");
    is_near(&image, 0, 7, rgb_make(0.0f, 0.0f, 1.0f), 0.03, "base colour");
    is_near(&image, 3, 7, rgb_make(0.5f, 1.0f, 1.0f), 0.03, "base colour");
    is_near(&image, 6, 4, rgb_make(0.1f, 0.2f, 0.3f), 0.002, "base colour");
    CHECK_THAT(strstr(said, "normal maps (1)") && strstr(said, "KHR_materials_clearcoat (1)"), "%s", said);
    image_release(&image);
    pass(dir, "two.gltf", "", "roughness", &image);
    is_near(&image, 0, 0, rgb_gray(0.5f), 0.02, "roughness");
    is_near(&image, 0, 7, rgb_gray(0.1f), 0.02, "roughness");
    is_near(&image, 6, 4, rgb_gray(0.25f), 0.002, "roughness");
    image_release(&image);
    pass(dir, "two.gltf", "", "emission", &image);
    is_near(&image, 0, 0, rgb_make(4.0f, 0.0f, 0.0f), 0.15, "emission");
    is_near(&image, 3, 7, rgb_make(4.0f, 4.0f, 4.0f), 0.15, "emission");
    is_near(&image, 6, 4, rgb_gray(0.0f), 1e-6, "emission");
    image_release(&image);
    pass(dir, "two.gltf", ",\"insert.1.base_color\":\"0.7,0.7,0.7\",\"insert.1.emission_scale\":0.5", "emission",
         &image);
    is_near(&image, 3, 7, rgb_gray(2.0f), 0.1, "half the emission");
    image_release(&image);
    pass(dir, "two.gltf", ",\"insert.1.base_color\":\"0.7,0.7,0.7\"", "base_color", &image);
    is_near(&image, 0, 0, rgb_gray(0.7f), 0.002, "the setting's base colour");
    is_near(&image, 6, 4, rgb_gray(0.7f), 0.002, "the setting's base colour");
    image_release(&image);
    /* The specification's example of KHR_texture_transform: the lower left quarter, which is blue. */
    put_gltf(dir, "turned.gltf",
             "\"images\":[{\"uri\":\"c.png\"}],\"textures\":[{\"source\":0}],\"materials\":[{\"pbrMetallicRoughness\":"
             "{\"baseColorTexture\":{\"index\":0,\"extensions\":{\"KHR_texture_transform\":{\"offset\":[0.125,0.875],"
             "\"rotation\":1.57079632679,\"scale\":[0.25,0.25]}}}}},{}]");
    pass(dir, "turned.gltf", "", "base_color", &image);
    is_near(&image, 1, 4, rgb_make(0.0f, 0.0f, 1.0f), 0.1, "a quarter of the picture");
    is_near(&image, 6, 4, rgb_gray(1.0f), 0.002, "the default of a material");
    image_release(&image);
    relit_remove(dir);
}

static void refused(const char *dir, const char *file, const char *why, const char *hint) {
    char *text = mem_printf("{" COMMON ",\"insert.1.file\":\"%s/%s\"}", dir, file);
    cJSON *tree = cJSON_Parse(text);
    char *out = file_join(dir, "out");
    struct relight_job job = {.outputs = dir, .settings = tree, .out = out};
    err = (struct error){.message = ""};
    CHECK_THAT(relight_run(&job, NULL, pool, &err) == STATUS_INPUT && strstr(err.message, why) &&
                   strstr(err.hint, hint),
               "%s", err.message);
    CHECK(!file_is_in(dir, "out")); /* what is refused leaves no folder */
    mem_free(out);
    cJSON_Delete(tree);
    mem_free(text);
}

static void test_obj(void) {
    static const char obj[] = "mtllib m.mtl\nv -1 -1 0\nv 0 -1 0\nv 0 1 0\nv -1 1 0\nv 1 -1 0\nv 1 1 0\n"
                              "vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nusemtl left\nf 1/1 2/2 3/3 4/4\n"
                              "usemtl right\nf 2 5 6 3\n";
    static const char mtl[] = "newmtl left\nKd 0.8 0.8 0.8\nmap_Kd -clamp on C:\\some where\\c.png\nPr 0.3\nd 0.5\n"
                              "newmtl right\nKd 0.2 0.4 0.6\nKs 0.5 0.5 0.5\nNs 198\nKe 1 2 3\nillum 2\n";
    static const float color[4][3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {1, 1, 1}};
    struct image image;
    char *dir = dark_room();
    put_picture(dir, "c.png", color);
    put_file(dir, "two.obj", obj, strlen(obj));
    pass(dir, "two.obj", ",\"insert.1.base_color\":\"0.3,0.3,0.3\"", "base_color", &image);
    is_near(&image, 0, 0, rgb_gray(0.3f), 0.002, "no library");
    CHECK_THAT(strstr(said, "m.mtl, which is not there"), "%s", said);
    image_release(&image);
    put_file(dir, "m.mtl", mtl, strlen(mtl));
    pass(dir, "two.obj", "", "base_color", &image);
    is_near(&image, 0, 0, rgb_make(0.8f, 0.0f, 0.0f), 0.03, "base colour");
    is_near(&image, 0, 7, rgb_make(0.0f, 0.0f, 0.8f), 0.03, "base colour");
    is_near(&image, 6, 4, rgb_make(0.2f, 0.4f, 0.6f), 0.002, "base colour");
    CHECK_THAT(strstr(said, "transparency (1)"), "%s", said);
    image_release(&image);
    put_file(dir, "bare.obj", "mtllib m.mtl\nv -1 -1 0\nv 0 -1 0\nv 0 1 0\nusemtl left\nf 1 2 3\n", 60);
    pass(dir, "bare.obj", "", "base_color", &image);
    is_near(&image, 3, 5, rgb_gray(0.8f), 0.03, "no texture coordinates");
    CHECK_THAT(strstr(said, "1 triangles have no texture coordinates"), "%s", said);
    image_release(&image);
    pass(dir, "two.obj", "", "roughness", &image);
    is_near(&image, 0, 4, rgb_gray(0.3f), 0.002, "roughness");
    is_near(&image, 6, 4, rgb_gray(powf(0.01f, 0.25f)), 0.002, "roughness of Ns");
    image_release(&image);
    pass(dir, "two.obj", "", "emission", &image);
    is_near(&image, 6, 4, rgb_make(1.0f, 2.0f, 3.0f), 0.01, "emission");
    image_release(&image);
    put_file(dir, "m.mtl", "newmtl left\nmap_Kd gone.png\n", 28);
    refused(dir, "two.obj", "gone.png is not there", "attach.1");
    put_file(dir, "m.mtl", "newmtl left\nKd spectral a.rfl\n", 30);
    refused(dir, "two.obj", "Kd spectral", "");
    relit_remove(dir);
}

/* A picture of four texels on a thousand pieces, each of which needs texels of its own. */
static void test_pieces(void) {
    static const float red[4][3] = {{1, 0, 0}, {1, 0, 0}, {1, 0, 0}, {1, 0, 0}};
    struct image image;
    struct buf text;
    char *dir = dark_room();
    put_picture(dir, "r.png", red);
    put_file(dir, "r.mtl", "newmtl r\nmap_Kd r.png\n", 22);
    buf_init(&text, 1 << 20);
    buf_printf(&text, "mtllib r.mtl\nvt 0 0\nvt 1 0\nvt 0 1\nusemtl r\n");
    for (int i = 0; i < 1000; i++)
        buf_printf(&text, "v -1 -1 %g\nv 1 -1 %g\nv -1 1 %g\nf -3/1 -2/2 -1/3\n", -0.001 * i, -0.001 * i, -0.001 * i);
    put_file(dir, "pieces.obj", text.data, text.length);
    pass(dir, "pieces.obj", "", "base_color", &image);
    is_near(&image, 1, 6, rgb_make(1.0f, 0.0f, 0.0f), 0.02, "one of many pieces");
    image_release(&image);
    buf_release(&text);
    relit_remove(dir);
}

/* Mean of a render from the middle of the plane. */
static double lit_plane(const char *dir, const char *more) {
    struct image image;
    char *text = mem_printf("{" COMMON ",\"spp\":1024,\"max_depth\":2%s}", more);
    CHECK_THAT(relit_picture(dir, text, pool, &image, &err) == STATUS_OK, "%s", err.message);
    double mean = image.pixel ? relit_mean(&image) : 0.0;
    image_release(&image);
    mem_free(text);
    return mean;
}

/* Over a plane at z = 0 hangs a square of 2 x 2 at z = 3 that shines down: as a lamp, and as a file of an even
 * picture. */
static void test_emission(void) {
    static const float white[4][3] = {{1, 1, 1}, {1, 1, 1}, {1, 1, 1}, {1, 1, 1}};
    const struct relit_quad plane = {{-5, -5, 0}, {10, 0, 0}, {0, 10, 0}, {0.5f, 0.5f, 0.5f}, {0, 0, 0}, 0.5f, 0.0f};
    char *dir = relit_outputs(&plane, 1, VIEW);
    put_picture(dir, "w.png", white);
    put_gltf(dir, "lamp.gltf",
             "\"images\":[{\"uri\":\"w.png\"}],\"textures\":[{\"source\":0}],\"materials\":["
             "{\"emissiveTexture\":{\"index\":0},\"emissiveFactor\":[3,3,3],\"pbrMetallicRoughness\":"
             "{\"baseColorFactor\":[0,0,0,1]}},{\"emissiveFactor\":[3,3,3],\"pbrMetallicRoughness\":"
             "{\"baseColorFactor\":[0,0,0,1]}}]");
    /* turned by half a turn it faces -z */
    char *insert =
        mem_printf(",\"insert.1.file\":\"%s/lamp.gltf\",\"insert.1.position\":\"0,0,3\",\"insert.1.turn\":180", dir);
    double found = lit_plane(dir, insert),
           lamp = lit_plane(dir, ",\"lamp.1.kind\":\"area\",\"lamp.1.position\":\"0,0,3\","
                                 "\"lamp.1.direction\":\"0,0,-1\",\"lamp.1.size\":\"2,2\","
                                 "\"lamp.1.radiance\":\"3,3,3\"");
    CHECK_THAT(lamp > 0.0 && fabs(found / lamp - 1.0) < 0.01, "an inserted lamp gives %g, an added one %g", found,
               lamp);
    mem_free(insert);
    relit_remove(dir);
}

/* Walls of radiance 1 around a mirror of perfect and of coloured metal: it shows 1 and its colour. Rough metal of white
 * loses what is scattered more than once; a dielectric of albedo .5 at normal incidence is between. */
static void test_furnace(void) {
    struct relit_quad walls[6];
    struct image image;
    relit_cube(walls, rgb_gray(0.0f), rgb_gray(1.0f));
    for (int i = 0; i < 6; i++) {
        walls[i].corner = vec3_scale(walls[i].corner, 4.0f);
        walls[i].edge1 = vec3_scale(walls[i].edge1, 4.0f);
        walls[i].edge2 = vec3_scale(walls[i].edge2, 4.0f);
    }
    char *dir = relit_outputs(walls, 6, VIEW);
    put_gltf(dir, "metal.gltf",
             "\"materials\":[{\"pbrMetallicRoughness\":{\"roughnessFactor\":0,\"metallicFactor\":1}},"
             "{\"pbrMetallicRoughness\":{\"roughnessFactor\":0,\"metallicFactor\":1,"
             "\"baseColorFactor\":[0.9,0.5,0.1,1]}}]");
    pass(dir, "metal.gltf", ",\"spp\":64", "radiance", &image);
    is_near(&image, 2, 4, rgb_gray(1.0f), 2e-3, "a mirror");
    is_near(&image, 5, 4, rgb_make(0.9f, 0.5f, 0.1f), 5e-3, "a coloured mirror"); /* nearly at normal incidence */
    image_release(&image);
    pass(dir, "metal.gltf", ",\"spp\":1024,\"insert.1.roughness\":0.5", "radiance", &image);
    float rough = image.pixel[3 * (4 * 8 + 2)];
    CHECK_THAT(fabsf(rough - 0.9155f) < 0.02f, "rough metal: %g", (double)rough); /* by integration, alpha = 1/4 */
    image_release(&image);
    pass(dir, "metal.gltf",
         ",\"spp\":4096,\"insert.1.metallic\":0.5,\"insert.1.specular\":0,\"insert.1.roughness\":0.3", "radiance",
         &image);
    const float *p = image.pixel + 3 * (4 * 8 + 5);
    CHECK_THAT(fabsf(p[0] - 0.9f) < 0.04f && fabsf(p[1] - 0.5f) < 0.03f, "half a metal: %g %g", (double)p[0],
               (double)p[1]);
    image_release(&image);
    relit_remove(dir);
}

int main(void) {
    pool = parallel_new(1);
    test_gltf();
    test_obj();
    test_pieces();
    test_emission();
    test_furnace();
    parallel_free(pool);
    return check_result();
}
