/* test_ply.c -- the PLY reader, and the mesh checks behind it, on damaged files. */
#include "server/ingest/mesh/ply.h"

#include "tests/fuzz/mesh.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    struct mesh mesh;
    struct error err = {.message = ""};
    enum status status = ply_parse(data, size, "case", 100000, &mesh, NULL, &err);
    must_be_mesh(status, &mesh, &err);
    return 0;
}

/* A binary file of either byte order, with what the shared vectors lack. */
static void add_binary(struct seeds *s, bool big) {
    uint8_t file[1024];
    size_t used =
        (size_t)snprintf((char *)file, 512,
                         "ply\nformat binary_%s_endian 1.0\nelement vertex 5\nproperty float x\nproperty double y\n"
                         "property short z\nproperty list uchar int l\nelement face 3\nproperty ushort object_id\n"
                         "property list uchar uint vertex_indices\nelement other 1\nproperty int a\nend_header\n",
                         big ? "big" : "little");
    for (int i = 0; i < 5; i++) {
        memset(file + used, i, 14);
        file[used + 14] = (uint8_t)(i & 1); /* the list: none or one int */
        used += 15;
        if (i & 1)
            used += 4;
    }
    static const uint8_t corners[3] = {3, 4, 5};
    for (int f = 0; f < 3; f++) {
        file[used++] = 0;
        file[used++] = (uint8_t)f;
        file[used++] = corners[f];
        for (uint8_t k = 0; k < corners[f]; k++) {
            memset(file + used, 0, 4);
            file[used + (big ? 3 : 0)] = k;
            used += 4;
        }
    }
    memset(file + used, 7, 4);
    seeds_add(s, file, used + 4);
}

void fuzz_seeds(struct seeds *s) {
    static const char text[] =
        "ply\r\nformat ascii 1.0\r\ncomment x\r\nelement face 2\r\nproperty int object_id\r\n"
        "property list uchar int vertex_index\r\nelement vertex 6\r\nproperty float nx\r\nproperty float x\r\n"
        "property float y\r\nproperty float z\r\nproperty float ny\r\nproperty float nz\r\nend_header\r\n"
        "-1 3 0 1 2\r\n7 6 0 1 2 3 4 5\r\n0 0 0 0 0 1\r\n0 4 0 0 0 1\r\n0 4 4 0 0 1\r\n0 2 1 0 0 1\r\n"
        "0 1 3 0 0 1\r\n0 0 4 0 0 1\r\n";
    s->mutants = 10000;
    seeds_data(s, "vectors/ply-happly", ".ply");
    seeds_data(s, "vectors/assimp/PLY", "");
    seeds_data(s, "conformance/room.ply", "");
    seeds_text(s, text);
    seeds_text(s, "ply\nformat ascii 1.0\ncomment unbake offset 1e6 2 3\nelement Vertex 5\nproperty double X\n"
                  "property double Y\nproperty double z\nelement tristrips 1\nproperty list int int vertex_indices\n"
                  "end_header\n0 0\n0\n4100000.5 0 0\n4100001 2 0\n1e7 1 1\nnan 0 0\n7 0 1 2\n -1 1 2 3\n");
    add_binary(s, false);
    add_binary(s, true);
}
