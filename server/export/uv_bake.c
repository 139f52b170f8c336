/* uv_bake.c -- see uv_bake.h. */
#include "server/export/uv_bake.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "common/image.h"
#include "common/mem.h"
#include "server/scene/coverage.h"

/* Coordinates may leave the unit square by so much: rounding, and half a texel of a picture of 512. They are
 * clamped. */
#define SQUARE_SLACK 1e-3f
/* Share of texels that more than one triangle may cover: packers let charts touch, and round. Layouts that mirror or
 * repeat a part have tens of percent. */
#define OVERLAP_MAX 0.002
/* Share of the square that a layout of a whole room covers at least. Coordinates that are all alike, or pick colours
 * from a palette, cover less. */
#define AREA_MIN 0.01
#define BATCH 1024 /* valid texels */

/* --- whether it can be made ------------------------------------------------------------------ */

static void refuse(struct uv_bake *b, const char *reason) { snprintf(b->reason, sizeof b->reason, "%s", reason); }

static bool is_within_square(const struct mesh *mesh) {
    for (size_t i = 0; i < 3 * mesh->triangle_count; i++) {
        vec2 uv = mesh->uv[i / 3][i % 3];
        if (mesh_has_uv(mesh, i / 3) && !(uv.x >= -SQUARE_SLACK && uv.y >= -SQUARE_SLACK &&
                                          uv.x <= 1.0f + SQUARE_SLACK && uv.y <= 1.0f + SQUARE_SLACK))
            return false;
    }
    return true;
}

/* Twice the area of a triangle of the plane. */
static double flat_area(const vec2 c[3]) {
    return fabs(((double)c[1].x - (double)c[0].x) * ((double)c[2].y - (double)c[0].y) -
                ((double)c[1].y - (double)c[0].y) * ((double)c[2].x - (double)c[0].x));
}

static double uv_share(const struct mesh *mesh) {
    double sum = 0.0;
    for (size_t t = 0; t < mesh->triangle_count; t++)
        if (mesh_has_uv(mesh, t) && flat_area(mesh->uv[t]) > 0.0)
            sum += (double)mesh_triangle_area(mesh, t);
    return sum / mesh_area(mesh);
}

/* --- the layout as an atlas ------------------------------------------------------------------- */

/* A coordinate in texels, in the units of coverage.h. */
static float to_texels(float part, uint32_t size) {
    return rintf(clampf(part, 0.0f, 1.0f) * (float)size * COVERAGE_UNITS) / COVERAGE_UNITS;
}

/* Triangles without coordinates lie outside, where they cover no texel. */
static void lay_out(struct atlas *a, const struct export_input *in) {
    const struct mesh *mesh = in->mesh;
    uint32_t size = in->atlas->width > in->atlas->height ? in->atlas->width : in->atlas->height;
    *a = (struct atlas){.width = size, .height = size};
    a->corner = mem_array(mesh->triangle_count, sizeof *a->corner);
    for (size_t i = 0; i < 3 * mesh->triangle_count; i++) {
        vec2 uv = mesh->uv[i / 3][i % 3];
        a->corner[i / 3][i % 3] = mesh_has_uv(mesh, i / 3) ? (vec2){to_texels(uv.x, size), to_texels(1.0f - uv.y, size)}
                                                           : (vec2){-16.0f, -16.0f};
    }
}

/* Whether (x, y), in texels, is strictly inside; exact, since corners are whole units. */
static bool holds(const vec2 corner[3], double x, double y) {
    int positive = 0, negative = 0;
    for (int i = 0; i < 3; i++) {
        vec2 p = corner[i], q = corner[(i + 1) % 3];
        double side = ((double)q.x - (double)p.x) * (y - (double)p.y) - ((double)q.y - (double)p.y) * (x - (double)p.x);
        positive += side > 0.0;
        negative += side < 0.0;
    }
    return positive == 3 || negative == 3;
}

static size_t count_overlaps(const struct uv_bake *b, uint32_t t) {
    const vec2 *c = b->atlas.corner[t];
    size_t count = 0;
    int64_t left = (int64_t)fminf(c[0].x, fminf(c[1].x, c[2].x)), right = (int64_t)fmaxf(c[0].x, fmaxf(c[1].x, c[2].x));
    int64_t top = (int64_t)fminf(c[0].y, fminf(c[1].y, c[2].y)), bottom = (int64_t)fmaxf(c[0].y, fmaxf(c[1].y, c[2].y));
    for (int64_t y = top; y <= bottom && y < b->inverse.height; y++) {
        for (int64_t x = left; x <= right && x < b->inverse.width; x++) {
            uint32_t owner = x >= 0 && y >= 0 ? b->inverse.triangle[(size_t)y * b->inverse.width + (size_t)x] : t;
            double px = (double)x + 0.5, py = (double)y + 0.5;
            if (owner != t && owner != INVERSE_UV_NONE)
                count += holds(c, px, py) && holds(b->atlas.corner[owner], px, py);
        }
    }
    return count;
}

/* --- resampling -------------------------------------------------------------------------------- */

/* Samples a side so that they lie no farther apart than the atlas's texels. */
static int sample_count(const struct uv_bake *b, uint32_t t) {
    double own = flat_area(b->atlas.corner[t]), atlas = flat_area(b->input.atlas->corner[t]);
    double side = own > 0.0 ? sqrt(atlas / own) : BAKE_SAMPLES_MAX;
    return side >= BAKE_SAMPLES_MAX ? BAKE_SAMPLES_MAX : side <= 1.0 ? 1 : (int)ceil(side);
}

/* Where the texel's point (dx, dy) lies in the atlas. */
static vec2 place_of(const struct uv_bake *b, size_t texel, float dx, float dy) {
    uint32_t t, x = (uint32_t)(texel % b->inverse.width), y = (uint32_t)(texel / b->inverse.width);
    float b1, b2;
    inverse_uv_lookup(&b->inverse, &b->atlas, (float)x + dx, (float)y + dy, &t, &b1, &b2);
    return atlas_point(b->input.atlas, t, b1, b2);
}

static rgb mean_color(const struct uv_bake *b, size_t texel, int side) {
    rgb sum = {0.0f, 0.0f, 0.0f};
    for (int i = 0; i < side * side; i++) {
        struct texture_taps taps;
        vec2 at =
            place_of(b, texel, ((float)(i % side) + 0.5f) / (float)side, ((float)(i / side) + 0.5f) / (float)side);
        texture_taps(&b->input.materials->base_color, at.x, at.y, &taps);
        sum = rgb_add(sum, texture_gather(&b->input.materials->base_color, &taps));
    }
    return rgb_scale(sum, 1.0f / (float)(side * side));
}

static size_t nearest_texel(const struct atlas *a, vec2 at) {
    uint32_t x = (uint32_t)clampf(at.x, 0.0f, (float)a->width - 1.0f);
    uint32_t y = (uint32_t)clampf(at.y, 0.0f, (float)a->height - 1.0f);
    return (size_t)y * a->width + x;
}

static void fill_texel(struct uv_bake *b, size_t texel) {
    const struct materials *from = b->input.materials;
    struct materials *to = &b->materials;
    uint32_t t = b->inverse.triangle[texel];
    rgb color = mean_color(b, texel, sample_count(b, t));
    vec2 at = place_of(b, texel, 0.5f, 0.5f);
    size_t nearest = nearest_texel(b->input.atlas, at);
    float *out = to->base_color.texel[texel];
    out[0] = color.r;
    out[1] = color.g;
    out[2] = color.b;
    if (from->deviation)
        to->deviation[texel] = from->deviation[nearest];
    if (from->emission_pattern && !rgb_is_black(rgb_from_half(from->emission_pattern[nearest]))) {
        uint32_t s = b->input.segments->of_triangle[t];
        rgb mean = from->emission[s];
        materials_set_emission_pattern(to, texel, materials_emission(from, s, at.x, at.y), mean);
    }
}

static void fill_batch(void *user, size_t batch, int thread) {
    struct uv_bake *b = user;
    size_t end = (batch + 1) * BATCH;
    (void)thread;
    for (size_t i = batch * BATCH; i < end && i < b->inverse.valid_count; i++)
        fill_texel(b, b->inverse.valid[i]);
}

static void fill(struct uv_bake *b) {
    const struct materials *from = b->input.materials;
    struct materials *to = &b->materials;
    size_t count = from->segment_count;
    materials_init(to, &b->inverse, count, rgb_gray(0.0f), 0.0f, 0.0f);
    memcpy(to->roughness, from->roughness, count * sizeof *to->roughness);
    memcpy(to->specular, from->specular, count * sizeof *to->specular);
    memcpy(to->emission, from->emission, count * sizeof *to->emission);
    to->spread = from->spread;
    if (from->deviation)
        materials_start_deviation(to);
    if (from->emission_pattern)
        materials_start_emission_pattern(to);
    parallel_for(b->input.pool, (b->inverse.valid_count + BATCH - 1) / BATCH, fill_batch, b);
    b->atlas.utilisation = (double)b->inverse.valid_count / ((double)b->atlas.width * (double)b->atlas.height);
    b->input.atlas = &b->atlas;
    b->input.inverse = &b->inverse;
    b->input.materials = to;
}

/* --- the whole ---------------------------------------------------------------------------------- */

/* Whether no two places share texels. */
static bool is_flat(struct uv_bake *b) {
    const struct mesh *mesh = b->input.mesh;
    double area = 0.0, valid = (double)b->inverse.valid_count; /* texels */
    size_t overlaps = 0;
    for (size_t t = 0; t < mesh->triangle_count; t++) {
        area += 0.5 * flat_area(b->atlas.corner[t]);
        overlaps += count_overlaps(b, (uint32_t)t);
    }
    /* Triangles smaller than a texel hold no centre; but the areas of all are no more than what they cover. */
    b->overlap_share = fmax((double)overlaps, area - valid) / fmax(valid, 1.0);
    if (b->overlap_share > OVERLAP_MAX)
        snprintf(b->reason, sizeof b->reason,
                 "the input's texture coordinates overlap: %.3g %% of their texels belong to more than one triangle",
                 100.0 * fmin(b->overlap_share, 1.0));
    else if (area < AREA_MIN * (double)b->atlas.width * (double)b->atlas.height)
        snprintf(b->reason, sizeof b->reason, "the input's texture coordinates cover only %.2g %% of their square",
                 100.0 * area / ((double)b->atlas.width * (double)b->atlas.height));
    return b->reason[0] == '\0';
}

void uv_bake_make(struct uv_bake *b, const struct export_input *input) {
    *b = (struct uv_bake){.input = *input, .uv_share = uv_share(input->mesh)};
    if (!input->options.bakes_uv)
        refuse(b, "bake_uv is off");
    else if (input->mesh->picture_count > 1)
        snprintf(b->reason, sizeof b->reason, "the input's texture coordinates are of %zu pictures",
                 input->mesh->picture_count);
    else if (!is_within_square(input->mesh))
        refuse(b, "the input's texture coordinates leave the unit square: tiles or a repeated picture");
    if (b->reason[0])
        return;
    lay_out(&b->atlas, input);
    inverse_uv_make(&b->inverse, &b->atlas, input->mesh->triangle_count, input->pool);
    b->is_made = is_flat(b);
    if (b->is_made)
        fill(b);
}

void uv_bake_release(struct uv_bake *b) {
    materials_release(&b->materials);
    inverse_uv_release(&b->inverse);
    atlas_release(&b->atlas);
    *b = (struct uv_bake){0};
}
