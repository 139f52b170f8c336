/* The PLY reader: what it takes, what it refuses and where it says the fault lies. */
#include "server/ingest/mesh/mesh_file.h"
#include "server/ingest/mesh/ply.h"

#include "server/ingest/mesh/polygon.h"
#include "tests/check.h"

#define CUBE_CORNERS "0 0 0\n1 0 0\n1 1 0\n0 1 0\n0 0 1\n1 0 1\n1 1 1\n0 1 1\n"

static enum status parse(const char *text, struct mesh *mesh, struct faces_report *report, struct error *err) {
    return ply_parse(text, strlen(text), "mesh.ply", 1000, mesh, report, err);
}

static void test_ascii(void) {
    struct mesh mesh;
    struct faces_report report;
    struct error err;
    CHECK(parse("ply\r\nformat ascii 1.0\r\ncomment hello\r\nelement vertex 8\r\n"
                "property double z\r\nproperty list uchar float spare\r\nproperty float x\r\n"
                "property float y\r\nelement edge 2\r\nproperty int a\r\nelement nothing 9\r\n"
                "element face 4\r\nproperty short object_id\r\n"
                "property list uint8 int32 vertex_index\r\nproperty uchar red\r\nend_header\r\n"
                "0 0 0 0\r\n0 1 7 1 0\r\n\r\n0 2 7 8 1 1\r\n0 0 0 1\r\n"
                "1 0 0 0\r\n1 0 1 0\r\n1 0 1 1\r\n1e0 0 0 1\r\n"
                "5\r\n6\r\n-3 4 0 1 2 3 255\r\n12 3 4 5 6 1\r\n0 2 1 2 9\r\n7 5 0 1 5 6 2 0",
                &mesh, &report, &err) == STATUS_OK);
    CHECK(mesh.vertex_count == 8 && mesh.triangle_count == 6 && mesh.face_count == 4);
    CHECK(mesh.normal == NULL && mesh.object_id != NULL);
    CHECK(report.small_count == 1 && report.polygon_count == 1);
    CHECK(mesh.position[2].x == 1 && mesh.position[2].y == 1 && mesh.position[2].z == 0);
    CHECK(mesh.position[7].x == 0 && mesh.position[7].y == 1 && mesh.position[7].z == 1);
    static const uint32_t quad[2][3] = {{0, 1, 2}, {0, 2, 3}};
    CHECK(memcmp(mesh.index, quad, sizeof quad) == 0);
    CHECK(mesh.face[0] == 0 && mesh.face[1] == 0 && mesh.face[2] == 1 && mesh.face[3] == 3);
    CHECK(mesh.object_id[1] == -3 && mesh.object_id[2] == 12 && mesh.object_id[5] == 7);
    mesh_release(&mesh);
}

/* Faces before vertices, old Macintosh line ends. */
static void test_order(void) {
    struct mesh mesh;
    struct error err;
    CHECK(parse("ply\rformat ascii 1.0\relement face 1\rproperty list char uint vertex_indices\r"
                "element vertex 3\rproperty float x\rproperty float y\rproperty float z\r"
                "property float nx\rproperty float ny\rproperty float nz\rend_header\r"
                "3 0 1 2\r0 0 0 0 0 1\r1 0 0 0 0 1\r0 1 0 0 0 1\r",
                &mesh, NULL, &err) == STATUS_OK);
    CHECK(mesh.triangle_count == 1 && mesh.normal && mesh.normal[2].z == 1 && !mesh.object_id);
    mesh_release(&mesh);
}

static size_t put(uint8_t *at, uint64_t bits, size_t bytes, bool big) {
    for (size_t i = 0; i < bytes; i++)
        at[i] = (uint8_t)(bits >> (8 * (big ? bytes - 1 - i : i)));
    return bytes;
}

static size_t put_float(uint8_t *at, float value, bool big) {
    uint32_t bits;
    memcpy(&bits, &value, sizeof bits);
    return put(at, bits, 4, big);
}

/* Every integer type of object_id, both byte orders. */
static void test_binary(void) {
    static const struct {
        const char *type;
        size_t bytes;
        int64_t id;
    } table[] = {{"char", 1, -7},      {"uint8", 1, 200},  {"short", 2, -300},
                 {"ushort", 2, 60000}, {"int", 4, -70000}, {"uint32", 4, 4000000000}};
    for (size_t i = 0; i < 12; i++) {
        bool big = i % 2;
        uint8_t file[1024];
        size_t used = (size_t)snprintf((char *)file, sizeof file,
                                       "ply\nformat binary_%s_endian 1.0\nelement vertex 3\nproperty float x\n"
                                       "property double y\nproperty float z\nelement face 1\n"
                                       "property list ushort ushort unused\nproperty %s object_id\n"
                                       "property list uchar short vertex_indices\nend_header\n",
                                       big ? "big" : "little", table[i / 2].type);
        size_t header = used;
        for (int k = 0; k < 3; k++) {
            double y = k * 0.125;
            uint64_t bits;
            memcpy(&bits, &y, sizeof bits);
            used += put_float(file + used, (float)k - 1.5f, big);
            used += put(file + used, bits, 8, big);
            used += put_float(file + used, 2.0f, big);
        }
        used += put(file + used, 1, 2, big) + put(file + used + 2, 4711, 2, big);
        used += put(file + used, (uint64_t)table[i / 2].id, table[i / 2].bytes, big);
        used += put(file + used, 3, 1, big);
        for (uint64_t k = 0; k < 3; k++)
            used += put(file + used, 2 - k, 2, big);
        struct mesh mesh;
        struct error err;
        CHECK(ply_parse(file, used, "mesh.ply", 10, &mesh, NULL, &err) == STATUS_OK);
        CHECK(mesh.triangle_count == 1 && mesh.object_id[0] == table[i / 2].id);
        CHECK(mesh.index[0][0] == 2 && mesh.index[0][2] == 0);
        CHECK(mesh.position[2].x == 0.5f && mesh.position[2].y == 0.25f && mesh.position[1].z == 2);
        mesh_release(&mesh);
        for (size_t cut = header; cut < used; cut++)
            CHECK(ply_parse(file, cut, "mesh.ply", 10, &mesh, NULL, &err) == STATUS_INPUT);
    }
}

#define HEAD "ply\nformat ascii 1.0\n"
#define VERTEX(n) "element vertex " #n "\nproperty float x\nproperty float y\nproperty float z\n"
#define FACE(n) "element face " #n "\nproperty list uchar int vertex_indices\n"

static void test_refusals(void) {
    static const struct {
        const char *text;
        const char *sentence[2]; /* parts that the message must hold */
    } table[] = {
        {"", {"mesh.ply", "not a PLY"}},
        {"plywood\n", {"mesh.ply", "not a PLY"}},
        {HEAD VERTEX(3), {"line 6", "end_header"}},
        {"ply\nformat utf8 1.0\n", {"line 2", "\"utf8\""}},
        {"ply\n" VERTEX(1) FACE(0) "end_header\n0 0 0\n", {"mesh.ply", "format"}},
        {HEAD "element vertex -3\n", {"line 3", "\"-3\""}},
        {HEAD "element vertex 99999999999999999999\n", {"line 3", "count"}},
        {HEAD "property float x\n", {"line 3", "before the first element"}},
        {HEAD "element vertex 1\nproperty quaternion x\n", {"line 4", "\"quaternion\""}},
        {HEAD "element face 1\nproperty list float int vertex_indices\n", {"line 4", "\"float\""}},
        {HEAD "rubbish\n", {"line 3", "\"rubbish\""}},
        {HEAD "element vertex 1\nproperty float x\nproperty float y\n" FACE(0) "end_header\n0 0\n",
         {"mesh.ply", "no property z"}},
        {HEAD VERTEX(1) "end_header\n0 0 0\n", {"mesh.ply", "no faces"}},
        {HEAD FACE(0) "end_header\n", {"mesh.ply", "no vertices"}},
        {HEAD VERTEX(1000000000) FACE(1) "end_header\n0 0 0\n", {"mesh.ply", "promises 1000000000"}},
        {HEAD VERTEX(3) FACE(1) "end_header\n0 0 0\n1 0\n0 1 0\n3 0 1 2\n", {"line 11", "vertex 1 has fewer"}},
        {HEAD VERTEX(3) FACE(1) "end_header\n0 0 0\n1 0 0x1\n0 1 0\n3 0 1 2\n", {"line 11", "not a number"}},
        {HEAD VERTEX(3) FACE(1) "end_header\n0 0 0\n1 0 0\n0 1 0\n", {"mesh.ply", "promises 1 of element face"}},
        {HEAD VERTEX(3) FACE(1) "end_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 3\n", {"line 13", "vertex 3, but"}},
        {HEAD VERTEX(3) FACE(1) "end_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 -1\n", {"line 13", "vertex -1"}},
        {HEAD VERTEX(3) FACE(1) "end_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 0.5\n", {"line 13", "vertex 0.5"}},
        {HEAD VERTEX(3) FACE(1) "end_header\n0 0 0\n1 0 0\n0 1 0\n-3 0 1 2\n", {"line 13", "impossible length"}},
        {HEAD VERTEX(3) FACE(1) "end_header\n0 0 0\n1 0 0\n0 1 0\n5000 0 1 2\n", {"line 13", "corners"}},
        {HEAD VERTEX(3) FACE(1) "property float object_id\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2 1\n",
         {"mesh.ply", "object_id"}},
        {HEAD VERTEX(
             3) "element face 1\nproperty list uchar float vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n",
         {"mesh.ply", "vertex_indices"}},
    };
    for (size_t i = 0; i < sizeof table / sizeof *table; i++) {
        struct mesh mesh;
        struct error err = {.message = ""};
        CHECK_THAT(parse(table[i].text, &mesh, NULL, &err) == STATUS_INPUT, "case %zu: %s", i, err.message);
        for (int k = 0; k < 2; k++)
            CHECK_THAT(strstr(err.message, table[i].sentence[k]), "case %zu wants \"%s\": %s", i, table[i].sentence[k],
                       err.message);
        CHECK(mesh.position == NULL && mesh.index == NULL);
    }
    struct mesh mesh;
    struct error err;
    CHECK(ply_parse(HEAD VERTEX(8) FACE(2) "end_header\n" CUBE_CORNERS "4 0 1 2 3\n4 4 5 6 7\n",
                    strlen(HEAD VERTEX(8) FACE(2) "end_header\n" CUBE_CORNERS "4 0 1 2 3\n4 4 5 6 7\n"), "mesh.ply", 3,
                    &mesh, NULL, &err) == STATUS_LIMIT);
}

static double signed_area(const vec3 *corner, const uint32_t *t) {
    vec3 a = corner[t[0]], b = corner[t[1]], c = corner[t[2]];
    return 0.5 * (double)((b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x));
}

/* All triangles keep the orientation and their areas add up: nothing overlaps. */
static void test_polygons(void) {
    static const struct {
        size_t count;
        double area;
        vec3 corner[10];
    } table[] = {
        {4, 1.0, {{0, 0, 0}, {2, 0, 0}, {0.5f, 0.5f, 0}, {0, 2, 0}}}, /* arrow, reflex at 2 */
        {4, 1.0, {{0, 2, 0}, {0, 0, 0}, {2, 0, 0}, {0.5f, 0.5f, 0}}}, /* the same, turned */
        {8, 5.0, {{0, 0, 0}, {3, 0, 0}, {3, 2, 0}, {2, 2, 0}, {2, 1, 0}, {1, 1, 0}, {1, 2, 0}, {0, 2, 0}}},
        {10,
         15.0, /* a square hole, joined to the rim by a bridge */
         {{0, 0, 0},
          {4, 0, 0},
          {4, 4, 0},
          {0, 4, 0},
          {0, 0, 0},
          {1, 1, 0},
          {1, 2, 0},
          {2, 2, 0},
          {2, 1, 0},
          {1, 1, 0}}},
    };
    for (size_t i = 0; i < 4; i++) {
        uint32_t t[10][3];
        polygon_triangulate(table[i].corner, table[i].count, t);
        double area = 0.0;
        for (size_t k = 0; k + 2 < table[i].count; k++) {
            double part = signed_area(table[i].corner, t[k]);
            CHECK_THAT(part >= 0.0, "polygon %zu, triangle %zu: area %g", i, k, part);
            area += part;
        }
        CHECK_NEAR(area, table[i].area, 1e-6);
    }
    vec3 line[5] = {{0, 0, 0}, {1, 0, 0}, {2, 0, 0}, {3, 0, 0}, {4, 0, 0}};
    uint32_t t[3][3];
    polygon_triangulate(line, 5, t); /* without area: must end */
}

/* More than the limit, and more than can be counted: a hole after the header. */
static void test_large(void) {
    static const char header[] =
        "ply\nformat binary_little_endian 1.0\nelement vertex 4294967295\nproperty char x\nproperty "
        "char y\nproperty char z\nelement face 0\nproperty list uchar int vertex_indices\nend_header\n";
    static const char faces[] =
        "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
        "element face 2\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n"
        "3 0 1 2\n3 0 2 1\n";
    char path[] = "/tmp/unbake-test-ply-XXXXXX";
    struct mesh mesh;
    struct error err = {.message = ""};
    CHECK(ply_parse(faces, sizeof faces - 1, "mesh.ply", 1, &mesh, NULL, &err) == STATUS_LIMIT);
    CHECK_STRING(err.message, "mesh.ply has 2 faces, more than the limit of 1");
    CHECK(!mesh.position && !mesh.index);
    int fd = mkstemp(path);
    CHECK(fd >= 0 && write(fd, header, sizeof header - 1) > 0);
    if (ftruncate(fd, (off_t)13 << 30) != 0)
        printf("no file of 13 GiB here, not even of holes\n");
    else
        CHECK_THAT(mesh_file_read(path, "mesh.ply", 9, &mesh, NULL, &err) == STATUS_LIMIT &&
                       strcmp(err.message, "mesh.ply has 4294967295 vertices, more than fit") == 0,
                   "%s", err.message);
    close(fd);
    unlink(path);
}

static void check_strip(const char *text) {
    static const uint32_t wanted[4][3] = {{0, 1, 2}, {2, 1, 3}, {4, 5, 6}, {6, 5, 7}};
    struct mesh mesh;
    struct error err = {.message = ""};
    CHECK_THAT(parse(text, &mesh, NULL, &err) == STATUS_OK, "%s", err.message);
    CHECK(mesh.triangle_count == 4 && mesh.face_count == 4 && !mesh.object_id);
    CHECK(mesh.triangle_count == 4 && memcmp(mesh.index, wanted, sizeof wanted) == 0);
    mesh_release(&mesh);
}

#define STRIPS "element tristrips 1\nproperty list int int vertex_indices\n"

/* Strips in place of faces, before the vertices or behind them; -1 and repeated vertices lead to the next. */
static void test_strips(void) {
    struct mesh mesh;
    struct error err = {.message = ""};
    check_strip(HEAD VERTEX(8) STRIPS "end_header\n" CUBE_CORNERS "9 0 1 2 3 -1 4 5 6 7\n");
    check_strip(HEAD STRIPS VERTEX(8) "end_header\n9 0 1 2 3 -1 4 5 6 7\n" CUBE_CORNERS);
    check_strip(HEAD VERTEX(8) FACE(0) STRIPS "end_header\n" CUBE_CORNERS "11 0 1 2 3 3 4 4 5\n 6 7 -1\n");
    CHECK(parse(HEAD VERTEX(8) STRIPS "end_header\n" CUBE_CORNERS "3 0 1 -2\n", &mesh, NULL, &err) == STATUS_INPUT);
    CHECK_THAT(strstr(err.message, "tristrips 0 refers to vertex -2, but vertices run from 0 to 7"), "%s", err.message);
    CHECK(parse(HEAD VERTEX(8) STRIPS "end_header\n" CUBE_CORNERS "3 0 1 8\n", &mesh, NULL, &err) == STATUS_INPUT);
}

/* Records over several lines; what a missing value would do to the records behind it is noticed. */
static void test_wrapped(void) {
    struct mesh mesh;
    struct error err = {.message = ""};
    CHECK_THAT(parse(HEAD VERTEX(4) FACE(2) "end_header\n0 0\n0\n1 0 0\n\n1\n1\n0\n0 1 0\n4 0 1\n2 3\n3\n0 1 2\n",
                     &mesh, NULL, &err) == STATUS_OK,
               "%s", err.message);
    CHECK(mesh.triangle_count == 3 && mesh.position[2].x == 1 && mesh.position[2].y == 1 && mesh.position[3].x == 0);
    mesh_release(&mesh);
    CHECK(parse(HEAD VERTEX(3) FACE(1) "end_header\n0 0\n1 0 0\n1 1 0\n3 0 1 2\n", &mesh, NULL, &err) == STATUS_INPUT);
    CHECK_THAT(strstr(err.message, "line 10: vertex 0 has fewer values"), "%s", err.message);
    CHECK(parse(HEAD VERTEX(4) FACE(2) "end_header\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n4 0 1 2\n3 0 1 2\n", &mesh, NULL,
                &err) == STATUS_INPUT);
    CHECK_THAT(strstr(err.message, "line 14: face 0 has fewer values"), "%s", err.message);
}

/* Numbers that a writer has broken at a width, without regard to records. */
static void test_broken_lines(void) {
    struct mesh mesh;
    struct error err = {.message = ""};
    const char *vertices = HEAD VERTEX(4) FACE(2) "end_header\n0 0 0 1 0 0 1\n1 0 0 1 0 4 0\n1 2 3 3 0 1 2\n";
    CHECK_THAT(parse(vertices, &mesh, NULL, &err) == STATUS_OK, "%s", err.message);
    CHECK(mesh.triangle_count == 3 && mesh.position[1].x == 1 && mesh.position[2].y == 1 && mesh.position[3].x == 0);
    mesh_release(&mesh);
    CHECK_THAT(parse(HEAD FACE(2) VERTEX(4) "end_header\n4 0 1 2 3 3 0\n1 2 0 0 0 1 0\n0 1 1 0 0 1 0", &mesh, NULL,
                     &err) == STATUS_OK,
               "%s", err.message);
    CHECK(mesh.triangle_count == 3 && mesh.position[3].y == 1);
    mesh_release(&mesh);
    CHECK(parse(HEAD VERTEX(3) FACE(1) "end_header\n0 0 0 1 0 0\n1 1 0 3 0 1 2 7\n", &mesh, NULL, &err) ==
          STATUS_INPUT);
    CHECK_THAT(strstr(err.message, "vertex 2 is missing"), "%s", err.message);
    CHECK(parse(HEAD VERTEX(3) FACE(1) "end_header\n0 0 0 1 0 0\n1 1 0 3 0 1\n", &mesh, NULL, &err) == STATUS_INPUT);
    CHECK_THAT(strstr(err.message, "vertex 2 is missing"), "%s", err.message);
}

/* Names in capitals; of two names, the exact one. */
static void test_capitals(void) {
    struct mesh mesh;
    struct error err = {.message = ""};
    CHECK_THAT(parse(HEAD "element Vertex 3\nproperty FLOAT X\nproperty float32 Y\nproperty float y\nproperty float Z\n"
                          "element FACE 1\nproperty list UChar INT Vertex_Indices\nend_header\n"
                          "0 9 0 0\n1 9 0 0\n0 9 1 0\n3 0 1 2\n",
                     &mesh, NULL, &err) == STATUS_OK,
               "%s", err.message);
    CHECK(mesh.triangle_count == 1 && mesh.position[2].y == 1);
    mesh_release(&mesh);
}

/* Other projects' files. */
static void test_vectors(void) {
    static const struct {
        const char *file;
        size_t vertices, triangles; /* 0: refused, with the sentence */
        const char *sentence;
    } table[] = {
        {"ply-happly/test/sampledata/platonic_shelf.ply", 50, 80, NULL},
        {"ply-happly/test/sampledata/platonic_shelf_ascii.ply", 50, 80, NULL},
        {"ply-happly/test/sampledata/platonic_shelf_big_endian.ply", 50, 80, NULL},
        {"assimp/PLY/Wuson.ply", 0, 0, "line 3: unknown keyword \"Created\""},
        {"assimp/PLY/cube.ply", 8, 12, NULL},
        {"assimp/PLY/cube_binary.ply", 8, 12, NULL},
        {"assimp/PLY/cube_binary_header_with_RN_newline.ply", 8, 12, NULL},
        {"assimp/PLY/cube_binary_starts_with_nl.ply", 8, 12, NULL},
        {"assimp/PLY/cube_uv.ply", 24, 12, NULL},
        {"assimp/PLY/float-color.ply", 3, 1, NULL},
        {"assimp/PLY/issue623.ply", 0, 0, "line 14: vertex 0 has a list of impossible length"},
        {"assimp/PLY/points.ply", 0, 0, "no faces"},
        {"assimp/PLY/pond.0.ply", 0, 0, "no faces"},
        {"assimp/PLY/payload_JVN42386607", 0, 0, "payload_JVN42386607"},
    };
    const char *root = getenv("UNBAKE_TEST_DATA");
    for (size_t i = 0; i < sizeof table / sizeof *table; i++) {
        char path[1024];
        snprintf(path, sizeof path, "%s/vectors/%s", root ? root : "../shared/data", table[i].file);
        if (access(path, R_OK) != 0) {
            printf("no vectors here\n");
            return;
        }
        struct mesh mesh;
        struct error err = {.message = ""};
        enum status status = mesh_file_read(path, table[i].file, 1000000, &mesh, NULL, &err);
        CHECK_THAT(status == (table[i].sentence ? STATUS_INPUT : STATUS_OK), "%s: %s", table[i].file, err.message);
        CHECK_THAT(mesh.vertex_count == table[i].vertices && mesh.triangle_count == table[i].triangles,
                   "%s: %zu vertices, %zu triangles", table[i].file, mesh.vertex_count, mesh.triangle_count);
        if (table[i].sentence)
            CHECK_THAT(strstr(err.message, table[i].sentence), "%s", err.message);
        mesh_release(&mesh);
    }
}

int main(void) {
    test_ascii();
    test_strips();
    test_wrapped();
    test_broken_lines();
    test_capitals();
    test_order();
    test_binary();
    test_refusals();
    test_polygons();
    test_large();
    test_vectors();
    return check_result();
}
