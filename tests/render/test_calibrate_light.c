/* calibrate_light.h: drift, white balance, vignette and a tone curve are put into a capture and found again; a capture
 * without them is left alone. In the long form (UNBAKE_LONG) more of them are put into a noisy one. */
#include "server/capture/calibrate_light.h"

#include "tests/render/painted_room.h"

static struct light_found run(struct painted *room, int faults) {
    struct light_found found;
    calibrate_light(&room->scene, &room->views, &room->atlas, &room->inverse, faults, room->pool, &found);
    return found;
}

/* Largest error of the frames' gains, after each channel's mean (a matter of units) is taken off. */
static double worst_gain(const struct painted *room, const rgb *truth) {
    double worst = 0.0;
    for (int c = 0; c < 3; c++) {
        double error[PAINTED_FRAMES], mean = 0.0;
        for (size_t t = 0; t < room->views.train_count; t++) {
            const struct photograph *photo = &room->scene.photograph[room->views.train[t]];
            const rgb *wanted = &truth[room->views.train[t]];
            const float gain[3] = {photo->gain.r / wanted->r, photo->gain.g / wanted->g, photo->gain.b / wanted->b};
            error[t] = log((double)(gain[c] * photo->exposure));
            mean += error[t] / (double)room->views.train_count;
        }
        for (size_t t = 0; t < room->views.train_count; t++)
            worst = fmax(worst, fabs(error[t] - mean));
    }
    return worst;
}

static double worst_vignette(const struct painted *room, double truth) {
    double worst = 0.0;
    for (int i = 0; i <= 10; i++) {
        const float *v = room->scene.photograph[0].vignette;
        double s = i / 10.0;
        double found = s * ((double)v[0] + s * ((double)v[1] + s * (double)v[2]));
        worst = fmax(worst, fabs(found + truth * s));
    }
    return worst;
}

static void test_clean(struct painted *room) {
    painted_reset(room);
    struct light_found found = run(room, LIGHT_ALL);
    CHECK(!found.drift && !found.white_balance && !found.vignette && found.exposures_solved == 0);
    for (int f = 0; f < PAINTED_FRAMES; f++) {
        const struct photograph *photo = &room->scene.photograph[f];
        CHECK(photo->exposure == 1.0f && photo->gain.r == 1.0f && photo->gain.g == 1.0f && photo->gain.b == 1.0f &&
              photo->vignette[0] == 0.0f);
    }
}

/* Only the first frame tells its exposure; the others have gains between 1/4 and 4. */
static void test_unknown(struct painted *room) {
    rgb truth[PAINTED_FRAMES];
    painted_reset(room);
    for (int f = 0; f < PAINTED_FRAMES; f++) {
        truth[f] = rgb_gray(f == 0 ? 1.0f : powf(4.0f, painted_random((uint64_t)f, 1)));
        painted_spoil(&room->scene.photograph[f], truth[f], 0.0f);
        room->scene.photograph[f].exposure_known = f == 0;
    }
    struct light_found found = run(room, 0);
    CHECK(found.exposures_solved == room->views.train_count - 1);
    CHECK_THAT(worst_gain(room, truth) < 0.02, "off by %.4f", worst_gain(room, truth));
    CHECK_THAT(found.spread_after < 0.1 * found.spread_before, "%.4f", found.spread_after);
    CHECK(room->scene.photograph[0].exposure == 1.0f && room->scene.photograph[0].gain.r == 1.0f);
    /* A held-out frame is not touched. */
    CHECK(room->scene.photograph[7].is_test && room->scene.photograph[7].exposure == 1.0f);
}

/* Frames that claim exposure 1 drift by up to `drift`, their colours by up to `color`, and all have
 * the vignette. What is found must be within 2 %, and fusing must get better by `factor`. */
static void test_faults(struct painted *room, float drift, float color, float vignette, double factor) {
    rgb truth[PAINTED_FRAMES];
    painted_reset(room);
    for (uint64_t f = 0; f < PAINTED_FRAMES; f++) {
        float level = drift * painted_random(f, 1), warm = color * painted_random(f, 2);
        truth[f] = rgb_make(expf(level + warm), expf(level), expf(level - warm));
        painted_spoil(&room->scene.photograph[f], truth[f], vignette);
    }
    double before = painted_error(room);
    struct light_found found = run(room, LIGHT_ALL);
    double after = painted_error(room);
    printf("drift %.2f color %.2f vignette %.2f: gains within %.4f, vignette within %.4f, spread %.4f -> "
           "%.4f, fused error %.4f -> %.4f\n",
           (double)drift, (double)color, (double)vignette, worst_gain(room, truth),
           worst_vignette(room, (double)vignette), found.spread_before, found.spread_after, before, after);
    CHECK(found.drift == (drift > 0.0f) && found.white_balance == (color > 0.0f) &&
          found.vignette == (vignette > 0.0f));
    CHECK(worst_gain(room, truth) < 0.02);
    CHECK(worst_vignette(room, (double)vignette) < 0.02);
    CHECK_THAT(before > factor * after, "%.4f, then %.4f", before, after);
}

/* Ordinary frames that clip what is bright at their exposure, which nobody told, and in each of which a
 * highlight that no other frame shows covers a sixteenth of the picture: clipped pixels are lower
 * bounds, and neither they nor their absence may move what is found. */
static void test_clipped(struct painted *room) {
    rgb truth[PAINTED_FRAMES];
    painted_reset(room);
    for (uint64_t f = 0; f < PAINTED_FRAMES; f++) {
        struct photograph *photo = &room->scene.photograph[f];
        truth[f] = rgb_gray(powf(2.0f, painted_random(f, 1)));
        photo->is_hdr = photo->exposure_known = false;
        photo->clip = 0.75f; /* exact as a half */
        painted_spoil(photo, truth[f], 0.0f);
        size_t left = (size_t)(60.0f * (1.0f + painted_random(f, 4)));
        size_t top = (size_t)(45.0f * (1.0f + painted_random(f, 5)));
        for (size_t y = top; y < top + 30; y++)
            for (size_t x = left; x < left + 40; x++)
                for (int c = 0; c < 3; c++)
                    photo->pixel[y * PAINTED_WIDTH + x][c] = image_half_from_float(photo->clip);
    }
    struct light_found found = run(room, LIGHT_ALL);
    printf("clipped: gains within %.4f, fused error %.4f\n", worst_gain(room, truth), painted_error(room));
    CHECK(found.exposures_solved == room->views.train_count);
    CHECK(!found.white_balance && !found.vignette);
    CHECK(worst_gain(room, truth) < 0.06);
    CHECK(painted_error(room) < 0.03);
}

/* An S over encoded values, as cameras have: shadows darker, highlights held back. `share` of smoothstep. */
static float with_contrast(float value, float share) {
    float u = image_linear_to_srgb(fminf(value, 1.0f));
    return image_srgb_to_linear(u + share * (u * u * (3.0f - 2.0f * u) - u));
}

/* Ordinary frames of exposures that are told, or not, of a camera with or without a curve. The same curve is found
 * again, and not where there is none. */
enum exposures { TOLD, UNTOLD, FAR }; /* far: two that are told, fifteen times one another */
static void test_tones(struct painted *room, enum exposures exposures, float share, double before_at_least,
                       double after_at_most) {
    static const char *const name[] = {"told", "not told", "far apart"};
    bool told = exposures != UNTOLD;
    painted_reset(room);
    for (uint64_t f = 0; f < PAINTED_FRAMES; f++) {
        struct photograph *photo = &room->scene.photograph[f];
        float exposure = exposures == FAR ? (f % 2 ? 0.06f : 0.9f) : 0.7f * powf(2.0f, painted_random(f, 1));
        photo->is_hdr = false;
        photo->exposure_known = told;
        photo->exposure = told ? exposure : 1.0f;
        photo->clip = 1.0f;
        painted_spoil(photo, rgb_gray(exposure), 0.0f);
        for (size_t i = 0; i < PAINTED_WIDTH * PAINTED_HEIGHT && share != 0.0f; i++)
            for (size_t c = 0; c < 3; c++)
                photo->pixel[i][c] =
                    image_half_from_float(with_contrast(image_float_from_half(photo->pixel[i][c]), share));
    }
    double before = painted_error(room);
    struct light_found found = run(room, LIGHT_ALL);
    double after = painted_error(room);
    printf("exposures %s, contrast %.1f: curve %d (%.3f %.3f %.3f %.3f), fused error %.4f -> %.4f, vignette %d, drift "
           "%d, white balance %d\n",
           name[exposures], (double)share, found.tones, found.curve.term[0], found.curve.term[1], found.curve.term[2],
           found.curve.term[3], before, after, found.vignette, found.drift, found.white_balance);
    CHECK(found.tones == (share != 0.0f) && !found.vignette && !found.white_balance && !found.drift);
    CHECK_THAT(before >= before_at_least && after <= after_at_most, "%g, then %g", before, after);
    CHECK(room->scene.photograph[7].is_straight == found.tones); /* held out */
    if (share == 0.6f && exposures != UNTOLD)
        CHECK_NEAR(found.curve.term[TONE_POWER], -0.268, 0.05); /* of that curve by its own formula */
    CHECK(found.is_power_open == (exposures == UNTOLD));
    if (share == 0.6f && exposures == TOLD) {
        found = run(room, LIGHT_ALL);
        CHECK(!found.tones); /* once */
    }
}

/* The photographs as the last test left them, calibrated again by another number of threads. */
static void test_threads(struct painted *room) {
    struct light_found found;
    struct photograph first[PAINTED_FRAMES];
    memcpy(first, room->scene.photograph, sizeof first);
    for (int f = 0; f < PAINTED_FRAMES; f++) {
        room->scene.photograph[f].gain = rgb_gray(1.0f);
        memset(room->scene.photograph[f].vignette, 0, sizeof first[f].vignette);
    }
    struct parallel *pool = parallel_new(3);
    calibrate_light(&room->scene, &room->views, &room->atlas, &room->inverse, LIGHT_ALL, pool, &found);
    parallel_free(pool);
    for (int f = 0; f < PAINTED_FRAMES; f++) {
        const struct photograph *photo = &room->scene.photograph[f];
        CHECK(memcmp(&photo->gain, &first[f].gain, sizeof photo->gain) == 0);
        CHECK(memcmp(photo->vignette, first[f].vignette, sizeof photo->vignette) == 0);
    }
}

int main(void) {
    struct painted room;
    painted_make(&room, 1, false);
    test_clean(&room);
    test_unknown(&room);
    test_faults(&room, 0.15f, 0.0f, 0.0f, 1.5);
    test_faults(&room, 0.0f, 0.15f, 0.0f, 1.5);
    test_faults(&room, 0.0f, 0.0f, 0.4f, 2.0);
    test_faults(&room, 0.15f, 0.15f, 0.4f, 2.0);
    test_threads(&room);
    test_tones(&room, TOLD, 0.6f, 0.15, 0.026);
    test_tones(&room, UNTOLD, 0.6f, 0.25, 0.17); /* a power of all radiances is not told */
    test_tones(&room, TOLD, -0.4f, 0.09, 0.026); /* flat, as for grading */
    test_tones(&room, TOLD, 0.0f, 0.0, 0.026);
    test_tones(&room, UNTOLD, 0.0f, 0.1, 0.026);
    test_tones(&room, FAR, 0.6f, 0.19, 0.075); /* a shape that repeats every fifteen times is hardly told */
    test_tones(&room, FAR, 0.0f, 0.0, 0.026);
    test_clipped(&room);
    painted_release(&room);
    painted_noise = 0.5f; /* of 29 % no curve may be made that presses or pulls what one point shows together */
    painted_make(&room, 1, false);
    test_tones(&room, TOLD, 0.6f, 0.2, 0.14);
    if (getenv("UNBAKE_LONG")) {
        test_tones(&room, FAR, 0.6f, 0.25, 0.16);
        test_tones(&room, TOLD, -0.4f, 0.14, 0.14);
    }
    painted_release(&room);
    return check_result();
}
