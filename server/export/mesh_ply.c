/* mesh_ply.c -- see mesh_ply.h. */
#include "server/export/mesh_ply.h"

#include "common/buf.h"
#include "server/export/parts.h"
#include "server/export/sink.h"

/* On one line each. */
static void put_names(struct sink *out, const struct mesh *mesh, const struct segments *segments) {
    struct buf text;
    buf_init(&text, PLY_NAMES_BYTES);
    for (size_t s = 0; s < segments->count; s++) {
        const char *name = segments_name(segments, mesh, s);
        if (!name)
            continue;
        size_t before = text.length;
        buf_printf(&text, "comment segment %zu %s", s, name);
        for (size_t i = before; i < text.length; i++)
            if ((unsigned char)text.data[i] < ' ')
                text.data[i] = ' ';
        buf_puts(&text, "\n");
        if (text.overflowed) {
            text.length = before;
            break;
        }
    }
    sink_bytes(out, text.data, text.length);
    buf_release(&text);
}

static void put_header(struct sink *out, const struct mesh *mesh, const struct segments *segments,
                       size_t vertex_count) {
    sink_printf(out, "ply\nformat binary_little_endian 1.0\n");
    put_names(out, mesh, segments);
    sink_offset(out, "comment", mesh->offset, "\n");
    sink_printf(out,
                "comment s t: atlas coordinates, origin lower left\n%s"
                "comment TextureFile base_color.png\n" /* as MeshLab and Blender read it */
                "element vertex %zu\n"
                "property float x\nproperty float y\nproperty float z\n%s"
                "property float s\nproperty float t\n%s"
                "element face %zu\n"
                "property list uchar int vertex_indices\n"
                "property int segment\nproperty int face\n"
                "end_header\n",
                mesh->uv ? "comment s1 t1: texture coordinates of the input, origin lower left\n" : "", vertex_count,
                mesh->normal ? "property float nx\nproperty float ny\nproperty float nz\n" : "",
                mesh->uv ? "property float s1\nproperty float t1\n" : "", mesh->triangle_count);
}

enum status mesh_ply_write(const char *path, const struct mesh *mesh, const struct segments *segments,
                           const struct atlas *atlas, struct error *err) {
    struct seams seams;
    struct sink out;
    enum status status = sink_open(&out, path, 0, err);
    if (status != STATUS_OK)
        return status;
    seams_make(&seams, mesh, atlas, NULL);
    put_header(&out, mesh, segments, seams.vertex_count);
    for (size_t v = 0; v < seams.vertex_count; v++) {
        sink_vec3(&out, seams_position(&seams, mesh, v));
        if (mesh->normal)
            sink_vec3(&out, seams_normal(&seams, mesh, v));
        vec2 uv = seams_uv(&seams, atlas, v);
        sink_float(&out, uv.x);
        sink_float(&out, 1.0f - uv.y);
        if (mesh->uv) {
            vec2 own = seams_input_uv(&seams, mesh, v);
            sink_float(&out, own.x);
            sink_float(&out, own.y);
        }
    }
    for (size_t t = 0; t < mesh->triangle_count; t++) {
        sink_bytes(&out, "\3", 1);
        for (int c = 0; c < 3; c++)
            sink_u32(&out, seams.index[t][c]);
        sink_u32(&out, segments->of_triangle[t]);
        sink_u32(&out, mesh->face[t]);
    }
    seams_release(&seams);
    return sink_close(&out, STATUS_OK, err);
}
