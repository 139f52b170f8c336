/* footprint.h: of a plane seen aslant, what a pixel covers in closed form; its texels' shares come to 1, have their
 * middle where the footprint's is, and read a pattern as an integral over the footprint does; what is of another chart
 * or beyond the texture is told; nothing is seen edge-on or from behind. */
#include "common/parallel.h"
#include "server/material/footprint.h"
#include "tests/check.h"

#define SIDE 256    /* texels */
#define METRES 8.0f /* of the plane */
#define TEXELS_A_METRE ((double)SIDE / 8.0)
#define DISTANCE 3.0
#define PIXELS 64

static vec3 position[4] = {{-4, -4, 0}, {4, -4, 0}, {4, 4, 0}, {-4, 4, 0}};
static uint32_t indices[2][3] = {{0, 1, 2}, {0, 2, 3}}, chart_of_triangle[2];
static vec2 corner[2][3];
static uint32_t chart_of_texel[SIDE * SIDE];
static const struct mesh mesh = {.vertex_count = 4, .position = position, .triangle_count = 2, .index = indices};
static const struct atlas atlas = {
    .width = SIDE, .height = SIDE, .chart_count = 1, .chart_of_triangle = chart_of_triangle, .corner = corner};

/* Looks at the origin from DISTANCE, at so many radians from the normal, with x to the right. */
static struct camera camera_at(double tilt, float focal) {
    double s = sin(tilt), c = cos(tilt);
    struct camera camera = {.width = PIXELS,
                            .height = PIXELS,
                            .fx = focal,
                            .fy = focal,
                            .cx = PIXELS / 2.0f + 0.5f,
                            .cy = PIXELS / 2.0f + 0.5f};
    struct rigid w = {{{1, 0, 0}, {0, (float)-c, (float)s}, {0, (float)-s, (float)-c}},
                      {0.0f, (float)(-DISTANCE * s), (float)(DISTANCE * c)}};
    camera.world_from_camera = w;
    camera.camera_from_world = rigid_inverse(&w);
    return camera;
}

/* How far up the plane, from where the middle of the picture is, a ray `slope` above the axis meets it. */
static double along(double tilt, double slope) {
    double angle = atan(slope);
    return DISTANCE * sin(angle) / cos(tilt + angle);
}

static void check_aslant(const struct accel *accel, double tilt, float focal) {
    struct camera camera = camera_at(tilt, focal);
    struct footprint f;
    CHECK(footprint_find(&f, &mesh, &atlas, accel, &camera, PIXELS / 2, PIXELS / 2));
    double half = 0.5 / (double)focal, across = DISTANCE * 2.0 * half * TEXELS_A_METRE;
    double down = (along(tilt, half) - along(tilt, -half)) * TEXELS_A_METRE;
    CHECK_NEAR(f.middle.x, SIDE / 2, 1e-3);
    CHECK_NEAR(f.middle.y, SIDE / 2, 1e-3);
    CHECK_NEAR(f.across.x, across, 1e-3 * across);
    CHECK_NEAR(f.across.y, 0.0, 1e-3);
    CHECK_NEAR(f.down.x, 0.0, 1e-3);
    CHECK_NEAR(f.down.y, -down, 1e-3 * down); /* rows run down, the plane's y up */
    CHECK(down > across || tilt == 0.0);
    /* Five pixels further up the picture, where it is farther. */
    CHECK(footprint_find(&f, &mesh, &atlas, accel, &camera, PIXELS / 2, PIXELS / 2 - 5));
    CHECK_NEAR(f.middle.y, SIDE / 2 + along(tilt, 5.0 / (double)focal) * TEXELS_A_METRE, 0.02);
}

static void check_unseen(const struct accel *accel) {
    struct footprint f;
    struct camera edge_on = camera_at(1.54, 100.0f), behind = camera_at(PI - 0.3, 100.0f);
    CHECK(!footprint_of_triangle(&f, &mesh, &atlas, &edge_on, PIXELS / 2, PIXELS / 2, 0));
    CHECK(!footprint_of_triangle(&f, &mesh, &atlas, &behind, PIXELS / 2, PIXELS / 2, 0));
    struct camera away = camera_at(0.0, 3.0f);
    CHECK(!footprint_find(&f, &mesh, &atlas, accel, &away, 0, 0)); /* beside the plane */
}

/* --- texels --------------------------------------------------------------------------------------- */

static double pattern(double x, double y) { return 2.0 + cos(0.35 * x + 0.2 * y); }

static void check_texels(vec2 middle, vec2 across, vec2 down) {
    struct footprint f = {.middle = middle, .across = across, .down = down};
    struct footprint_texels t;
    CHECK_NEAR(footprint_texels(&t, &f, 0, chart_of_texel, SIDE, SIDE), 1.0, 1e-5);
    double sum = 0.0, x = 0.0, y = 0.0, read = 0.0, exact = 0.0;
    for (size_t i = 0; i < t.count; i++) {
        double cx = t.texel[i] % SIDE + 0.5, cy = (double)(t.texel[i] / SIDE) + 0.5, share = (double)t.share[i];
        sum += share, x += share * cx, y += share * cy, read += share * pattern(cx, cy);
    }
    const int fine = 200;
    for (int i = 0; i < fine * fine; i++) {
        double a = (i % fine + 0.5) / fine - 0.5, b = ((double)(i / fine) + 0.5) / fine - 0.5;
        exact += pattern((double)middle.x + a * (double)across.x + b * (double)down.x,
                         (double)middle.y + a * (double)across.y + b * (double)down.y) /
                 (fine * fine);
    }
    CHECK_NEAR(sum, 1.0, 1e-5);
    CHECK_NEAR(x, middle.x, 2e-3);
    CHECK_NEAR(y, middle.y, 2e-3);
    CHECK_NEAR(read, exact, 0.03); /* look-ups are bilinear: tents over texels */
}

/* At the middle of the border between two charts, and of the texture's left one. */
static void check_borders(void) {
    struct footprint f = {.middle = {100.0f, 60.0f}, .across = {4.0f, 0.0f}, .down = {0.0f, 4.0f}};
    struct footprint_texels t;
    for (uint32_t i = 0; i < SIDE * SIDE; i++)
        chart_of_texel[i] = i % SIDE < 100 ? 0 : 1;
    for (uint32_t chart = 0; chart < 2; chart++) {
        double sum = 0.0;
        CHECK_NEAR(footprint_texels(&t, &f, chart, chart_of_texel, SIDE, SIDE), 0.5, 1e-5);
        for (size_t i = 0; i < t.count; i++) {
            CHECK(chart_of_texel[t.texel[i]] == chart);
            sum += (double)t.share[i];
        }
        CHECK_NEAR(sum, 1.0, 1e-5);
    }
    CHECK(footprint_texels(&t, &f, 2, chart_of_texel, SIDE, SIDE) == 0.0f || t.count > 0);
    CHECK(t.count == 0);
    f.middle.x = 0.0f;
    CHECK_NEAR(footprint_texels(&t, &f, 0, chart_of_texel, SIDE, SIDE), 0.5, 1e-5);
}

int main(void) {
    struct parallel *pool = parallel_new(1);
    struct accel *accel;
    struct error err;
    for (size_t t = 0; t < 2; t++)
        for (size_t k = 0; k < 3; k++)
            corner[t][k] = (vec2){(position[indices[t][k]].x / METRES + 0.5f) * SIDE,
                                  (position[indices[t][k]].y / METRES + 0.5f) * SIDE};
    CHECK(accel_new(&accel, &mesh, pool, &err) == STATUS_OK);
    check_aslant(accel, 0.0, 40.0f);
    check_aslant(accel, 0.6, 40.0f);
    check_aslant(accel, 1.2, 100.0f);
    check_unseen(accel);
    check_texels((vec2){100.3f, 60.7f}, (vec2){3.0f, 0.0f}, (vec2){0.0f, 3.0f});
    check_texels((vec2){100.0f, 60.5f}, (vec2){5.0f, 2.0f}, (vec2){-1.5f, 4.0f});
    check_texels((vec2){90.1f, 61.9f}, (vec2){0.3f, 0.0f}, (vec2){0.0f, 0.6f});
    check_borders();
    accel_free(accel);
    parallel_free(pool);
    return check_result();
}
