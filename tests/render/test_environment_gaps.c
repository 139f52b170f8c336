/* environment.h: on a scan photographs look out through a window, and onto the wall where the mesh has a gap. What the
 * gap shows stays, but the sky beside it, which nothing shows, follows the window. */
#include "common/rng.h"
#include "server/capture/distant/environment_gather.h"
#include "server/reconstruct/reconstruct.h"
#include "tests/render/open_room.h"
#include "tests/render/scanned_mesh.h"
#include "tests/render/shell.h"

#define GAP_M 0.3f
#define QUAD_M 0.1f
#define WINDOW_M 2.4f
#define EDGE_M 0.5f   /* how far edges may be off */
#define BESIDE 0.985f /* cosine: within 10 degrees of the gap's directions */
#define PLACES 20000

static const vec3 gap = {0.0f, 1.4f, 1.5f}; /* its middle, in the wall at x = 0 */

/* A rectangle a x b from `corner` without that of a0 to a1, b0 to b1 of it; empty: none. */
static void add_around(struct mesh *m, vec3 corner, vec3 a, vec3 b, float a0, float a1, float b0, float b1) {
    vec3 low = vec3_mad(corner, b0, b);
    add_scanned(m, QUAD_M, corner, a, vec3_scale(b, b0));
    add_scanned(m, QUAD_M, vec3_mad(corner, b1, b), a, vec3_scale(b, 1.0f - b1));
    add_scanned(m, QUAD_M, low, vec3_scale(a, a0), vec3_scale(b, b1 - b0));
    add_scanned(m, QUAD_M, vec3_mad(low, a1, a), vec3_scale(a, 1.0f - a1), vec3_scale(b, b1 - b0));
}

/* The room of open_room.h as a scan has it: vertices off by up to 3 mm, and a gap in a wall. */
static void make_scan(struct mesh *m, float gap_m) {
    *m = (struct mesh){0};
    m->position = mem_array(PLACES, sizeof *m->position);
    m->index = mem_array(PLACES, sizeof *m->index);
    m->face = mem_array(PLACES, sizeof *m->face);
    vec3 x = {4, 0, 0}, y = {0, 3, 0}, z = {0, 0, 3};
    float left = 0.5f - 0.125f * WINDOW_M, half = 0.5f * gap_m / 3.0f;
    add_scanned(m, QUAD_M, (vec3){0, 0, 0}, z, x);
    add_scanned(m, QUAD_M, (vec3){0, 3, 0}, x, z);
    add_scanned(m, QUAD_M, (vec3){4, 0, 0}, z, y);
    add_scanned(m, QUAD_M, (vec3){0, 0, 3}, y, x);
    add_scanned(m, QUAD_M, (vec3){1.5f, 2.9f, 1.0f}, (vec3){1, 0, 0}, (vec3){0, 0, 1});
    add_around(m, (vec3){0, 0, 0}, x, y, left, 1.0f - left, 0.8f / 3.0f, 2.2f / 3.0f);
    if (gap_m > 0.0f)
        add_around(m, (vec3){0, 0, 0}, y, z, gap.y / 3.0f - half, gap.y / 3.0f + half, gap.z / 3.0f - half,
                   gap.z / 3.0f + half);
    else
        add_scanned(m, QUAD_M, (vec3){0, 0, 0}, y, z);
    CHECK(m->vertex_count <= PLACES && m->triangle_count <= PLACES);
    for (size_t i = 0; i < m->vertex_count; i++)
        for (size_t c = 0; c < 3; c++)
            (&m->position[i].x)[c] += 0.006f * ((float)(rng_key(3, i, c) % 1000) / 1000.0f - 0.5f);
}

static void gather(struct environment *e, struct scene *scene, float gap_m, float edge_m) {
    struct rig rig;
    struct scene scan = *scene;
    make_scan(&scan.mesh, gap_m);
    scan.mesh.object_id = mem_calloc(scan.mesh.triangle_count, sizeof *scan.mesh.object_id);
    rig_init(&rig, &scan, 0);
    CHECK(environment_gather(e, &rig.views, edge_m, rig.pool));
    rig_release(&rig);
    mesh_release(&scan.mesh);
}

/* Whether photographs look that way through the gap alone. */
static bool is_gap(const struct environment *torn, const struct environment *whole, size_t pixel) {
    return environment_pixel_is_seen(torn, pixel) && !environment_pixel_is_seen(whole, pixel);
}

static bool is_beside_gap(const struct environment *torn, const struct environment *whole, size_t pixel) {
    vec3 direction = environment_pixel_direction(torn, pixel);
    for (size_t i = 0; i < environment_pixel_count(torn); i++)
        if (is_gap(torn, whole, i) && vec3_dot(direction, environment_pixel_direction(torn, i)) > BESIDE)
            return !environment_pixel_is_seen(torn, pixel);
    return false;
}

static void compare(struct scene *scene, float edge_m, float *beside, float *within) {
    struct environment whole, torn;
    float fill = 0.0f, wanted = 0.0f, shown = 0.0f, count = 0.0f;
    gather(&whole, scene, 0.0f, edge_m);
    gather(&torn, scene, GAP_M, edge_m);
    for (size_t i = 0; i < environment_pixel_count(&torn); i++) {
        float sky = rgb_mean(environment_pixel_radiance(&torn, i));
        if (is_gap(&torn, &whole, i)) {
            shown += sky;
            count += 1.0f;
        } else if (is_beside_gap(&torn, &whole, i)) {
            fill += sky;
            wanted += rgb_mean(environment_pixel_radiance(&whole, i));
        }
    }
    CHECK(count > 0.0f && wanted > 0.0f);
    *beside = fill / wanted;
    *within = shown / count;
    environment_release(&whole);
    environment_release(&torn);
}

/* Of a scan without normals prepare knows how far its edges may be off. */
static void test_call(struct scene *scene) {
    struct scene scan = *scene;
    struct shell shell = {.polls_until_stop = 0}; /* once all is prepared */
    struct settings s = shell_settings(SHELL_SMALL);
    struct reconstruction r;
    make_scan(&scan.mesh, GAP_M);
    CHECK(shell_run(&scan, &s, 2, &shell, &r) == STATUS_CANCELLED);
    printf("noise %.2f mm, rims off by %.3f\n", 1e3 * (double)r.mesh_noise_m, (double)r.environment.rim_angle);
    CHECK(r.environment.map.pixel && r.environment.rim_angle > 0.0f);
    reconstruct_release(&r);
    shell_release(&shell);
    settings_release(&s);
    mesh_release(&scan.mesh);
}

int main(void) {
    struct open_room room;
    float beside, within, exact_beside, exact_within;
    open_room_init(&room);
    compare(&room.scene, EDGE_M, &beside, &within);
    compare(&room.scene, 0.0f, &exact_beside, &exact_within);
    printf("the gap shows %.2f; beside it, of the sky without it, %.3f; with exact edges %.3f\n", (double)within,
           (double)beside, (double)exact_beside);
    CHECK(within == exact_within);
    CHECK_NEAR(beside, 1.0f, 0.1f);
    CHECK(exact_beside < 0.7f); /* a gap it is */
    test_call(&room.scene);
    open_room_release(&room);
    return check_result();
}
