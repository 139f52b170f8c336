/* views.h: a look-up is trusted the less, and how much of what a look-up shows may be light of others grows towards an
 * edge, and the more the brighter the other side of the edge is. */
#include "common/image.h"
#include "common/mem.h"
#include "server/capture/views.h"
#include "tests/check.h"

#define WIDTH 32
#define HEIGHT 8
#define DISTANCE 8.0f
#define EDGE_AT 16 /* the pixel column in which a dark wall ends before a bright one, 1 m behind it */
#define DARK 0.125f
#define BRIGHT 8.0f

static uint16_t pixel[WIDTH * HEIGHT][3];

static float mixing_at(const struct views *v, float x, uint32_t triangle) {
    struct view view = {.train = 0, .x = x, .y = HEIGHT / 2, .weight = 1.0f};
    struct photograph_sample s;
    CHECK(photograph_sample(&v->scene->photograph[0], view.x, view.y, &s));
    return views_mixing(v, &view, triangle, s.radiance);
}

int main(void) {
    /* A pixel is 1 x 1 m of the plane z = 8; fronts face the camera. */
    vec3 position[] = {{-40, -40, 8},
                       {EDGE_AT + 0.5f, -40, 8},
                       {EDGE_AT + 0.5f, 40, 8},
                       {-40, 40, 8},
                       {-90, -90, 9},
                       {90, -90, 9},
                       {90, 90, 9},
                       {-90, 90, 9}};
    uint32_t index[][3] = {{0, 2, 1}, {0, 3, 2}, {4, 6, 5}, {4, 7, 6}}, of_triangle[] = {0, 0, 1, 1};
    struct photograph photograph = {
        .exposure = 1.0f, .gain = {1, 1, 1}, .clip = INFINITY, .is_hdr = true, .pixel = pixel};
    struct camera *c = &photograph.camera;
    *c = (struct camera){
        .width = WIDTH, .height = HEIGHT, .fx = DISTANCE, .fy = DISTANCE, .cx = WIDTH / 2, .cy = HEIGHT / 2};
    for (int i = 0; i < 3; i++)
        c->world_from_camera.rotation[i][i] = 1.0f;
    c->world_from_camera.translation = (vec3){WIDTH / 2, HEIGHT / 2, 0.0f};
    c->camera_from_world = rigid_inverse(&c->world_from_camera);
    for (int i = 0; i < WIDTH * HEIGHT; i++)
        for (int k = 0; k < 3; k++)
            pixel[i][k] = image_half_from_float(i % WIDTH < EDGE_AT ? DARK : BRIGHT);
    struct scene scene = {.photograph_count = 1, .photograph = &photograph};
    scene.mesh = (struct mesh){.vertex_count = 8, .position = position, .triangle_count = 4, .index = index};
    struct segments segments = {.count = 2, .of_triangle = of_triangle};
    struct parallel *pool = parallel_new(1);
    struct accel *accel;
    struct error err;
    struct views v;
    CHECK(accel_new(&accel, &scene.mesh, pool, &err) == STATUS_OK);
    views_init(&v, &scene, &segments, accel, pool);

    float far = mixing_at(&v, 4.5f, 0), near = mixing_at(&v, EDGE_AT - 1.5f, 0);
    float beside = mixing_at(&v, EDGE_AT - 0.5f, 0), bright = mixing_at(&v, EDGE_AT + 1.5f, 2);
    CHECK(far == 0.0f && bright > 0.0f);
    CHECK_THAT(near > 2.0f * bright, "%g beside light, %g beside dark", (double)near, (double)bright);
    CHECK_THAT(beside >= near && beside == 1.0f, "%g, further off %g", (double)beside, (double)near);

    /* A look-up is trusted the less the nearer it is to the edge, by the classes of views.h. */
    for (int k = 0; k < 4; k++) {
        static const float trust[4] = {1.0f, 0.5f, 0.05f, 0.001f};
        struct view view = {.train = 0, .x = (float)EDGE_AT + 0.5f - (float)(4 - k), .y = HEIGHT / 2, .weight = 1.0f};
        CHECK(views_edge(&v, &view, 0) == k);
        CHECK_NEAR(views_edge_weight(&v, &view, 0), trust[k], 1e-6f);
    }

    /* As bright on both sides: only the distance from the edge counts. */
    for (int i = 0; i < WIDTH * HEIGHT; i++)
        for (int k = 0; k < 3; k++)
            pixel[i][k] = image_half_from_float(BRIGHT);
    CHECK_NEAR(mixing_at(&v, EDGE_AT - 1.5f, 0), mixing_at(&v, EDGE_AT + 1.5f, 2), 1e-6f);
    CHECK(mixing_at(&v, EDGE_AT - 1.5f, 0) < near);

    views_release(&v);
    accel_free(accel);
    parallel_free(pool);
    return check_result();
}
