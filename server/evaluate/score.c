/* score.c -- see score.h. */
#include "server/evaluate/score.h"

#include <assert.h>
#include <math.h>

#include "common/vec.h"

/* Where the channels of a picture of parameters are. */
struct score_columns {
    size_t base_color[3], emission[3], roughness, specular;
};

static size_t column(const struct image *image, const char *name) {
    int c = image_channel(image, name);
    assert(c >= 0);
    return (size_t)c;
}

static struct score_columns find_columns(const struct image *image) {
    return (struct score_columns){
        {column(image, "base_color.R"), column(image, "base_color.G"), column(image, "base_color.B")},
        {column(image, "emission.R"), column(image, "emission.G"), column(image, "emission.B")},
        column(image, "roughness"),
        column(image, "specular"),
    };
}

static void add_square(struct score_sum *s, float found, float truth) {
    double d = (double)clampf(found, 0.0f, 1.0f) - (double)clampf(truth, 0.0f, 1.0f);
    s->sum += d * d;
    s->count++;
}

/* Whether the 3 x 3 neighbourhood of (x, y), clipped to the picture, shows one object. */
static bool one_object(const struct image *truth, size_t object, uint32_t x, uint32_t y) {
    size_t stride = truth->channel_count;
    float id = truth->pixel[((size_t)y * truth->width + x) * stride + object];
    for (uint32_t j = y ? y - 1 : 0; j <= y + 1 && j < truth->height; j++)
        for (uint32_t i = x ? x - 1 : 0; i <= x + 1 && i < truth->width; i++)
            if (truth->pixel[((size_t)j * truth->width + i) * stride + object] != id)
                return false;
    return true;
}

static void add_emission(struct score *score, const float *found, const float *truth, const struct score_columns *fc,
                         const struct score_columns *tc) {
    bool found_emits = false, truth_emits = false;
    for (int c = 0; c < 3; c++) {
        double a = (double)found[fc->emission[c]], b = (double)truth[tc->emission[c]];
        double d = log1p(fmax(a, 0.0)) - log1p(fmax(b, 0.0));
        score->emission_log.sum += d * d;
        score->emission_log.count++;
        found_emits = found_emits || a > 0.0;
        truth_emits = truth_emits || b > 0.0;
    }
    score->emission_both += found_emits && truth_emits;
    score->emission_either += found_emits || truth_emits;
}

void score_add(struct score *score, const struct image *found, const struct image *truth, const uint8_t *flags) {
    assert(found->width == truth->width && found->height == truth->height);
    struct score_columns fc = find_columns(found), tc = find_columns(truth);
    size_t object = column(truth, "object_id");
    for (uint32_t y = 0; y < truth->height; y++) {
        for (uint32_t x = 0; x < truth->width; x++) {
            size_t pixel = (size_t)y * truth->width + x;
            const float *f = found->pixel + pixel * found->channel_count;
            const float *t = truth->pixel + pixel * truth->channel_count;
            score->pixels++;
            add_emission(score, f, t, &fc, &tc);
            if (!(flags[pixel] & SCORE_PLAIN))
                continue;
            bool seen = flags[pixel] & SCORE_SEEN;
            score->plain_pixels++;
            score->seen_pixels += seen;
            for (int c = 0; c < 3; c++) {
                add_square(&score->base_color_all, f[fc.base_color[c]], t[tc.base_color[c]]);
                if (!seen)
                    continue;
                add_square(&score->base_color_seen, f[fc.base_color[c]], t[tc.base_color[c]]);
                score->base_color_found += (double)clampf(f[fc.base_color[c]], 0.0f, 1.0f);
                score->base_color_truth += (double)clampf(t[tc.base_color[c]], 0.0f, 1.0f);
            }
            if (!seen || !one_object(truth, object, x, y))
                continue;
            for (int c = 0; c < 3; c++)
                add_square(&score->base_color_inside, f[fc.base_color[c]], t[tc.base_color[c]]);
            add_square(&score->roughness, f[fc.roughness], t[tc.roughness]);
            add_square(&score->specular, f[fc.specular], t[tc.specular]);
        }
    }
}

double score_share(size_t part, size_t whole) { return whole ? (double)part / (double)whole : (double)NAN; }

double score_mean(struct score_sum sum) { return sum.count ? sum.sum / (double)sum.count : (double)NAN; }

double score_base_color_ratio(const struct score *score) {
    return score->base_color_truth > 0.0 ? score->base_color_found / score->base_color_truth : (double)NAN;
}

double score_psnr_db(struct score_sum sum) {
    double mean = score_mean(sum);
    return mean > 0.0 ? -10.0 * log10(mean) : mean == 0.0 ? (double)INFINITY : (double)NAN;
}

double score_emission_iou(const struct score *score) {
    return score->emission_either ? (double)score->emission_both / (double)score->emission_either : 1.0;
}
