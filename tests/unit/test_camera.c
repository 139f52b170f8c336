/* Cameras against OpenCV 4's projectPoints and fisheye::projectPoints (figures computed with its
 * Python package), round trips, and what happens beyond the fold of a lens polynomial. */
#include "server/scene/camera.h"

#include "tests/check.h"

static const vec3 points[5] = {
    {0.0f, 0.0f, 2.5f}, {0.6f, -0.4f, 1.9f}, {-1.1f, 0.7f, 3.2f}, {0.9f, 0.8f, 2.1f}, {-0.5f, -0.9f, 1.7f}};

static const struct {
    const char *name;
    enum camera_model model;
    float k[6], p[2];
    double pixel[5][2];
} table[] = {
    {"pinhole",
     CAMERA_OPENCV,
     {0},
     {0},
     {{549.400187, 422.363032},
      {739.495189, 324.070874},
      {295.421554, 549.878673},
      {764.663908, 618.732136},
      {405.613708, 69.592184}}},
    {"brown",
     CAMERA_OPENCV,
     {-0.28f, 0.09f, -0.012f},
     {0.0011f, -0.0007f},
     {{552.650492, 424.225890},
      {738.402405, 328.995825},
      {338.222993, 545.457180},
      {763.829267, 617.331064},
      {454.563870, 142.997342}}},
    {"rational",
     CAMERA_OPENCV,
     {0.31f, -0.12f, 0.021f, 0.62f, -0.05f, 0.013f},
     {0.0004f, 0.0009f},
     {{553.154236, 424.426838},
      {738.417520, 329.320321},
      {344.145443, 544.670066},
      {763.793388, 617.167704},
      {461.996851, 152.571157}}},
    {"fisheye",
     CAMERA_OPENCV_FISHEYE,
     {-0.031f, 0.012f, -0.0052f, 0.0008f},
     {0},
     {{553.573385, 424.662982},
      {738.205119, 330.034821},
      {346.385838, 544.291795},
      {763.598104, 616.858577},
      {461.247649, 151.901358}}},
};

static struct camera make_camera(enum camera_model model, const float *k, const float *p) {
    struct camera c = {
        .model = model,
        .width = 1400,
        .height = 1000,
        .fx = 612.5f,
        .fy = 598.75f,
        .cx = 700.25f,
        .cy = 505.5f,
        .camera_from_world = {{{0.9381999685537209f, -0.06618657819218582f, -0.33970598445274236f},
                               {0.03157856058226948f, 0.9938199968553721f, -0.10641714317693438f},
                               {0.34464998696844473f, 0.08911313437197621f, 0.9344919666669441f}},
                              {0.2f, -0.1f, 0.3f}},
    };
    memcpy(c.k, k, sizeof c.k);
    memcpy(c.p, p, sizeof c.p);
    c.world_from_camera = rigid_inverse(&c.camera_from_world);
    camera_find_fold(&c);
    return c;
}

static void test_against_opencv(void) {
    for (size_t m = 0; m < sizeof table / sizeof *table; m++) {
        struct camera c = make_camera(table[m].model, table[m].k, table[m].p);
        for (int i = 0; i < 5; i++) {
            float x, y, depth_m;
            CHECK_THAT(camera_project(&c, points[i], &x, &y, &depth_m), "%s, point %d", table[m].name, i);
            CHECK_NEAR(x, table[m].pixel[i][0], 1e-3);
            CHECK_NEAR(y, table[m].pixel[i][1], 1e-3);
            CHECK_NEAR(depth_m, rigid_point(&c.camera_from_world, points[i]).z, 1e-6);
        }
    }
}

/* Every pixel of a grid has a direction, and a point along it projects back to the pixel. */
static void check_round_trip(const struct camera *c, const char *name, int least_found) {
    int found = 0;
    for (int j = 0; j <= 20; j++) {
        for (int i = 0; i <= 20; i++) {
            float px = (float)i / 20.001f * (float)c->width, py = (float)j / 20.001f * (float)c->height;
            vec3 direction;
            if (!camera_direction(c, px, py, &direction))
                continue;
            found++;
            CHECK_NEAR(vec3_length(direction), 1.0, 1e-6);
            float x, y, depth_m;
            vec3 point = vec3_mad(camera_origin(c), 3.0f, direction);
            bool seen = camera_project(c, point, &x, &y, &depth_m);
            if (i > 0 && j > 0)
                CHECK_THAT(seen, "%s: pixel %g, %g", name, (double)px, (double)py);
            if (seen) {
                CHECK_NEAR(x, px, 2e-3);
                CHECK_NEAR(y, py, 2e-3);
            }
        }
    }
    CHECK_THAT(found >= least_found, "%s: %d directions", name, found);
}

static void test_round_trip(void) {
    for (size_t m = 0; m < sizeof table / sizeof *table; m++) {
        struct camera c = make_camera(table[m].model, table[m].k, table[m].p);
        check_round_trip(&c, table[m].name, m == 1 ? 360 : 21 * 21); /* brown folds before the corners */
    }
    /* Barrel distortion so strong that the picture's corners lie beyond the fold. */
    struct camera c = make_camera(CAMERA_OPENCV, (float[6]){-0.35f}, (float[2]){0});
    check_round_trip(&c, "strong barrel", 130);
    CHECK(!camera_direction(&c, 1.0f, 1.0f, &(vec3){0}));
}

/* r (1 - 0.3 r^2) folds at r = 1 / sqrt(0.9), where it reaches 0.7027. */
static void test_fold(void) {
    struct camera c = {.model = CAMERA_OPENCV,
                       .width = 1000,
                       .height = 1000,
                       .fx = 500,
                       .fy = 500,
                       .cx = 500,
                       .cy = 500,
                       .k = {-0.3f}};
    for (int i = 0; i < 3; i++)
        c.camera_from_world.rotation[i][i] = 1.0f;
    c.world_from_camera = c.camera_from_world;
    camera_find_fold(&c);
    CHECK_NEAR(c.fold, 1.0 / sqrt(0.9), 1e-6);
    float x, y, depth_m;
    CHECK(camera_project(&c, vec3_make(1.05f, 0, 1), &x, &y, &depth_m));
    CHECK(!camera_project(&c, vec3_make(1.06f, 0, 1), &x, &y, &depth_m));
    CHECK(!camera_project(&c, vec3_make(1.82f, 0, 1), &x, &y, &depth_m)); /* would land near the centre */
    CHECK(!camera_project(&c, vec3_make(0, 0, -1), &x, &y, &depth_m));
    CHECK(!camera_project(&c, vec3_make(0, 0, 0), &x, &y, &depth_m));
    CHECK(!camera_project(&c, vec3_make(NAN, 0, 1), &x, &y, &depth_m));
    CHECK(camera_direction(&c, 500.0f + 0.70f * 500.0f, 500.0f, &(vec3){0}));
    CHECK(!camera_direction(&c, 500.0f + 0.71f * 500.0f, 500.0f, &(vec3){0}));

    c.model = CAMERA_OPENCV_FISHEYE;
    camera_find_fold(&c); /* t (1 - 0.3 t^2), the same polynomial in the angle */
    CHECK_NEAR(c.fold, 1.0 / sqrt(0.9), 1e-6);
    CHECK(camera_project(&c, vec3_make((float)tan(1.05), 0, 1), &x, &y, &depth_m));
    CHECK(!camera_project(&c, vec3_make((float)tan(1.06), 0, 1), &x, &y, &depth_m));
    CHECK(!camera_direction(&c, 500.0f + 0.71f * 500.0f, 500.0f, &(vec3){0}));
}

/* Pixel borders: [0, width) is inside. */
static void test_borders(void) {
    struct camera c = {.width = 4, .height = 2, .fx = 1, .fy = 1, .cx = 2, .cy = 1};
    for (int i = 0; i < 3; i++)
        c.camera_from_world.rotation[i][i] = 1.0f;
    float x, y, depth_m;
    CHECK(camera_project(&c, vec3_make(-2, -1, 1), &x, &y, &depth_m) && x == 0 && y == 0);
    CHECK(!camera_project(&c, vec3_make(2, 0, 1), &x, &y, &depth_m));
    CHECK(!camera_project(&c, vec3_make(0, 1, 1), &x, &y, &depth_m));
}

int main(void) {
    test_against_opencv();
    test_round_trip();
    test_fold();
    test_borders();
    return check_result();
}
