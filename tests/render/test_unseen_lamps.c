/* unseen_space.h, unseen_lamps.h: a lamp in a cornice, of which a scan has neither lamp nor gap, is found by what it
 * lights, where no photograph looks; where the mesh tells objects apart, or holes are to be kept, nothing is added. */
#include "server/light/unseen_lamps.h"

#include "server/capture/unseen_space.h"
#include "tests/check.h"
#include "tests/render/shell.h"
#include "tests/render/small_room.h"

#define LOW 2.3f /* of the cornice, which is open above */
#define HIGH 2.55f
#define DEEP 0.3f
#define FROM 0.5f /* along the wall at z = 0 */
#define TO 3.5f
#define BESIDE 0.3f /* so far from it a lamp may be found */

/* A room with a cornice, in which a lamp faces the ceiling. */
static void make_cornice(struct mesh *m) {
    const vec3 along = {TO - FROM, 0, 0};
    start_room(m, OBJECTS + 2);
    add_quad(m, 4, (vec3){0, 0, 0}, (vec3){4, 0, 0}, (vec3){0, 3, 0});
    add_quad(m, 5, (vec3){0, 0, 3}, (vec3){0, 3, 0}, (vec3){4, 0, 0});
    add_quad(m, 5, (vec3){FROM, LOW, 0}, along, (vec3){0, 0, DEEP});
    add_quad(m, 5, (vec3){FROM, LOW, DEEP}, along, (vec3){0, HIGH - LOW, 0});
    add_quad(m, LAMP, (vec3){FROM, LOW + 0.02f, 0.05f}, (vec3){0, 0, 0.2f}, along);
}

/* What a scanner has of it. */
static void drop_lamp(struct mesh *m, bool has_objects) {
    m->triangle_count -= 2;
    m->face_count = m->triangle_count;
    if (!has_objects) {
        mem_free(m->object_id);
        m->object_id = NULL;
    }
}

static bool is_seen(const struct views *v, vec3 point) {
    for (size_t t = 0; t < v->train_count; t++) {
        const struct camera *camera = &v->scene->photograph[v->train[t]].camera;
        vec3 way = vec3_sub(point, camera_origin(camera));
        float x, y, depth_m, length = vec3_length(way);
        if (camera_project(camera, point, &x, &y, &depth_m) && x >= 0.0f && y >= 0.0f && x < WIDTH && y < HEIGHT &&
            !accel_occluded(v->accel, camera_origin(camera), vec3_scale(way, 1.0f / length), 0.0f, length))
            return true;
    }
    return false;
}

/* No camera looks behind the border; over the cornice it is as large as that is. */
static void test_space(struct scene *scene) {
    struct parallel *pool = parallel_new(3), *alone = parallel_new(1);
    struct error err = {0};
    struct segments segments;
    struct accel *accel;
    struct views views;
    struct unseen_space u, again;
    size_t seen = 0, over = 0, through = 0;
    segments_automatic(&segments, &scene->mesh);
    CHECK(accel_new(&accel, &scene->mesh, pool, &err) == STATUS_OK);
    views_init(&views, scene, &segments, accel, pool);
    unseen_space_find(&u, &views, pool);
    unseen_space_find(&again, &views, alone);
    CHECK(u.face_count == again.face_count && memcmp(u.face, again.face, u.face_count * sizeof *u.face) == 0);
    unseen_space_release(&again);
    for (size_t p = 0; p < u.part_count; p++) {
        for (size_t i = u.part[p].first; i < u.part[p].end; i++) {
            const struct unseen_face *face = &u.face[i];
            vec3 corner[4], at = face->middle;
            unseen_space_corners(&u, face, corner);
            vec3 front = vec3_cross(vec3_sub(corner[1], corner[0]), vec3_sub(corner[2], corner[0]));
            CHECK_NEAR(vec3_dot(front, face->normal), u.side_m * u.side_m, 1e-6f);
            CHECK_NEAR(vec3_dot(face->normal, u.face[u.part[p].first].normal), 1.0f, 1e-6f);
            vec3 behind = vec3_mad(at, -0.25f * u.side_m, face->normal);
            for (int k = 0; k < 8; k++) {
                vec3 off = vec3_make(k & 1 ? 1 : -1, k & 2 ? 1 : -1, k & 4 ? 1 : -1);
                seen +=
                    (k == 0 || k == 3 || k == 5 || k == 6) && is_seen(&views, vec3_mad(behind, -0.3f * u.side_m, off));
            }
            seen += is_seen(&views, behind);
            through += fabsf(at.z - DEEP) < u.side_m && at.y > LOW + u.side_m && at.y < HIGH - u.side_m &&
                       at.x > FROM && at.x < TO && face->normal.z > 0.5f;
            over += face->normal.y > 0.5f && at.x > FROM && at.x < TO && at.y > LOW && at.z > 0.0f && at.z < DEEP;
        }
    }
    CHECK_THAT(seen == 0, "%zu of %zu faces have seen space behind them", seen, u.face_count);
    CHECK_THAT(through == 0, "%zu faces are behind the mesh", through);
    double wanted_m2 = (double)((TO - FROM) * DEEP);
    CHECK_NEAR((double)over * (double)(u.side_m * u.side_m), wanted_m2, 0.2 * wanted_m2);
    unseen_space_release(&u);
    views_release(&views);
    accel_free(accel);
    segments_release(&segments);
    parallel_free(alone);
    parallel_free(pool);
}

static float area_of(const struct reconstruction *r, size_t segment) {
    float area = 0.0f;
    for (size_t t = 0; t < r->scene->mesh.triangle_count; t++)
        area += r->segments.of_triangle[t] == segment ? mesh_triangle_area(&r->scene->mesh, t) : 0.0f;
    return area;
}

/* Every other one at what is over the cornice. */
static vec3 look_over(int frame) {
    vec3 at = spread(frame * 7 + 3, 0.0f);
    return frame % 2 == 0 ? (vec3){at.x, 2.7f, 0.2f} : at;
}

static void check_lamps(const struct reconstruction *r) {
    size_t elsewhere = 0;
    double power = 0.0, wanted = (double)(rgb_mean(lamp_radiance) * (TO - FROM) * 0.2f);
    CHECK(r->unseen_lamps.count > 0 && r->unseen_lamps.first + r->unseen_lamps.count == r->segments.count);
    for (size_t s = 0; s < r->segments.count; s++) {
        bool is_added = segment_range_has(&r->unseen_lamps, s);
        CHECK_THAT(r->evidence[s].is_hidden == is_added, "segment %zu", s);
        power += is_added ? (double)(area_of(r, s) * rgb_mean(r->evidence[s].radiance)) : 0.0;
        const char *name = segments_name(&r->segments, &r->scene->mesh, s);
        CHECK(!is_added || (name && strncmp(name, "hidden lamp", 11) == 0));
    }
    for (size_t t = 0; t < r->scene->mesh.triangle_count; t++) {
        vec3 at = mesh_point(&r->scene->mesh, t, 1.0f / 3.0f, 1.0f / 3.0f);
        bool is_there = at.y > LOW && at.y < HIGH + BESIDE && at.z < DEEP + BESIDE;
        elsewhere += segment_range_has(&r->unseen_lamps, r->segments.of_triangle[t]) && !is_there;
    }
    CHECK_THAT(elsewhere == 0, "%zu triangles are elsewhere", elsewhere);
    printf("power: %.2f of the true one\n", power / wanted);
    CHECK_THAT(power > 0.6 * wanted && power < 1.4 * wanted, "%g of the power", power / wanted);
}

static void test_found(struct scene *scene) {
    struct settings settings = shell_settings(SHELL_SMALL);
    struct shell shell = {.polls_until_stop = 1}; /* light is estimated before */
    struct reconstruction r;
    CHECK(shell_run(scene, &settings, 0, &shell, &r) == STATUS_CANCELLED);
    check_lamps(&r);
    reconstruct_release(&r);
    settings_release(&settings);
    shell_release(&shell);
}

/* Where the mesh tells objects apart, or `json` says so, the mesh is meant as it is. */
static void test_none(bool has_objects, const char *json) {
    struct scene scene = {0};
    struct settings settings = shell_settings(json);
    struct reconstruction r = {.scene = &scene, .settings = &settings};
    struct views views = {.scene = &scene};
    make_cornice(&scene.mesh);
    drop_lamp(&scene.mesh, has_objects);
    size_t triangles = scene.mesh.triangle_count;
    CHECK(unseen_lamps_find(&r, &views) == 0 && r.unseen_lamps.count == 0 && scene.mesh.triangle_count == triangles);
    settings_release(&settings);
    scene_release(&scene);
}

int main(void) {
    struct parallel *pool = parallel_new(0);
    struct scene scene = {0};
    make_cornice(&scene.mesh);
    photograph_mesh(&scene, lamp_radiance, NULL, look_over, pool);
    drop_lamp(&scene.mesh, false);
    test_space(&scene);
    test_found(&scene);
    test_none(true, "{}");
    test_none(false, "{\"holes\":\"keep\"}");
    scene_release(&scene);
    parallel_free(pool);
    return check_result();
}
