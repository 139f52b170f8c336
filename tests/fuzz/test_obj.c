/* test_obj.c -- the OBJ reader, and the mesh checks behind it, on damaged files. */
#include "server/ingest/mesh/obj.h"

#include "tests/fuzz/mesh.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    struct mesh mesh;
    struct error err = {.message = ""};
    enum status status = obj_parse(data, size, "case", NULL, 100000, &mesh, NULL, NULL, &err);
    MUST(status != STATUS_OK || mesh.triangle_count > 0);
    for (size_t i = 0; status == STATUS_OK && i < mesh.triangle_count; i++)
        MUST(!mesh.object_id || (mesh.object_id[i] >= 0 && mesh.object_id[i] <= (int64_t)mesh.face_count));
    must_be_mesh(status, &mesh, &err);
    struct mesh_materials materials = {0};
    status = obj_parse(data, size, "case", NULL, 100000, &mesh, &materials, NULL, &err);
    must_be_materials(status, &mesh, &materials, &err);
    return 0;
}

void fuzz_seeds(struct seeds *s) {
    s->mutants = 10000;
    seeds_data(s, "vectors/assimp/OBJ", ".obj");
    seeds_text(s, "# x\r\nmtllib a.mtl\no a b\nv 0 0 0\nv 1 0 0 1\nv 1 1 0 .5 .5 .5\nv 0 \\\n1e0 0\nvt 0 0\nvn 0 0 1\n"
                  "usemtl m\ng g h\nf 1/1/1 2/1/1 3//1 -1//-1\nf 1 2 3\ns off\nl 1 2\n");
    seeds_text(s,
               "\xef\xbb\xbf# unbake offset 1e6 0 -1\rv 0 0 0\rv 900 1000.5 0\rv 900 1001 \\\r0\rf 1/1/ 2//9 -1//\r");
}
