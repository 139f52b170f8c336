/* How a bundle is to be read: its JSON, its command-line form, and what it does to poses and meshes. */
#include "common/mem.h"
#include "common/reading.h"
#include "server/ingest/reading_apply.h"
#include "tests/check.h"

static struct error err;

static cJSON *object(const char *text) {
    cJSON *json = NULL;
    CHECK_THAT(json_parse(text, strlen(text), "test", &json, &err) == STATUS_OK, "%s", err.message);
    return json;
}

static void test_round_trip(void) {
    static const char *const texts[] = {
        "{}",
        "{\"transforms\":\"a/b.json\",\"mesh\":\"m.ply\",\"axes\":\"opencv-inverse\",\"mesh_axes\":\"x -z y\",\"scale\":0.001,"
        "\"shift\":-1,\"coordinates\":\"capture\",\"lens\":0.5,\"distortion\":\"ignored\",\"exposures\":\"ignored\"}",
    };
    for (size_t i = 0; i < sizeof texts / sizeof *texts; i++) {
        struct reading reading;
        cJSON *json = object(texts[i]);
        CHECK_THAT(reading_parse(json, &reading, &err) == STATUS_OK, "%s", err.message);
        struct reading copy = reading_copy(&reading);
        cJSON *again = reading_json(&copy);
        char *text = json_text(again);
        CHECK_STRING(text, texts[i]);
        mem_free(text);
        cJSON_Delete(again);
        cJSON_Delete(json);
        reading_release(&copy);
        reading_release(&reading);
    }
}

static void test_faults(void) {
    static const char *const faults[][2] = {
        {"[]", "object"},
        {"{\"axis\":1}", "unknown \"axis\""},
        {"{\"axes\":\"opengl2\"}", "axes must be"},
        {"{\"mesh_axes\":\"x x y\"}", "mesh_axes must"},
        {"{\"mesh_axes\":\"x y\"}", "mesh_axes must"},
        {"{\"mesh_axes\":\"x y z w\"}", "mesh_axes must"},
        {"{\"scale\":0}", "scale must"},
        {"{\"scale\":\"1\"}", "scale must"},
        {"{\"shift\":1.5}", "shift must"},
        {"{\"shift\":11}", "shift must"},
        {"{\"mesh\":\"\"}", "mesh must"},
        {"{\"exposures\":true}", "exposures must"},
        {"{\"distortion\":\"no\"}", "distortion must"},
        {"{\"coordinates\":\"elsewhere\"}", "coordinates must"},
        {"{\"lens\":0}", "lens must"},
        {"{\"lens\":\"2\"}", "lens must"},
    };
    for (size_t i = 0; i < sizeof faults / sizeof *faults; i++) {
        struct reading reading;
        cJSON *json = object(faults[i][0]);
        CHECK_THAT(reading_parse(json, &reading, &err) == STATUS_INPUT && strstr(err.message, faults[i][1]), "%s: %s",
                   faults[i][0], err.message);
        cJSON_Delete(json);
        reading_release(&reading);
    }
}

static void test_assignments(void) {
    cJSON *json = cJSON_CreateObject();
    CHECK(reading_parse_assignment("scale=.01", json, &err) == STATUS_OK);
    CHECK(reading_parse_assignment("mesh_axes=x,-z,y", json, &err) == STATUS_OK);
    CHECK(reading_parse_assignment("scale=.001", json, &err) == STATUS_OK); /* the last one counts */
    char *text = json_text(json);
    CHECK_STRING(text, "{\"mesh_axes\":\"x,-z,y\",\"scale\":0.001}");
    mem_free(text);
    CHECK(reading_parse_assignment("scale", json, &err) == STATUS_INPUT);
    CHECK(reading_parse_assignment("lens=0.5", json, &err) == STATUS_OK);
    CHECK(reading_parse_assignment("lens=wide", json, &err) == STATUS_INPUT);
    CHECK(reading_parse_assignment("scale=big", json, &err) == STATUS_INPUT);
    cJSON_Delete(json);
}

/* A camera at (1, 2, 3) that looks along +x with z up, as each convention writes it. */
static void test_poses(void) {
    /* Columns: right, down, forward. */
    const struct exact_pose truth = {.rotation = {{0, 0, 1}, {-1, 0, 0}, {0, -1, 0}}, .translation = {1, 2, 3}};
    const enum matrix_axes all[] = {AXES_OPENCV, AXES_OPENGL, AXES_OPENCV_INVERSE, AXES_OPENGL_INVERSE};
    for (size_t told = 0; told < 4; told++)
        for (size_t meant = 0; meant < 4; meant++) {
            /* Read wrongly and then rightly is the truth again. */
            struct exact_pose wrong = reading_reinterpret(&truth, all[meant], all[told]);
            struct exact_pose right = reading_reinterpret(&wrong, all[told], all[meant]);
            for (int i = 0; i < 3; i++)
                for (int j = 0; j < 3; j++)
                    CHECK_NEAR(right.rotation[i][j], truth.rotation[i][j], 1e-12);
            for (int i = 0; i < 3; i++)
                CHECK_NEAR(right.translation[i], truth.translation[i], 1e-12);
        }
    /* What is an OpenCV camera-to-world matrix, read as OpenGL's, looks back and is upside down. */
    struct exact_pose backwards = reading_reinterpret(&truth, AXES_OPENCV, AXES_OPENGL);
    CHECK(backwards.rotation[0][2] == -1.0 && backwards.rotation[2][1] == 1.0 && backwards.translation[0] == 1.0);
    /* Read as world-to-camera, the origin is elsewhere: -R^T t. */
    struct exact_pose inverse = reading_reinterpret(&truth, AXES_OPENCV, AXES_OPENCV_INVERSE);
    CHECK(inverse.translation[0] == 2.0 && inverse.translation[1] == 3.0 && inverse.translation[2] == -1.0);
}

static void test_mesh(void) {
    struct reading reading;
    cJSON *json = object("{\"mesh_axes\":\"x -z y\",\"scale\":0.5}");
    CHECK(reading_parse(json, &reading, &err) == STATUS_OK);
    CHECK(!signed_axes_is_mirror(&reading.mesh_axes));
    vec3 turned = signed_axes_apply(&reading.mesh_axes, vec3_make(1, 2, 3));
    CHECK(turned.x == 1.0f && turned.y == -3.0f && turned.z == 2.0f); /* up was y */
    static const char *const mirrors[] = {"-x y z", "y x z", "x z y", "z y x", "-x -y -z"};
    for (size_t i = 0; i < sizeof mirrors / sizeof *mirrors; i++) {
        struct reading mirror;
        cJSON *own = cJSON_CreateObject();
        json_add_string(own, "mesh_axes", mirrors[i]);
        CHECK(reading_parse(own, &mirror, &err) == STATUS_OK);
        CHECK_THAT(signed_axes_is_mirror(&mirror.mesh_axes), "%s", mirrors[i]);
        cJSON_Delete(own);
        reading_release(&mirror);
    }
    vec3 position[3] = {{0, 0, 0}, {2, 0, 0}, {0, 2, 0}};
    uint32_t index[1][3] = {{0, 1, 2}};
    struct mesh mesh = {
        .offset = {10, 20, 30}, .vertex_count = 3, .position = position, .triangle_count = 1, .index = index};
    reading_apply_mesh(&reading, &mesh);
    CHECK(position[2].y == 0.0f && position[2].z == 1.0f && index[0][1] == 1);
    CHECK(mesh.offset[0] == 5.0 && mesh.offset[1] == -15.0 && mesh.offset[2] == 10.0);
    reading.mesh_axes = (struct signed_axes){.axis = {0, 1, 2}, .sign = {1, 1, -1}};
    reading_apply_mesh(&reading, &mesh);
    CHECK(position[2].z == -0.5f && index[0][1] == 2); /* its front is still its front */
    cJSON_Delete(json);
    reading_release(&reading);
}

static void test_shift(void) {
    struct frames t = {.frame_count = 3, .frame = mem_calloc(3, sizeof *t.frame)};
    for (int i = 0; i < 3; i++) {
        t.frame[i].file = mem_printf("%d.png", i);
        t.frame[i].world_from_camera.translation[0] = i;
    }
    struct reading reading = reading_default();
    reading.shift = 1;
    reading_apply_frames(&reading, &t);
    CHECK(t.frame_count == 2);
    CHECK_STRING(t.frame[1].file, "1.png");
    CHECK(t.frame[1].world_from_camera.translation[0] == 2.0);
    frames_release(&t);
}

/* What a shell takes from the words is what they were made of. */
static void test_words(void) {
    cJSON *object = cJSON_Parse("{\"mesh_axes\":\"x -z y\",\"scale\":0.001,\"mesh\":\"a'b.ply\"}"),
          *again = cJSON_CreateObject();
    char *words = reading_words(object);
    CHECK_STRING(words, "mesh_axes='x -z y' scale=0.001 mesh='a'\\''b.ply'");
    CHECK(reading_parse_assignment("mesh_axes=x -z y", again, NULL) == STATUS_OK);
    CHECK(reading_parse_assignment("scale=0.001", again, NULL) == STATUS_OK);
    CHECK(reading_parse_assignment("mesh=a'b.ply", again, NULL) == STATUS_OK);
    CHECK(cJSON_Compare(object, again, true));
    mem_free(words);
    cJSON_Delete(again);
    cJSON_Delete(object);
}

/* The lens of pictures of half the size, and of none. */
static void test_lens(void) {
    const struct lens stated = {.model = CAMERA_THIN_PRISM_FISHEYE,
                                .width = 640,
                                .height = 480,
                                .fl_x = 600,
                                .fl_y = 500,
                                .cx = 400,
                                .cy = 200,
                                .angle_x = NAN,
                                .angle_y = NAN,
                                .k = {0.1},
                                .k8 = 0.2,
                                .p = {0.3},
                                .s = {0.4}};
    struct frame frame = {.lens = stated, .world_from_camera = {.rotation = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}}};
    struct frames t = {.frame = &frame, .frame_count = 1};
    struct reading reading = reading_default();
    struct camera camera;
    reading.lens = 0.5;
    reading_apply_frames(&reading, &t);
    CHECK(frame_camera(&frame, 640, 480, (double[3]){0}, &camera, &err) == STATUS_OK);
    CHECK(camera.fx == 300.0f && camera.fy == 250.0f && camera.cx == 200.0f && camera.cy == 100.0f);
    CHECK(camera.model == CAMERA_THIN_PRISM_FISHEYE && camera_is_distorted(&camera));
    reading.lens = 1.0;
    reading.ignores_distortion = true;
    reading_apply_frames(&reading, &t);
    CHECK(frame_camera(&frame, 640, 480, (double[3]){0}, &camera, &err) == STATUS_OK);
    CHECK(camera.fx == 600.0f && camera.model == CAMERA_OPENCV && !camera_is_distorted(&camera));
}

int main(void) {
    test_words();
    test_lens();
    test_round_trip();
    test_faults();
    test_assignments();
    test_poses();
    test_mesh();
    test_shift();
    return check_result();
}
