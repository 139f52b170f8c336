/* test_panel.c -- a glossy panel of the wall's white, 2 cm before a matt wall, on a mesh as scans have it: even
 * triangles, steps rounded, no objects told. The photographs show the true room. */
#include "server/reconstruct/reconstruct.h"
#include "tests/render/scanned_mesh.h"
#include "tests/render/shell.h"
#include "tests/render/small_room.h"

#define PANEL 3 /* an object: both walls across x are object 2 */
#define WALL 4  /* that the panel is on, at z = 0 */
#define QUAD_M 0.1f
#define WALL_QUAD_M 0.025f
#define WALL_COLUMNS 160
#define STEP_M 0.05f /* over which a step is rounded */

static const vec3 panel_low = {1.2f, 0.7f, 0.0f}, panel_high = {2.8f, 1.9f, 0.02f};

static void make_true_mesh(struct mesh *m) {
    start_room(m, OBJECTS + 5);
    for (size_t t = 0; t < m->triangle_count; t++)
        m->object_id[t] = m->object_id[t] == PANEL ? 2 : m->object_id[t];
    add_quad(m, WALL, (vec3){0, 0, 0}, (vec3){4, 0, 0}, (vec3){0, 3, 0});
    add_quad(m, 5, (vec3){0, 0, 3}, (vec3){0, 3, 0}, (vec3){4, 0, 0});
    add_lamp(m);
    vec3 l = panel_low, size = vec3_sub(panel_high, panel_low);
    vec3 x = {size.x, 0, 0}, y = {0, size.y, 0}, z = {0, 0, size.z};
    add_quad(m, PANEL, vec3_add(l, z), x, y);
    add_quad(m, PANEL, l, x, z);
    add_quad(m, PANEL, vec3_add(l, y), z, x);
    add_quad(m, PANEL, l, z, y);
    add_quad(m, PANEL, vec3_add(l, x), y, z);
}

/* Height of the scanned wall: the panel with rounded edges, and waves as depth maps leave. */
static float wall_height(float x, float y) {
    float off = fminf(fminf(x - panel_low.x, panel_high.x - x), fminf(y - panel_low.y, panel_high.y - y));
    float t = clampf(off / STEP_M + 0.5f, 0.0f, 1.0f), turn = 6.2831853f / 0.4f;
    return panel_high.z * t * t * (3.0f - 2.0f * t) + 0.001f * sinf(turn * x) * sinf(turn * y + 1.0f);
}

/* The wall with the panel first. */
static void make_scan(struct mesh *m) {
    size_t room = 100000;
    *m = (struct mesh){0};
    m->position = mem_array(room, sizeof *m->position);
    m->index = mem_array(room, sizeof *m->index);
    m->face = mem_array(room, sizeof *m->face);
    vec3 x = {4, 0, 0}, y = {0, 3, 0}, z = {0, 0, 3};
    add_scanned(m, WALL_QUAD_M, (vec3){0, 0, 0}, x, y);
    for (size_t v = 0; v < m->vertex_count; v++)
        m->position[v].z = wall_height(m->position[v].x, m->position[v].y);
    add_scanned(m, QUAD_M, (vec3){0, 0, 0}, z, x);
    add_scanned(m, QUAD_M, (vec3){0, 3, 0}, x, z);
    add_scanned(m, QUAD_M, (vec3){0, 0, 0}, y, z);
    add_scanned(m, QUAD_M, (vec3){4, 0, 0}, z, y);
    add_scanned(m, QUAD_M, (vec3){0, 0, 3}, y, x);
    add_scanned(m, QUAD_M, (vec3){1.5f, 2.9f, 1.0f}, (vec3){1, 0, 0}, (vec3){0, 0, 1});
    CHECK(m->vertex_count <= room && m->triangle_count <= room);
}

static vec3 look_at_wall(int frame) {
    vec3 to = spread(frame * 7 + 3, 0.0f);
    return (vec3){0.6f + 0.7f * to.x, 0.4f + 0.7f * to.y, 0.0f};
}

static uint32_t segment_at(const struct reconstruction *r, float x, float y) {
    size_t quad = (size_t)(y / WALL_QUAD_M) * WALL_COLUMNS + (size_t)(x / WALL_QUAD_M);
    return r->segments.of_triangle[2 * quad];
}

int main(void) {
    struct parallel *pool = parallel_new(0);
    struct scene scene = {0};
    struct settings settings = shell_settings("{\"texture_size\":192,\"iterations\":1,\"report_samples\":1,"
                                              "\"gather_samples\":64,\"calibrate\":false,\"holes\":\"keep\"}");
    struct shell shell = {.polls_until_stop = -1};
    struct reconstruction r;
    wall_color[WALL] = wall_color[PANEL] = rgb_gray(0.8f);
    wall_roughness[PANEL] = 0.2f;
    wall_specular[PANEL] = 0.5f;
    make_true_mesh(&scene.mesh);
    photograph_mesh(&scene, lamp_radiance, NULL, look_at_wall, pool);
    mesh_release(&scene.mesh);
    make_scan(&scene.mesh);
    CHECK(shell_run(&scene, &settings, 0, &shell, &r) == STATUS_OK);
    uint32_t panel = segment_at(&r, 2.0f, 1.3f), wall = segment_at(&r, 0.5f, 1.3f);
    printf("%zu segments; panel %.3f %.3f (true %.3f %.3f), wall %.3f %.3f (1 0)\n", r.segments.count,
           (double)r.materials.roughness[panel], (double)r.materials.specular[panel], (double)wall_roughness[PANEL],
           (double)wall_specular[PANEL], (double)r.materials.roughness[wall], (double)r.materials.specular[wall]);
    CHECK(panel != wall && segment_at(&r, 3.5f, 2.5f) == wall);
    CHECK_NEAR(r.materials.roughness[panel], wall_roughness[PANEL], 0.1);
    CHECK(r.materials.specular[panel] > 0.35f); /* one segment with the wall: .26 */
    CHECK(r.materials.roughness[wall] > 0.95f && r.materials.specular[wall] < 0.05f);
    reconstruct_release(&r);
    shell_release(&shell);
    settings_release(&settings);
    scene_release(&scene);
    parallel_free(pool);
    return check_result();
}
