/* split.h: of a wall that is one segment with a screen on it the screen is split off and found to emit, the
 * wall is not; white tiles among black ones, a patch of sun and what a lamp lights from nearby stay where they are,
 * though they are brighter by more. The same for any number of threads. */
#include "server/reconstruct/reconstruct.h"
#include "tests/check.h"
#include "tests/render/shell.h"
#include "tests/render/small_room.h"

#define COLUMNS 16 /* cells of a wall, of 0.25 m */
#define ROWS 12
#define WHITE 1 /* the ceiling */
#define WALL 4  /* what is looked at */
#define BLACK 5 /* the wall across */

/* Of a wall's cell: its object in truth, or less than 0 for a hole. */
typedef int64_t paint_function(int column, int row);

/* A wall from `corner` along 4 m of unit `u` and 3 m of `v`, in cells. */
static void add_wall(struct mesh *m, vec3 corner, vec3 u, vec3 v, paint_function *paint) {
    vec3 du = vec3_scale(u, 4.0f / COLUMNS), dv = vec3_scale(v, 3.0f / ROWS);
    for (int row = 0; row < ROWS; row++) {
        for (int column = 0; column < COLUMNS; column++) {
            int64_t object = paint(column, row);
            vec3 at = vec3_mad(vec3_mad(corner, (float)column, du), (float)row, dv);
            if (object >= 0)
                add_quad(m, object, at, du, dv);
        }
    }
}

static int64_t plain_floor(int column, int row) {
    (void)column, (void)row;
    return FLOOR;
}

static int64_t screen(int column, int row) { return column >= 4 && column < 12 && row >= 3 && row < 9 ? LAMP : WALL; }

static int64_t tiles(int column, int row) { return row == 0 ? WALL : (column / 3 + row / 3) % 2 ? WHITE : BLACK; }

static int64_t window(int column, int row) { return column >= 6 && column < 10 && row >= 8 && row < 11 ? -1 : WALL; }

/* The room of small_room.h, its floor and the wall at z = 0 in cells, the lamp left out where that wall holds it. */
static void make_room(struct mesh *m, paint_function *paint, bool has_lamp) {
    size_t quads = OBJECTS + 2 + 2 * COLUMNS * ROWS;
    *m = (struct mesh){0};
    m->position = mem_array(4 * quads, sizeof *m->position);
    m->index = mem_array(2 * quads, sizeof *m->index);
    m->face = mem_array(2 * quads, sizeof *m->face);
    m->object_id = mem_array(2 * quads, sizeof *m->object_id);
    vec3 x = {4, 0, 0}, y = {0, 3, 0}, z = {0, 0, 3};
    add_wall(m, (vec3){4, 0, 0}, (vec3){-1, 0, 0}, (vec3){0, 0, 1}, plain_floor);
    add_wall(m, (vec3){0, 0, 0}, (vec3){1, 0, 0}, (vec3){0, 1, 0}, paint);
    add_quad(m, WHITE, (vec3){0, 3, 0}, x, z);
    add_quad(m, 2, (vec3){0, 0, 0}, y, z);
    add_quad(m, 3, (vec3){4, 0, 0}, z, y);
    add_quad(m, BLACK, (vec3){0, 0, 3}, y, x);
    if (has_lamp)
        add_quad(m, LAMP, (vec3){1.5f, 2.9f, 1.0f}, (vec3){1, 0, 0}, (vec3){0, 0, 1});
}

/* From then on the cells of the wall are of one object, whatever they were painted. */
static void join_wall(struct mesh *m) {
    for (size_t t = 0; t < m->triangle_count; t++) {
        bool on_wall = true;
        for (int k = 0; k < 3; k++)
            on_wall = on_wall && m->position[m->index[t][k]].z == 0.0f;
        if (on_wall)
            m->object_id[t] = WALL;
    }
}

static int64_t plain_wall(int column, int row) {
    (void)column, (void)row;
    return WALL;
}

#define TO_THE_END -1L
#define PREPARED 0L /* stops when segments are as they stay */

static enum status reconstruct(struct scene *scene, int threads, long polls_until_stop, struct reconstruction *r) {
    struct settings s = shell_settings("{\"texture_size\":80,\"iterations\":2,\"report_samples\":1,"
                                       "\"gather_samples\":32,\"texels_per_iteration\":64}");
    struct shell shell = {.polls_until_stop = polls_until_stop};
    enum status status = shell_run(scene, &s, threads, &shell, r);
    shell_release(&shell);
    settings_release(&s);
    return status;
}

static size_t part_count(const struct reconstruction *r) {
    return (size_t)cJSON_GetArraySize(cJSON_GetObjectItem(r->report, "parts_that_shine"));
}

static vec3 look_at_wall(int frame) {
    vec3 at = spread(frame * 7 + 3, 0.0f);
    return frame % 4 == 0 ? at : (vec3){at.x, at.y, 0.0f};
}

static void test_screen(struct parallel *pool) {
    struct scene scene = {0};
    make_room(&scene.mesh, screen, false);
    photograph_mesh(&scene, lamp_radiance, NULL, look_at_wall, pool);
    struct reconstruction r, again;
    join_wall(&scene.mesh);
    CHECK(reconstruct(&scene, 1, TO_THE_END, &r) == STATUS_OK);
    CHECK(part_count(&r) == 1 && r.segments.count == OBJECTS && r.segments.id[OBJECTS - 1] == WALL);
    const cJSON *part = cJSON_GetArrayItem(cJSON_GetObjectItem(r.report, "parts_that_shine"), 0);
    CHECK(cJSON_GetNumberValue(cJSON_GetObjectItem(part, "of_segment")) == WALL);
    CHECK(cJSON_GetNumberValue(cJSON_GetObjectItem(part, "segment")) == OBJECTS - 1);
    size_t wrong = 0;
    for (size_t t = 0; t < scene.mesh.triangle_count; t++) {
        size_t cell = t / 2 - COLUMNS * ROWS;
        bool shines = t / 2 >= COLUMNS * ROWS && cell < COLUMNS * ROWS &&
                      screen((int)(cell % COLUMNS), (int)(cell / COLUMNS)) == LAMP;
        wrong += r.is_emitter[r.segments.of_triangle[t]] != shines;
    }
    CHECK_THAT(wrong == 0, "%zu triangles", wrong);
    const rgb *e = &r.materials.emission[OBJECTS - 1];
    CHECK_NEAR(e->r, lamp_radiance.r, 0.05f * lamp_radiance.r);
    CHECK_NEAR(e->b, lamp_radiance.b, 0.05f * lamp_radiance.b);
    join_wall(&scene.mesh);
    CHECK(reconstruct(&scene, 3, PREPARED, &again) == STATUS_CANCELLED);
    CHECK(again.segments.count == r.segments.count &&
          memcmp(again.segments.of_triangle, r.segments.of_triangle,
                 scene.mesh.triangle_count * sizeof *r.segments.of_triangle) == 0);
    reconstruct_release(&again);
    reconstruct_release(&r);
    scene_release(&scene);
}

/* Screen and lamp saturate. How bright the lamp is nobody knows, nor, then, what white paint would show at the screen;
 * but the screen may be as much brighter than it seems. */
static void test_saturated(struct parallel *pool) {
    struct scene scene = {0};
    make_room(&scene.mesh, screen, true);
    photograph_mesh(&scene, lamp_radiance, NULL, look_at_wall, pool);
    for (size_t f = 0; f < scene.photograph_count; f++)
        saturate_photograph(&scene.photograph[f], 2.0f);
    struct reconstruction r;
    join_wall(&scene.mesh);
    CHECK(reconstruct(&scene, 0, PREPARED, &r) == STATUS_CANCELLED);
    CHECK_THAT(part_count(&r) == 1, "%zu parts", part_count(&r));
    size_t wrong = 0;
    for (size_t t = 2 * COLUMNS * ROWS; t < 4 * COLUMNS * ROWS; t++) {
        size_t cell = t / 2 - COLUMNS * ROWS;
        bool shines = screen((int)(cell % COLUMNS), (int)(cell / COLUMNS)) == LAMP;
        wrong += (r.segments.of_triangle[t] == r.segments.count - 1) != shines;
    }
    CHECK_THAT(wrong == 0, "%zu triangles", wrong);
    reconstruct_release(&r);
    scene_release(&scene);
}

static void test_tiles(struct parallel *pool) {
    struct scene scene = {0};
    make_room(&scene.mesh, tiles, true);
    photograph_mesh(&scene, lamp_radiance, NULL, look_at_wall, pool);
    join_wall(&scene.mesh);
    struct reconstruction r;
    CHECK(reconstruct(&scene, 0, TO_THE_END, &r) == STATUS_OK);
    CHECK_THAT(part_count(&r) == 0, "%zu parts", part_count(&r));
    for (size_t s = 0; s < r.segments.count; s++)
        CHECK_THAT(r.is_emitter[s] == (s == LAMP), "segment %zu", s);
    reconstruct_release(&r);
    scene_release(&scene);
}

/* Nobody looks at the window or out of it. */
static vec3 look_away(int frame) {
    vec3 at = spread(frame * 7 + 3, 0.0f);
    return (vec3){at.x, 0.5f * at.y, 3.0f};
}

static void test_sun(struct parallel *pool) {
    struct scene scene = {0};
    struct image sky;
    make_room(&scene.mesh, window, true);
    image_init_rgb(&sky, 256, 128);
    for (size_t i = 0; i < 256 * 128; i++) {
        /* 45 degrees above, towards -z: column 0. */
        float radiance = i == 32 * 256 ? 25000.0f : 0.5f;
        for (size_t c = 0; c < 3; c++)
            sky.pixel[3 * i + c] = radiance;
    }
    photograph_mesh(&scene, rgb_scale(lamp_radiance, 0.2f), &sky, look_away, pool);
    struct reconstruction r;
    CHECK(reconstruct(&scene, 0, PREPARED, &r) == STATUS_CANCELLED);
    CHECK_THAT(cJSON_HasObjectItem(r.report, "parts_that_shine") && part_count(&r) == 0, "%zu parts", part_count(&r));
    reconstruct_release(&r);
    image_release(&sky);
    scene_release(&scene);
}

static vec3 stand_off(int frame) {
    vec3 at = spread(frame, 0.4f);
    return (vec3){at.x, at.y, 1.0f + 0.6f * at.z};
}

/* A lamp with its back to the cameras lights a plain wall from so near that it is brighter there than white paint would
 * be in the light that photographs show. */
static void test_lit(struct parallel *pool) {
    struct scene scene = {0};
    make_room(&scene.mesh, plain_wall, false);
    add_quad(&scene.mesh, LAMP, (vec3){1.7f, 1.2f, 0.7f}, (vec3){0, 0.6f, 0}, (vec3){0.6f, 0, 0});
    add_quad(&scene.mesh, BLACK, (vec3){1.6f, 1.1f, 0.71f}, (vec3){0.8f, 0, 0}, (vec3){0, 0.8f, 0});
    camera_place = stand_off;
    photograph_mesh(&scene, lamp_radiance, NULL, look_at_wall, pool);
    camera_place = NULL;
    struct reconstruction r;
    CHECK(reconstruct(&scene, 0, TO_THE_END, &r) == STATUS_OK);
    CHECK_THAT(part_count(&r) == 0, "%zu parts", part_count(&r));
    CHECK(!r.is_emitter[WALL] && r.is_emitter[LAMP]);
    reconstruct_release(&r);
    scene_release(&scene);
}

int main(void) {
    struct parallel *pool = parallel_new(0);
    wall_color[WHITE] = rgb_gray(0.85f);
    wall_color[BLACK] = rgb_gray(0.04f);
    test_screen(pool);
    test_saturated(pool);
    test_tiles(pool);
    test_sun(pool);
    test_lit(pool);
    parallel_free(pool);
    return check_result();
}
