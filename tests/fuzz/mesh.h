/* mesh.h -- what a mesh reader must have done with any bytes: an answer of "ok" comes with a mesh whose
 * every index and vertex can be read, through the mesh checks behind it; any other with a reason. */
#ifndef UNBAKE_TESTS_FUZZ_MESH_H
#define UNBAKE_TESTS_FUZZ_MESH_H

#include "common/error.h"
#include "server/ingest/mesh/mesh_materials.h"
#include "server/scene/mesh.h"
#include "tests/fuzz/fuzz.h"

static volatile float sink; /* what was read goes here, so that it is read */

/* Of a reader's answer; releases the mesh. */
static inline void must_be_mesh(enum status status, struct mesh *mesh, struct error *err) {
    struct mesh_report report;
    for (size_t i = 0; status == STATUS_OK && i < mesh->triangle_count; i++) {
        MUST(mesh->face[i] < mesh->face_count && (i == 0 || mesh->face[i] >= mesh->face[i - 1]));
        for (int k = 0; k < 3; k++) {
            uint32_t vertex = mesh->index[i][k];
            MUST(vertex < mesh->vertex_count);
            sink = mesh->position[vertex].x + (mesh->normal ? mesh->normal[vertex].x : 0);
        }
    }
    if (status == STATUS_OK)
        status = mesh_check(mesh, "case", &report, err);
    if (status == STATUS_OK)
        sink = (float)mesh_area(mesh);
    else
        MUST((status == STATUS_INPUT || status == STATUS_LIMIT) && err->message[0] != '\0');
    mesh_release(mesh);
}

/* Of a reader that reads materials, too: each triangle has one, each vertex a place in its pictures, which can be
 * looked up. Releases both. */
static inline void must_be_materials(enum status status, struct mesh *mesh, struct mesh_materials *materials,
                                     struct error *err) {
    for (size_t i = 0; status == STATUS_OK && i < mesh->triangle_count; i++) {
        MUST(mesh->object_id[i] >= 0 && (uint64_t)mesh->object_id[i] < materials->material_count);
        const struct mesh_material *m = &materials->material[mesh->object_id[i]];
        for (int q = 0; q < MATERIAL_QUANTITIES; q++)
            if (m->map[q].is_there && mesh->uv)
                sink = material_map_value(materials, &m->map[q], mesh->uv[i][0]).r;
        MUST(m->roughness >= 0.0f && m->roughness <= 1.0f && m->metallic >= 0.0f && m->metallic <= 1.0f);
        MUST(m->specular >= 0.0f && m->specular <= 1.0f && rgb_max(m->base_color) <= 1.0f);
    }
    mesh_materials_release(materials);
    must_be_mesh(status, mesh, err);
}

#endif
