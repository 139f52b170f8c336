/* mesh_obj.c -- see mesh_obj.h. */
#include "server/export/mesh_obj.h"

#include "common/mem.h"
#include "server/export/emission_texture.h"
#include "server/export/sink.h"

#define MAX_NS 1000.0 /* of a surface of roughness 0 */

static void put_corner(struct sink *out, uint32_t vertex, uint32_t uv, bool has_normal) {
    if (has_normal)
        sink_printf(out, " %u/%u/%u", vertex + 1, uv + 1, vertex + 1);
    else
        sink_printf(out, " %u/%u", vertex + 1, uv + 1);
}

enum status mesh_obj_write(const char *path, const struct export_input *input, const struct parts *parts,
                           struct error *err) {
    const struct mesh *mesh = input->mesh;
    struct sink out;
    enum status status = sink_open(&out, path, UINT32_MAX, err);
    if (status != STATUS_OK)
        return status;
    sink_offset(&out, "#", mesh->offset, "\n");
    sink_printf(&out, "mtllib scene.mtl\n");
    for (size_t v = 0; v < mesh->vertex_count; v++)
        sink_printf(&out, "v " SINK_FLOAT " " SINK_FLOAT " " SINK_FLOAT "\n", (double)mesh->position[v].x,
                    (double)mesh->position[v].y, (double)mesh->position[v].z);
    for (size_t v = 0; v < parts->seams.vertex_count; v++) {
        vec2 uv = seams_uv(&parts->seams, input->atlas, v);
        sink_printf(&out, "vt " SINK_FLOAT " " SINK_FLOAT "\n", (double)uv.x, (double)(1.0f - uv.y));
    }
    for (size_t v = 0; v < mesh->vertex_count && mesh->normal; v++)
        sink_printf(&out, "vn " SINK_FLOAT " " SINK_FLOAT " " SINK_FLOAT "\n", (double)mesh->normal[v].x,
                    (double)mesh->normal[v].y, (double)mesh->normal[v].z);
    for (size_t p = 0; p < parts->count; p++) {
        const struct part *part = &parts->part[p];
        char label[PARTS_LABEL_BYTES];
        parts_label(input->segments, mesh, part->segment, label);
        sink_printf(&out, "o %s\nusemtl %s\n", label, label);
        for (size_t i = part->first_triangle; i < part->first_triangle + part->triangle_count; i++) {
            uint32_t t = parts->order[i];
            sink_printf(&out, "f");
            for (int c = 0; c < 3; c++)
                put_corner(&out, mesh->index[t][c], parts->seams.index[t][c], mesh->normal != NULL);
            sink_printf(&out, "\n");
        }
    }
    return sink_close(&out, STATUS_OK, err);
}

enum status mesh_mtl_write(const char *path, const struct export_input *input, const struct parts *parts,
                           const char *base_color, const char *emission, struct error *err) {
    const struct materials *m = input->materials;
    struct sink out;
    enum status status = sink_open(&out, path, UINT32_MAX, err);
    if (status != STATUS_OK)
        return status;
    float *scales = emission_texture_scales(input);
    for (size_t p = 0; p < parts->count; p++) {
        uint32_t s = parts->part[p].segment;
        double specular = (double)m->specular[s], roughness = (double)m->roughness[s];
        double smooth = 1.0 - roughness;
        char label[PARTS_LABEL_BYTES];
        parts_label(input->segments, input->mesh, s, label);
        sink_printf(&out,
                    "newmtl %s\nKd 1 1 1\nmap_Kd %s\nKs " SINK_FLOAT " " SINK_FLOAT " " SINK_FLOAT
                    "\nNi 1.5\nNs " SINK_FLOAT "\nPr " SINK_FLOAT "\n",
                    label, base_color, specular, specular, specular, MAX_NS * smooth * smooth, roughness);
        bool varies = scales && scales[s] > 0.0f;
        rgb e = varies ? rgb_gray(scales[s]) : m->emission[s];
        if (rgb_max(e) > 0.0f)
            sink_printf(&out, "Ke " SINK_FLOAT " " SINK_FLOAT " " SINK_FLOAT "\n", (double)e.r, (double)e.g,
                        (double)e.b);
        if (varies)
            sink_printf(&out, "map_Ke %s\n", emission);
        sink_printf(&out, "illum 2\n\n");
    }
    mem_free(scales);
    return sink_close(&out, STATUS_OK, err);
}
