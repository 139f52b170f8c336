/* views.h: classes of the pixels of a large photograph, which are found in cells of 2 x 2 pixels, the last of them cut:
 * a wall that ends before another one, 1 m behind it, which ends before nothing. */
#include "common/mem.h"
#include "server/capture/views.h"
#include "tests/check.h"

#define WIDTH 2001
#define HEIGHT 1001
#define FOCAL 1000.0f
#define DEPTH_EDGE 1200.5f /* columns, in the cell of pixels 1200 and 1201 */
#define END 1703.5f        /* in that of 1702 and 1703 */

static float at_depth(float column, float z) { return (column - 0.5f * WIDTH) * z / FOCAL; }

static uint8_t wanted_class(uint32_t x) {
    uint32_t cell = x / 2;
    if (cell == (uint32_t)DEPTH_EDGE / 2 || cell == (uint32_t)END / 2)
        return VIEWS_MIXED;
    return cell > (uint32_t)END / 2 ? VIEWS_OPEN : VIEWS_SURFACE;
}

static uint8_t wanted_edge(uint32_t x) {
    uint8_t edge = 0;
    for (uint32_t i = x < VIEWS_EDGE ? 0 : x - VIEWS_EDGE; i <= x + VIEWS_EDGE && i < WIDTH; i++) {
        uint32_t distance = i > x ? i - x : x - i;
        if (wanted_class(i) == VIEWS_MIXED && distance <= VIEWS_EDGE && VIEWS_EDGE - distance > edge)
            edge = (uint8_t)(VIEWS_EDGE - distance);
    }
    return edge;
}

int main(void) {
    float first = at_depth(DEPTH_EDGE, 8.0f), second = at_depth(END, 9.0f);
    vec3 position[] = {{-40, -40, 8}, {first, -40, 8},  {first, 40, 8},  {-40, 40, 8},
                       {-90, -90, 9}, {second, -90, 9}, {second, 90, 9}, {-90, 90, 9}};
    uint32_t index[][3] = {{0, 2, 1}, {0, 3, 2}, {4, 6, 5}, {4, 7, 6}}, of_triangle[] = {0, 0, 1, 1};
    struct photograph photograph = {.exposure = 1.0f, .gain = {1, 1, 1}, .clip = INFINITY, .is_hdr = true};
    photograph.pixel = mem_calloc((size_t)WIDTH * HEIGHT, sizeof *photograph.pixel);
    struct camera *c = &photograph.camera;
    *c = (struct camera){
        .width = WIDTH, .height = HEIGHT, .fx = FOCAL, .fy = FOCAL, .cx = 0.5f * WIDTH, .cy = 0.5f * HEIGHT};
    for (int i = 0; i < 3; i++)
        c->world_from_camera.rotation[i][i] = 1.0f;
    c->camera_from_world = c->world_from_camera;
    struct scene scene = {.photograph_count = 1, .photograph = &photograph};
    scene.mesh = (struct mesh){.vertex_count = 8, .position = position, .triangle_count = 4, .index = index};
    struct segments segments = {.count = 2, .of_triangle = of_triangle};
    struct parallel *pool = parallel_new(2);
    struct accel *accel;
    struct error err;
    struct views v;
    CHECK(accel_new(&accel, &scene.mesh, pool, &err) == STATUS_OK);
    views_init(&v, &scene, &segments, accel, pool);

    uint32_t wrong_class = 0, wrong_edge = 0, wrong_owner = 0;
    for (uint32_t y = 0; y < HEIGHT; y++) {
        for (uint32_t x = 0; x < WIDTH; x++) {
            size_t at = (size_t)y * WIDTH + x;
            uint8_t class = wanted_class(x);
            wrong_class += v.shows[0][at] != class;
            wrong_edge += v.edge[0][at] != wanted_edge(x);
            wrong_owner += class == VIEWS_SURFACE && v.owner[0][at] != views_owner_mark(x > DEPTH_EDGE);
        }
    }
    CHECK_THAT(wrong_class == 0, "%u pixels have another class", wrong_class);
    CHECK_THAT(wrong_edge == 0, "%u pixels have another distance to the edge", wrong_edge);
    CHECK_THAT(wrong_owner == 0, "%u pixels have another segment", wrong_owner);

    views_release(&v);
    accel_free(accel);
    parallel_free(pool);
    mem_free(photograph.pixel);
    return check_result();
}
