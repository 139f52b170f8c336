/* bake.c -- see bake.h. */
#include "server/relight/bake.h"

#include <math.h>

#include "common/mem.h"
#include "server/scene/inverse_uv.h"

#define MIN_SIZE 64       /* texels a side: mips and gutters need some room, however small the pictures are */
#define UTILISATION 0.5   /* of an atlas, about */
#define MIN_DENSITY 0.05f /* of a triangle, as a share of the finest one's; those without a picture have it */
#define TAPS 4            /* by which a texel is averaged: 2 x 2 */

void bake_release(struct baked *b) {
    atlas_release(&b->atlas);
    mem_free(b->base_color);
    mem_free(b->gloss);
    mem_free(b->emission);
    mem_free(b->part);
    *b = (struct baked){0};
}

static const struct mesh_material *material_of(const struct mesh *mesh, const struct mesh_materials *materials,
                                               size_t triangle) {
    return &materials->material[mesh->object_id[triangle]];
}

/* Area of a triangle in the pixels of its material's finest picture. */
static double pixels_of(const struct mesh *mesh, const struct mesh_materials *materials, size_t triangle) {
    const struct mesh_material *m = material_of(mesh, materials, triangle);
    if (!mesh->uv)
        return 0.0;
    vec2 a = mesh->uv[triangle][0], b = mesh->uv[triangle][1], c = mesh->uv[triangle][2];
    double area = 0.5 * fabs((double)(b.x - a.x) * (double)(c.y - a.y) - (double)(b.y - a.y) * (double)(c.x - a.x));
    double most = 0.0;
    for (int q = 0; q < MATERIAL_QUANTITIES; q++) {
        const struct material_map *map = &m->map[q];
        if (!map->is_there)
            continue;
        const struct image *image = &materials->image[map->image].image;
        double turn =
            fabs((double)map->turn[0][0] * (double)map->turn[1][1] - (double)map->turn[0][1] * (double)map->turn[1][0]);
        most = fmax(most, area * turn * (double)image->width * (double)image->height);
    }
    return isfinite(most) ? most : 0.0;
}

/* Makes the atlas: as many texels as the pictures have pixels on the mesh, where these are finest most. */
static enum status make_atlas(const struct mesh *mesh, const struct mesh_materials *materials,
                              const struct segments *segments, struct atlas *atlas, struct error *err) {
    float *density = mem_array(mesh->triangle_count, sizeof *density), finest = 0.0f;
    double sum = 0.0;
    for (size_t t = 0; t < mesh->triangle_count; t++) {
        double pixels = pixels_of(mesh, materials, t), area = (double)mesh_triangle_area(mesh, t);
        density[t] = (float)sqrt(pixels / area);
        finest = fmaxf(finest, density[t]);
        sum += pixels;
    }
    for (size_t t = 0; t < mesh->triangle_count; t++)
        density[t] = finest > 0.0f ? fmaxf(density[t] / finest, MIN_DENSITY) : 1.0f;
    double size = fmin(fmax(ceil(sqrt(sum / UTILISATION)), MIN_SIZE), BAKE_MAX_SIZE);
    enum status status = atlas_make_uneven(atlas, mesh, segments, (uint32_t)size, density, ATLAS_PADDING, err);
    while (status == STATUS_INPUT && size < BAKE_MAX_SIZE) { /* of a mesh in many pieces each takes some texels */
        size = fmin(2.0 * size, BAKE_MAX_SIZE);
        status = atlas_make_uneven(atlas, mesh, segments, (uint32_t)size, density, ATLAS_PADDING, err);
    }
    mem_free(density);
    return status;
}

/* --- filling it ----------------------------------------------------------------------------------- */

struct filling {
    const struct mesh *mesh;
    const struct mesh_materials *materials;
    const struct inverse_uv *inverse;
    struct baked *baked;
};

static rgb value_of(const struct filling *f, const struct mesh_material *m, enum material_quantity quantity, rgb factor,
                    vec2 uv) {
    const struct material_map *map = &m->map[quantity];
    bool is_shown = map->is_there && isfinite(uv.x) && isfinite(uv.y); /* some faces of an OBJ have no coordinates */
    return is_shown ? rgb_mul(factor, material_map_value(f->materials, map, uv)) : factor;
}

/* Adds a share of what the material is at a point. */
static void add_point(const struct filling *f, size_t texel, const struct mesh_material *m, vec2 uv) {
    struct baked *b = f->baked;
    rgb base = value_of(f, m, MATERIAL_BASE_COLOR, m->base_color, uv);
    const float color[3] = {base.r, base.g, base.b};
    for (int c = 0; c < 3; c++)
        b->base_color[texel][c] += clampf(color[c], 0.0f, 1.0f) / TAPS;
    if (b->gloss) {
        float roughness = value_of(f, m, MATERIAL_ROUGHNESS, rgb_gray(m->roughness), uv).r;
        float metallic = value_of(f, m, MATERIAL_METALLIC, rgb_gray(m->metallic), uv).r;
        b->gloss[texel][0] += clampf(roughness, 0.0f, 1.0f) / TAPS;
        b->gloss[texel][1] += clampf(metallic, 0.0f, 1.0f) / TAPS;
    }
    if (b->emission) {
        rgb light = value_of(f, m, MATERIAL_EMISSION, m->emission, uv);
        const float radiance[3] = {light.r, light.g, light.b};
        for (int c = 0; c < 3; c++)
            b->emission[texel][c] += fmaxf(radiance[c], 0.0f) / TAPS;
    }
}

static void fill_texel(void *user, size_t index, int thread) {
    (void)thread;
    const struct filling *f = user;
    size_t texel = f->inverse->valid[index];
    uint32_t x = (uint32_t)(texel % f->inverse->width), y = (uint32_t)(texel / f->inverse->width);
    f->baked->base_color[texel][3] = 1.0f;
    f->baked->part[texel] = (uint32_t)f->mesh->object_id[f->inverse->triangle[texel]];
    for (int k = 0; k < TAPS; k++) {
        uint32_t triangle;
        float b1, b2;
        inverse_uv_lookup(f->inverse, &f->baked->atlas, (float)x + 0.25f + 0.5f * (float)(k % 2),
                          (float)y + 0.25f + 0.5f * (float)(k / 2), &triangle, &b1, &b2);
        vec2 uv = {NAN, NAN};
        if (f->mesh->uv) {
            const vec2 *c = f->mesh->uv[triangle];
            float b0 = 1.0f - b1 - b2; /* from the lower left; ours from the upper left */
            uv = vec2_make(b0 * c[0].x + b1 * c[1].x + b2 * c[2].x, 1.0f - b0 * c[0].y - b1 * c[1].y - b2 * c[2].y);
        }
        add_point(f, texel, material_of(f->mesh, f->materials, triangle), uv);
    }
}

static bool has_map(const struct mesh_materials *materials, enum material_quantity quantity) {
    for (size_t i = 0; i < materials->material_count; i++)
        if (materials->material[i].map[quantity].is_there)
            return true;
    return false;
}

enum status bake_make(const struct mesh *mesh, const struct mesh_materials *materials, struct parallel *pool,
                      struct baked *b, struct error *err) {
    struct segments segments;
    struct inverse_uv inverse;
    *b = (struct baked){0};
    segments_from_object_id(&segments, mesh);
    enum status status = make_atlas(mesh, materials, &segments, &b->atlas, err);
    segments_release(&segments);
    if (status != STATUS_OK)
        return status;
    size_t texels = (size_t)b->atlas.width * b->atlas.height;
    b->base_color = mem_calloc(texels, sizeof *b->base_color);
    b->part = mem_calloc(texels, sizeof *b->part);
    if (has_map(materials, MATERIAL_ROUGHNESS) || has_map(materials, MATERIAL_METALLIC))
        b->gloss = mem_calloc(texels, sizeof *b->gloss);
    if (has_map(materials, MATERIAL_EMISSION))
        b->emission = mem_calloc(texels, sizeof *b->emission);
    inverse_uv_make(&inverse, &b->atlas, mesh->triangle_count, pool);
    struct filling filling = {mesh, materials, &inverse, b};
    parallel_for(pool, inverse.valid_count, fill_texel, &filling);
    inverse_uv_release(&inverse);
    return STATUS_OK;
}
