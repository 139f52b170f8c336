/* test_fit.c -- server/check finds each way in which mesh and cameras are commonly at odds, and lets a room pass
 * that fits. */
#include "server/ingest/reading_apply.h"
#include "tests/unit/fit_rig.h"

/* --- what is done to a room ------------------------------------------------------------------------------ */

static void set_pose(struct camera *camera, struct rigid pose) {
    camera->world_from_camera = pose;
    camera->camera_from_world = rigid_inverse(&pose);
}

static void nothing(struct scene *scene) { (void)scene; }

static void read_mesh(struct scene *scene, const char *assignment) {
    cJSON *json = cJSON_CreateObject();
    struct reading reading;
    CHECK(reading_parse_assignment(assignment, json, NULL) == STATUS_OK);
    CHECK(reading_parse(json, &reading, NULL) == STATUS_OK);
    reading_apply_mesh(&reading, &scene->mesh);
    reading_release(&reading);
    cJSON_Delete(json);
}
static void turn_y_up(struct scene *scene) { read_mesh(scene, "mesh_axes=x z -y"); }
static void permute(struct scene *scene) { read_mesh(scene, "mesh_axes=y x -z"); }
static void mirror(struct scene *scene) { read_mesh(scene, "mesh_axes=-x y z"); }
static void in_millimetres(struct scene *scene) { read_mesh(scene, "scale=1000"); }
static void in_centimetres(struct scene *scene) { read_mesh(scene, "scale=100"); }

static void flip_cameras(struct scene *scene) { /* a file of OpenCV's axes that is read as of OpenGL's */
    for (size_t i = 0; i < scene->photograph_count; i++) {
        struct rigid pose = scene->photograph[i].camera.world_from_camera;
        for (int row = 0; row < 3; row++)
            for (int column = 1; column < 3; column++)
                pose.rotation[row][column] *= -1.0f;
        set_pose(&scene->photograph[i].camera, pose);
    }
}

static void invert_cameras(struct scene *scene) { /* world-to-camera, of OpenGL's axes */
    flip_cameras(scene);
    for (size_t i = 0; i < scene->photograph_count; i++)
        set_pose(&scene->photograph[i].camera, rigid_inverse(&scene->photograph[i].camera.world_from_camera));
    flip_cameras(scene);
}

static void scale_poses(struct scene *scene) { /* nerfstudio's, to a cube of +-1 */
    for (size_t i = 0; i < scene->photograph_count; i++) {
        struct rigid pose = scene->photograph[i].camera.world_from_camera;
        pose.translation = vec3_scale(pose.translation, 0.37f);
        set_pose(&scene->photograph[i].camera, pose);
    }
}

static void shift_by_one(struct scene *scene) {
    struct rigid last = scene->photograph[scene->photograph_count - 1].camera.world_from_camera;
    for (size_t i = scene->photograph_count - 1; i > 0; i--)
        set_pose(&scene->photograph[i].camera, scene->photograph[i - 1].camera.world_from_camera);
    last.translation.x += 0.5f;
    set_pose(&scene->photograph[0].camera, last);
}

static void double_lens(struct scene *scene) {
    for (size_t i = 0; i < scene->photograph_count; i++) {
        struct camera *c = &scene->photograph[i].camera;
        c->fx *= 2.0f;
        c->fy *= 2.0f;
        c->cx *= 2.0f;
        c->cy *= 2.0f;
    }
}

/* Poses that nerfstudio turned, moved and scaled; the scene knows by what. */
static void apply_transform(struct scene *scene) {
    static const double to[3][4] = {{0.3, -0.4, 0.0, 1.5}, {0.4, 0.3, 0.0, -0.7}, {0.0, 0.0, 0.5, 2.0}};
    for (size_t i = 0; i < scene->photograph_count; i++) {
        struct exact_pose pose;
        const struct rigid *rigid = &scene->photograph[i].camera.world_from_camera;
        const float t[3] = {rigid->translation.x, rigid->translation.y, rigid->translation.z};
        for (int row = 0; row < 3; row++) {
            pose.translation[row] = (double)t[row];
            for (int column = 0; column < 3; column++)
                pose.rotation[row][column] = (double)rigid->rotation[row][column];
        }
        struct rigid inverse, moved;
        pose_transform(to, &pose);
        pose_to_rigid(&pose, (double[3]){0}, &moved, &inverse);
        set_pose(&scene->photograph[i].camera, moved);
    }
    scene->other[0] = (struct coordinates){.name = "capture", .text = "those before applied_transform"};
    memcpy(scene->other[0].poses_from, to, sizeof to);
    scene->other_count = 1;
}

static void distort(struct scene *scene) {
    for (size_t i = 0; i < scene->photograph_count; i++) {
        struct camera *c = &scene->photograph[i].camera;
        c->k[0] = -0.35f;
        c->k[1] = 0.1f;
        camera_find_fold(c);
    }
}

static void move_away(struct scene *scene) {
    for (size_t i = 0; i < scene->photograph_count; i++) {
        struct rigid pose = scene->photograph[i].camera.world_from_camera;
        pose.translation.y += 9.0f;
        set_pose(&scene->photograph[i].camera, pose);
    }
}

static void move_a_little(struct scene *scene) {
    for (size_t i = 0; i < scene->photograph_count; i++) {
        struct rigid pose = scene->photograph[i].camera.world_from_camera;
        pose.translation.y += 0.3f;
        set_pose(&scene->photograph[i].camera, pose);
    }
}

/* Poses of a tracker: off by 2 cm and half a degree, a pixel of these small pictures. */
static void drift(struct scene *scene) {
    for (size_t i = 0; i < scene->photograph_count; i++) {
        struct camera *c = &scene->photograph[i].camera;
        uint32_t n = (uint32_t)i;
        vec3 z = {c->world_from_camera.rotation[0][2], c->world_from_camera.rotation[1][2],
                  c->world_from_camera.rotation[2][2]};
        vec3 off = {fit_random(n, 11) - 0.5f, fit_random(n, 12) - 0.5f, fit_random(n, 13) - 0.5f};
        vec3 turn = {fit_random(n, 14) - 0.5f, fit_random(n, 15) - 0.5f, fit_random(n, 16) - 0.5f};
        fit_point_camera(c, vec3_mad(camera_origin(c), 0.05f, off), vec3_mad(z, 0.02f, turn));
    }
}

/* Every fourth triangle of the room is missing, and the ceiling. */
static void make_holes(struct scene *scene) {
    struct mesh *m = &scene->mesh;
    size_t kept = 0;
    for (size_t t = 0; t < m->triangle_count; t++)
        if (t % 4 != 1 && t != 2 && t != 3)
            memcpy(m->index[kept++], m->index[t], sizeof *m->index);
    m->triangle_count = kept;
}

/* --- what must be found ------------------------------------------------------------------------------------ */

static const struct {
    const char *name;
    void (*change)(struct scene *);
    enum fit_verdict verdict;
    const char *remedy; /* JSON; NULL: none */
    bool is_taken;
    const char *told; /* part of the text of the remedy; NULL: there is none; "": there may be one */
} cases[] = {
    {"as it is", nothing, FIT_YES, NULL, false, NULL},
    {"poses that drift", drift, FIT_YES, NULL, false, NULL},
    {"a mesh with holes", make_holes, FIT_YES, NULL, false, NULL},
    {"y-up mesh", turn_y_up, FIT_NO, "{\"mesh_axes\":\"x -z y\"}", true, "y-up"},
    {"permuted axes", permute, FIT_NO, "{\"mesh_axes\":\"y x -z\"}", true, "turned"},
    {"mirrored mesh", mirror, FIT_NO, "{\"mesh_axes\":\"-x y z\"}", true, "mirrored"},
    {"millimetres", in_millimetres, FIT_NO, "{\"scale\":0.001}", true, "millimetres"},
    {"centimetres", in_centimetres, FIT_NO, "{\"scale\":0.01}", true, "centimetres"},
    {"scaled poses", scale_poses, FIT_NO, "", true, "one unit of the mesh"},
    {"OpenCV's axes", flip_cameras, FIT_NO, "{\"axes\":\"opencv\"}", true, "OpenCV"},
    {"world-to-camera", invert_cameras, FIT_NO, "{\"axes\":\"opengl-inverse\"}", true, "world-to-camera"},
    {"a frame too late", shift_by_one, FIT_NO, "{\"shift\":1}", true, "frame after"},
    {"another picture's size", double_lens, FIT_NO, "{\"lens\":0.5}", true, "2 times the size"},
    {"undistorted pictures", distort, FIT_NO, "{\"distortion\":\"ignored\"}", true, "no lens distortion"},
    {"a mesh before applied_transform", apply_transform, FIT_NO, "{\"coordinates\":\"capture\"}", true,
     "applied_transform"},
    {"another origin", move_a_little, FIT_DOUBTFUL, NULL, false, NULL},
    {"another place", move_away, FIT_NO, NULL, false, NULL},
};

static void check_remedy(const char *name, const struct fit_result *fit, const char *wanted, const char *told) {
    struct reading given = reading_default();
    cJSON *json = fit_json(fit, &given), *remedy = cJSON_GetObjectItemCaseSensitive(json, "remedy");
    const char *text = cJSON_GetStringValue(cJSON_GetObjectItemCaseSensitive(json, "remedy_text"));
    char *found = json_text(remedy);
    CHECK_THAT(!wanted || *wanted == '\0' || strcmp(found, wanted) == 0, "%s: %s, wanted %s", name, found, wanted);
    CHECK_THAT((told && !*told) || (told != NULL) == (text != NULL), "%s: %s", name, text ? text : "no text");
    CHECK_THAT(!told || !text || strstr(text, told), "%s: \"%s\" does not tell \"%s\"", name, text, told);
    if (wanted && *wanted == '\0') /* the scale, within a hundredth */
        CHECK_NEAR(cJSON_GetObjectItemCaseSensitive(remedy, "scale")->valuedouble, 0.37, 0.005);
    mem_free(found);
    cJSON_Delete(json);
}

static void test_cases(void) {
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        struct fit_rig rig;
        struct fit_result fit;
        fit_rig_init(&rig, 0.8f);
        cases[i].change(&rig.scene);
        fit_rig_judge(&rig, &fit);
        const char *why = fit.evidence_count > 0 ? fit.evidence[fit.evidence_count - 1] : "";
        CHECK_THAT(fit.verdict == cases[i].verdict, "%s: %s, %s (correlation %.2f, %.1f deviations, sure %.1f)",
                   cases[i].name, fit_verdict_name(fit.verdict), why, fit.search.given.correlation, fit.search.given.z,
                   fit.search.sure);
        CHECK_THAT(fit.is_overwhelming == cases[i].is_taken, "%s: overwhelming is %d, sure %.1f, correlation %.2f",
                   cases[i].name, fit.is_overwhelming, fit.search.sure, fit.search.found.correlation);
        check_remedy(cases[i].name, &fit, cases[i].remedy, cases[i].told);
        fit_release(&fit);
        fit_rig_release(&rig);
    }
}

/* Without paint and light there is nothing by which poses could be told. */
static void test_plain_walls(float noise) {
    struct fit_rig rig;
    struct fit_result fit;
    fit_rig_init_noisy(&rig, 0.0f, noise);
    fit_rig_judge(&rig, &fit);
    CHECK(fit.verdict == FIT_DOUBTFUL);
    CHECK(!fit.has_remedy);
    CHECK(strstr(fit.evidence[fit.evidence_count - 1], "cannot be determined") != NULL);
    fit_release(&fit);
    turn_y_up(&rig.scene);
    fit_rig_judge(&rig, &fit);
    CHECK_THAT(fit.verdict != FIT_YES && !fit.is_overwhelming, "%s", fit_verdict_name(fit.verdict));
    fit_release(&fit);
    fit_rig_release(&rig);
}

int main(void) {
    test_cases();
    test_plain_walls(0.02f);
    test_plain_walls(0.9f); /* which is no detail */
    return check_result();
}
