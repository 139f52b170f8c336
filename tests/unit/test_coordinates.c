/* Meshes and cameras far from the origin of their files are moved beside it, with nothing lost; others stay as they
 * are, bit for bit. */
#include "common/mem.h"
#include "server/ingest/bundle.h"
#include "server/ingest/facts.h"
#include "server/ingest/mesh/gltf.h"
#include "server/ingest/mesh/mesh_file.h"
#include "server/ingest/mesh/obj.h"
#include "server/ingest/mesh/ply.h"
#include "server/ingest/mesh/positions.h"
#include "server/ingest/pose.h"
#include "tests/check.h"

#define HEAD "ply\nformat ascii 1.0\n"
#define XYZ "property double x\nproperty double y\nproperty double z\n"
#define FACES(n) "element face " #n "\nproperty list uchar int vertex_indices\nend_header\n"

static enum status parse_ply(const char *text, struct mesh *mesh, struct error *err) {
    return ply_parse(text, strlen(text), "mesh.ply", 1000, mesh, NULL, err);
}

static void take(enum status status, const struct error *err) { CHECK_THAT(status == STATUS_OK, "%s", err->message); }

static bool is_at(const struct mesh *mesh, double x, double y, double z) {
    return mesh->offset[0] == x && mesh->offset[1] == y && mesh->offset[2] == z;
}

/* Where the file has a corner of the first triangle. */
static void check_corner(const struct mesh *mesh, int corner, double x, double y, double z, double tolerance_m) {
    vec3 p = mesh->position[mesh->index[0][corner]];
    CHECK_NEAR(mesh->offset[0] + (double)p.x, x, tolerance_m);
    CHECK_NEAR(mesh->offset[1] + (double)p.y, y, tolerance_m);
    CHECK_NEAR(mesh->offset[2] + (double)p.z, z, tolerance_m);
}

/* Millimetres at 600 km and 4100 km; the height stays as it is. */
static void test_far(void) {
    struct mesh mesh;
    struct error err = {.message = ""};
    take(parse_ply(HEAD "element vertex 3\n" XYZ FACES(1) "600000.001 4100000.002 105.003\n"
                                                          "600004.5 4100000.002 105.003\n"
                                                          "600004.5 4100003.25 105.003\n3 0 1 2\n",
                   &mesh, &err),
         &err);
    CHECK(is_at(&mesh, 600002.0, 4100002.0, 0.0));
    check_corner(&mesh, 0, 600000.001, 4100000.002, 105.003, 1e-5);
    check_corner(&mesh, 2, 600004.5, 4100003.25, 105.003, 1e-5);
    mesh_release(&mesh);
    static const char obj[] = "v 600000.001 4100000.002 105.003\nv 600004.5 4100000.002 105.003\n"
                              "v 600004.5 4100003.25 105.003\nf 1 2 3\n";
    take(obj_parse(obj, strlen(obj), "a.obj", NULL, 9, &mesh, NULL, NULL, &err), &err);
    CHECK(is_at(&mesh, 600002.0, 4100002.0, 0.0));
    check_corner(&mesh, 0, 600000.001, 4100000.002, 105.003, 1e-5);
    mesh_release(&mesh);
    /* three points, 0 0 0, 1 0 0, 0 1 0, moved by two nodes */
    static const char gltf[] =
        "{\"asset\":{\"version\":\"2.0\"},\"buffers\":[{\"byteLength\":36,\"uri\":\"data:application/octet-stream;base64,"
        "AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAA\"}],\"bufferViews\":[{\"buffer\":0,\"byteLength\":36}],"
        "\"accessors\":[{\"bufferView\":0,\"componentType\":5126,\"count\":3,\"type\":\"VEC3\"}],\"meshes\":[{"
        "\"primitives\":[{\"attributes\":{\"POSITION\":0}}]}],\"nodes\":[{\"mesh\":0,\"translation\":[0.001,0.002,0]},"
        "{\"children\":[0],\"translation\":[600000,4100000,-5]}]}";
    take(gltf_parse(gltf, strlen(gltf), "a.gltf", NULL, 9, &mesh, NULL, NULL, &err), &err);
    CHECK(is_at(&mesh, 600001.0, 4100001.0, 0.0) || is_at(&mesh, 600000.0, 4100001.0, 0.0));
    check_corner(&mesh, 0, 600000.001, 4100000.002, -5.0, 1e-6);
    check_corner(&mesh, 1, 600001.001, 4100000.002, -5.0, 1e-6);
    mesh_release(&mesh);
}

/* A coordinate is moved when single precision has steps of more than 0.1 mm there and the move makes them finer. */
static void test_rule(void) {
    static const struct {
        double lower, upper, offset;
    } table[] = {{0, 10, 0},       {800, 838, 0}, {830, 840, 835},      {-845, -840, -843},
                 {-5000, 5000, 0}, {0, 5000, 0},  {3000, 5000, 4000},   {1000, 5000, 0},
                 {1e7, 1e7, 1e7},  {-1, 1e9, 0},  {1e300, 1e300, 1e300}};
    for (size_t i = 0; i < sizeof table / sizeof *table; i++) {
        struct positions p = {0};
        uint32_t index[1][3] = {{0, 2, 2}};
        struct mesh mesh = {.triangle_count = 1, .index = index};
        positions_append(&p, (double[3]){0.0, table[i].lower, 0.0});
        positions_append(&p, (double[3]){NAN, -1e9, 1e9}); /* of no triangle */
        positions_append(&p, (double[3]){0.0, table[i].upper, 0.0});
        positions_move_to_mesh(&p, &mesh);
        double wanted = table[i].lower - table[i].offset;
        CHECK_THAT(mesh.offset[1] == table[i].offset, "case %zu: %.17g", i, mesh.offset[1]);
        CHECK(mesh.offset[0] == 0.0 && mesh.offset[2] == 0.0 && mesh.vertex_count == 3);
        CHECK(mesh.position[0].y == (float)wanted);
        mem_free(mesh.position);
    }
    CHECK(positions_step(1.0) <= POSITIONS_STEP_M && positions_step(-1e4) > POSITIONS_STEP_M);
}

/* A concave polygon is cut as it would be at the origin. */
static void test_polygon(void) {
    struct mesh near, far;
    struct error err = {.message = ""};
    take(parse_ply(HEAD
                   "element vertex 5\n" XYZ FACES(1) "0 0 0\n.02 0 0\n.02 .02 0\n.01 .005 0\n0 .02 0\n5 0 1 2 3 4\n",
                   &near, &err),
         &err);
    take(parse_ply(HEAD "element vertex 5\n" XYZ FACES(
                       1) "600000 600000 0\n600000.02 600000 0\n600000.02 600000.02 0\n600000.01 600000.005 0\n"
                          "600000 600000.02 0\n5 0 1 2 3 4\n",
                   &far, &err),
         &err);
    CHECK(near.triangle_count == 3 && far.triangle_count == 3 &&
          memcmp(near.index, far.index, sizeof near.index[0] * 3) == 0);
    mesh_release(&near);
    mesh_release(&far);
}

/* Our own files state their offset; other comments, and numbers beside it, do not count. */
static void test_stated(void) {
    struct mesh mesh;
    struct error err = {.message = ""};
    take(parse_ply(HEAD "comment unbake offset 600000 -4100000 .5\nelement vertex 3\n" XYZ FACES(
                       1) "0.1 0 0\n1 0 0\n0 1 0\n3 0 1 2\n",
                   &mesh, &err),
         &err);
    CHECK(is_at(&mesh, 600000.0, -4100000.0, 0.5) && mesh.position[0].x == 0.1f);
    mesh_release(&mesh);
    static const char obj[] = "# unbake offset 7 8 9\nv 0.1 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
    take(obj_parse(obj, strlen(obj), "a.obj", NULL, 9, &mesh, NULL, NULL, &err), &err);
    CHECK(is_at(&mesh, 7.0, 8.0, 9.0) && mesh.position[0].x == 0.1f);
    mesh_release(&mesh);
    double offset[3] = {1.0, 2.0, 3.0};
    CHECK(!positions_read_offset("unbake offset 1 2", offset) &&
          !positions_read_offset("unbake offset 1 2 3 4", offset));
    CHECK(!positions_read_offset(" offset 1 2 3", offset) && !positions_read_offset("unbake offset 1 2 inf", offset));
    CHECK(!positions_read_offset("", offset) && offset[0] == 1.0 && offset[2] == 3.0);
    CHECK(positions_read_offset(" unbake offset -1e6 2.5 0 \r", offset) && offset[0] == -1e6 && offset[1] == 2.5);
}

/* Vertices without coordinates are left out where no face uses them, and refused where one does. */
static void test_unused(void) {
    struct mesh mesh;
    struct mesh_report report;
    struct error err = {.message = ""};
    take(parse_ply(HEAD "element vertex 5\n" XYZ FACES(1) "nan nan nan\n0 0 0\n1 0 0\n0 inf 0\n0 1 0\n3 1 2 4\n", &mesh,
                   &err),
         &err);
    take(mesh_check(&mesh, "a.ply", &report, &err), &err);
    CHECK(report.unused_count == 2 && mesh.vertex_count == 3 && mesh.index[0][2] == 2 && mesh.position[2].y == 1.0f);
    mesh_release(&mesh);
    take(parse_ply(HEAD "element vertex 4\n" XYZ FACES(1) "0 0 0\n1 0 0\nnan 1 0\n0 nan 0\n3 0 1 3\n", &mesh, &err),
         &err);
    CHECK(mesh_check(&mesh, "a.ply", &report, &err) == STATUS_INPUT && strstr(err.message, "vertex 3: a coordinate"));
    mesh_release(&mesh);
}

/* A pose in double and the same pose at the origin give the same camera. */
static void test_pose(void) {
    const double near[3][4] = {{0.6, -0.8, 0, 1.001}, {0.8, 0.6, 0, -2.002}, {0, 0, 1, 3.003}};
    double far[3][4];
    memcpy(far, near, sizeof far);
    const double offset[3] = {600000.0, 4100000.0, 0.0}, none[3] = {0.0, 0.0, 0.0};
    struct exact_pose a, b;
    struct rigid forward[2], inverse[2];
    struct error err = {.message = ""};
    bool scaled;
    for (int i = 0; i < 3; i++)
        far[i][3] += offset[i];
    take(pose_from_matrix(near, "m", POSE_RIGHT_UP_BACK, &a, &scaled, &err), &err);
    take(pose_from_matrix((const double(*)[4])far, "m", POSE_RIGHT_UP_BACK, &b, &scaled, &err), &err);
    pose_to_rigid(&a, none, &forward[0], &inverse[0]);
    pose_to_rigid(&b, offset, &forward[1], &inverse[1]);
    CHECK(memcmp(forward[0].rotation, forward[1].rotation, sizeof forward[0].rotation) == 0);
    CHECK_NEAR(vec3_length(vec3_sub(forward[0].translation, forward[1].translation)), 0.0, 1e-6);
    CHECK_NEAR(vec3_length(vec3_sub(inverse[0].translation, inverse[1].translation)), 0.0, 1e-6);
    CHECK_NEAR(vec3_length(rigid_point(&inverse[1], forward[1].translation)), 0.0, 1e-6);
}

/* A mesh that itself is in single precision there has lost what it lost: that is said. */
static void test_coarse(void) {
    static const char head[] = "ply\nformat binary_little_endian 1.0\nelement vertex 3\nproperty float x\n"
                               "property float y\nproperty float z\n" FACES(1);
    const float at[9] = {600000.0f, 0.0f, 0.0f, 600004.0f, 0.0f, 0.0f, 600004.0f, 4.0f, 0.0f};
    const uint8_t face[13] = {3, 0, 0, 0, 0, 1, 0, 0, 0, 2, 0, 0, 0};
    char file[512];
    size_t used = sizeof head - 1;
    memcpy(file, head, used);
    memcpy(file + used, at, sizeof at);
    memcpy(file + used + sizeof at, face, sizeof face);
    struct mesh mesh;
    struct faces_report report;
    struct mesh_report check = {0};
    struct findings f = {0};
    struct error err = {.message = ""};
    take(ply_parse(file, used + sizeof at + sizeof face, "a.ply", 9, &mesh, &report, &err), &err);
    CHECK_NEAR(report.step_m, 0.07, 0.01);
    mesh_file_warn("a.ply", &mesh, &report, &check, &f);
    CHECK(f.warning_count == 2 && strstr(f.warning[0], "(-600002, -0, -0)") == NULL);
    CHECK(strstr(f.warning[0], "offset") && strstr(f.warning[1], "single precision whose steps are up to 0.072 m"));
    findings_release(&f);
    mesh_release(&mesh);
}

/* A whole bundle: its photographs see the mesh as they do at the origin. */
static void test_bundle(void) {
    const char *root = getenv("UNBAKE_TEST_DATA");
    char dir[1024];
    struct bundle_limits limits = bundle_default_limits();
    struct scene scene;
    struct error err = {.message = ""};
    cJSON *problems = cJSON_CreateArray();
    snprintf(dir, sizeof dir, "%s/captures/geo_utm", root ? root : "../shared/data");
    if (access(dir, R_OK) != 0) {
        printf("test data captures/geo_utm is not here\n");
        cJSON_Delete(problems);
        return;
    }
    struct parallel *pool = parallel_new(1);
    take(bundle_load(dir, NULL, &limits, pool, &scene, problems, &err), &err);
    CHECK(scene.mesh.offset[0] > 447990.0 && scene.mesh.offset[1] > 5410990.0 && scene.mesh.offset[2] == 0.0);
    vec3 at = camera_origin(&scene.photograph[0].camera);
    CHECK_NEAR(scene.mesh.offset[0] + (double)at.x, 448004.2707862854, 1e-5);
    CHECK_NEAR(scene.mesh.offset[1] + (double)at.y, 5411001.770595789, 1e-5);
    cJSON *facts = facts_of(&scene);
    CHECK(cJSON_GetNumberValue(cJSON_GetArrayItem(cJSON_GetObjectItem(facts, "offset"), 0)) == scene.mesh.offset[0]);
    cJSON_Delete(facts);
    scene_release(&scene);
    cJSON_Delete(problems);
    parallel_free(pool);
}

int main(void) {
    test_far();
    test_rule();
    test_polygon();
    test_stated();
    test_unused();
    test_pose();
    test_coarse();
    test_bundle();
    return check_result();
}
