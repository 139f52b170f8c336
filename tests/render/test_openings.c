/* openings.h, surround.h: which cell of the box around a scan a ray leaves through; a room whose ceiling was not
 * scanned, nor the lamp beneath it: light comes in from where it does; and one of which hardly more than a wall and the
 * floor were. The same for any number of threads. */
#include "server/light/surround.h"
#include "tests/check.h"
#include "tests/render/shell.h"
#include "tests/render/small_room.h"

#define CEILING 1

/* --- cells ------------------------------------------------------------------------------------------------- */

static void test_cells(void) {
    struct surround s = {.lower = {-1.0f, 0.0f, 2.0f}, .upper = {3.0f, 2.5f, 5.0f}};
    const vec3 inside = {0.3f, 1.9f, 2.2f};
    double area = 0.0;
    for (size_t cell = 0; cell < SURROUND_CELLS; cell++) {
        vec3 corner[4], middle;
        surround_corners(&s, cell, corner);
        middle = vec3_scale(vec3_add(corner[0], corner[2]), 0.5f);
        vec3 front = vec3_cross(vec3_sub(corner[1], corner[0]), vec3_sub(corner[2], corner[0]));
        area += (double)vec3_length(front);
        CHECK_THAT(vec3_dot(front, vec3_sub(inside, middle)) > 0.0f, "cell %zu faces away", cell);
        for (int k = 0; k < 4; k++) { /* nearly into its corners */
            vec3 at = vec3_mad(middle, 0.98f, vec3_sub(corner[k], middle));
            size_t found = surround_cell(&s, inside, vec3_normalize(vec3_sub(at, inside)));
            CHECK_THAT(found == cell, "cell %zu for %zu", found, cell);
        }
    }
    CHECK_NEAR(area, 2.0 * (4.0 * 2.5 + 4.0 * 3.0 + 2.5 * 3.0), 1e-3);
}

/* Cameras stand inside, also where nothing of what is around them was scanned. */
static void test_cameras(void) {
    struct scene scene = {.photograph = mem_calloc(1, sizeof *scene.photograph), .photograph_count = 1};
    struct views views = {.scene = &scene};
    struct surround s;
    make_mesh(&scene.mesh);
    scene.photograph->camera = look((vec3){2.0f, 4.5f, -1.0f}, (vec3){2.0f, 0.0f, 1.0f});
    surround_init(&s, &views);
    CHECK(s.lower.x < 0.0f && s.lower.y < 0.0f && s.lower.z < -1.0f);
    CHECK(s.upper.x > 4.0f && s.upper.y > 4.5f && s.upper.z > 3.0f);
    scene_release(&scene);
}

/* --- a room ------------------------------------------------------------------------------------------------ */

/* Towards floor and walls, so that none shows ceiling or lamp; every other one at the wall of which a part is
 * missing. */
static vec3 look_low(int frame) {
    vec3 from = spread(frame, 0.4f);
    float angle = 2.4f * (float)frame;
    if (frame % 2 == 0)
        return (vec3){1.0f + 2.0f * fmodf(0.618f * (float)frame, 1.0f), 0.6f, 0.0f};
    return (vec3){from.x + cosf(angle), from.y - 1.0f, from.z + sinf(angle)};
}

/* Takes the triangles of an object away. */
static void drop(struct mesh *mesh, int64_t object) {
    size_t kept = 0;
    for (size_t t = 0; t < mesh->triangle_count; t++) {
        if (mesh->object_id[t] == object)
            continue;
        memcpy(mesh->index[kept], mesh->index[t], sizeof *mesh->index);
        mesh->face[kept] = mesh->face[t];
        mesh->object_id[kept++] = mesh->object_id[t];
    }
    mesh->triangle_count = kept;
}

#define WORK                                                                                                           \
    "\"report_samples\":1,\"gather_samples\":32,\"iterations\":2,\"calibrate\":false,\"hold_out_every\":0,"            \
    "\"holes\":\"fill\""
#define SETTINGS "{\"texture_size\":64," WORK "}"

/* The walls that were scanned, as photographs of the whole room show them: their base colours come out right, since the
 * light comes from where the lamp is. Without openings the floor is white. */
static void check_colors(const struct reconstruction *r) {
    for (int wall = 0; wall < 6; wall++) {
        if (wall == CEILING)
            continue;
        rgb found = shell_mean_color(r, wall), wanted = wall_color[wall];
        float off = fmaxf(fabsf(found.r - wanted.r), fmaxf(fabsf(found.g - wanted.g), fabsf(found.b - wanted.b)));
        CHECK_THAT(off < 0.06f, "wall %d: %.3f %.3f %.3f", wall, (double)found.r, (double)found.g, (double)found.b);
    }
}

/* Of the report: the openings lie over the room and are about as bright as the lamp, which is smaller than two cells
 * and nearer; they have a name, by which they can be taken away. */
static void check_lights(const struct reconstruction *r) {
    const cJSON *light;
    int count = 0;
    cJSON_ArrayForEach(light, cJSON_GetObjectItem(r->report, "lights")) {
        const cJSON *place = cJSON_GetObjectItem(light, "place");
        double height = cJSON_GetNumberValue(cJSON_GetArrayItem(place, 1));
        double red = cJSON_GetNumberValue(cJSON_GetArrayItem(cJSON_GetObjectItem(light, "radiance"), 0));
        const char *name = cJSON_GetStringValue(cJSON_GetObjectItem(light, "name"));
        count++;
        CHECK(strcmp(cJSON_GetStringValue(cJSON_GetObjectItem(light, "kind")), "opening") == 0);
        CHECK(name && strcmp(name, "opening") == 0);
        CHECK_THAT(height > 3.0, "%g m high", height);
        CHECK_THAT(red > 0.5 * (double)lamp_radiance.r && red < 1.5 * (double)lamp_radiance.r, "%g in red", red);
    }
    CHECK(count > 0 && (size_t)count <= r->openings.count);
}

/* Figures of the surface are those of what it is with the openings. */
static void check_figures(const struct reconstruction *r) {
    static const char *const name[] = {"triangles", "segments", "charts", "valid_texels"};
    const size_t wanted[] = {r->scene->mesh.triangle_count, r->segments.count, r->atlas.chart_count,
                             r->inverse.valid_count};
    const cJSON *figures = cJSON_GetObjectItem(r->report, "prepare");
    for (size_t i = 0; i < sizeof wanted / sizeof *wanted; i++) {
        double found = cJSON_GetNumberValue(cJSON_GetObjectItem(figures, name[i]));
        CHECK_THAT(found == (double)wanted[i], "%s: %g in the report, %zu", name[i], found, wanted[i]);
    }
}

/* The room whose ceiling and lamp were not scanned, nor a part of a wall that photographs show. */
static void scan(struct scene *scene) {
    mesh_release(&scene->mesh);
    make_mesh_with_window(&scene->mesh);
    drop(&scene->mesh, LAMP);
    drop(&scene->mesh, CEILING);
}

static enum status reconstruct(struct scene *scene, int threads, long polls_until_stop, struct reconstruction *r) {
    struct settings settings = shell_settings(SETTINGS);
    struct shell shell = {.polls_until_stop = polls_until_stop};
    scan(scene);
    enum status status = shell_run(scene, &settings, threads, &shell, r);
    shell_release(&shell);
    settings_release(&settings);
    return status;
}

static void test_room(struct parallel *pool) {
    struct reconstruction r;
    struct scene scene = {0};
    size_t vertices;
    make_mesh(&scene.mesh);
    photograph_samples = 16;
    photograph_mesh(&scene, lamp_radiance, NULL, look_low, pool);
    CHECK(reconstruct(&scene, 2, -1, &r) == STATUS_OK);
    check_colors(&r);
    check_lights(&r);
    check_figures(&r);
    vertices = scene.mesh.vertex_count;
    vec3 *position = mem_array(vertices, sizeof *position);
    memcpy(position, scene.mesh.position, vertices * sizeof *position);
    reconstruct_release(&r);
    CHECK(IS_BRIEF || reconstruct(&scene, 1, 1, &r) == STATUS_CANCELLED); /* after fuse */
    CHECK(IS_BRIEF || (scene.mesh.vertex_count == vertices &&
                       memcmp(scene.mesh.position, position, vertices * sizeof *position) == 0));
    if (!IS_BRIEF)
        reconstruct_release(&r);
    mem_free(position);
    scene_release(&scene);
}

static vec3 look_at_wall(int frame) { return look_low(2 * frame); }

/* Only the floor and the wall with the hole were scanned: the hole is filled, and all else stays distant. */
static void test_mostly_unscanned(struct parallel *pool) {
    struct settings settings = shell_settings("{" SHELL_COARSE_TEXTURE "," WORK "}");
    struct shell shell = {.polls_until_stop = 1}; /* after fuse */
    struct reconstruction r;
    struct scene scene = {0};
    make_mesh(&scene.mesh);
    photograph_samples = 16;
    photograph_mesh(&scene, lamp_radiance, NULL, look_at_wall, pool);
    scan(&scene);
    for (int64_t wall = 2; wall < LAMP; wall++) {
        if (wall != 4)
            drop(&scene.mesh, wall);
    }
    size_t scanned = scene.mesh.triangle_count;
    CHECK(shell_run(&scene, &settings, 2, &shell, &r) == STATUS_CANCELLED);
    CHECK(scene.mesh.triangle_count > scanned);
    CHECK_THAT(r.unseen_share > 0.3, "%g of the rays", r.unseen_share);
    CHECK(r.openings.count == 0 && !r.is_surrounded && r.sky_is_fitted);
    reconstruct_release(&r);
    shell_release(&shell);
    settings_release(&settings);
    scene_release(&scene);
}

int main(void) {
    struct parallel *pool = parallel_new(0);
    test_cells();
    test_cameras();
    test_room(pool);
    test_mostly_unscanned(pool);
    parallel_free(pool);
    return check_result();
}
