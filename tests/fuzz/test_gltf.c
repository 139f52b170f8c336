/* test_gltf.c -- the glTF reader, and the mesh checks behind it, on damaged files. */
#include "server/ingest/mesh/gltf.h"

#include "common/mem.h"
#include "tests/fuzz/mesh.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    struct mesh mesh;
    struct error err = {.message = ""};
    enum status status = gltf_parse(data, size, "case", NULL, 100000, &mesh, NULL, NULL, &err);
    MUST(status != STATUS_OK || mesh.triangle_count > 0);
    for (size_t i = 0; status == STATUS_OK && i < mesh.triangle_count; i++)
        MUST(!mesh.object_id || mesh.object_id[i] >= 0);
    must_be_mesh(status, &mesh, &err);
    struct mesh_materials materials = {0};
    status = gltf_parse(data, size, "case", NULL, 100000, &mesh, &materials, NULL, &err);
    must_be_materials(status, &mesh, &materials, &err);
    return 0;
}

#define TABLES                                                                                                         \
    "\"asset\":{\"version\":\"2.0\"},\"bufferViews\":[{\"buffer\":0,\"byteLength\":36},{\"buffer\":0,"                 \
    "\"byteOffset\":36,\"byteLength\":8,\"target\":34963}],\"accessors\":[{\"bufferView\":0,\"byteOffset\":0,"         \
    "\"componentType\":5126,\"count\":3,\"type\":\"VEC3\"},{\"bufferView\":1,\"componentType\":5123,\"count\":3,"      \
    "\"type\":\"SCALAR\"}],\"meshes\":[{\"primitives\":[{\"attributes\":{\"POSITION\":0,\"NORMAL\":0},"                \
    "\"indices\":1,\"material\":0},{\"mode\":5,\"attributes\":{\"POSITION\":0}}]}],\"nodes\":[{\"mesh\":0,"            \
    "\"children\":[1],\"scale\":[1,-2,1]},{\"mesh\":0,\"matrix\":[1,0,0,0,0,1,0,0,0,0,1,0,0,3,0,1]}],"                 \
    "\"scenes\":[{\"nodes\":[0]}],\"scene\":0"

static void add_glb(struct seeds *s) {
    static const char json[] = "{" TABLES ",\"buffers\":[{\"byteLength\":44}]}";
    static const float points[9] = {0, 0, 0, 1, 0, 0, 0, 1, 0};
    static const uint16_t indices[4] = {0, 1, 2, 0};
    uint32_t length = (sizeof json - 1 + 3) / 4 * 4, head[] = {0x46546c67, 2, 28 + length + 44, length, 0x4e4f534a};
    uint32_t chunk[] = {44, 0x004e4942};
    uint8_t *file = mem_alloc(28 + length + 44);
    memcpy(file, head, 20);
    memset(file + 20, ' ', length);
    memcpy(file + 20, json, sizeof json - 1);
    memcpy(file + 20 + length, chunk, 8);
    memcpy(file + 28 + length, points, 36);
    memcpy(file + 64 + length, indices, 8);
    seeds_add(s, file, 28 + length + 44);
    mem_free(file);
}

/* A sparse accessor of shorts, instances, and a view that meshopt has packed: 16 times the same 4 bytes, 3 indices. */
#define EXTENSIONS                                                                                                         \
    "\"asset\":{\"version\":\"2.0\"},\"extensionsUsed\":[\"EXT_mesh_gpu_instancing\",\"A\"],\"bufferViews\":[{\"buffer\":" \
    "0,\"byteLength\":36},{\"buffer\":0,\"byteOffset\":36,\"byteLength\":6},{\"buffer\":0,\"byteLength\":64,"              \
    "\"byteStride\":4,\"extensions\":{\"EXT_meshopt_compression\":{\"buffer\":0,\"byteOffset\":42,\"byteLength\":41,"      \
    "\"byteStride\":4,\"count\":16,\"mode\":\"ATTRIBUTES\",\"filter\":\"OCTAHEDRAL\"}}}],\"accessors\":[{"                 \
    "\"bufferView\":0,\"componentType\":5122,\"normalized\":true,\"count\":3,\"type\":\"VEC3\",\"sparse\":{"               \
    "\"count\":1,\"indices\":{\"bufferView\":1,\"componentType\":5123},\"values\":{\"bufferView\":0}}},{"                  \
    "\"bufferView\":2,\"componentType\":5120,\"normalized\":true,\"count\":3,\"type\":\"VEC3\"},{\"bufferView\":0,"        \
    "\"componentType\":5126,\"count\":2,\"type\":\"VEC3\"}],\"meshes\":[{\"primitives\":[{\"attributes\":{"                \
    "\"POSITION\":0,\"NORMAL\":1}}]}],\"nodes\":[{\"mesh\":0,\"extensions\":{\"EXT_mesh_gpu_instancing\":{"                \
    "\"attributes\":{\"TRANSLATION\":2,\"SCALE\":2}}}}]"

/* A triangle with a material, whose pictures are a PNG of one pixel. */
#define MATERIALS                                                                                                        \
    "\"asset\":{\"version\":\"2.0\"},\"bufferViews\":[{\"buffer\":0,\"byteLength\":36}],\"accessors\":[{"                \
    "\"bufferView\":0,\"componentType\":5126,\"count\":3,\"type\":\"VEC3\"},{\"bufferView\":0,"                          \
    "\"componentType\":5126,\"count\":3,\"type\":\"VEC2\"}],\"images\":[{\"uri\":\"data:image/png;base64,"               \
    "iVBORw0KGgoAAAANSUhEUgAAAAEAAAABCAIAAACQd1PeAAAADElEQVR4nGNocFAAAAIkAOGrWWInAAAAAElFTkSuQmCC\"}],"                  \
    "\"samplers\":[{\"wrapS\":33648,\"wrapT\":33071}],\"textures\":[{\"source\":0,\"sampler\":0}],\"materials\":[{"      \
    "\"pbrMetallicRoughness\":{\"baseColorTexture\":{\"index\":0,\"extensions\":{\"KHR_texture_transform\":{"            \
    "\"offset\":[0,1],\"rotation\":1.5,\"scale\":[2,3]}}},\"metallicRoughnessTexture\":{\"index\":0},"                   \
    "\"baseColorFactor\":[1,0.5,2,1],\"roughnessFactor\":0.5},\"emissiveTexture\":{\"index\":0},\"emissiveFactor\":"     \
    "[1,1,1],\"extensions\":{\"KHR_materials_ior\":{\"ior\":1.4},\"KHR_materials_emissive_strength\":{"                  \
    "\"emissiveStrength\":5},\"KHR_materials_specular\":{\"specularFactor\":0.5}}}],\"meshes\":[{\"primitives\":[{"      \
    "\"attributes\":{\"POSITION\":0,\"TEXCOORD_0\":1},\"material\":0},{\"attributes\":{\"POSITION\":0}}]}],\"nodes\":[{" \
    "\"mesh\":0}]"

void fuzz_seeds(struct seeds *s) {
    s->mutants = 10000;
    add_glb(s);
    seeds_text(s, "{" MATERIALS ",\"buffers\":[{\"byteLength\":36,\"uri\":\"data:x;base64,"
                  "AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAA\"}]}");
    seeds_text(s, "{" EXTENSIONS ",\"buffers\":[{\"byteLength\":83,\"uri\":\"data:x;base64,"
                  "AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAAAAABAAIAoAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAA"
                  "AAAAAAAA\"}]}");
    seeds_text(s, "{" TABLES ",\"buffers\":[{\"byteLength\":44,\"uri\":\"data:application/octet-stream;base64,"
                  "AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAAAAABAAIAAAA=\"}]}");
}
