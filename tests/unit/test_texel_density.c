/* texel_density.h: what a photograph shows of a chart gives all of it its density, what none shows a quarter. */
#include "server/capture/texel_density.h"

#include "tests/check.h"

#define SIDE 16

static uint16_t pixel[SIDE * SIDE][3];

int main(void) {
    /* A wall before the camera, of which it sees the middle, one beside it and one behind the first. */
    vec3 position[12];
    uint32_t index[6][3], of_triangle[6], chart[6];
    for (int wall = 0; wall < 3; wall++) {
        for (int k = 0; k < 4; k++)
            position[4 * wall + k] = (vec3){(k == 1 || k == 2 ? 20.0f : -20.0f) + (wall == 1 ? 100.0f : 0.0f),
                                            k < 2 ? -20.0f : 20.0f, wall == 2 ? 12.0f : 8.0f};
        for (int half = 0; half < 2; half++) {
            uint32_t first = (uint32_t)(4 * wall), *corner = index[2 * wall + half];
            corner[0] = first;
            corner[1] = first + (half ? 3 : 2);
            corner[2] = first + (half ? 2 : 1);
            of_triangle[2 * wall + half] = 0;
            chart[2 * wall + half] = (uint32_t)wall;
        }
    }
    struct photograph photograph = {
        .exposure = 1.0f, .gain = {1, 1, 1}, .clip = INFINITY, .is_hdr = true, .pixel = pixel};
    struct camera *c = &photograph.camera;
    *c = (struct camera){.width = SIDE, .height = SIDE, .fx = 16, .fy = 16, .cx = SIDE / 2, .cy = SIDE / 2};
    for (int i = 0; i < 3; i++)
        c->world_from_camera.rotation[i][i] = 1.0f;
    c->camera_from_world = rigid_inverse(&c->world_from_camera);
    struct scene scene = {.photograph_count = 1, .photograph = &photograph};
    scene.mesh = (struct mesh){.vertex_count = 12, .position = position, .triangle_count = 6, .index = index};
    struct segments segments = {.count = 1, .of_triangle = of_triangle};
    struct atlas atlas = {.chart_count = 3, .chart_of_triangle = chart};
    struct parallel *pool = parallel_new(2);
    struct accel *accel;
    struct error err;
    struct views views;
    float density[6];
    CHECK(accel_new(&accel, &scene.mesh, pool, &err) == STATUS_OK);
    views_init(&views, &scene, &segments, accel, pool);
    texel_density_from_views(&views, &atlas, pool, density);
    for (int t = 0; t < 6; t++)
        CHECK_THAT(density[t] == (t < 2 ? 1.0f : 0.25f), "triangle %d: %g", t, (double)density[t]);
    views_release(&views);
    accel_free(accel);
    parallel_free(pool);
    return check_result();
}
