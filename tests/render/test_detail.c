/* detail.h: of paint about as fine as the photographs' pixels less is lost than by the mean of what they show, on any
 * number of threads; noise is not taken for it; none comes out darker than black; what one half of the photographs
 * alone tells stays; and pixels of little worth are counted as exactly as others. */
#include "server/capture/split_half.h"
#include "server/material/detail.h"
#include "server/material/divide.h"
#include "server/scene/surface.h"
#include "server/state/reconstruction.h"
#define PAINTED_WIDTH 40 /* pixels larger than texels */
#define PAINTED_HEIGHT 30
#define PAINTED_SIDE 8
#define PAINTED_GLOSS 0.0f
#include "tests/render/painted_room.h"

#define STEPS 16
#define SIDE 4 /* places of a texel, a row and column */
#define LOOKS_MOST 64
#define WHITE 2.0f /* what a white surface would send out: more than the brightest paint */

/* The mean over the photographs, as divide.h takes it. */
static struct measurement mean_of(const struct painted *room, const struct surface_point *at) {
    struct robust_sample look[LOOKS_MOST];
    struct measurement m = {.weight = 0.0f};
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
        look[count++] = (struct robust_sample){
            .value = shown, .deviation = 0.01f, .weight = view.weight, .source = t, .sharp = view.weight};
        sum = rgb_mad(sum, view.weight, shown);
        m.weight += view.weight;
    }
    if (!(m.weight > 0.0f))
        return m;
    split_half_draw(look, count, &noise);
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

/* Root of the mean square error over measured texels. */
static double error_of(const struct painted *room, const struct measurement *measured) {
    double errors = 0.0, count = 0.0;
    for (size_t i = 0; i < room->inverse.valid_count; i++) {
        uint32_t texel = room->inverse.valid[i];
        if (!(measured[texel].weight > 0.0f))
            continue;
        rgb off = rgb_sub(measurement_value(&measured[texel]), truth_of(room, texel));
        errors += (double)(off.g * off.g);
        count += 1.0;
    }
    return sqrt(errors / count);
}

/* A painted room as detail.h is given it. */
struct capture {
    struct painted room;
    struct reconstruction r;
    struct measurement *measured;
    uint16_t (*white)[3];
    size_t texels;
};

/* Base colours are as measured but for `offset`. */
static void capture_init(struct capture *s, bool tiles, int threads, float offset) {
    painted_make(&s->room, threads, tiles);
    s->r = (struct reconstruction){.scene = &s->room.scene,
                                   .pool = s->room.pool,
                                   .segments = s->room.segments,
                                   .atlas = s->room.atlas,
                                   .inverse = s->room.inverse};
    s->texels = (size_t)s->r.inverse.width * s->r.inverse.height;
    s->measured = mem_calloc(s->texels, sizeof *s->measured);
    s->white = mem_calloc(s->texels, sizeof *s->white);
    s->r.is_emitter = mem_calloc(s->r.segments.count, sizeof *s->r.is_emitter);
    noise_measure(&s->r.noise, &s->room.views, s->room.pool);
    for (size_t i = 0; i < s->r.inverse.valid_count; i++) {
        uint32_t texel = s->r.inverse.valid[i];
        struct surface_point at;
        if (surface_at_texel(&s->room.scene.mesh, &s->r.atlas, &s->r.inverse, texel, &at))
            s->measured[texel] = mean_of(&s->room, &at);
        rgb_to_half(s->measured[texel].value, rgb_add(measurement_value(&s->measured[texel]), rgb_gray(offset)));
        rgb_to_half(s->white[texel], rgb_gray(WHITE));
    }
}

static void capture_release(struct capture *s) {
    noise_release(&s->r.noise);
    mem_free(s->r.is_emitter);
    mem_free(s->white);
    mem_free(s->measured);
    painted_release(&s->room);
}

static struct detail_input input_of(struct capture *s, const struct views *views) {
    return (struct detail_input){.surface = reconstruction_surface(&s->r),
                                 .views = views,
                                 .noise = &s->r.noise,
                                 .is_emitter = s->r.is_emitter,
                                 .pool = s->r.pool,
                                 .lambert = (const uint16_t(*)[3])s->white,
                                 .measured = s->measured};
}

static void find(struct capture *s, const struct views *views) {
    struct detail_input input = input_of(s, views);
    struct detail detail;
    detail_init(&detail, &input);
    for (int i = 0; i < STEPS; i++)
        detail_step(&detail);
    detail_finish(&detail);
    detail_release(&detail);
}

/* Of the draw of noise, over all texels. */
static double noise_power(const struct capture *s) {
    double power = 0.0;
    for (size_t i = 0; i < s->texels; i++)
        power += (double)rgb_dot(rgb_from_half(s->measured[i].noise), rgb_from_half(s->measured[i].noise));
    return power;
}

static void test_paint(bool tiles, int threads, uint32_t *sum) {
    struct capture s;
    capture_init(&s, tiles, threads, 0.0f);
    double before = error_of(&s.room, s.measured), noise = noise_power(&s);
    const struct surface surface = reconstruction_surface(&s.r);
    CHECK(detail_texels_per_pixel(&surface, &s.room.views) > 1.0);
    find(&s, &s.room.views);
    double after = error_of(&s.room, s.measured);
    printf("%s: error %.4f, after %.4f\n", tiles ? "tiles" : "waves", before, after);
    CHECK(after < 0.85 * before);
    CHECK_THAT(noise > 0.0 && noise_power(&s) < 0.5 * noise, "photographs disagree by their blur, which is gone");
    *sum = 0;
    for (size_t i = 0; i < s.texels; i++)
        *sum = rng_mix32(*sum ^ s.measured[i].value[0] ^ ((uint32_t)s.measured[i].value[2] << 16));
    capture_release(&s);
}

/* Noise is not taken for detail, which would make specks: a plain wall stays as plain as it was measured, and paint in
 * noisy photographs little worse. */
static void test_noise(float contrast, float noise, double most) {
    struct capture s;
    painted_contrast = contrast;
    painted_noise = noise;
    capture_init(&s, true, 2, 0.0f);
    double before = error_of(&s.room, s.measured);
    find(&s, &s.room.views);
    double after = error_of(&s.room, s.measured);
    printf("contrast %.0f, noise %.3f: error %.4f, after %.4f\n", (double)contrast, (double)noise, before, after);
    CHECK(after < most * before);
    capture_release(&s);
    painted_contrast = 1.0f;
    painted_noise = PAINTED_NOISE;
}

/* Where the dark paint is almost black. */
static void test_black(void) {
    struct capture s;
    size_t black = 0;
    capture_init(&s, true, 2, -0.2f);
    struct measurement *before = mem_array(s.texels, sizeof *before);
    memcpy(before, s.measured, s.texels * sizeof *before);
    find(&s, &s.room.views);
    for (size_t i = 0; i < s.texels; i++) {
        float value = measurement_value(&s.measured[i]).g, start = measurement_value(&before[i]).g;
        CHECK(value >= fminf(start, 0.0f) - 1e-4f);
        black += start > 0.02f && fabsf(value) < 1e-4f;
    }
    printf("%zu texels went to black\n", black);
    CHECK(black > 5);
    mem_free(before);
    capture_release(&s);
}

/* Texels that the first `count` photographs move. */
static size_t changed_by(uint32_t count) {
    struct capture s;
    size_t changed = 0;
    capture_init(&s, true, 2, 0.0f);
    struct measurement *before = mem_array(s.texels, sizeof *before);
    memcpy(before, s.measured, s.texels * sizeof *before);
    struct views few = s.room.views;
    few.train_count = count;
    find(&s, &few);
    for (size_t i = 0; i < s.texels; i++)
        changed += memcmp(&before[i], &s.measured[i], sizeof before[i]) != 0;
    mem_free(before);
    capture_release(&s);
    return changed;
}

/* One photograph has nothing to agree with; two have each other, though they are in one half in the first
 * split. */
static void test_few(void) {
    CHECK(changed_by(1) == 0);
    CHECK(split_half_of(0, 0) == split_half_of(1, 0) && split_half_of(0, 1) != split_half_of(1, 1));
    size_t changed = changed_by(2);
    printf("two photographs move %zu texels\n", changed);
    CHECK(changed > 20);
}

/* Where one photograph is worth ten thousand times as much as any other, the others are counted, too. */
static void test_count(void) {
    struct capture s;
    struct detail_input input;
    struct detail d;
    double counted = 0.0, best = 0.0, others = 0.0;
    capture_init(&s, true, 2, 0.0f);
    const float bright = s.room.scene.photograph[s.room.views.train[0]].exposure;
    for (uint32_t t = 1; t < s.room.views.train_count; t++)
        s.room.scene.photograph[s.room.views.train[t]].exposure = bright / 4096.0f;
    for (int octave = 0; octave < NOISE_OCTAVES; octave++) /* of these 12 lie between the two exposures */
        s.r.noise.share[octave] = octave < NOISE_OCTAVES / 2 - 6 ? 1.0f : 0.01f;
    input = input_of(&s, &s.room.views);
    detail_init(&d, &input);
    for (size_t i = 0; i < s.texels; i++)
        counted += (double)d.weight_sum[i];
    for (uint32_t t = 0; t < s.room.views.train_count; t++)
        for (size_t i = 0; i < PAINTED_WIDTH * PAINTED_HEIGHT; i++)
            *(t == 0 ? &best : &others) += (double)d.weight[t][i];
    printf("worth %.3f and %.5f, counted %.5f\n", best, others, counted - best);
    CHECK(others > 0.0 && others < 0.01 * best);
    CHECK(fabs(counted - best - others) < 0.01 * others);
    detail_release(&d);
    capture_release(&s);
}

/* Texels that share a pixel share the directions of its highlights, between bounds. */
static void test_highlight_samples(void) {
    CHECK(divide_highlight_samples(0.5) == 16);
    CHECK(divide_highlight_samples(8.0) == 16);
    CHECK(divide_highlight_samples(16.0) == 8);
    CHECK(divide_highlight_samples(1000.0) == 4);
}

int main(void) {
    uint32_t sum[3];
    test_highlight_samples();
    test_paint(true, 1, &sum[0]);
    test_paint(true, 3, &sum[1]);
    CHECK(sum[0] == sum[1]);
    test_paint(false, 2, &sum[2]);
    test_noise(0.0f, 4.0f * PAINTED_NOISE, 1.03);
    test_noise(1.0f, 4.0f * PAINTED_NOISE, 1.06);
    test_black();
    test_few();
    test_count();
    return check_result();
}
