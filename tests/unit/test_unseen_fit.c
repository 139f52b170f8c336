/* unseen_fit.h: points under a sky that is bright above, with light from below that is known. The map is
 * found again from what they show, emitters among them or not; and the corners of directions. */
#include "server/light/sky/unseen_fit.h"

#include <string.h>

#include "common/mem.h"
#include "common/rng.h"
#include "tests/check.h"

#define POINTS 600
#define SEGMENTS 12
#define WAYS 256
#define KNOWN 0.1f

static float number(uint64_t a, uint64_t b) { return rng_to_float((uint32_t)rng_key(7, a, b)); }

static vec3 direction_of(uint64_t a, uint64_t b) {
    float z = 2.0f * number(a, b) - 1.0f, turn = 6.2831853f * number(a, b + 1), r = sqrtf(1.0f - z * z);
    return (vec3){r * cosf(turn), z, r * sinf(turn)};
}

static float sky(vec3 d) { return d.y < 0.0f ? 0.2f : 0.2f + 3.0f * d.y; }

static void test_corners(void) {
    for (uint64_t i = 0; i < 1000; i++) {
        vec3 d = direction_of(i, 100);
        struct sky_corners c = sky_cells_around(d);
        float sum = 0.0f;
        for (int k = 0; k < 4; k++) {
            CHECK(c.cell[k] < SKY_CELLS && c.weight[k] >= 0.0f);
            sum += c.weight[k];
        }
        CHECK_NEAR(sum, 1.0, 1e-5);
    }
    CHECK(sky_cells_around((vec3){0, 1, 0}).cell[0] / SKY_COLUMNS == 0);
    CHECK(sky_cells_around((vec3){0, -1, 0}).cell[0] / SKY_COLUMNS == SKY_ROWS - 1);
    /* Around the seam, which is at -z: half the first column, half the last. */
    struct sky_corners seam = sky_cells_around((vec3){0, 0, -1});
    CHECK(seam.cell[0] % SKY_COLUMNS == SKY_COLUMNS - 1 && seam.cell[1] % SKY_COLUMNS == 0);
    CHECK_NEAR(seam.weight[0], seam.weight[1], 1e-6);
}

/* Fills point[POINTS]; returns the mean of the light that the sky sends to them. */
static double make_points(struct unseen_point *point, float white[POINTS]) {
    double mean = 0.0;
    for (uint64_t i = 0; i < POINTS; i++) {
        struct unseen_point *p = &point[i];
        vec3 normal = direction_of(i, 0);
        float light = 0.0f;
        *p = (struct unseen_point){.segment = (uint32_t)(i % SEGMENTS), .known = KNOWN, .unseen = 1.0f};
        for (uint64_t k = 0; k < WAYS; k++) {
            vec3 d = vec3_normalize(vec3_add(normal, vec3_scale(direction_of(i, 10 + 2 * k), 0.999f)));
            struct sky_corners c = sky_cells_around(d);
            for (int m = 0; m < 4; m++)
                p->share[c.cell[m]] += c.weight[m] / WAYS;
            light += sky(d) / WAYS;
        }
        /* Base colours from .2 to .85, the last two segments white, with a texture of a tenth. */
        float base = p->segment + 2 < SEGMENTS ? 0.2f + 0.05f * (float)p->segment : 0.85f;
        white[i] = light + KNOWN;
        p->observed = base * white[i] * (p->segment + 2 < SEGMENTS ? 0.9f + 0.2f * number(i, 1) : 1.0f);
        mean += (double)light / POINTS;
    }
    return mean;
}

/* Relative error of the light that arrives, root of the mean square. */
static double fit_error(const struct unseen_point *point, const float *white, struct parallel *pool) {
    static struct unseen_point sorted[POINTS];
    double map[SKY_CELLS], error = 0.0;
    memcpy(sorted, point, sizeof sorted);
    unseen_fit(sorted, POINTS, pool, map);
    for (size_t i = 0; i < POINTS; i++) {
        double light = (double)point[i].known;
        for (size_t k = 0; k < SKY_CELLS; k++)
            light += (double)point[i].share[k] * exp(map[k]);
        error += pow(light / (double)white[i] - 1.0, 2.0) / POINTS;
    }
    return sqrt(error);
}

int main(void) {
    static struct unseen_point point[POINTS];
    static float white[POINTS];
    struct parallel *pool = parallel_new(0);
    test_corners();
    double mean = make_points(point, white);
    CHECK(mean > 0.5);
    CHECK(unseen_base_color(point, POINTS, 0.8, NULL) > 3.0);
    double plain = fit_error(point, white, pool);
    for (size_t i = 0; i < POINTS; i += 25)
        point[i].observed *= 20.0f; /* they emit */
    double with = fit_error(point, white, pool);
    printf("light off by %.3f, with emitters by %.3f\n", plain, with);
    CHECK_THAT(plain < 0.07, "light off by %g", plain);
    CHECK_THAT(with < 0.1, "with emitters light off by %g", with);
    for (size_t i = 0; i < POINTS; i++)
        point[i].filled = white[i] - KNOWN;
    CHECK_NEAR(unseen_base_color(point, POINTS, 0.8, NULL), 0.75, 0.1);
    parallel_free(pool);
    return check_result();
}
