/* test_obj.c -- the OBJ reader, and the mesh checks behind it, on damaged files. An answer of "ok" must
 * come with a mesh whose every index and vertex can be read. */
#include "server/ingest/obj.h"

#include "tests/fuzz/fuzz.h"

static volatile float sink;

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    struct mesh mesh;
    struct mesh_report report;
    struct error err = {.message = ""};
    enum status status = obj_parse(data, size, "case", 100000, &mesh, NULL, &err);
    if (status == STATUS_OK) {
        MUST(mesh.triangle_count > 0);
        for (size_t i = 0; i < mesh.triangle_count; i++) {
            MUST(mesh.face[i] < mesh.face_count && (i == 0 || mesh.face[i] >= mesh.face[i - 1]));
            MUST(!mesh.object_id || (mesh.object_id[i] >= 0 && mesh.object_id[i] <= (int64_t)mesh.face_count));
            for (int k = 0; k < 3; k++) {
                MUST(mesh.index[i][k] < mesh.vertex_count);
                sink = mesh.position[mesh.index[i][k]].x + (mesh.normal ? mesh.normal[mesh.index[i][k]].x : 0);
            }
        }
        status = mesh_check(&mesh, "case", &report, &err);
    }
    if (status == STATUS_OK)
        sink = (float)mesh_area(&mesh);
    else
        MUST((status == STATUS_INPUT || status == STATUS_LIMIT) && err.message[0] != '\0');
    mesh_release(&mesh);
    return 0;
}

void fuzz_seeds(struct seeds *s) {
    s->mutants = 10000;
    seeds_data(s, "vectors/assimp/OBJ", ".obj");
    seeds_text(s, "# x\r\nmtllib a.mtl\no a b\nv 0 0 0\nv 1 0 0 1\nv 1 1 0 .5 .5 .5\nv 0 \\\n1e0 0\nvt 0 0\nvn 0 0 1\n"
                  "usemtl m\ng g h\nf 1/1/1 2/1/1 3//1 -1//-1\nf 1 2 3\ns off\nl 1 2\n");
}
