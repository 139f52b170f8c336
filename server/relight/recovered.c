/* recovered.c -- see recovered.h. */
#include "server/relight/recovered.h"

#include <string.h>

#include "common/buf.h"
#include "common/file.h"
#include "common/image.h"
#include "common/mem.h"
#include "common/output_names.h"
#include "server/ingest/mesh/ply_header.h"

#define PLY_LIMIT ((size_t)1 << 34) /* bytes of scene.ply: the largest room, of 2^26 triangles, has some 3 GiB */
#define NO_TEXEL SIZE_MAX           /* of a segment */

/* --- scene.ply ---------------------------------------------------------------------------- */

/* What is used of scene.ply's body. */
struct charted {
    size_t vertex_count, triangle_count;
    vec3 *position;
    vec2 *st;
    uint32_t (*index)[3];
    uint32_t *segment;
};

static void charted_release(struct charted *c) {
    mem_free(c->position);
    mem_free(c->st);
    mem_free(c->index);
    mem_free(c->segment);
}

/* Byte offset of a property within its element; false when there is none of that type or a list precedes it. */
static bool find_property(const struct ply_header *h, const struct ply_element *e, const char *name, enum ply_type type,
                          size_t *offset) {
    *offset = 0;
    for (size_t i = e->first; i < e->first + e->property_count; i++) {
        const struct ply_property *p = &h->property[i];
        if (p->is_list)
            return false;
        if (strcmp(p->name, name) == 0)
            return p->type == type;
        *offset += ply_type_bytes(p->type);
    }
    return false;
}

static size_t element_bytes(const struct ply_header *h, const struct ply_element *e) {
    size_t bytes = 0;
    for (size_t i = e->first; i < e->first + e->property_count; i++)
        bytes += ply_type_bytes(h->property[i].type);
    return bytes;
}

static enum status read_vertices(struct charted *c, const struct ply_header *h, struct ply_cursor *at,
                                 struct error *err) {
    const struct ply_element *e = &h->element[0];
    static const char *const name[5] = {"x", "y", "z", "s", "t"};
    size_t offset[5], stride = element_bytes(h, e);
    for (int i = 0; i < 5; i++)
        if (strcmp(e->name, "vertex") != 0 || !find_property(h, e, name[i], PLY_FLOAT32, &offset[i]))
            return error_set(err, STATUS_INPUT, "%s: the vertices have no float %s", at->name, name[i]);
    if (e->count > (at->size - at->at) / stride)
        return error_set(err, STATUS_INPUT, "%s: ends within its vertices", at->name);
    c->vertex_count = (size_t)e->count;
    c->position = mem_array(c->vertex_count, sizeof *c->position);
    c->st = mem_array(c->vertex_count, sizeof *c->st);
    for (size_t v = 0; v < c->vertex_count; v++, at->at += stride) {
        float value[5];
        for (int i = 0; i < 5; i++)
            memcpy(&value[i], at->data + at->at + offset[i], sizeof value[i]);
        c->position[v] = vec3_make(value[0], value[1], value[2]);
        c->st[v] = vec2_make(value[3], value[4]);
    }
    return STATUS_OK;
}

/* Faces as mesh_ply.c writes them: a list of three corners, then properties of fixed size. */
static enum status read_faces(struct charted *c, const struct ply_header *h, struct ply_cursor *at, struct error *err) {
    const struct ply_element *e = &h->element[1];
    const struct ply_property *list = &h->property[e->first];
    struct ply_element rest = {"", e->count, e->first + 1, e->property_count - 1};
    size_t segment;
    if (strcmp(e->name, "face") != 0 || e->property_count < 2 || !list->is_list || list->count_type != PLY_UINT8 ||
        ply_type_bytes(list->type) != sizeof(uint32_t) ||
        (!find_property(h, &rest, "segment", PLY_INT32, &segment) &&
         !find_property(h, &rest, "segment", PLY_UINT32, &segment)))
        return error_set(err, STATUS_INPUT, "%s: its faces are not a list of corners and a segment", at->name);
    size_t corners = 3 * sizeof(uint32_t), stride = 1 + corners + element_bytes(h, &rest);
    if (e->count > (at->size - at->at) / stride)
        return error_set(err, STATUS_INPUT, "%s: ends within its faces", at->name);
    c->triangle_count = (size_t)e->count;
    c->index = mem_array(c->triangle_count, sizeof *c->index);
    c->segment = mem_array(c->triangle_count, sizeof *c->segment);
    for (size_t t = 0; t < c->triangle_count; t++, at->at += stride) {
        const uint8_t *face = at->data + at->at;
        memcpy(c->index[t], face + 1, corners);
        memcpy(&c->segment[t], face + 1 + corners + segment, sizeof c->segment[t]);
        for (int k = 0; k < 3; k++)
            if (face[0] != 3 || c->index[t][k] >= c->vertex_count)
                return error_set(err, STATUS_INPUT, "%s: face %zu is not a triangle of its vertices", at->name, t);
        if (c->segment[t] >= c->triangle_count)
            return error_set(err, STATUS_INPUT, "%s: face %zu names segment %u", at->name, t, c->segment[t]);
    }
    return STATUS_OK;
}

static enum status read_scene_ply(const char *dir, struct charted *c, struct error *err) {
    struct buf file;
    struct ply_header header;
    char *path = file_join(dir, OUTPUT_MESH);
    buf_init(&file, PLY_LIMIT);
    enum status status = file_read(path, &file, err);
    struct ply_cursor at = {.name = path, .data = (const uint8_t *)file.data, .size = file.length};
    if (status == STATUS_OK)
        status = ply_header_parse(&at, &header, err);
    if (status == STATUS_OK && (header.format != PLY_LITTLE_ENDIAN || header.element_count < 2))
        status = error_set(err, STATUS_INPUT, "%s: not the scene.ply of a reconstruction's outputs", path);
    if (status == STATUS_OK)
        status = read_vertices(c, &header, &at, err);
    if (status == STATUS_OK)
        status = read_faces(c, &header, &at, err);
    buf_release(&file);
    mem_free(path);
    return status;
}

/* Whether the corners of a triangle of scene.ply coincide with those of `mesh`, optionally with the second and third
 * swapped: reconstruction may have flipped triangles. */
static bool is_there(const struct charted *c, const struct mesh *mesh, size_t t, bool swapped) {
    for (size_t k = 0; k < 3; k++) {
        vec3 a = c->position[c->index[t][k]], b = mesh->position[mesh->index[t][swapped ? (3 - k) % 3 : k]];
        if (memcmp(&a, &b, sizeof a) != 0)
            return false;
    }
    return true;
}

/* The atlas and the segments of `mesh` from scene.ply. */
static enum status read_charts(struct recovered *r, const struct charted *c, const struct mesh *mesh, uint32_t width,
                               uint32_t height, struct error *err) {
    if (c->triangle_count != mesh->triangle_count)
        return error_set(err, STATUS_INPUT,
                         "scene.ply has %zu triangles, the room %zu: the outputs "
                         "belong to another room",
                         c->triangle_count, mesh->triangle_count);
    r->atlas = (struct atlas){.width = width, .height = height};
    r->atlas.corner = mem_array(mesh->triangle_count, sizeof *r->atlas.corner);
    r->segments.of_triangle = mem_array(mesh->triangle_count, sizeof *r->segments.of_triangle);
    for (size_t t = 0; t < mesh->triangle_count; t++) {
        bool swapped = !is_there(c, mesh, t, false);
        if (swapped && !is_there(c, mesh, t, true))
            return error_set(err, STATUS_INPUT,
                             "scene.ply: triangle %zu is not where the room "
                             "has it: the outputs belong to another room",
                             t);
        for (size_t k = 0; k < 3; k++) {
            vec2 st = c->st[c->index[t][swapped ? (3 - k) % 3 : k]];
            r->atlas.corner[t][k] = vec2_make(st.x * (float)width, (1.0f - st.y) * (float)height);
        }
        r->segments.of_triangle[t] = c->segment[t];
        if (c->segment[t] >= r->segments.count)
            r->segments.count = c->segment[t] + 1;
    }
    r->segments.id = mem_array(r->segments.count, sizeof *r->segments.id);
    for (size_t s = 0; s < r->segments.count; s++)
        r->segments.id[s] = (int64_t)s;
    return STATUS_OK;
}

/* --- textures ----------------------------------------------------------------------------- */

static enum status read_texture(const char *dir, const char *name, struct image *image, struct error *err) {
    char *path = file_join(dir, name);
    enum status status = image_read(path, image, NULL, err);
    if (status == STATUS_OK && image->channel_count != 3) {
        status = error_set(err, STATUS_INPUT, "%s: has %u channels instead of R G B or Y", path, image->channel_count);
        image_release(image);
    }
    mem_free(path);
    return status;
}

/* As read_texture, but of the atlas's size. */
static enum status read_sized(const char *dir, const char *name, const struct atlas *atlas, struct image *image,
                              struct error *err) {
    enum status status = read_texture(dir, name, image, err);
    if (status == STATUS_OK && (image->width != atlas->width || image->height != atlas->height)) {
        status = error_set(err, STATUS_INPUT, "%s/%s: %u x %u texels, base_color.exr has %u x %u", dir, name,
                           image->width, image->height, atlas->width, atlas->height);
        image_release(image);
    }
    return status;
}

static void take_base_color(struct recovered *r, const struct image *image) {
    for (size_t i = 0; i < r->inverse.valid_count; i++) {
        size_t texel = r->inverse.valid[i];
        memcpy(r->materials.base_color.texel[texel], image->pixel + 3 * texel, 3 * sizeof(float));
    }
}

/* One texel of each segment; NO_TEXEL where it has none. [segments.count], the caller's. */
static size_t *sample_texels(const struct recovered *r) {
    size_t *texel = mem_array(r->segments.count, sizeof *texel);
    for (size_t s = 0; s < r->segments.count; s++)
        texel[s] = NO_TEXEL;
    for (size_t i = r->inverse.valid_count; i-- > 0;)
        texel[r->segments.of_triangle[r->inverse.triangle[r->inverse.valid[i]]]] = r->inverse.valid[i];
    return texel;
}

static enum status take_segment_values(struct recovered *r, const char *dir, struct error *err) {
    static const char *const name[2] = {OUTPUT_ROUGHNESS, OUTPUT_SPECULAR};
    float *const to[2] = {r->materials.roughness, r->materials.specular};
    size_t *texel = sample_texels(r);
    enum status status = STATUS_OK;
    for (int k = 0; k < 2 && status == STATUS_OK; k++) {
        struct image image;
        status = read_sized(dir, name[k], &r->atlas, &image, err);
        if (status != STATUS_OK)
            break;
        for (size_t s = 0; s < r->segments.count; s++) {
            if (texel[s] != NO_TEXEL)
                to[k][s] = image.pixel[3 * texel[s]];
        }
        image_release(&image);
    }
    mem_free(texel);
    return status;
}

static uint32_t segment_of_texel(const struct recovered *r, size_t texel) {
    return r->segments.of_triangle[r->inverse.triangle[texel]];
}

/* The emission of a segment's texels, one by one. */
struct emission_sum {
    double sum[3], count;
    rgb first;
    bool varies; /* some texel's is not that of the first */
};

static rgb emission_at(const struct image *image, size_t texel) {
    const float *v = image->pixel + 3 * texel;
    return rgb_make(v[0], v[1], v[2]);
}

static void add_emission(struct emission_sum *e, rgb value) {
    const float v[3] = {value.r, value.g, value.b};
    if (e->count == 0.0)
        e->first = value;
    for (int c = 0; c < 3; c++)
        e->sum[c] += (double)v[c];
    e->count += 1.0;
    e->varies = e->varies || !rgb_is_black(rgb_sub(value, e->first));
}

/* A segment's emission is the mean of its texels, with a pattern where these differ. */
static void take_emission(struct recovered *r, const struct image *image) {
    struct materials *m = &r->materials;
    struct emission_sum *of = mem_calloc(r->segments.count, sizeof *of);
    for (size_t i = 0; i < r->inverse.valid_count; i++) {
        size_t texel = r->inverse.valid[i];
        add_emission(&of[segment_of_texel(r, texel)], emission_at(image, texel));
    }
    for (size_t s = 0; s < r->segments.count; s++) {
        const double *sum = of[s].sum, count = of[s].count;
        if (count > 0.0)
            m->emission[s] = rgb_make((float)(sum[0] / count), (float)(sum[1] / count), (float)(sum[2] / count));
    }
    for (size_t i = 0; i < r->inverse.valid_count; i++) {
        size_t texel = r->inverse.valid[i], s = segment_of_texel(r, texel);
        if (!of[s].varies)
            continue;
        if (!m->emission_pattern)
            materials_start_emission_pattern(m);
        materials_set_emission_pattern(m, texel, emission_at(image, texel), m->emission[s]);
    }
    mem_free(of);
}

static enum status read_emission(struct recovered *r, const char *dir, struct error *err) {
    struct image image;
    enum status status = read_sized(dir, OUTPUT_EMISSION, &r->atlas, &image, err);
    if (status != STATUS_OK)
        return status;
    take_emission(r, &image);
    image_release(&image);
    return STATUS_OK;
}

/* Distant light; most rooms have none. */
static enum status take_environment(struct recovered *r, const char *dir, struct parallel *pool, struct error *err) {
    struct image map = {0};
    char *path = file_join(dir, OUTPUT_ENVIRONMENT);
    enum status status = image_read(path, &map, NULL, err);
    if (status == STATUS_OK)
        world_set_environment(&r->world, &map, pool);
    image_release(&map);
    mem_free(path);
    return status == STATUS_NOT_FOUND ? STATUS_OK : status;
}

enum status recovered_read(const char *dir, const struct mesh *mesh, struct parallel *pool, struct recovered *r,
                           struct error *err) {
    struct charted charted = {0};
    struct image base_color = {0};
    memset(r, 0, sizeof *r);
    enum status status = read_texture(dir, OUTPUT_BASE_COLOR, &base_color, err);
    if (status != STATUS_OK)
        return status;
    status = read_scene_ply(dir, &charted, err);
    if (status == STATUS_OK)
        status = read_charts(r, &charted, mesh, base_color.width, base_color.height, err);
    charted_release(&charted);
    if (status != STATUS_OK)
        goto out;
    inverse_uv_make(&r->inverse, &r->atlas, mesh->triangle_count, pool);
    materials_init(&r->materials, &r->inverse, r->segments.count, rgb_gray(0.5f), 0.5f, 0.5f);
    take_base_color(r, &base_color);
    status = take_segment_values(r, dir, err);
    if (status == STATUS_OK)
        status = read_emission(r, dir, err);
out:
    image_release(&base_color);
    if (status != STATUS_OK)
        recovered_release(r);
    return status;
}

enum status recovered_load(const char *dir, const struct mesh *mesh, struct parallel *pool, struct recovered *r,
                           struct error *err) {
    enum status status = recovered_read(dir, mesh, pool, r, err);
    if (status != STATUS_OK)
        return status;
    status = world_init(&r->world, mesh, &r->segments, &r->atlas, &r->materials, NULL, pool, err);
    if (status == STATUS_OK)
        status = take_environment(r, dir, pool, err);
    if (status != STATUS_OK)
        recovered_release(r);
    return status;
}

void recovered_release(struct recovered *r) {
    world_release(&r->world);
    materials_release(&r->materials);
    inverse_uv_release(&r->inverse);
    atlas_release(&r->atlas);
    segments_release(&r->segments);
    memset(r, 0, sizeof *r);
}
