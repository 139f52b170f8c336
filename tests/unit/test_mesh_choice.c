/* test_mesh_choice.c -- which of several meshes is taken, and that it is said; and what nerfstudio applied is
 * undone. */
#include "server/ingest/mesh_choice.h"

#include "common/file.h"
#include "common/mem.h"
#include "server/ingest/applied_transform.h"
#include "tests/check.h"

static char dir[64]; /* in memory where possible: writing syncs the file system */

static void put(const char *name, const char *text) {
    char *path = file_join(dir, name), *slash = strrchr(path, '/');
    *slash = '\0';
    CHECK(file_make_dirs(path, NULL) == STATUS_OK);
    *slash = '/';
    CHECK(file_replace(path, text, strlen(text), NULL) == STATUS_OK);
    mem_free(path);
}

/* An OBJ of so many triangles. */
static void put_obj(const char *name, int triangles) {
    char text[4096] = "v 0 0 0\nv 1 0 0\nv 0 1 0\n";
    for (int i = 0; i < triangles; i++)
        strcat(text, "f 1 2 3\n");
    put(name, text);
}

/* Chooses for cameras in folder `base`; checks what is taken and a part of what is said. */
static void check(const char *base, const char *wanted, uint64_t limit, const char *taken, const char *part) {
    struct listing l;
    struct source_match match = {.base = (char *)(uintptr_t)base, .found = "x"};
    struct frames t = {0};
    struct findings f = {.problems = cJSON_CreateArray()};
    struct error err = {.message = ""};
    char *found;
    CHECK(listing_read(&l, dir, &err) == STATUS_OK);
    struct mesh_choice choice = {&l, &match, &t, wanted, limit};
    CHECK_THAT(mesh_choose(&choice, &found, &f, &err) == STATUS_OK, "%s", err.message);
    char *problems = json_text(f.problems);
    const char *said = f.warning_count > 0 ? f.warning[0] : problems;
    CHECK_THAT(taken ? found && strcmp(found, taken) == 0 : !found, "%s is taken, not %s: %s", found ? found : "none",
               taken ? taken : "none", said);
    CHECK_THAT(strstr(said, part) != NULL, "wanted \"%s\": %s", part, said);
    mem_free(problems);
    mem_free(found);
    cJSON_Delete(f.problems);
    findings_release(&f);
    listing_release(&l);
}

static void test_choice(void) {
    check("", NULL, 100, NULL, "no PLY, OBJ or glTF file");
    put_obj("out/room.obj", 3);
    check("", NULL, 100, "out/room.obj", "[]");
    put_obj("out/room_lod1.obj", 9);
    check("", NULL, 100, "out/room.obj", "which goes by its name, not out/room_lod1.obj");
    put_obj("out/fine.obj", 9);
    check("", NULL, 100, "out/fine.obj", "of 3 meshes out/fine.obj is taken, the finest");
    check("", NULL, 5, "out/room.obj", "the finest within the limit");
    check("", "out/room_lod1.obj", 100, "out/room_lod1.obj", "[]");
    check("", "out/none.obj", 100, NULL, "out/none.obj, is not in the bundle");
    put_obj("near.obj", 2);
    check("", NULL, 100, "near.obj", "the nearest to the cameras");
    check("out/", NULL, 100, "out/fine.obj", "the finest");
    put_obj("scene_dense_mesh_refine.obj", 1);
    check("", NULL, 100, "scene_dense_mesh_refine.obj", "which goes by its name");
    put_obj("scene_dense_mesh_refine_texture.obj", 1);
    check("", NULL, 100, "scene_dense_mesh_refine_texture.obj", "and 2 more");
}

static void check_undone(const struct exact_pose *pose) {
    for (int i = 0; i < 3; i++) {
        CHECK_NEAR(pose->translation[i], 4 + i, 1e-12);
        for (int j = 0; j < 3; j++)
            CHECK_NEAR(pose->rotation[i][j], i == j, 1e-12);
    }
}

/* stored = 2 (P x + (1, 2, 3)) with P that makes y of x, -x of y. */
static void test_undo(void) {
    struct findings f = {.problems = cJSON_CreateArray()};
    struct frame frame = {.world_from_camera = {.rotation = {{0, -1, 0}, {1, 0, 0}, {0, 0, 1}},
                                                .translation = {2 * (1 - 5), 2 * (2 + 4), 2 * (3 + 6)}}};
    struct frames t = {.frame = &frame,
                       .frame_count = 1,
                       .has_applied = true,
                       .applied = {{0, -1, 0, 1}, {1, 0, 0, 2}, {0, 0, 1, 3}},
                       .applied_scale = 2.0};
    const struct exact_pose stored = frame.world_from_camera;
    applied_transform_settle(&t, "transforms.json", "mesh.ply", NULL, &f);
    CHECK(t.has_applied && f.warning_count == 1 && strstr(f.warning[0], "needs coordinates=capture"));
    /* As the user says, or the check of fit finds; and back. */
    CHECK(t.other_count == 1 && frames_choose_coordinates(&t, "capture", NULL, NULL) == STATUS_OK);
    check_undone(&frame.world_from_camera);
    CHECK(frames_choose_coordinates(&t, "capture", NULL, NULL) == STATUS_OK);
    check_undone(&frame.world_from_camera);
    CHECK(frames_choose_coordinates(&t, "file", NULL, NULL) == STATUS_OK);
    for (int i = 0; i < 3; i++)
        CHECK_NEAR(frame.world_from_camera.translation[i], stored.translation[i], 1e-12);
    struct error err;
    CHECK(frames_choose_coordinates(&t, "chunk", NULL, &err) == STATUS_INPUT);
    CHECK_THAT(strstr(err.message, "only \"file\", \"capture\""), "%s", err.message);
    t.other_count = 0;
    /* By the mesh's name; it may be wrong, so the file's are known. */
    applied_transform_settle(&t, "transforms.json", "a/scene_dense_mesh.ply", NULL, &f);
    CHECK(!t.has_applied && f.warning_count == 2 && strstr(f.warning[1], "were turned back"));
    check_undone(&frame.world_from_camera);
    CHECK(t.other_count == 1 && frames_choose_coordinates(&t, "file", NULL, NULL) == STATUS_OK);
    for (int i = 0; i < 3; i++)
        CHECK_NEAR(frame.world_from_camera.translation[i], stored.translation[i], 1e-12);
    t.has_applied = true;
    t.applied[2][2] = -1;
    applied_transform_undo(&t, "transforms.json", "", &f);
    char *problems = json_text(f.problems);
    CHECK_THAT(strstr(problems, "mirrors space") != NULL, "%s", problems);
    mem_free(problems);
    cJSON_Delete(f.problems);
    findings_release(&f);
}

int main(void) {
    snprintf(dir, sizeof dir, "%s/unbake-mesh-choice-XXXXXX", check_fast_dir());
    CHECK(mkdtemp(dir) != NULL);
    test_choice();
    test_undo();
    CHECK(file_remove_tree(dir, NULL) == STATUS_OK);
    return check_result();
}
