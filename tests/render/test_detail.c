/* detail.h: of paint about as fine as the photographs' pixels less is lost than by the mean of what they show, on any
 * number of threads; and where edges are sharpened the draw of noise grows. */
#include "server/capture/halves.h"
#include "server/reconstruct/detail.h"
#include "server/reconstruct/divide.h"
#include "server/scene/surface.h"
#define PAINTED_WIDTH 40 /* pixels larger than texels */
#define PAINTED_HEIGHT 30
#define PAINTED_SIDE 8
#define PAINTED_GLOSS 0.0f
#include "tests/render/painted_room.h"

#define STEPS 4
#define SIDE 4 /* places of a texel, a row and column */
#define LOOKS_MOST 64
#define WHITE 2.0f /* what a white surface would send out: more than the brightest paint */

/* The mean over the photographs, as divide.h takes it. */
static struct measured mean_of(const struct painted *room, const struct surface_point *at) {
    struct robust_sample look[LOOKS_MOST];
    struct measured m = {.weight = 0.0f};
    rgb sum = {0.0f, 0.0f, 0.0f}, noise = sum;
    size_t count = 0;
    for (uint32_t t = 0; t < room->views.train_count; t++) {
        struct view view;
        rgb shown;
        if (!views_sees(&room->views, t, at->position, at->normal, &view) ||
            views_edge(&room->views, &view, at->triangle) > 0 ||
            !photograph_sample_cubic(&room->scene.photograph[room->views.train[t]], view.x, view.y, &shown))
            continue;
        shown = rgb_scale(shown, 1.0f / WHITE);
        look[count++] = (struct robust_sample){.value = shown, .deviation = 0.01f, .weight = view.weight,
                                               .source = t, .sharp = view.weight};
        sum = rgb_mad(sum, view.weight, shown);
        m.weight += view.weight;
    }
    if (!(m.weight > 0.0f))
        return m;
    halves_draw(look, count, &noise);
    sum = rgb_scale(sum, 1.0f / m.weight);
    for (int c = 0; c < 3; c++) {
        m.value[c] = image_half_from_float((&sum.r)[c]);
        m.noise[c] = image_half_from_float((&noise.r)[c]);
    }
    return m;
}

/* The mean over a texel. */
static rgb truth_of(const struct painted *room, uint32_t texel) {
    rgb sum = {0.0f, 0.0f, 0.0f};
    for (int k = 0; k < SIDE * SIDE; k++) {
        float x = (float)(texel % room->inverse.width) + ((float)(k % SIDE) + 0.5f) / SIDE;
        float y = (float)(texel / room->inverse.width) + ((float)(k / SIDE) + 0.5f) / SIDE;
        struct surface_point at;
        CHECK(surface_at(&room->scene.mesh, &room->atlas, &room->inverse, x, y, &at));
        sum = rgb_add(sum, painted_radiance(room, room->scene.mesh.object_id[at.triangle], at.position));
    }
    return rgb_scale(sum, 1.0f / (SIDE * SIDE * WHITE));
}

/* Root of the mean square over measured texels: of the error, and of the draw of its noise. */
struct spread {
    double error, draw;
};

static struct spread spread_of(const struct painted *room, const struct measured *measured) {
    double errors = 0.0, draws = 0.0, count = 0.0;
    for (size_t i = 0; i < room->inverse.valid_count; i++) {
        uint32_t texel = room->inverse.valid[i];
        if (!(measured[texel].weight > 0.0f))
            continue;
        rgb off = rgb_sub(measured_value(&measured[texel]), truth_of(room, texel));
        float draw = image_float_from_half(measured[texel].noise[1]);
        errors += (double)(off.g * off.g);
        draws += (double)(draw * draw);
        count += 1.0;
    }
    return (struct spread){sqrt(errors / count), sqrt(draws / count)};
}

static void test_paint(bool tiles, int threads, struct spread *before, struct spread *after, uint32_t *sum) {
    struct painted room;
    painted_make(&room, threads, tiles);
    struct reconstruction r = {.scene = &room.scene, .pool = room.pool, .segments = room.segments, .atlas = room.atlas,
                               .inverse = room.inverse};
    size_t texels = (size_t)r.inverse.width * r.inverse.height;
    struct measured *measured = mem_calloc(texels, sizeof *measured);
    uint16_t(*white)[3] = mem_calloc(texels, sizeof *white);
    r.is_emitter = mem_calloc(r.segments.count, sizeof *r.is_emitter);
    noise_measure(&r.noise, &room.views);
    for (size_t i = 0; i < r.inverse.valid_count; i++) {
        uint32_t texel = r.inverse.valid[i];
        struct surface_point at;
        if (surface_at_texel(&room.scene.mesh, &r.atlas, &r.inverse, texel, &at))
            measured[texel] = mean_of(&room, &at);
        for (int c = 0; c < 3; c++)
            white[texel][c] = image_half_from_float(WHITE);
    }
    *before = spread_of(&room, measured);
    CHECK(detail_texels_a_pixel(&r, &room.views) > 1.0);
    struct detail detail;
    detail_init(&detail, &r, &room.views, (const uint16_t(*)[3])white, measured);
    for (int i = 0; i < STEPS; i++)
        detail_step(&detail);
    detail_release(&detail);
    *after = spread_of(&room, measured);
    *sum = 0;
    for (size_t i = 0; i < texels; i++)
        *sum = rng_mix32(*sum ^ measured[i].value[0] ^ ((uint32_t)measured[i].noise[2] << 16));
    printf("%s: error %.4f, after %.4f; draw of noise %.4f, %.4f\n", tiles ? "tiles" : "waves", before->error,
           after->error, before->draw, after->draw);
    noise_release(&r.noise);
    mem_free(r.is_emitter);
    mem_free(white);
    mem_free(measured);
    painted_release(&room);
}

/* Texels that share a pixel share the directions of its highlights, between bounds. */
static void test_highlight_samples(void) {
    CHECK(divide_highlight_samples(0.5) == 16);
    CHECK(divide_highlight_samples(8.0) == 16);
    CHECK(divide_highlight_samples(16.0) == 8);
    CHECK(divide_highlight_samples(1000.0) == 4);
}

int main(void) {
    struct spread before, after;
    uint32_t sum[2];
    test_highlight_samples();
    test_paint(true, 1, &before, &after, &sum[0]);
    CHECK(after.error < 0.95 * before.error);
    CHECK(after.draw > before.draw);
    test_paint(true, 3, &before, &after, &sum[1]);
    CHECK(sum[0] == sum[1]);
    test_paint(false, 2, &before, &after, &sum[0]);
    CHECK(after.error < 0.85 * before.error);
    return check_result();
}
