/* test_mtl.c -- the reader of OBJ's materials on damaged files: values stay in their ranges, a fault has a reason. */
#include "server/ingest/mesh/mtl.h"

#include "tests/fuzz/fuzz.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    struct mesh_materials materials = {0};
    struct error err = {.message = ""};
    bool found[2] = {false, false};
    mesh_materials_add(&materials, "a");
    mesh_materials_add(&materials, "b c");
    enum status status = mtl_read("case", (const char *)data, size, NULL, &materials, found, &err);
    MUST(status == STATUS_OK || (status == STATUS_INPUT && err.message[0] != '\0'));
    for (size_t i = 0; i < materials.material_count && status == STATUS_OK; i++) {
        const struct mesh_material *m = &materials.material[i];
        MUST(m->is_own == found[i] && !m->map[MATERIAL_BASE_COLOR].is_there);
        MUST(m->roughness >= 0.0f && m->roughness <= 1.0f && m->metallic >= 0.0f && m->metallic <= 1.0f);
        MUST(m->specular >= 0.0f && m->specular <= 1.0f && rgb_max(m->base_color) <= 1.0f && m->emission.r >= 0.0f);
    }
    mesh_materials_release(&materials);
    return 0;
}

void fuzz_seeds(struct seeds *s) {
    s->mutants = 10000;
    seeds_data(s, "vectors/assimp/OBJ", ".mtl");
    seeds_text(s, "# x\r\nnewmtl a\nKd 1 .5 0\nKs .5\nNs 200\nKe 1 2 3\nillum 1\nd -halo .5\nTr 0\nPr .2\nPm 1\n"
                  "map_Bump -bm 1 n.png\nnewmtl b c\nKd .1 .2 .3\n");
    seeds_text(s,
               "newmtl a\nmap_Kd -clamp on -o 1 2 3 -s .5 .5 -blendu on a b.png\nnewmtl b c\nmap_Kd -mm 0 1 x.png\n");
}
