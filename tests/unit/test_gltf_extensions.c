/* Quantised, sparse, compressed and instanced glTF is read; what is used and not understood is refused or told. */
#include <meshoptimizer.h>

#include "common/buf.h"
#include "common/mem.h"
#include "server/ingest/bundle.h"
#include "server/ingest/mesh/gltf.h"
#include "server/ingest/mesh/mesh_file.h"
#include "tests/check.h"

#define ASSET "\"asset\":{\"version\":\"2.0\"}"
#define NODE "\"nodes\":[{\"mesh\":0}]"
#define MESH "\"meshes\":[{\"primitives\":[{\"attributes\":{\"POSITION\":0}}]}]"

static struct faces_report report;

/* A GLB of this JSON, whose buffer 0 is bin[size]. */
static enum status parse(const char *json, const void *bin, size_t size, struct mesh *mesh, struct error *err) {
    struct buf file;
    uint32_t length = (uint32_t)strlen(json), padding = (4 - length % 4) % 4, tail = (uint32_t)(4 - size % 4) % 4;
    uint32_t head[] = {0x46546c67, 2, (uint32_t)(28 + length + padding + size + tail), length + padding, 0x4e4f534a};
    uint32_t chunk[] = {(uint32_t)size + tail, 0x004e4942};
    buf_init(&file, 1 << 20);
    buf_append(&file, head, sizeof head);
    buf_append(&file, json, length);
    buf_append(&file, "   ", padding);
    buf_append(&file, chunk, sizeof chunk);
    buf_append(&file, bin, size);
    buf_append(&file, "\0\0\0", tail);
    enum status status = gltf_parse(file.data, file.length, "room.glb", NULL, 1000, mesh, NULL, &report, err);
    buf_release(&file);
    return status;
}

static void take(const char *json, const void *bin, size_t size, struct mesh *mesh) {
    struct error err = {.message = ""};
    CHECK_THAT(parse(json, bin, size, mesh, &err) == STATUS_OK, "%s: %s", err.message, json);
}

static void refused(const char *json, const void *bin, size_t size, const char *part, const char *hint) {
    struct mesh mesh;
    struct error err = {.message = ""};
    CHECK_THAT(parse(json, bin, size, &mesh, &err) == STATUS_INPUT, "%s", json);
    CHECK_THAT(strstr(err.message, part) && strstr(err.hint, hint), "%s; %s", err.message, err.hint);
    mesh_release(&mesh);
}

static bool is(const struct mesh *mesh, size_t triangle, int k, double x, double y, double z) {
    if (triangle >= mesh->triangle_count)
        return false;
    vec3 p = mesh->position[mesh->index[triangle][k]];
    return fabs((double)p.x - x) < 1e-5 && fabs((double)p.y - y) < 1e-5 && fabs((double)p.z - z) < 1e-5;
}

/* Shorts and bytes, plain and normalised; normals of bytes with a stride of four. */
static void test_quantised(void) {
    struct mesh mesh;
    const int16_t shorts[3][4] = {{0, 0, 0, 0}, {-32768, 100, 0, 0}, {0, 32767, 7, 0}};
    const int8_t normals[3][4] = {{0, 0, 127, 0}, {0, 0, 127, 0}, {0, 0, 127, 0}};
    uint8_t bin[36];
    memcpy(bin, shorts, 24);
    memcpy(bin + 24, normals, 12);
#define QUANTISED(normalized, scale)                                                                                      \
    "{" ASSET                                                                                                             \
    ",\"extensionsRequired\":[\"KHR_mesh_quantization\"],\"buffers\":[{\"byteLength\":36}],\"bufferViews\":["             \
    "{\"buffer\":0,\"byteLength\":24,\"byteStride\":8},{\"buffer\":0,\"byteOffset\":24,\"byteLength\":12,"                \
    "\"byteStride\":4}],\"accessors\":[{\"bufferView\":0,\"componentType\":5122,\"count\":3,\"type\":\"VEC3\"" normalized \
    "},{\"bufferView\":1,\"componentType\":5120,\"normalized\":true,\"count\":3,\"type\":\"VEC3\"}],\"meshes\":[{"        \
    "\"primitives\":[{\"attributes\":{\"POSITION\":0,\"NORMAL\":1}}]}],\"nodes\":[{\"mesh\":0,\"scale\":" scale "}]}"
    take(QUANTISED("", "[0.001,0.001,0.001]"), bin, sizeof bin, &mesh);
    CHECK(is(&mesh, 0, 1, -32.768, 0.1, 0) && is(&mesh, 0, 2, 0, 32.767, 0.007));
    CHECK(mesh.normal && mesh.normal[0].z > 0.0f && mesh.normal[0].x == 0.0f);
    mesh_release(&mesh);
    take(QUANTISED(",\"normalized\":true", "[5,5,5]"), bin, sizeof bin, &mesh);
    CHECK(is(&mesh, 0, 1, -5, 500.0 / 32767.0, 0) && is(&mesh, 0, 2, 0, 5, 35.0 / 32767.0));
    mesh_release(&mesh);
    const uint8_t small[12] = {0, 0, 0, 0, 255, 0, 0, 0, 0, 255, 51, 0};
    take(
        "{" ASSET
        ",\"buffers\":[{\"byteLength\":12}],\"bufferViews\":[{\"buffer\":0,\"byteLength\":12,\"byteStride\":4}],"
        "\"accessors\":[{\"bufferView\":0,\"componentType\":5121,\"normalized\":true,\"count\":3,\"type\":\"VEC3\"}]," MESH
        "," NODE "}",
        small, sizeof small, &mesh);
    CHECK(is(&mesh, 0, 1, 1, 0, 0) && is(&mesh, 0, 2, 0, 1, 0.2));
    mesh_release(&mesh);
}

/* Elements replaced in an accessor, and in one of zeros. */
static void test_sparse(void) {
    struct mesh mesh;
    const float points[3][3] = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, values[2][3] = {{9, 0, 0}, {0, 8, 0}};
    const uint16_t places[2] = {1, 2};
    uint8_t bin[64];
    memcpy(bin, points, 36), memcpy(bin + 36, values, 24), memcpy(bin + 60, places, 4);
#define SPARSE(view, count, last)                                                                                      \
    "{" ASSET ",\"buffers\":[{\"byteLength\":64}],\"bufferViews\":[{\"buffer\":0,\"byteLength\":36},{\"buffer\":0,"    \
    "\"byteOffset\":36,\"byteLength\":24},{\"buffer\":0,\"byteOffset\":60,\"byteLength\":4}],\"accessors\":[{" view    \
    "\"componentType\":5126,\"count\":3,\"type\":\"VEC3\",\"sparse\":{\"count\":" count                                \
    ",\"indices\":{\"bufferView\":2,"                                                                                  \
    "\"componentType\":" last "},\"values\":{\"bufferView\":1}}}]," MESH "," NODE "}"
    take(SPARSE("\"bufferView\":0,", "1", "5123"), bin, sizeof bin, &mesh);
    CHECK(is(&mesh, 0, 1, 9, 0, 0) && is(&mesh, 0, 2, 0, 1, 0));
    mesh_release(&mesh);
    take(SPARSE("", "2", "5123"), bin, sizeof bin, &mesh);
    CHECK(is(&mesh, 0, 0, 0, 0, 0) && is(&mesh, 0, 1, 9, 0, 0) && is(&mesh, 0, 2, 0, 8, 0));
    mesh_release(&mesh);
    refused(SPARSE("", "3", "5123"), bin, sizeof bin, "sparse promises 3 elements, but its bufferView holds 2", "");
    refused(SPARSE("", "4", "5123"), bin, sizeof bin, "sparse of accessors[0].count is not a whole number from 1 to 3",
            "");
    refused(SPARSE("", "1", "5122"), bin, sizeof bin, "are not unsigned integers", "");
    refused(SPARSE("", "1", "5125"), bin, sizeof bin, "replaces element 131073 of 3", "");
}

/* Every instance, by translation, rotation and scale, below the node's own transform. */
static void test_instances(void) {
    struct mesh mesh;
    const float bin[] = {0,
                         0,
                         0,
                         1,
                         0,
                         0,
                         0,
                         1,
                         0,
                         /* points */ 10,
                         0,
                         0,
                         0,
                         20,
                         0, /* translations */
                         0,
                         0,
                         0,
                         1,
                         0,
                         0,
                         0.70710678f,
                         0.70710678f,
                         /* rotations */ 1,
                         1,
                         1,
                         2,
                         2,
                         2 /* scales */};
#define INSTANCES(attributes)                                                                                              \
    "{" ASSET ",\"extensionsUsed\":[\"EXT_mesh_gpu_instancing\"],\"buffers\":[{\"byteLength\":116}],\"bufferViews\":["     \
    "{\"buffer\":0,\"byteLength\":36},{\"buffer\":0,\"byteOffset\":36,\"byteLength\":24},{\"buffer\":0,\"byteOffset\":60," \
    "\"byteLength\":32},{\"buffer\":0,\"byteOffset\":92,\"byteLength\":24}],\"accessors\":[{\"bufferView\":0,"             \
    "\"componentType\":5126,\"count\":3,\"type\":\"VEC3\"},{\"bufferView\":1,\"componentType\":5126,\"count\":2,"          \
    "\"type\":\"VEC3\"},{\"bufferView\":2,\"componentType\":5126,\"count\":2,\"type\":\"VEC4\"},{\"bufferView\":3,"        \
    "\"componentType\":5126,\"count\":2,\"type\":\"VEC3\"}]," MESH ",\"nodes\":[{\"mesh\":0,\"translation\":[0,0,5],"      \
    "\"extensions\":{\"EXT_mesh_gpu_instancing\":{\"attributes\":{" attributes "}}}}]}"
    take(INSTANCES("\"TRANSLATION\":1,\"ROTATION\":2,\"SCALE\":3"), bin, sizeof bin, &mesh);
    CHECK(mesh.triangle_count == 2 && mesh.object_id && mesh.object_id[1] == 1);
    CHECK(is(&mesh, 0, 0, 10, 0, 5) && is(&mesh, 0, 1, 11, 0, 5));
    CHECK(is(&mesh, 1, 0, 0, 20, 5) && is(&mesh, 1, 1, 0, 22, 5) && is(&mesh, 1, 2, -2, 20, 5));
    mesh_release(&mesh);
    take(INSTANCES("\"TRANSLATION\":1"), bin, sizeof bin, &mesh);
    CHECK(mesh.triangle_count == 2 && is(&mesh, 1, 1, 1, 20, 5));
    mesh_release(&mesh);
    refused(INSTANCES("\"_ID\":1"), bin, sizeof bin, "nodes[0].EXT_mesh_gpu_instancing has no TRANSLATION", "");
    refused(INSTANCES("\"TRANSLATION\":0,\"SCALE\":3"), bin, sizeof bin, "are 3 and 2", "");
}

enum { PACKED_COUNT = 100 }; /* vertices of a packed strip */
/* Bytes of each of its three packed views, one after the other. */
struct packed_sizes {
    size_t points, normals, indices;
};

/* As gltfpack writes it: triangles, positions and filtered normals, each in a view that the library unpacks. */
static struct packed_sizes pack_strip(unsigned char bin[8192]) {
    enum { COUNT = PACKED_COUNT };
    uint16_t points[COUNT][4];
    float normals[COUNT][4];
    uint32_t indices[3 * (COUNT - 2)];
    int8_t packed_normals[COUNT][4];
    for (int i = 0; i < COUNT; i++) {
        uint16_t p[4] = {(uint16_t)(10 * i), (uint16_t)(i % 2 * 1000), (uint16_t)(i * i), 0};
        memcpy(points[i], p, sizeof p);
        memcpy(normals[i], (float[4]){0.0f, 0.6f, 0.8f, 0.0f}, sizeof normals[i]);
    }
    for (uint32_t i = 0; i < COUNT - 2; i++)
        for (uint32_t k = 0; k < 3; k++)
            indices[3 * i + k] = i + k;
    meshopt_encodeFilterOct(packed_normals, COUNT, 4, 8, &normals[0][0]);
    size_t a = meshopt_encodeVertexBuffer(bin, 4096, points, COUNT, 8);
    size_t b = meshopt_encodeVertexBuffer(bin + a, 2048, packed_normals, COUNT, 4);
    size_t c = meshopt_encodeIndexBuffer(bin + a + b, 2048, indices, 3 * (COUNT - 2));
    CHECK(a > 0 && b > 0 && c > 0);
    return (struct packed_sizes){a, b, c};
}

static void test_meshopt(void) {
    enum { COUNT = PACKED_COUNT };
    struct mesh mesh;
    unsigned char bin[8192];
    char json[2048];
    struct packed_sizes size = pack_strip(bin);
    size_t a = size.points, b = size.normals, c = size.indices;
    static const char form[] =
        "{" ASSET ",\"extensionsRequired\":[\"EXT_meshopt_compression\",\"KHR_mesh_quantization\"],\"buffers\":[{"
        "\"byteLength\":%zu},{\"byteLength\":1788,\"extensions\":{\"EXT_meshopt_compression\":{\"fallback\":true}}}],"
        "\"bufferViews\":[{\"buffer\":1,\"byteLength\":800,\"byteStride\":8,\"extensions\":{\"EXT_meshopt_compression\":{"
        "\"buffer\":0,\"byteLength\":%zu,\"byteStride\":8,\"mode\":\"ATTRIBUTES\",\"count\":%d}}},{\"buffer\":1,"
        "\"byteOffset\":800,\"byteLength\":400,\"byteStride\":4,\"extensions\":{\"EXT_meshopt_compression\":{\"buffer\":0,"
        "\"byteOffset\":%zu,\"byteLength\":%zu,\"byteStride\":4,\"mode\":\"ATTRIBUTES\",\"filter\":\"%s\",\"count\":100}}},"
        "{\"buffer\":1,\"byteOffset\":1200,\"byteLength\":588,\"extensions\":{\"EXT_meshopt_compression\":{\"buffer\":0,"
        "\"byteOffset\":%zu,\"byteLength\":%zu,\"byteStride\":2,\"mode\":\"TRIANGLES\",\"count\":294}}}],\"accessors\":[{"
        "\"bufferView\":0,\"componentType\":5123,\"count\":100,\"type\":\"VEC3\"},{\"bufferView\":1,\"componentType\":5120,"
        "\"normalized\":true,\"count\":100,\"type\":\"VEC3\"},{\"bufferView\":2,\"componentType\":5123,\"count\":294,"
        "\"type\":\"SCALAR\"}],\"meshes\":[{\"primitives\":[{\"attributes\":{\"POSITION\":0,\"NORMAL\":1},\"indices\":2}]}]"
        ",\"nodes\":[{\"mesh\":0,\"scale\":[0.01,0.01,0.01]}]}";
    snprintf(json, sizeof json, form, a + b + c, a, COUNT, a, b, "OCTAHEDRAL", a + b, c);
    take(json, bin, a + b + c, &mesh);
    CHECK(mesh.triangle_count == COUNT - 2 && mesh.vertex_count == COUNT && mesh.normal);
    bool found = false; /* the encoder may rotate the corners */
    for (int k = 0; k < 3; k++)
        found = found || is(&mesh, COUNT - 3, k, 9.9, 10.0, 98.01);
    CHECK(found);
    vec3 n = vec3_normalize(mesh.normal[0]);
    CHECK_NEAR(n.y, 0.6, 0.02);
    CHECK_NEAR(n.z, 0.8, 0.02);
    mesh_release(&mesh);
    snprintf(json, sizeof json, form, a + b + c, a, COUNT, a, b, "QUATERNION", a + b, c); /* needs a stride of 8 */
    refused(json, bin, a + b + c, "bufferViews[1] is compressed by meshopt and damaged", "");
    snprintf(json, sizeof json, form, a + b + c, a, 4000000, a, b, "OCTAHEDRAL", a + b, c);
    refused(json, bin, a + b + c, "bufferViews[0] is compressed by meshopt and damaged", "");
    snprintf(json, sizeof json, form, a + b + c, a / 2, COUNT, a, b, "OCTAHEDRAL", a + b, c);
    refused(json, bin, a + b + c, "bufferViews[0] is compressed by meshopt and damaged", "");
    snprintf(json, sizeof json, form, a + b + c, a, COUNT, a + b + c, b, "OCTAHEDRAL", a + b, c);
    refused(json, bin, a + b + c, "bufferViews[1].EXT_meshopt_compression does not lie within", "");

    /* The ratified name. */
    snprintf(json, sizeof json, form, a + b + c, a, COUNT, a, b, "OCTAHEDRAL", a + b, c);
    for (char *at = json; (at = strstr(at, "EXT_meshopt")) != NULL;)
        memcpy(at, "KHR", 3);
    take(json, bin, a + b + c, &mesh);
    CHECK(mesh.triangle_count == COUNT - 2 && mesh.vertex_count == COUNT && mesh.normal);
    mesh_release(&mesh);
    bin[a] = 0xaf; /* a version that no library reads */
    refused(json, bin, a + b + c, "bufferViews[1] is compressed by version 15 of meshopt's vertex codec", "gltfpack");
    bin[a] = 0xa0;
    snprintf(json, sizeof json, form, a + b + c, a, COUNT, a, b, "COLOR", a + b, c);
    refused(json, bin, a + b + c, "bufferViews[1] has meshopt's filter COLOR", "gltfpack");
}

static bool has_note(const char *part) {
    for (size_t i = 0; i < report.note_count; i++)
        if (strstr(report.note[i], part))
            return true;
    return false;
}

static void test_names(void) {
    struct mesh mesh;
    const float points[9] = {0, 0, 0, 1, 0, 0, 0, 1, 0};
#define USED(list, node)                                                                                               \
    "{" ASSET ",\"extensionsUsed\":[" list "],\"buffers\":[{\"byteLength\":36}],\"bufferViews\":[{\"buffer\":0,"       \
    "\"byteLength\":36}],\"accessors\":[{\"bufferView\":0,\"componentType\":5126,\"count\":3,\"type\":\"VEC3\"}],"     \
    "\"meshes\":[{\"primitives\":[{\"attributes\":{\"POSITION\":0},\"targets\":[{\"POSITION\":0}]}]}],\"nodes\":[{"    \
    "\"mesh\":0" node "},{\"mesh\":0,\"extensions\":{\"KHR_node_visibility\":{\"visible\":false}}}]}"
    refused(USED("\"KHR_draco_mesh_compression\"", ""), points, sizeof points,
            "uses the extension KHR_draco_mesh_compression, which is not read", "blender -b");
    refused(USED("\"KHR_texture_basisu\",\"CESIUM_RTC\"", ""), points, sizeof points, "CESIUM_RTC", "translation");
    take(USED("\"KHR_materials_unlit\",\"KHR_lights_punctual\",\"KHR_node_visibility\"", ",\"skin\":0"), points,
         sizeof points, &mesh);
    CHECK(mesh.triangle_count == 1 && !mesh.object_id); /* the other is hidden */
    CHECK(report.note_count == 3 && has_note("1 nodes are skinned") && has_note("morph targets") && has_note("hidden"));
    mesh_release(&mesh);
    take(USED("\"ACME_shape\"", ""), points, sizeof points, &mesh);
    CHECK(has_note("it uses the extension ACME_shape, which was not read"));
    mesh_release(&mesh);
}

/* The bundles of the shared data that have such a mesh. */
static void test_captures(void) {
    static const struct {
        const char *name;
        size_t triangles;
    } table[] = {{"glb_inst", 96}, {"glb_quant_notrequired", 12}};
    const char *root = getenv("UNBAKE_TEST_DATA");
    for (size_t i = 0; i < sizeof table / sizeof *table; i++) {
        char path[1024];
        struct mesh mesh;
        struct error err = {.message = ""};
        snprintf(path, sizeof path, "%s/captures/%s/m.glb", root ? root : "../shared/data", table[i].name);
        if (access(path, R_OK) != 0)
            continue;
        CHECK_THAT(mesh_file_read(path, "m.glb", 1000, &mesh, NULL, &err) == STATUS_OK, "%s", err.message);
        CHECK_THAT(mesh.triangle_count == table[i].triangles, "%s: %zu", table[i].name, mesh.triangle_count);
        mesh_release(&mesh);
    }
}

int main(void) {
    test_quantised();
    test_sparse();
    test_instances();
    test_meshopt();
    test_names();
    test_captures();
    return check_result();
}
