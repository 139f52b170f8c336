/* parts.c -- see parts.h. */
#include "server/export/parts.h"

#include <stdbool.h>
#include <stdio.h>
#include <string.h>

#include "common/mem.h"
#include "common/rng.h"
#include "common/utf8.h"

#define NONE UINT32_MAX /* no vertex */

/* The bits of the input's texture coordinates at a corner; 0: none. */
static uint64_t uv_key(const struct mesh *mesh, uint32_t corner) {
    uint64_t bits = 0;
    if (mesh_has_uv(mesh, corner / 3))
        memcpy(&bits, &mesh->uv[corner / 3][corner % 3], sizeof bits);
    return bits;
}

void seams_make(struct seams *s, const struct mesh *mesh, const struct atlas *atlas, const uint32_t *order) {
    size_t corner_count = 3 * mesh->triangle_count, size = 16;
    while (size < 2 * corner_count)
        size *= 2;
    uint32_t *table = mem_array(size, sizeof *table);
    for (size_t i = 0; i < size; i++)
        table[i] = NONE;
    s->vertex_count = 0;
    s->corner = mem_array(corner_count, sizeof *s->corner);
    s->index = mem_array(mesh->triangle_count, sizeof *s->index);
    for (size_t i = 0; i < corner_count; i++) {
        size_t t = order ? order[i / 3] : i / 3, c = i % 3;
        uint32_t vertex = mesh->index[t][c], chart = atlas->chart_of_triangle[t];
        uint64_t uv = uv_key(mesh, (uint32_t)(3 * t + c));
        size_t slot = rng_key(vertex, chart, uv) & (size - 1);
        for (; table[slot] != NONE; slot = (slot + 1) & (size - 1)) {
            uint32_t other = s->corner[table[slot]];
            if (mesh->index[other / 3][other % 3] == vertex && atlas->chart_of_triangle[other / 3] == chart &&
                uv_key(mesh, other) == uv)
                break;
        }
        if (table[slot] == NONE) {
            table[slot] = (uint32_t)s->vertex_count;
            s->corner[s->vertex_count++] = (uint32_t)(3 * t + c);
        }
        s->index[t][c] = table[slot];
    }
    mem_free(table);
}

void seams_release(struct seams *s) {
    mem_free(s->corner);
    mem_free(s->index);
    *s = (struct seams){0};
}

/* First triangle of each segment in the order by segment; [count + 1], the caller's. */
static size_t *sort_by_segment(const struct mesh *mesh, const struct segments *segments, uint32_t *order) {
    size_t *begin = mem_calloc(segments->count + 2, sizeof *begin);
    for (size_t t = 0; t < mesh->triangle_count; t++)
        begin[segments->of_triangle[t] + 2]++;
    for (size_t s = 2; s <= segments->count; s++)
        begin[s] += begin[s - 1];
    for (size_t t = 0; t < mesh->triangle_count; t++)
        order[begin[segments->of_triangle[t] + 1]++] = (uint32_t)t;
    return begin;
}

/* Vertices are numbered in the order of triangles, so those of a part follow those of the previous one. */
static void measure(struct parts *p, const struct mesh *mesh, struct part *part, size_t first_vertex) {
    part->first_vertex = first_vertex;
    part->lower = (vec3){INFINITY, INFINITY, INFINITY};
    part->upper = vec3_neg(part->lower);
    for (size_t i = part->first_triangle; i < part->first_triangle + part->triangle_count; i++) {
        for (int c = 0; c < 3; c++) {
            size_t vertex = p->seams.index[p->order[i]][c];
            vec3 at = seams_position(&p->seams, mesh, vertex);
            part->lower = (vec3){fminf(part->lower.x, at.x), fminf(part->lower.y, at.y), fminf(part->lower.z, at.z)};
            part->upper = (vec3){fmaxf(part->upper.x, at.x), fmaxf(part->upper.y, at.y), fmaxf(part->upper.z, at.z)};
            if (vertex - first_vertex >= part->vertex_count)
                part->vertex_count = vertex - first_vertex + 1;
        }
    }
}

enum status parts_make(struct parts *p, const struct mesh *mesh, const struct segments *segments,
                       const struct atlas *atlas, struct error *err) {
    *p = (struct parts){.order = mem_array(mesh->triangle_count, sizeof *p->order)};
    size_t *begin = sort_by_segment(mesh, segments, p->order), first_vertex = 0;
    for (size_t s = 0; s < segments->count; s++)
        p->count += begin[s + 1] > begin[s];
    if (p->count > PARTS_MAX) {
        enum status status = error_set(err, STATUS_LIMIT,
                                       "the room has %zu segments, a file of objects "
                                       "%d at most",
                                       p->count, PARTS_MAX);
        mem_free(begin);
        mem_free(p->order);
        return status;
    }
    seams_make(&p->seams, mesh, atlas, p->order);
    p->part = mem_calloc(p->count, sizeof *p->part);
    struct part *part = p->part;
    for (size_t s = 0; s < segments->count; s++) {
        if (begin[s + 1] == begin[s])
            continue;
        *part = (struct part){
            .segment = (uint32_t)s, .first_triangle = begin[s], .triangle_count = begin[s + 1] - begin[s]};
        measure(p, mesh, part, first_vertex);
        first_vertex += part->vertex_count;
        part++;
    }
    mem_free(begin);
    return STATUS_OK;
}

void parts_release(struct parts *p) {
    seams_release(&p->seams);
    mem_free(p->order);
    mem_free(p->part);
    *p = (struct parts){0};
}

static bool is_of_labels(uint32_t c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '-' ||
           (c >= 0x80 && utf8_kind(c) == UTF8_VISIBLE);
}

void parts_label(const struct segments *segments, const struct mesh *mesh, uint32_t segment,
                 char label[PARTS_LABEL_BYTES]) {
    const char *name = segments_name(segments, mesh, segment);
    size_t length = (size_t)snprintf(label, PARTS_LABEL_BYTES, "segment_%u%s", segment, name ? "_" : "");
    while (name && *name) {
        uint32_t character;
        size_t size = utf8_next(name, strlen(name), &character);
        bool is_plain = size > 0 && is_of_labels(character);
        if (length + size + 1 >= PARTS_LABEL_BYTES)
            break;
        if (is_plain) {
            memcpy(label + length, name, size);
            length += size;
        } else if (label[length - 1] != '_') { /* other characters in a row are one _ */
            label[length++] = '_';
        }
        name += size > 0 ? size : 1;
    }
    while (label[length - 1] == '_')
        length--;
    label[length] = '\0';
}
