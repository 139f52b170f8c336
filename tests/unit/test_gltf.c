/* The glTF reader: what it takes, what it refuses and where it says the fault lies. */
#include "server/ingest/mesh/gltf.h"
#include "server/ingest/mesh/mesh_file.h"

#include "common/buf.h"
#include "common/file.h"
#include "common/mem.h"
#include "tests/check.h"

/* Six points, their normals (all +x), indices 0 to 5 in 16 bits, the same in 8 bits. */
static const float points[6][3] = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {1, 1, 0}, {0, 2, 0}, {1, 2, 3}};
static const float normals[6][3] = {{1, 0, 0}, {1, 0, 0}, {1, 0, 0}, {1, 0, 0}, {1, 0, 0}, {1, 0, 0}};
static const uint16_t shorts[6] = {0, 1, 2, 3, 4, 5};
static const uint8_t bytes[6] = {5, 4, 3, 2, 1, 0};

#define ASSET "\"asset\":{\"version\":\"2.0\"}"
#define BUFFER "\"buffers\":[{\"byteLength\":164}]"
#define VIEWS                                                                                                          \
    "\"bufferViews\":[{\"buffer\":0,\"byteLength\":144,\"byteStride\":12},"                                            \
    "{\"buffer\":0,\"byteOffset\":144,\"byteLength\":20}]"
#define ACCESSORS                                                                                                      \
    "\"accessors\":[{\"bufferView\":0,\"componentType\":5126,\"count\":6,\"type\":\"VEC3\"},"                          \
    "{\"bufferView\":0,\"byteOffset\":72,\"componentType\":5126,\"count\":6,\"type\":\"VEC3\"},"                       \
    "{\"bufferView\":1,\"componentType\":5123,\"count\":6,\"type\":\"SCALAR\"},"                                       \
    "{\"bufferView\":1,\"byteOffset\":12,\"componentType\":5121,\"count\":6,\"type\":\"SCALAR\"}]"
#define TABLES ASSET "," BUFFER "," VIEWS "," ACCESSORS ","
#define MESH(primitives) "\"meshes\":[{\"primitives\":[" primitives "]}]"
#define BARE "{\"attributes\":{\"POSITION\":0}}"
#define ALL "{\"attributes\":{\"POSITION\":0,\"NORMAL\":1},\"indices\":2}"
#define NODE "\"nodes\":[{\"mesh\":0}]"
#define WHOLE(mesh, nodes) "{" TABLES mesh "," nodes "}"

/* One point, and a triangle of the accessors and the view. */
#define POINTS(count) "{\"bufferView\":0,\"componentType\":5126,\"count\":" #count ",\"type\":\"VEC3\"}"
#define WITH(view, accessors, primitive)                                                                               \
    "{" ASSET "," BUFFER ",\"bufferViews\":[" view "],\"accessors\":[" accessors "]," MESH(primitive) "," NODE "}"

static void put_word(struct buf *out, uint32_t value) { buf_append(out, &value, 4); }

static void put_data(struct buf *out) {
    buf_append(out, points, sizeof points);
    buf_append(out, normals, sizeof normals);
    buf_append(out, shorts, sizeof shorts);
    buf_append(out, bytes, sizeof bytes);
    buf_append(out, "\0\0", 2);
}

static void make_glb(struct buf *out, const char *json) {
    size_t length = strlen(json), padding = (4 - length % 4) % 4;
    buf_init(out, 1 << 20);
    buf_append(out, "glTF\2\0\0\0", 8);
    put_word(out, (uint32_t)(12 + 8 + length + padding + 8 + 164));
    put_word(out, (uint32_t)(length + padding));
    buf_append(out, "JSON", 4);
    buf_append(out, json, length);
    buf_append(out, "   ", padding);
    put_word(out, 164);
    buf_append(out, "BIN\0", 4);
    put_data(out);
}

static enum status parse(const char *json, struct mesh *mesh, struct error *err) {
    struct buf file;
    make_glb(&file, json);
    enum status status = gltf_parse(file.data, file.length, "room.glb", NULL, 1000, mesh, NULL, NULL, err);
    buf_release(&file);
    return status;
}

static void take(const char *json, struct mesh *mesh) {
    struct error err = {.message = ""};
    CHECK_THAT(parse(json, mesh, &err) == STATUS_OK, "%s: %s", err.message, json);
}

/* Corner k of a triangle. */
static vec3 corner(const struct mesh *mesh, size_t triangle, int k) {
    return triangle < mesh->triangle_count ? mesh->position[mesh->index[triangle][k]] : (vec3){NAN, NAN, NAN};
}

static bool is(vec3 v, float x, float y, float z) {
    return fabsf(v.x - x) < 1e-6f && fabsf(v.y - y) < 1e-6f && fabsf(v.z - z) < 1e-6f;
}

static void test_modes(void) {
    struct mesh mesh;
    take(WHOLE(MESH(BARE), NODE), &mesh);
    CHECK(mesh.triangle_count == 2 && mesh.vertex_count == 6 && mesh.face_count == 2);
    CHECK(!mesh.normal && !mesh.object_id && mesh.face[1] == 1);
    CHECK(is(corner(&mesh, 1, 2), 1, 2, 3));
    mesh_release(&mesh);
    take(WHOLE(MESH("{\"mode\":5,\"attributes\":{\"POSITION\":0},\"indices\":2}"), NODE), &mesh);
    CHECK(mesh.triangle_count == 4);
    for (size_t t = 0; t < 3 && t < mesh.triangle_count; t++) /* a strip's triangles all face one way */
        CHECK(mesh_cross(&mesh, t).z > 0.0f);
    mesh_release(&mesh);
    take(WHOLE(MESH("{\"mode\":6,\"attributes\":{\"POSITION\":0},\"indices\":3}"), NODE), &mesh);
    CHECK(mesh.triangle_count == 4 && is(corner(&mesh, 0, 2), 1, 2, 3) && is(corner(&mesh, 3, 2), 1, 2, 3));
    CHECK(is(corner(&mesh, 0, 0), 0, 2, 0) && is(corner(&mesh, 3, 1), 0, 0, 0));
    mesh_release(&mesh);
    take(WHOLE(MESH("{\"mode\":1,\"attributes\":{\"POSITION\":7}}," ALL), NODE), &mesh); /* lines are skipped */
    CHECK(mesh.triangle_count == 2 && mesh.normal && mesh.normal[4].x == 1.0f);
    mesh_release(&mesh);
}

static void test_transforms(void) {
    struct mesh mesh;
    /* moved and turned by 90 degrees around z within a node scaled by 2 */
    take(
        WHOLE(MESH(ALL),
              "\"nodes\":[{\"children\":[1],\"scale\":[2,2,2]},{\"mesh\":0,\"translation\":[10,0,0],"
              "\"rotation\":[0,0,0.7071067811865476,0.7071067811865476]}],\"scenes\":[{},{\"nodes\":[0]}],\"scene\":1"),
        &mesh);
    CHECK(is(corner(&mesh, 0, 1), 20, 2, 0) && is(corner(&mesh, 0, 2), 18, 0, 0));
    CHECK(mesh.normal && mesh.normal[0].y > 0.0f && fabsf(mesh.normal[0].x) < 1e-6f);
    mesh_release(&mesh);
    /* a mirror turns the corners round, and the normals stay in front of the surface */
    take(WHOLE(MESH(ALL), "\"nodes\":[{\"mesh\":0,\"matrix\":[-1,0,0,0,0,1,0,0,0,0,1,0,0,0,5,1]}]"), &mesh);
    CHECK(is(corner(&mesh, 0, 2), 0, 0, 5) && is(corner(&mesh, 0, 1), -1, 0, 5) && is(corner(&mesh, 0, 0), 0, 1, 5));
    CHECK(mesh_cross(&mesh, 0).z > 0.0f);
    CHECK(mesh.normal && mesh.normal[0].x == -1.0f);
    mesh_release(&mesh);
    /* a shear turns normals by its inverse transpose */
    take(WHOLE(MESH(ALL), "\"nodes\":[{\"mesh\":0,\"matrix\":[1,0,0,0,1,1,0,0,0,0,1,0,0,0,0,1]}]"), &mesh);
    CHECK(mesh.normal && mesh.normal[0].x == 1.0f && mesh.normal[0].y == -1.0f);
    mesh_release(&mesh);
}

/* Nodes times materials; vertices that are not used are left away. */
static void test_objects(void) {
    static const int64_t wanted[] = {0, 0, 1, 1, 2, 2, 3, 3, 4, 4, 5, 5};
    struct mesh mesh;
    take(WHOLE(MESH(BARE ",{\"attributes\":{\"POSITION\":0},\"material\":0},{\"attributes\":{\"POSITION\":0},"
                         "\"material\":1}"),
               "\"nodes\":[{\"mesh\":0,\"children\":[1]},{\"mesh\":0}]"),
         &mesh);
    CHECK(mesh.triangle_count == 12 && mesh.object_id && memcmp(mesh.object_id, wanted, sizeof wanted) == 0);
    CHECK(mesh.vertex_count == 36);
    mesh_release(&mesh);
    take("{" ASSET "," BUFFER "," VIEWS ",\"accessors\":[{\"bufferView\":0,\"componentType\":5126,\"count\":6,"
         "\"type\":\"VEC3\"},{\"bufferView\":1,\"byteOffset\":6,\"componentType\":5123,\"count\":3,\"type\":"
         "\"SCALAR\"}]," MESH("{\"attributes\":{\"POSITION\":0},\"indices\":1}") "," NODE "}",
         &mesh);
    CHECK(mesh.vertex_count == 3 && mesh.triangle_count == 1 && is(mesh.position[2], 1, 2, 3));
    mesh_release(&mesh);
}

/* Buffers in the JSON and beside it. */
static void test_buffers(void) {
    char dir[] = "/tmp/unbake-gltf-XXXXXX";
    struct buf data;
    struct mesh mesh;
    struct error err = {.message = ""};
    CHECK(mkdtemp(dir) != NULL);
    char *bin = file_join(dir, "a b.bin"), *path = file_join(dir, "room.gltf");
    buf_init(&data, 1 << 16);
    put_data(&data);
    CHECK(file_replace(bin, data.data, data.length, NULL) == STATUS_OK);
    const char *json = "{" ASSET ",\"buffers\":[{\"byteLength\":164,\"uri\":\"./a%20b.bin\"}]," VIEWS "," ACCESSORS
                       "," MESH(ALL) "," NODE "}";
    CHECK(file_replace(path, json, strlen(json), NULL) == STATUS_OK);
    CHECK_THAT(mesh_file_read(path, "room.gltf", 1000, &mesh, NULL, &err) == STATUS_OK, "%s", err.message);
    CHECK(mesh.triangle_count == 2 && is(corner(&mesh, 1, 2), 1, 2, 3));
    mesh_release(&mesh);
    CHECK(gltf_parse(json, strlen(json), "room.gltf", NULL, 1000, &mesh, NULL, NULL, &err) == STATUS_INPUT);
    unlink(bin);
    CHECK(mesh_file_read(path, "room.gltf", 1000, &mesh, NULL, &err) == STATUS_INPUT);
    CHECK_STRING(err.message, "room.gltf names the buffer a b.bin, which is not in the bundle");
    /* three points: 0 0 0, 1 0 0, 0 1 0 */
    json =
        "{" ASSET ",\"buffers\":[{\"byteLength\":36,\"uri\":\"data:application/octet-stream;base64,"
        "AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAA\"}],\"bufferViews\":[{\"buffer\":0,\"byteLength\":36}],"
        "\"accessors\":[{\"bufferView\":0,\"componentType\":5126,\"count\":3,\"type\":\"VEC3\"}]," MESH(BARE) "," NODE
                                                                                                              "}";
    CHECK_THAT(gltf_parse(json, strlen(json), "room.gltf", NULL, 1000, &mesh, NULL, NULL, &err) == STATUS_OK, "%s",
               err.message);
    CHECK(is(corner(&mesh, 0, 1), 1, 0, 0) && is(corner(&mesh, 0, 2), 0, 1, 0));
    mesh_release(&mesh);
    CHECK(mesh_file_read("/nowhere/room.glb", "room.glb", 9, &mesh, NULL, &err) == STATUS_NOT_FOUND);
    buf_release(&data);
    mem_free(bin);
    mem_free(path);
    CHECK(file_remove_tree(dir, NULL) == STATUS_OK);
}

static const struct {
    const char *json, *part;
} bad[] = {
    {"", "not JSON"},
    {"{}", "not glTF 2.0"},
    {"{\"asset\":{\"version\":\"1.0\"}}", "\"1.0\""},
    {"{" ASSET "}", "no triangles"},
    {"{" ASSET ",\"nodes\":{}}", "\"nodes\" must be an array"},
    {"{" ASSET ",\"nodes\":[3]}", "nodes[0] must be an object"},
    {"{" ASSET ",\"extensionsRequired\":[\"KHR_materials_unlit\",\"KHR_draco_mesh_compression\"]}", "KHR_draco"},
    {"{" ASSET ",\"nodes\":[{\"children\":[0]}]}", "no triangles"}, /* no root */
    {"{" ASSET ",\"nodes\":[{\"children\":[0]}],\"scenes\":[{\"nodes\":[0]}]}", "more than one parent"},
    {"{" ASSET ",\"nodes\":[{\"children\":[1]},{}],\"scenes\":[{\"nodes\":[0,1]}]}", "nodes[1] has more than one"},
    {"{" ASSET ",\"nodes\":[{\"children\":[9]}]}", "a child of nodes[0] is none of the 1 nodes"},
    {"{" ASSET ",\"nodes\":[{}],\"scenes\":[{\"nodes\":[0.5]}]}", "a node of the scene"},
    {"{" ASSET ",\"nodes\":[{}],\"scenes\":[{}],\"scene\":1}", "the file.scene is none of the 1 scenes"},
    {WHOLE(MESH(BARE), "\"nodes\":[{\"mesh\":1}]"), "nodes[0].mesh is none of the 1 meshes"},
    {WHOLE(MESH(BARE), "\"nodes\":[{\"mesh\":\"a\"}]"), "nodes[0].mesh"},
    {WHOLE(MESH(BARE), "\"nodes\":[{\"mesh\":0,\"scale\":[1,2]}]"), "nodes[0].scale is not 3 numbers"},
    {WHOLE(MESH(BARE), "\"nodes\":[{\"mesh\":0,\"matrix\":[1,0,0,0,0,1,0,0,0,0,1,0,0,0,null,1]}]"), "16 numbers"},
    {WHOLE(MESH("{\"attributes\":{}}"), NODE), "meshes[0].primitives[0] has no POSITION"},
    {WHOLE(MESH("{\"attributes\":{\"POSITION\":2}}"), NODE), "accessors[2] is of type SCALAR, wanted is VEC3"},
    {WHOLE(MESH("{\"attributes\":{\"POSITION\":0},\"indices\":0}"), NODE), "accessors[0] is of type VEC3"},
    {WHOLE(MESH("{\"attributes\":{\"POSITION\":0},\"indices\":4}"), NODE), "indices is none of the 4 accessors"},
    {WHOLE(MESH("{\"attributes\":{\"POSITION\":0},\"extensions\":{\"KHR_draco_mesh_compression\":{}}}"), NODE),
     "Draco"},
    {"{" ASSET "," BUFFER "," VIEWS ",\"accessors\":[{\"bufferView\":0,\"componentType\":5125,\"count\":6,\"type\":"
     "\"VEC3\"}]," MESH(BARE) "," NODE "}",
     "holds neither floats nor short integers"},
    {"{" ASSET "," BUFFER "," VIEWS ",\"accessors\":[{\"bufferView\":0,\"componentType\":5124,\"count\":6,\"type\":"
     "\"VEC3\"}]," MESH(BARE) "," NODE "}",
     "componentType is none"},
    {"{" ASSET "," BUFFER "," VIEWS ",\"accessors\":[{\"bufferView\":0,\"componentType\":5126,\"count\":13,\"type\":"
     "\"VEC3\"}]," MESH(BARE) "," NODE "}",
     "promises 13 elements, but its bufferView holds 12"},
    {"{" ASSET "," BUFFER "," VIEWS ",\"accessors\":[{\"bufferView\":0,\"componentType\":5126,\"count\":0,\"type\":"
     "\"VEC3\"}]," MESH(BARE) "," NODE "}",
     "accessors[0].count is not a whole number from 1"},
    {"{" ASSET "," BUFFER "," VIEWS
     ",\"accessors\":[{\"componentType\":5126,\"count\":6,\"type\":\"VEC3\"}]," MESH(BARE) "," NODE "}",
     "accessors[0] has no bufferView"},
    {"{" ASSET "," BUFFER "," VIEWS ",\"accessors\":[{\"bufferView\":0,\"sparse\":{},\"componentType\":5126,"
     "\"count\":6,\"type\":\"VEC3\"}]," MESH(BARE) "," NODE "}",
     "sparse"},
    {"{" ASSET "," BUFFER ",\"bufferViews\":[{\"buffer\":0,\"byteOffset\":100,\"byteLength\":72}]," ACCESSORS
     "," MESH(BARE) "," NODE "}",
     "does not lie within the 164 bytes of buffers[0]"},
    {"{" ASSET "," BUFFER ",\"bufferViews\":[{\"buffer\":0,\"byteLength\":72,\"byteStride\":8}]," ACCESSORS
     "," MESH(BARE) "," NODE "}",
     "byteStride is not a whole number from 12"},
    {"{" ASSET "," BUFFER ",\"bufferViews\":[{\"byteLength\":72}]," ACCESSORS "," MESH(BARE) "," NODE "}", "no buffer"},
    {"{" ASSET ",\"buffers\":[{\"uri\":\"data:x;base64,!!\"}]," VIEWS "," ACCESSORS "," MESH(BARE) "," NODE "}",
     "base64"},
    {"{" ASSET ",\"buffers\":[{\"uri\":\"../a.bin\"}]," VIEWS "," ACCESSORS "," MESH(BARE) "," NODE "}", ".."},
    {"{" ASSET ",\"extensionsRequired\":[3]}", "requires the extension (not a name)"},
    {WHOLE(MESH(BARE), "\"nodes\":[{\"mesh\":0,\"translation\":[1,2,3,4]}]"), "nodes[0].translation is not 3 numbers"},
    {WHOLE(MESH(BARE), "\"nodes\":[{\"mesh\":0,\"rotation\":[0,0,0]}]"), "nodes[0].rotation is not 4 numbers"},
    {WHOLE(MESH("{\"attributes\":{\"POSITION\":0,\"NORMAL\":9}}"), NODE),
     "primitives[0].NORMAL is none of the 4 accessors"},
    {WITH("{\"buffer\":0,\"byteLength\":144}", POINTS(6) "," POINTS(5),
          "{\"attributes\":{\"POSITION\":0,\"NORMAL\":1}}"),
     "meshes[0].primitives[0] has 6 positions and 5 normals"},
    {WITH("{\"buffer\":0,\"byteLength\":144}",
          POINTS(6) ",{\"bufferView\":0,\"componentType\":5126,\"count\":3,\"type\":\"SCALAR\"}",
          "{\"attributes\":{\"POSITION\":0},\"indices\":1}"),
     "the indices of meshes[0].primitives[0] are not unsigned integers"},
    {WITH("{\"buffer\":0,\"byteLength\":144}", /* a float as an index, as its bits say */
          POINTS(6) ",{\"bufferView\":0,\"componentType\":5125,\"count\":6,\"type\":\"SCALAR\"}",
          "{\"attributes\":{\"POSITION\":0},\"indices\":1}"),
     "refers to vertex 1065353216, but there are 6"},
    {WITH("{\"buffer\":0,\"byteLength\":4}", POINTS(1), BARE), "promises 1 elements, but its bufferView holds 0"},
    {WITH("{\"buffer\":0,\"byteOffset\":0.5,\"byteLength\":144}", POINTS(6), BARE),
     "bufferViews[0].byteOffset is not a whole"},
    {WITH("{\"buffer\":0}", POINTS(6), BARE), "bufferViews[0].byteLength is not a whole number from 0"},
    {WITH("{\"buffer\":1,\"byteLength\":144}", POINTS(6), BARE), "bufferViews[0].buffer is none of the 1 buffers"},
    {"{" ASSET "," BUFFER "," VIEWS
     ",\"accessors\":[{\"bufferView\":0,\"byteOffset\":-1,\"componentType\":5126,\"count\":6,"
     "\"type\":\"VEC3\"}]," MESH(BARE) "," NODE "}",
     "accessors[0].byteOffset is not a whole number from 0"},
    {"{" ASSET "," BUFFER "," VIEWS
     ",\"accessors\":[{\"bufferView\":0,\"componentType\":1,\"count\":6,\"type\":\"VEC3\"}]," MESH(BARE) "," NODE "}",
     "accessors[0].componentType is not a whole number from 5120 to 5126"},
    {"{" ASSET "," BUFFER "," VIEWS
     ",\"accessors\":[{\"bufferView\":2,\"componentType\":5126,\"count\":6,\"type\":\"VEC3\"}]," MESH(BARE) "," NODE
                                                                                                            "}",
     "accessors[0].bufferView is none of the 2 bufferViews"},
    {"{" ASSET "," BUFFER "," VIEWS
     ",\"accessors\":[{\"bufferView\":0,\"componentType\":5126,\"count\":6}]," MESH(BARE) "," NODE "}",
     "accessors[0] is of type none, wanted is VEC3"},
    {"{" ASSET ",\"buffers\":[{\"uri\":\"data:x\"},{}]," VIEWS "," ACCESSORS "," MESH(BARE) "," NODE "}",
     "buffers[0] is a data: URI that is not base64"},
    {"{" ASSET ",\"buffers\":[{\"uri\":\"a.bin\"}]," VIEWS "," ACCESSORS "," MESH(BARE) "," NODE "}", "is not in it"},
};

static void test_refused(void) {
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) {
        struct mesh mesh;
        struct error err = {.message = ""};
        CHECK_THAT(parse(bad[i].json, &mesh, &err) == STATUS_INPUT, "case %zu: %s", i, err.message);
        CHECK_THAT(strstr(err.message, bad[i].part) != NULL, "case %zu: %s", i, err.message);
        CHECK(mesh.triangle_count == 0 && !mesh.position && !mesh.index);
        mesh_release(&mesh);
    }
}

/* Cut off at every place, and with lengths that lie. */
static void test_container(void) {
    struct buf file;
    struct mesh mesh;
    struct error err;
    make_glb(&file, WHOLE(MESH(ALL), NODE));
    for (size_t length = 0; length < file.length; length++) {
        CHECK(gltf_parse(file.data, length, "room.glb", NULL, 1000, &mesh, NULL, NULL, &err) == STATUS_INPUT);
        mesh_release(&mesh);
    }
    CHECK(gltf_parse(file.data, file.length, "room.glb", NULL, 1, &mesh, NULL, NULL, &err) == STATUS_LIMIT);
    file.data[12]++;
    CHECK(gltf_parse(file.data, file.length, "room.glb", NULL, 1000, &mesh, NULL, NULL, &err) == STATUS_INPUT);
    file.data[15] = 127;
    CHECK(gltf_parse(file.data, file.length, "room.glb", NULL, 1000, &mesh, NULL, NULL, &err) == STATUS_INPUT);
    CHECK(strstr(err.message, "chunk 0 is longer"));
    file.data[4] = 1;
    CHECK(gltf_parse(file.data, file.length, "room.glb", NULL, 1000, &mesh, NULL, NULL, &err) == STATUS_INPUT);
    CHECK(strstr(err.message, "version 2"));
    buf_release(&file);
}

/* JSON that is too large is not read. */
static void test_large(void) {
    size_t size = ((size_t)64 << 20) + 1;
    char *json = mem_calloc(size, 1);
    struct mesh mesh;
    struct error err;
    CHECK(gltf_parse(json, size, "room.gltf", NULL, 1000, &mesh, NULL, NULL, &err) == STATUS_LIMIT);
    CHECK_STRING(err.message, "room.gltf: its JSON is larger than 67108864 bytes");
    mem_free(json);
}

static void test_depth(void) {
    struct buf json;
    struct mesh mesh;
    struct error err;
    buf_init(&json, 1 << 20);
    buf_puts(&json, "{" ASSET ",\"nodes\":[{}");
    for (int i = 0; i < 300; i++)
        buf_printf(&json, ",{\"children\":[%d]}", i);
    buf_puts(&json, "]}");
    CHECK(parse(buf_text(&json), &mesh, &err) == STATUS_INPUT && strstr(err.message, "256 nodes deep"));
    buf_release(&json);
}

int main(void) {
    test_modes();
    test_transforms();
    test_objects();
    test_buffers();
    test_refused();
    test_container();
    test_large();
    test_depth();
    return check_result();
}
