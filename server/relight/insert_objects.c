/* insert_objects.c -- see insert_objects.h. A material without pictures has one texel in a square of four, so that no
 * lookup mixes it with others; an object with pictures has a block as large as its atlas. */
#include "server/relight/insert_objects.h"

#include <string.h>

#include "common/image.h"
#include "common/mem.h"

#define CELL 2          /* texels a side */
#define MAX_ROWS 65536u /* of textures: a path keeps a texel's place in 16 bits (render/lanes.h) */

/* Where texels go. */
struct texel_plan {
    uint32_t width, first_row, cell_rows, height;
};

static size_t part_count(const struct virtual_objects *objects) {
    size_t count = 0;
    for (size_t i = 0; i < objects->count; i++)
        count += objects->object[i].part_count;
    return count;
}

char *insert_objects_name(const struct virtual_objects *objects, size_t i) {
    size_t object = 0;
    while (i >= objects->object[object].part_count)
        i -= objects->object[object++].part_count;
    const struct virtual_object *t = &objects->object[object];
    return t->part_count == 1 ? mem_strdup(t->name) : mem_printf("%s_%zu", t->name, i);
}

static enum status plan(const struct virtual_objects *objects, const struct texture *room, struct texel_plan *l,
                        struct error *err) {
    uint64_t blocks = 0;
    *l = (struct texel_plan){.width = room->width > CELL ? room->width : CELL, .first_row = room->height};
    for (size_t i = 0; i < objects->count; i++) {
        const struct baked *b = objects->object[i].baked;
        blocks += b ? b->atlas.height : 0;
        l->width = b && b->atlas.width > l->width ? b->atlas.width : l->width;
    }
    uint32_t columns = l->width / CELL;
    l->cell_rows = CELL * (uint32_t)((part_count(objects) + columns - 1) / columns);
    uint64_t height = (uint64_t)l->first_row + l->cell_rows + blocks;
    l->height = (uint32_t)height;
    if (height <= MAX_ROWS)
        return STATUS_OK;
    return error_set(err, STATUS_LIMIT, "the pictures of the inserted meshes take %llu rows of texels, more than %u",
                     (unsigned long long)height, MAX_ROWS);
}

/* Copies rows of `bytes` a texel into a larger array of zeros; the caller's. */
static void *enlarge(const void *from, const struct texture *old, const struct texel_plan *l, size_t bytes) {
    char *to = mem_calloc_large((size_t)l->width * l->height, bytes);
    for (size_t y = 0; y < old->height; y++)
        memcpy(to + y * l->width * bytes, (const char *)from + y * old->width * bytes, old->width * bytes);
    return to;
}

static void extend_textures(struct materials *m, const struct texel_plan *l) {
    struct texture *t = &m->base_color;
    float(*texel)[4] = enlarge(t->texel, t, l, sizeof *texel);
    if (m->emission_pattern) {
        uint16_t(*pattern)[3] = enlarge(m->emission_pattern, t, l, sizeof *pattern);
        mem_free(m->emission_pattern);
        m->emission_pattern = pattern;
    }
    mem_free(t->texel);
    t->texel = texel;
    t->width = l->width;
    t->height = l->height;
}

/* --- segments ------------------------------------------------------------------------------------- */

static void extend_segments(struct recovered *r, const struct virtual_objects *objects) {
    struct materials *m = &r->materials;
    size_t old = r->segments.count, count = old + part_count(objects), s = old;
    m->roughness = mem_realloc_array(m->roughness, count, sizeof *m->roughness);
    m->specular = mem_realloc_array(m->specular, count, sizeof *m->specular);
    m->emission = mem_realloc_array(m->emission, count, sizeof *m->emission);
    m->cone = mem_array(count, sizeof *m->cone);
    m->metallic = mem_calloc(count, sizeof *m->metallic);
    r->segments.id = mem_realloc_array(r->segments.id, count, sizeof *r->segments.id);
    for (size_t i = 0; i < count; i++) {
        m->cone[i] = (struct emission_cone){-1.0f, -1.0f};
        r->segments.id[i] = (int64_t)i;
    }
    bool has_metals = false;
    for (size_t i = 0; i < objects->count; i++) {
        const struct virtual_object *object = &objects->object[i];
        bool has_gloss = object->baked && object->baked->gloss;
        for (size_t k = 0; k < object->part_count; k++, s++) {
            const struct virtual_object_part *part = &object->part[k];
            m->cone[s] = object->cone;
            m->roughness[s] = part->roughness;
            m->specular[s] = part->specular;
            m->emission[s] = part->emission;
            m->metallic[s] = has_gloss ? MATERIALS_BY_TEXEL : part->metallic;
            has_metals = has_metals || m->metallic[s] != 0.0f;
        }
    }
    if (!has_metals) {
        mem_free(m->metallic);
        m->metallic = NULL;
    }
    m->segment_count = r->segments.count = count;
}

/* --- texels --------------------------------------------------------------------------------------- */

/* The texel of material number i. */
static vec2 set_cell(struct materials *m, const struct texel_plan *l, size_t i, rgb color) {
    uint32_t columns = l->width / CELL;
    uint32_t x = CELL * (uint32_t)(i % columns), y = l->first_row + CELL * (uint32_t)(i / columns);
    float *texel = m->base_color.texel[(size_t)y * l->width + x];
    texel[0] = color.r;
    texel[1] = color.g;
    texel[2] = color.b;
    texel[3] = 1.0f;
    return vec2_make((float)x + 0.5f, (float)y + 0.5f);
}

/* The block of an object from row `top` on; its first material is segment `first`. */
static void set_block(struct materials *m, const struct texel_plan *l, const struct baked *b, uint32_t top,
                      size_t first) {
    if (b->emission && !m->emission_pattern)
        materials_start_emission_pattern(m);
    if (b->gloss && !m->gloss)
        m->gloss = mem_calloc_large((size_t)l->width * l->height, sizeof *m->gloss);
    for (size_t i = 0; i < (size_t)b->atlas.width * b->atlas.height; i++) {
        size_t at = (top + i / b->atlas.width) * l->width + i % b->atlas.width;
        memcpy(m->base_color.texel[at], b->base_color[i], sizeof b->base_color[i]);
        if (b->base_color[i][3] == 0.0f)
            continue;
        for (int c = 0; c < 2 && b->gloss; c++)
            m->gloss[at][c] = image_half_from_float(b->gloss[i][c]);
        if (b->emission)
            materials_set_emission_pattern(m, at, rgb_make(b->emission[i][0], b->emission[i][1], b->emission[i][2]),
                                           m->emission[first + b->part[i]]);
    }
}

/* --- triangles ------------------------------------------------------------------------------------ */

/* Where one mesh has normals, the others get zeros, which mean none. */
static void append_mesh(struct mesh *mesh, const struct mesh *more) {
    size_t vertices = mesh->vertex_count + more->vertex_count, triangles = mesh->triangle_count + more->triangle_count;
    mesh->position = mem_realloc_array(mesh->position, vertices, sizeof *mesh->position);
    memcpy(mesh->position + mesh->vertex_count, more->position, more->vertex_count * sizeof *mesh->position);
    if (mesh->normal || more->normal) {
        vec3 *normal = mem_calloc(vertices, sizeof *normal);
        if (mesh->normal)
            memcpy(normal, mesh->normal, mesh->vertex_count * sizeof *normal);
        if (more->normal)
            memcpy(normal + mesh->vertex_count, more->normal, more->vertex_count * sizeof *normal);
        mem_free(mesh->normal);
        mesh->normal = normal;
    }
    mem_free(mesh->uv); /* of no use in a render */
    mesh->uv = NULL;
    mesh->index = mem_realloc_array(mesh->index, triangles, sizeof *mesh->index);
    for (size_t t = 0; t < more->triangle_count; t++)
        for (int k = 0; k < 3; k++)
            mesh->index[mesh->triangle_count + t][k] = (uint32_t)mesh->vertex_count + more->index[t][k];
    mesh->vertex_count = vertices;
    mesh->triangle_count = triangles;
}

/* `place` of each material, for an object without pictures. */
static void put_thing(struct recovered *r, struct mesh *mesh, const struct virtual_object *object, size_t first_segment,
                      const vec2 *place, uint32_t top) {
    size_t first = mesh->triangle_count;
    append_mesh(mesh, &object->mesh);
    r->atlas.corner = mem_realloc_array(r->atlas.corner, mesh->triangle_count, sizeof *r->atlas.corner);
    r->segments.of_triangle =
        mem_realloc_array(r->segments.of_triangle, mesh->triangle_count, sizeof *r->segments.of_triangle);
    for (size_t t = first; t < mesh->triangle_count; t++) {
        size_t part = object->mesh.object_id ? (size_t)object->mesh.object_id[t - first] : 0;
        for (int k = 0; k < 3; k++) {
            vec2 own = object->baked ? object->baked->atlas.corner[t - first][k] : place[part];
            r->atlas.corner[t][k] = object->baked ? vec2_make(own.x, own.y + (float)top) : own;
        }
        r->segments.of_triangle[t] = (uint32_t)(first_segment + part);
    }
}

enum status insert_objects(const struct virtual_objects *objects, struct recovered *r, struct mesh *mesh,
                           struct error *err) {
    struct texel_plan l;
    size_t segment = r->segments.count, cell = 0;
    if (objects->count == 0)
        return STATUS_OK;
    enum status status = plan(objects, &r->materials.base_color, &l, err);
    if (status != STATUS_OK)
        return status;
    extend_segments(r, objects);
    extend_textures(&r->materials, &l);
    r->atlas.width = l.width;
    r->atlas.height = l.height;
    uint32_t top = l.first_row + l.cell_rows;
    for (size_t i = 0; i < objects->count; i++) {
        const struct virtual_object *object = &objects->object[i];
        vec2 *place = mem_array(object->part_count, sizeof *place);
        for (size_t k = 0; k < object->part_count; k++)
            place[k] = set_cell(&r->materials, &l, cell++, object->part[k].base_color);
        if (object->baked)
            set_block(&r->materials, &l, object->baked, top, segment);
        put_thing(r, mesh, object, segment, place, top);
        top += object->baked ? object->baked->atlas.height : 0;
        segment += object->part_count;
        mem_free(place);
    }
    return STATUS_OK;
}
