/* test_holes.c -- a room of 4 x 3 x 3 m whose mesh lacks 2 x 1.5 m of a wall, photographed with what may be there: the
 * wall, painted or plain, also where some photographs saturate; sky, clouded or plain; a room beyond; nothing.
 * Photographs are closed forms. Or it lacks what none of them shows: a part of the wall behind a panel, the floor
 * within a block that reaches the ceiling. */
#include "server/holes/holes.h"

#include "common/image.h"
#include "server/reconstruct/reconstruct.h"
#include "tests/render/shell.h"
#include "tests/render/small_room.h"

#define TEST_FRAMES 24
#define TEST_WIDTH 128
#define TEST_HEIGHT 96
#define WALL 4         /* the object of the wall at z = 0 */
#define HOLE_M2 3.0    /* x of 1 to 3 m, y of 1.25 to 2.75 m */
#define BEYOND_Z -1.5f /* of the wall of the room beyond */
#define CLIP 0.32f     /* the painted wall is of .3 to .9 */

enum shown { PAINTED_WALL, CLIPPED_WALL, PLAIN_WALL, FAINT_CLOUDS, CLOUDED_SKY, PLAIN_SKY, ROOM_BEYOND, NOTHING };

struct holed {
    enum shown shown;
    struct parallel *pool;
    struct scene scene;
    struct segments segments;
    struct accel *accel;
    struct views views;
};

/* Evenly distributed in [-1, 1]. */
static float random_of(size_t frame, size_t what) {
    return 2.0f * rng_to_float((uint32_t)rng_key(frame, what, 11)) - 1.0f;
}

static float paint(vec3 p) {
    float wave = sinf(5.0f * p.x + 3.0f * p.y + 1.0f) * sinf(4.0f * p.z - 2.0f * p.y + 6.0f * p.x);
    return 0.6f * (1.0f + 0.5f * wave);
}

/* Walls are painted, or a little brighter towards one side. */
static float wall_radiance(enum shown shown, vec3 p) {
    if (shown == FAINT_CLOUDS)
        return 0.6f;
    bool is_plain = shown == PLAIN_WALL || shown == PLAIN_SKY;
    return is_plain ? 0.6f + 0.05f * p.x : paint(p);
}

/* What a ray shows that leaves the room. */
static float beyond(enum shown shown, vec3 origin, vec3 direction) {
    vec3 on_wall = vec3_mad(origin, -origin.z / direction.z, direction);
    vec3 on_next = vec3_mad(origin, (BEYOND_Z - origin.z) / direction.z, direction);
    switch (shown) {
    case PAINTED_WALL:
    case CLIPPED_WALL:
    case PLAIN_WALL: return wall_radiance(shown, on_wall);
    case FAINT_CLOUDS: /* in the mean as bright as the wall */
        return 0.6f + 0.2f * (paint(vec3_scale(direction, 4.0f)) - 0.6f);
    case CLOUDED_SKY: return paint(vec3_scale(direction, 4.0f));
    case PLAIN_SKY: return 2.0f;
    case ROOM_BEYOND: return paint(on_next);
    case NOTHING: break;
    }
    return 0.0f;
}

/* Where the wall is to be clipped two photographs in five are, nearly everywhere. */
static bool is_clipped(const struct holed *room, size_t frame) { return room->shown == CLIPPED_WALL && frame % 5 < 2; }

static void take(struct holed *room, size_t frame) {
    struct photograph *photo = &room->scene.photograph[frame];
    vec3 origin = camera_origin(&photo->camera);
    for (size_t i = 0; i < TEST_WIDTH * TEST_HEIGHT; i++) {
        vec3 direction;
        struct accel_hit hit;
        float x = (float)(i % TEST_WIDTH) + 0.5f, y = (float)(i / TEST_WIDTH) + 0.5f;
        CHECK(camera_direction(&photo->camera, x, y, &direction));
        bool meets = accel_intersect(room->accel, origin, direction, 0.0f, INFINITY, &hit);
        float value = meets ? wall_radiance(room->shown, vec3_mad(origin, hit.distance_m, direction))
                            : beyond(room->shown, origin, direction);
        for (size_t c = 0; c < 3; c++)
            photo->pixel[i][c] =
                image_half_from_float(fminf(value * (1.0f + 0.0173f * random_of(frame, 3 * i + c)), photo->clip));
    }
}

/* A wall with a window, a panel 10 cm before it, and no wall behind the panel; a block at the opposite wall, within
 * which there is no floor, ceiling or wall. */
static void make_hidden_mesh(struct mesh *m) {
    const vec3 x = {4, 0, 0};
    const float low[2] = {1.5f, 2.65f}, high[2] = {2.5f, 3.0f}; /* of the block, along x and z */
    start_room(m, OBJECTS + 18);
    m->vertex_count = m->triangle_count = 0;
    add_quad(m, FLOOR, (vec3){0, 0, 0}, (vec3){0, 0, low[1]}, x);
    add_quad(m, FLOOR, (vec3){0, 0, low[1]}, (vec3){0, 0, high[1] - low[1]}, (vec3){low[0], 0, 0});
    add_quad(m, FLOOR, (vec3){high[0], 0, low[1]}, (vec3){0, 0, high[1] - low[1]}, (vec3){4.0f - high[0], 0, 0});
    add_quad(m, 1, (vec3){0, 3, 0}, x, (vec3){0, 0, low[1]});
    add_quad(m, 1, (vec3){0, 3, low[1]}, (vec3){low[0], 0, 0}, (vec3){0, 0, high[1] - low[1]});
    add_quad(m, 1, (vec3){high[0], 3, low[1]}, (vec3){4.0f - high[0], 0, 0}, (vec3){0, 0, high[1] - low[1]});
    add_quad(m, 2, (vec3){0, 0, 0}, (vec3){0, 3, 0}, (vec3){0, 0, 3});
    add_quad(m, 3, (vec3){4, 0, 0}, (vec3){0, 0, 3}, (vec3){0, 3, 0});
    add_quad(m, 5, (vec3){0, 0, 3}, (vec3){0, 3, 0}, (vec3){low[0], 0, 0});
    add_quad(m, 5, (vec3){high[0], 0, 3}, (vec3){0, 3, 0}, (vec3){4.0f - high[0], 0, 0});
    add_quad(m, LAMP, (vec3){low[0], 0, low[1]}, (vec3){0, 3, 0}, (vec3){high[0] - low[0], 0, 0});
    add_quad(m, LAMP, (vec3){low[0], 0, low[1]}, (vec3){0, 0, high[1] - low[1]}, (vec3){0, 3, 0});
    add_quad(m, LAMP, (vec3){high[0], 0, low[1]}, (vec3){0, 3, 0}, (vec3){0, 0, high[1] - low[1]});
    add_quad(m, WALL, (vec3){0, 2.75f, 0}, x, (vec3){0, 0.25f, 0});
    add_quad(m, WALL, (vec3){0, 1.25f, 0}, (vec3){1, 0, 0}, (vec3){0, 1.5f, 0});
    add_quad(m, WALL, (vec3){3, 1.25f, 0}, (vec3){1, 0, 0}, (vec3){0, 1.5f, 0});
    add_quad(m, WALL, (vec3){0, 0.7f, 0}, x, (vec3){0, 0.55f, 0});
    add_quad(m, WALL, (vec3){0, 0, 0}, (vec3){1.3f, 0, 0}, (vec3){0, 0.7f, 0});
    add_quad(m, WALL, (vec3){2.7f, 0, 0}, (vec3){1.3f, 0, 0}, (vec3){0, 0.7f, 0});
    add_quad(m, LAMP, (vec3){1, 0, 0.1f}, (vec3){2, 0, 0}, (vec3){0, 1.2f, 0});
}

#define HIDDEN_M2 0.98 /* behind the panel, down to the floor */

static void make_of(struct holed *room, void make_mesh_of(struct mesh *m), enum shown shown, int threads) {
    struct error err = {0};
    *room = (struct holed){.shown = shown, .pool = parallel_new(threads)};
    struct mesh *mesh = &room->scene.mesh;
    make_mesh_of(mesh);
    mesh->uv = mem_calloc(mesh->triangle_count, sizeof *mesh->uv);
    segments_from_object_id(&room->segments, &room->scene.mesh);
    CHECK(accel_new(&room->accel, &room->scene.mesh, room->pool, &err) == STATUS_OK);
    room->scene.photograph = mem_calloc(TEST_FRAMES, sizeof *room->scene.photograph);
    room->scene.photograph_count = TEST_FRAMES;
    for (size_t f = 0; f < TEST_FRAMES; f++) {
        struct photograph *photo = &room->scene.photograph[f];
        *photo = (struct photograph){
            .is_hdr = true, .exposure_known = true, .exposure = 1.0f, .gain = {1, 1, 1}, .clip = INFINITY};
        if (is_clipped(room, f))
            photo->is_hdr = false, photo->clip = CLIP;
        photo->name = mem_printf("frame %zu", f);
        vec3 to = spread((int)f * 7 + 3, 0.0f); /* every other one looks at the wall */
        photo->camera = look(spread((int)f, 0.4f), f % 2 == 0 ? to : vec3_make(to.x, 0.5f + to.y, 0.0f));
        photo->camera.width = TEST_WIDTH;
        photo->camera.height = TEST_HEIGHT;
        photo->camera.fx = photo->camera.fy = TEST_WIDTH / 1.6f;
        photo->camera.cx = TEST_WIDTH / 2.0f;
        photo->camera.cy = TEST_HEIGHT / 2.0f;
        photo->pixel = mem_array(TEST_WIDTH * TEST_HEIGHT, sizeof *photo->pixel);
        take(room, f);
    }
    views_init(&room->views, &room->scene, &room->segments, room->accel, room->pool);
}

static void make(struct holed *room, enum shown shown, int threads) {
    make_of(room, make_mesh_with_window, shown, threads);
}

static void release(struct holed *room) {
    views_release(&room->views);
    accel_free(room->accel);
    segments_release(&room->segments);
    scene_release(&room->scene);
    parallel_free(room->pool);
}

/* Fills; returns the number of triangles there were before. */
static size_t fill(struct holed *room, bool fills_all, struct holes_found *found) {
    size_t before = room->scene.mesh.triangle_count;
    struct holes_wanted wanted = {.fills_all = fills_all, .fills_hidden = true};
    holes_fill(&room->scene, &room->segments, &room->views, &wanted, room->pool, found);
    CHECK(room->scene.mesh.triangle_count == before + found->triangles);
    cJSON_Delete(found->list);
    return before;
}

/* What was added lies in the wall, faces the room, is one with the wall, and lets no ray of the photographs out. */
static void check_closed(const struct holed *room, size_t before) {
    const struct mesh *mesh = &room->scene.mesh;
    struct error err = {0};
    struct accel *accel;
    size_t out = 0, wrong = 0;
    float farthest_m = 0.0f;
    for (size_t t = before; t < mesh->triangle_count; t++) {
        for (int c = 0; c < 3; c++)
            farthest_m = fmaxf(farthest_m, fabsf(mesh->position[mesh->index[t][c]].z));
        wrong += !(mesh_cross(mesh, t).z > 0.0f) || mesh->object_id[t] != WALL || mesh->face[t] != MESH_NO_FACE ||
                 room->segments.id[room->segments.of_triangle[t]] != WALL || mesh_has_uv(mesh, t);
    }
    CHECK_THAT(wrong == 0, "%zu triangles face away, or continue no wall", wrong);
    CHECK_THAT(farthest_m < 0.002f, "%.4f m off the wall", (double)farthest_m);
    CHECK(accel_new(&accel, mesh, room->pool, &err) == STATUS_OK);
    for (size_t f = 0; f < TEST_FRAMES; f++) {
        for (size_t i = 0; i < TEST_WIDTH * TEST_HEIGHT; i++) {
            const struct camera *camera = &room->scene.photograph[f].camera;
            vec3 direction;
            camera_direction(camera, (float)(i % TEST_WIDTH) + 0.3f, (float)(i / TEST_WIDTH) + 0.6f, &direction);
            out += !accel_occluded(accel, camera_origin(camera), direction, 0.0f, INFINITY);
        }
    }
    CHECK_THAT(out == 0, "%zu rays leave the room", out);
    accel_free(accel);
}

static void test_hole(enum shown shown) {
    struct holed room;
    struct holes_found found;
    make(&room, shown, 2);
    size_t before = fill(&room, false, &found);
    CHECK_THAT(found.filled == 1 && found.kept == 0, "%zu filled, %zu kept of %d", found.filled, found.kept, shown);
    CHECK_NEAR(found.filled_m2, HOLE_M2, 0.3);
    check_closed(&room, before);
    release(&room);
}

/* A kept opening leaves the mesh alone; fills_all closes it, unless it shows darkness: that is no surface to anyone. */
static void test_opening(enum shown shown) {
    struct holed room;
    struct holes_found found;
    make(&room, shown, 2);
    size_t before = fill(&room, false, &found);
    CHECK_THAT(found.triangles == 0, "%zu triangles for %d", found.triangles, shown);
    if (shown == FAINT_CLOUDS || shown == CLOUDED_SKY || shown == PLAIN_SKY)
        CHECK_THAT(found.kept == 1, "%zu kept of %d", found.kept, shown);
    fill(&room, true, &found);
    CHECK((found.triangles > 0) == (shown != NOTHING));
    if (shown != NOTHING)
        check_closed(&room, before);
    release(&room);
}

/* The wall goes on behind the panel; the window stays open, and nothing is filled in within the block. */
static void test_hidden(void) {
    struct holed room;
    struct holes_found found;
    double area_m2 = 0.0;
    make_of(&room, make_hidden_mesh, PLAIN_SKY, 2);
    size_t before = fill(&room, false, &found);
    const struct mesh *mesh = &room.scene.mesh;
    size_t elsewhere = 0;
    for (size_t t = before; t < mesh->triangle_count; t++) {
        elsewhere += room.segments.id[room.segments.of_triangle[t]] != WALL ||
                     fabsf(mesh->position[mesh->index[t][0]].z) > 0.01f;
        area_m2 += 0.5 * (double)vec3_length(mesh_cross(mesh, t));
    }
    CHECK_THAT(elsewhere == 0, "%zu triangles elsewhere", elsewhere);
    CHECK_THAT(found.filled == 1 && found.kept == 1, "%zu filled, %zu kept", found.filled, found.kept);
    CHECK_NEAR(found.filled_m2, HIDDEN_M2, 0.1);
    CHECK_NEAR(area_m2, HIDDEN_M2, 0.3); /* it goes on behind the rim */
    release(&room);
}

/* What was cropped stays away: here all beyond x = 2 m. */
static void test_cropped(void) {
    const vec3 within[2] = {{-10.0f, -10.0f, -10.0f}, {2.0f, 10.0f, 10.0f}};
    struct holed room;
    struct holes_found found;
    float farthest_m = 0.0f;
    make(&room, PAINTED_WALL, 2);
    size_t before = room.scene.mesh.vertex_count;
    struct holes_wanted wanted = {.within = within};
    holes_fill(&room.scene, &room.segments, &room.views, &wanted, room.pool, &found);
    cJSON_Delete(found.list);
    for (size_t v = before; v < room.scene.mesh.vertex_count; v++)
        farthest_m = fmaxf(farthest_m, room.scene.mesh.position[v].x);
    CHECK_NEAR(found.filled_m2, 0.5 * HOLE_M2, 0.2);
    CHECK_NEAR(farthest_m, 2.0, 0.05);
    release(&room);
}

static void test_threads(void) {
    struct holed one, many;
    struct holes_found found;
    make(&one, PAINTED_WALL, 1);
    make(&many, PAINTED_WALL, 5);
    fill(&one, false, &found);
    fill(&many, false, &found);
    const struct mesh *a = &one.scene.mesh, *b = &many.scene.mesh;
    CHECK(a->vertex_count == b->vertex_count && a->triangle_count == b->triangle_count);
    CHECK(memcmp(a->position, b->position, a->vertex_count * sizeof *a->position) == 0);
    CHECK(memcmp(a->index, b->index, a->triangle_count * sizeof *a->index) == 0);
    release(&many);
    release(&one);
}

/* A whole reconstruction: with the hole filled there is no distant light; with holes=keep there is, once all is
 * prepared. */
static void test_reconstruction(const char *json, bool fills) {
    struct holed room;
    struct settings s = shell_settings(json);
    struct shell shell = {.polls_until_stop = fills ? -1 : 0};
    struct reconstruction r;
    make(&room, PAINTED_WALL, 2);
    size_t before = room.scene.mesh.triangle_count;
    CHECK(shell_run(&room.scene, &s, 2, &shell, &r) == (fills ? STATUS_OK : STATUS_CANCELLED));
    const cJSON *report = cJSON_GetObjectItem(r.report, "holes");
    CHECK((room.scene.mesh.triangle_count > before) == fills);
    CHECK((report != NULL) == fills);
    CHECK(!fills || cJSON_GetNumberValue(cJSON_GetObjectItem(report, "filled")) == 1.0);
    CHECK((r.environment.map.pixel == NULL) == fills);
    reconstruct_release(&r);
    shell_release(&shell);
    settings_release(&s);
    release(&room);
}

/* What no photograph shows is filled in on a scan, but not where objects are told apart. */
static void test_hidden_of(bool is_scan, const char *json) {
    struct holed room;
    struct settings s = shell_settings(json);
    struct shell shell = {.polls_until_stop = 0}; /* once all is prepared */
    struct reconstruction r;
    make_of(&room, make_hidden_mesh, PLAIN_SKY, 2);
    if (is_scan) {
        mem_free(room.scene.mesh.object_id);
        room.scene.mesh.object_id = NULL;
    }
    CHECK(shell_run(&room.scene, &s, 2, &shell, &r) == STATUS_CANCELLED);
    const cJSON *report = cJSON_GetObjectItem(r.report, "holes");
    CHECK_NEAR(cJSON_GetNumberValue(cJSON_GetObjectItem(report, "filled_m2")), is_scan ? HIDDEN_M2 : 0.0, 0.1);
    const cJSON *first = cJSON_GetArrayItem(cJSON_GetObjectItem(report, "regions"), 0);
    CHECK(cJSON_IsTrue(cJSON_GetObjectItem(first, "hidden")) == is_scan);
    reconstruct_release(&r);
    shell_release(&shell);
    settings_release(&s);
    release(&room);
}

#define LITTLE "\"texture_size\":64,\"report_samples\":1,\"gather_samples\":16,\"iterations\":2,\"calibrate\":false"

int main(void) {
    test_hole(PAINTED_WALL);
    test_hole(PLAIN_WALL);
    test_hole(CLIPPED_WALL);
    test_hidden();
    test_opening(FAINT_CLOUDS);
    test_opening(CLOUDED_SKY);
    test_opening(PLAIN_SKY);
    test_opening(ROOM_BEYOND);
    test_opening(NOTHING);
    test_cropped();
    test_threads();
    test_reconstruction("{" LITTLE "}", true);
    test_reconstruction("{" LITTLE ",\"holes\":\"keep\"}", false);
    test_hidden_of(true, "{" LITTLE "}");
    test_hidden_of(false, "{" LITTLE "}");
    return check_result();
}
