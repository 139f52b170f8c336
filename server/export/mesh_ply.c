/* mesh_ply.c -- see mesh_ply.h. */
#include "server/export/mesh_ply.h"

#include <endian.h>
#include <stdint.h>
#include <string.h>

#include "common/buf.h"
#include "common/file.h"
#include "common/mem.h"
#include "common/rng.h"

#define NONE UINT32_MAX

/* The vertices of the file: one for each pair of vertex and chart, in order of first use. */
struct split {
    size_t count;
    uint32_t *corner;     /* [count] corner 3 t + c that a vertex is taken from */
    uint32_t (*index)[3]; /* [triangle_count] */
};

static void split_make(struct split *split, const struct mesh *mesh, const struct atlas *atlas) {
    size_t corner_count = 3 * mesh->triangle_count, size = 16;
    while (size < 2 * corner_count)
        size *= 2;
    uint32_t *table = mem_array(size, sizeof *table);
    for (size_t i = 0; i < size; i++)
        table[i] = NONE;
    split->count = 0;
    split->corner = mem_array(corner_count, sizeof *split->corner);
    split->index = mem_array(mesh->triangle_count, sizeof *split->index);
    for (size_t corner = 0; corner < corner_count; corner++) {
        uint32_t vertex = mesh->index[corner / 3][corner % 3];
        uint32_t chart = atlas->chart_of_triangle[corner / 3];
        size_t slot = rng_key(vertex, chart, 0) & (size - 1);
        for (; table[slot] != NONE; slot = (slot + 1) & (size - 1)) {
            uint32_t other = split->corner[table[slot]];
            if (mesh->index[other / 3][other % 3] == vertex &&
                atlas->chart_of_triangle[other / 3] == chart)
                break;
        }
        if (table[slot] == NONE) {
            table[slot] = (uint32_t)split->count;
            split->corner[split->count++] = (uint32_t)corner;
        }
        split->index[corner / 3][corner % 3] = table[slot];
    }
    mem_free(table);
}

static void split_release(struct split *split) {
    mem_free(split->corner);
    mem_free(split->index);
}

static char *put_u32(char *at, uint32_t value) {
    value = htole32(value);
    memcpy(at, &value, sizeof value);
    return at + sizeof value;
}

static char *put_float(char *at, float value) {
    uint32_t bits;
    memcpy(&bits, &value, sizeof bits);
    return put_u32(at, bits);
}

static char *put_vec3(char *at, vec3 v) {
    return put_float(put_float(put_float(at, v.x), v.y), v.z);
}

static void put_header(struct buf *out, const struct mesh *mesh, size_t vertex_count) {
    buf_printf(out,
               "ply\nformat binary_little_endian 1.0\n"
               "comment s t: atlas coordinates, origin lower left\n"
               "element vertex %zu\n"
               "property float x\nproperty float y\nproperty float z\n%s"
               "property float s\nproperty float t\n"
               "element face %zu\n"
               "property list uchar int vertex_indices\n"
               "property int segment\nproperty int face\n"
               "end_header\n",
               vertex_count,
               mesh->normal ? "property float nx\nproperty float ny\nproperty float nz\n" : "",
               mesh->triangle_count);
}

static char *put_vertices(char *at, const struct mesh *mesh, const struct atlas *atlas,
                          const struct split *split) {
    for (size_t i = 0; i < split->count; i++) {
        uint32_t t = split->corner[i] / 3, c = split->corner[i] % 3;
        uint32_t vertex = mesh->index[t][c];
        vec2 place = atlas->corner[t][c];
        at = put_vec3(at, mesh->position[vertex]);
        if (mesh->normal)
            at = put_vec3(at, mesh->normal[vertex]);
        at = put_float(at, place.x / (float)atlas->width);
        at = put_float(at, 1.0f - place.y / (float)atlas->height);
    }
    return at;
}

enum status mesh_ply_write(const char *path, const struct mesh *mesh,
                           const struct segments *segments, const struct atlas *atlas,
                           struct error *err) {
    struct split split;
    struct buf header;
    split_make(&split, mesh, atlas);
    buf_init(&header, 4096);
    put_header(&header, mesh, split.count);
    size_t vertex_bytes = sizeof(float) * (mesh->normal ? 8 : 5);
    size_t face_bytes = 1 + 5 * sizeof(uint32_t);
    size_t length =
        header.length + split.count * vertex_bytes + mesh->triangle_count * face_bytes;
    char *file = mem_alloc(length), *at = file + header.length;
    memcpy(file, header.data, header.length);
    at = put_vertices(at, mesh, atlas, &split);
    for (size_t t = 0; t < mesh->triangle_count; t++) {
        *at++ = 3;
        for (int c = 0; c < 3; c++)
            at = put_u32(at, split.index[t][c]);
        at = put_u32(at, segments->of_triangle[t]);
        at = put_u32(at, mesh->face[t]);
    }
    enum status status = file_replace(path, file, length, err);
    mem_free(file);
    buf_release(&header);
    split_release(&split);
    return status;
}
