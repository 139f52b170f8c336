/* Objects of OBJ and glTF files: their names, and materials that are only pages of a texture. */
#include "server/ingest/mesh/texture_pages.h"

#include "common/file.h"
#include "common/mem.h"
#include "server/ingest/mesh/gltf.h"
#include "server/ingest/mesh/mesh_file.h"
#include "server/ingest/mesh/obj.h"
#include "tests/check.h"

#define TEXT(...) ((const char *const[]){__VA_ARGS__})
#define COUNT(...) (sizeof(const char *const[]){__VA_ARGS__} / sizeof(char *))
#define BY_NAME(...) texture_pages_by_name(TEXT(__VA_ARGS__), COUNT(__VA_ARGS__))
#define NUMBERED(...) texture_pages_are_numbered(TEXT(__VA_ARGS__), COUNT(__VA_ARGS__))

static void test_names(void) {
    CHECK(BY_NAME("material_0000", "material_0002", "material_0001"));
    CHECK(BY_NAME("odm_textured_model_geo_material0000", "odm_textured_model_geo_material0001"));
    CHECK(BY_NAME("tex_u1001", "tex_u1002") == false && BY_NAME("Texture 1001", "Texture 1002"));
    CHECK(!BY_NAME("material_0") && !BY_NAME("material_0", "material_2") && !BY_NAME("material_0", "material_0"));
    CHECK(!BY_NAME("chair_0", "chair_1") && !BY_NAME("material_0", "other_material_1"));
    CHECK(!BY_NAME("Material.001", "Material.002") && !BY_NAME("", "material_1") && !BY_NAME("material", "material_1"));
    CHECK(NUMBERED("scan_0_map_Kd.jpg", "scan_1_map_Kd.jpg") && NUMBERED("a_u1_v1.png", "a_u12_v1.png"));
    CHECK(!NUMBERED("wood.jpg", "wall.jpg") && !NUMBERED("a1.jpg", "a1.jpg") && !NUMBERED("a1.jpg"));
    CHECK(!NUMBERED("a1.jpg", "a1.png") && !NUMBERED("a.jpg", "a.jpg"));
}

static size_t pictures; /* of the last MTL */

static enum texture_pages by_mtl(const char *mtl) {
    return texture_pages_by_mtl(mtl, strlen(mtl), TEXT("a", "b c"), 2, &pictures);
}

static void test_mtl(void) {
    CHECK(
        by_mtl(
            "# x\r\nnewmtl a\r\n Kd 1 1 1\r\n\tmap_Kd t0.jpg\r\nnewmtl b c \r\nmap_Bump n1.jpg\r\nKd 1 1 1\r\nmap_Kd t1.jpg") ==
        TEXTURE_PAGES_YES);
    CHECK(by_mtl("newmtl a\nKd 1 1 1\nmap_Kd t0.jpg\nnewmtl b c\nKd 1 0 1\nmap_Kd t1.jpg\n") == TEXTURE_PAGES_NO);
    CHECK(by_mtl("newmtl a\nmap_Kd wood.jpg\nnewmtl b c\nmap_Kd wall.jpg\n") == TEXTURE_PAGES_NO);
    CHECK(by_mtl("newmtl a\nmap_Kd t0.jpg\nnewmtl b c\n") == TEXTURE_PAGES_NO);
    CHECK(by_mtl("newmtl a\nmap_Kd t0.jpg\nnewmtl c\nmap_Kd t1.jpg\n") == TEXTURE_PAGES_UNKNOWN);
    CHECK(by_mtl("") == TEXTURE_PAGES_UNKNOWN && by_mtl("newmtl") == TEXTURE_PAGES_UNKNOWN);
}

/* --- OBJ ------------------------------------------------------------------------------------ */

#define POINTS "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n"

static struct faces_report report;

static void take_obj(const char *text, const char *folder, struct mesh *mesh) {
    struct error err = {.message = ""};
    enum status status = obj_parse(text, strlen(text), "a.obj", folder, 99, mesh, NULL, &report, &err);
    CHECK_THAT(status == STATUS_OK, "%s", err.message);
}

static void check_names(const struct mesh *mesh, size_t count, const char *const *wanted) {
    CHECK_THAT(mesh->name_count == count, "%zu", mesh->name_count);
    for (size_t i = 0; i < count && i < mesh->name_count; i++)
        CHECK_STRING(mesh->name[i], wanted[i]);
}

static void test_obj(void) {
    char folder[] = "/tmp/unbake-pages-XXXXXX";
    struct mesh mesh;
    CHECK(mkdtemp(folder) != NULL);
    take_obj(POINTS "o wall\nusemtl paint\nf 1 2 3\nusemtl glass \nf 1 3 4\no lamp\ng lamp\nf 1 2 4\n", NULL, &mesh);
    check_names(&mesh, 3, TEXT("wall/paint", "wall/glass", "lamp/glass"));
    CHECK_STRING(mesh_object_name(&mesh, 2), "lamp/glass");
    CHECK(!mesh_object_name(&mesh, 3) && !mesh_object_name(&mesh, -1) && report.note_count == 0);
    mesh_release(&mesh);
    take_obj(POINTS "usemtl material_0000\nf 1 2 3\nusemtl material_0001\nf 1 3 4\n", NULL, &mesh);
    CHECK(!mesh.object_id && mesh.name_count == 0 && report.note_count == 1);
    CHECK_STRING(report.note[0],
                 "its 2 materials (material_0000, ...) are pages of a texture: they do not divide it into segments");
    mesh_release(&mesh);
    /* objects stay; a group for each page does not */
    take_obj(POINTS
             "o wall\ng g0\nusemtl tex_1\nf 1 2 3\ng g1\nusemtl tex_2\nf 1 3 4\no lamp\ng g0\nusemtl tex_1\nf 1 2 4\n",
             NULL, &mesh);
    check_names(&mesh, 2, TEXT("wall", "lamp"));
    CHECK(mesh.object_id && mesh.object_id[0] == 0 && mesh.object_id[1] == 0 && mesh.object_id[2] == 1);
    mesh_release(&mesh);
    /* the library knows better than the names */
    char *path = file_join(folder, "my lib.mtl");
#define WITH_LIBRARY POINTS "mtllib my lib.mtl\nusemtl material_0\nf 1 2 3\nusemtl material_1\nf 1 3 4\n"
    const char *mtl = "newmtl material_0\nKd 1 0 0\nnewmtl material_1\nKd 0 1 0\n";
    CHECK(file_replace(path, mtl, strlen(mtl), NULL) == STATUS_OK);
    take_obj(WITH_LIBRARY, folder, &mesh);
    check_names(&mesh, 2, TEXT("material_0", "material_1"));
    mesh_release(&mesh);
    take_obj(WITH_LIBRARY, NULL, &mesh);
    CHECK(!mesh.object_id);
    mesh_release(&mesh);
    take_obj(POINTS "mtllib ../my lib.mtl\nusemtl a\nf 1 2 3\nusemtl b\nf 1 3 4\n", folder, &mesh);
    CHECK(mesh.object_id != NULL);
    mesh_release(&mesh);
    mem_free(path);
    CHECK(file_remove_tree(folder, NULL) == STATUS_OK);
}

/* --- glTF ----------------------------------------------------------------------------------- */

/* A triangle in the buffer. */
#define GLTF(materials, meshes, nodes)                                                                                      \
    "{\"asset\":{\"version\":\"2.0\"},\"buffers\":[{\"byteLength\":36,\"uri\":\"data:;base64,"                              \
    "AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAA\"}],\"bufferViews\":[{\"buffer\":0,\"byteLength\":36}],"              \
    "\"accessors\":[{\"bufferView\":0,\"componentType\":5126,\"count\":3,\"type\":\"VEC3\"}],\"textures\":[{\"source\":0}," \
    "{\"source\":1}],\"images\":[{\"name\":\"t0\"},{\"name\":\"t1\"}],\"materials\":[" materials                            \
    "],\"meshes\":[" meshes "],\"nodes\":[" nodes "]}"
#define PART(material) "{\"attributes\":{\"POSITION\":0},\"material\":" #material "}"
#define TEXTURED(name, texture)                                                                                        \
    "{\"name\":\"" name "\",\"pbrMetallicRoughness\":{\"baseColorTexture\":{\"index\":" #texture "}}}"

static void take_gltf(const char *text, struct mesh *mesh) {
    struct error err = {.message = ""};
    enum status status = gltf_parse(text, strlen(text), "a.gltf", NULL, 99, mesh, NULL, &report, &err);
    CHECK_THAT(status == STATUS_OK, "%s", err.message);
}

static void test_gltf(void) {
    struct mesh mesh;
    take_gltf(GLTF("{\"name\":\"paint\"},{}", "{\"name\":\"m\",\"primitives\":[" PART(0) "," PART(1) "]}",
                   "{\"name\":\"wall\",\"mesh\":0},{\"mesh\":0}"),
              &mesh);
    check_names(&mesh, 4, TEXT("wall/paint", "wall", "m/paint", "m"));
    mesh_release(&mesh);
    /* pages in one mesh, two copies of it */
    take_gltf(GLTF(TEXTURED("a", 0) "," TEXTURED("b", 1), "{\"primitives\":[" PART(0) "," PART(1) "]}",
                   "{\"name\":\"x\",\"mesh\":0},{\"name\":\"y\",\"mesh\":0}"),
              &mesh);
    CHECK(mesh.triangle_count == 4 && report.note_count == 1 && strstr(report.note[0], "pages of a texture"));
    check_names(&mesh, 2, TEXT("x", "y"));
    mesh_release(&mesh);
    /* a node for each page */
    take_gltf(GLTF(TEXTURED("a", 0) "," TEXTURED("b", 1),
                   "{\"primitives\":[" PART(0) "]},{\"primitives\":[" PART(1) "]}",
                   "{\"name\":\"x\",\"mesh\":0},{\"name\":\"y\",\"mesh\":1}"),
              &mesh);
    CHECK(!mesh.object_id && mesh.name_count == 0 && report.note_count == 1);
    mesh_release(&mesh);
    /* they differ in more than the picture */
    take_gltf(
        GLTF(TEXTURED("a", 0) ",{\"pbrMetallicRoughness\":{\"baseColorTexture\":{\"index\":1},\"metallicFactor\":0}}",
             "{\"primitives\":[" PART(0) "," PART(1) "]}", "{\"mesh\":0}"),
        &mesh);
    CHECK(mesh.object_id && mesh.object_id[1] == 1 && report.note_count == 0);
    mesh_release(&mesh);
}

/* The bundle of the shared data. */
static void test_capture(void) {
    const char *root = getenv("UNBAKE_TEST_DATA");
    char path[1024];
    struct mesh mesh;
    struct error err = {.message = ""};
    snprintf(path, sizeof path, "%s/captures/obj_atlas_pages/m.obj", root ? root : "../shared/data");
    if (access(path, R_OK) != 0)
        return;
    CHECK_THAT(mesh_file_read(path, "m.obj", 1 << 20, &mesh, &report, &err) == STATUS_OK, "%s", err.message);
    CHECK(!mesh.object_id && report.note_count == 1);
    mesh_release(&mesh);
}

int main(void) {
    test_names();
    test_mtl();
    test_obj();
    test_gltf();
    test_capture();
    return check_result();
}
