/* The OBJ reader: what it takes, what it refuses and where it says the fault lies. */
#include "server/ingest/mesh/mesh_file.h"
#include "server/ingest/mesh/obj.h"

#include "server/ingest/mesh/intern.h"
#include "tests/check.h"

#define SQUARE "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n"

static enum status parse(const char *text, struct mesh *mesh, struct faces_report *report, struct error *err) {
    return obj_parse(text, strlen(text), "room.obj", NULL, 1000, mesh, NULL, report, err);
}

/* Comments, colours behind positions, indices from both ends, continued lines, all kinds of ends. */
static void test_taken(void) {
    struct mesh mesh;
    struct faces_report report;
    struct error err = {.message = ""};
    CHECK_THAT(parse("# made by hand\r\nmtllib a.mtl\r\n\r\n  v 0 0 0 1\r\nv 1 0 0 .5 .5 .5\nv 1 1 0\nv 0 \\\n 1 0\n"
                     "v 0 0 1\nv 1e0 +0 1\nv 1 1 1\nvt 0 0\nvt 1 1\nl 1 2\np 1\ns off\n"
                     "f 1/1 2/2 3/1 4/2\nf -3/1/ 6 7\\\n 8 # end\nf 1 2\nf 1/2 2/2 6/1 \\\r\n5/1 4/1",
                     &mesh, &report, &err) == STATUS_INPUT,
               "%s", err.message);
    CHECK_STRING(err.message, "room.obj, line 18: the face refers to vertex 8, but there are 7 above it");
    CHECK_THAT(parse("# made by hand\r\nmtllib a.mtl\r\n\r\n  v 0 0 0 1\r\nv 1 0 0 .5 .5 .5\nv 1 1 0\nv 0 \\\n 1 0\n"
                     "v 0 0 1\nv 1e0 +0 1\nv 1 1 1\nvt 0 0\nvt 1 1\nl 1 2\np 1\ns off\n"
                     "f 1/1 2/2 3/1 4/2\nf -3 6 7\\\n # end\nf 1 2\nf 1/2 2/2 6/1 \\\r\n5/1 4/1",
                     &mesh, &report, &err) == STATUS_OK,
               "%s", err.message);
    CHECK(mesh.triangle_count == 6 && mesh.face_count == 4 && mesh.vertex_count == 7);
    CHECK(!mesh.normal && !mesh.object_id);
    CHECK(report.small_count == 1 && report.polygon_count == 1);
    static const uint32_t quad[2][3] = {{0, 1, 2}, {0, 2, 3}};
    CHECK(memcmp(mesh.index, quad, sizeof quad) == 0);
    CHECK(mesh.face[1] == 0 && mesh.face[2] == 1 && mesh.face[3] == 3 && mesh.face[5] == 3);
    CHECK(mesh.position[3].y == 1.0f && mesh.position[4].z == 1.0f && mesh.position[4].x == 0.0f);
    mesh_release(&mesh);
}

/* A vertex for each pair of position and normal; no normals at all where a corner has none. */
static void test_normals(void) {
    struct mesh mesh;
    struct error err;
    CHECK(parse(SQUARE "vn 0 0 1\nvn 1 0 0\nf 1//1 2//1 3//1\nf 1//1 3//2 4//-2\n", &mesh, NULL, &err) == STATUS_OK);
    CHECK(mesh.vertex_count == 5 && mesh.normal && mesh.normal[3].x == 1.0f && mesh.normal[4].z == 1.0f);
    CHECK(mesh.index[1][0] == 0 && mesh.index[1][1] == 3);
    CHECK(memcmp(&mesh.position[3], &mesh.position[2], sizeof(vec3)) == 0);
    mesh_release(&mesh);
    CHECK(parse(SQUARE "vn 0 0 1\nf 1//1 2//1 3//1\nf 1//1 3 4//1\n", &mesh, NULL, &err) == STATUS_OK);
    CHECK(mesh.triangle_count == 2 && !mesh.normal);
    mesh_release(&mesh);
}

/* What others leave away or write without anything to refer to; old and new marks around the lines. */
static void test_careless(void) {
    struct mesh mesh;
    struct faces_report report;
    struct error err = {.message = ""};
    CHECK(parse(SQUARE "vt 0 0\nvn 0 0 1\nf 1/1/ 2/1/ 3/1/\nf 1// 3/ 4/9\n", &mesh, &report, &err) == STATUS_OK);
    CHECK(mesh.triangle_count == 2 && !mesh.normal && report.note_count == 0);
    mesh_release(&mesh);
    CHECK(parse(SQUARE "f 1//1 2//-3 3/7/0\nvn 0 0 1\nf 1//1 3//1 4//1\n", &mesh, &report, &err) == STATUS_OK);
    CHECK(mesh.triangle_count == 2 && !mesh.normal && report.note_count == 1);
    CHECK_STRING(report.note[0], "3 corners of faces name a normal that is not there: it was read without normals");
    mesh_release(&mesh);
    CHECK(parse("\xef\xbb\xbfv 5 0 0\nv 1 0 0\nv 1 1 0\nf 1 2 3\n", &mesh, &report, &err) == STATUS_OK);
    CHECK(mesh.triangle_count == 1 && mesh.position[0].x == 5.0f);
    mesh_release(&mesh);
    CHECK(parse("# old\rv 0 0 0\rv 1 0 0\rv 1 \\\r1 0\r\ro a b\rf 1 2 3\rf 1 2 4\r", &mesh, &report, &err) ==
          STATUS_INPUT);
    CHECK_STRING(err.message, "room.obj, line 9: the face refers to vertex 4, but there are 3 above it");
    CHECK(parse("# old\rv 0 0 0\rv 1 0 0\rv 1 \\\r1 0\rf -3 -2 -1", &mesh, &report, &err) == STATUS_OK);
    CHECK(mesh.triangle_count == 1 && mesh.position[2].y == 1.0f);
    mesh_release(&mesh);
}

/* Objects are combinations of names that faces have, by first use. */
static void test_objects(void) {
    static const int64_t wanted[] = {0, 1, 1, 2, 0, 3};
    struct mesh mesh;
    struct error err;
    CHECK(parse(SQUARE "o empty\no wall \nusemtl paint\nf 1 2 3\no lamp\nf 1 3 4\ng\nf 1 2 3\nusemtl glass\nf 1 2 4\n"
                       "usemtl paint\no\twall\r\nf 2 3 4\ng shade left\nf 1 2 3\n",
                &mesh, NULL, &err) == STATUS_OK);
    CHECK(mesh.triangle_count == 6 && mesh.object_id && memcmp(mesh.object_id, wanted, sizeof wanted) == 0);
    mesh_release(&mesh);
    CHECK(parse("o one\n" SQUARE "f 1 2 3\nf 1 3 4\no none\n", &mesh, NULL, &err) == STATUS_OK);
    CHECK(!mesh.object_id);
    mesh_release(&mesh);
}

static void refused(const char *text, const char *part) {
    struct mesh mesh;
    struct error err = {.message = ""};
    CHECK_THAT(parse(text, &mesh, NULL, &err) == STATUS_INPUT, "%s", text);
    CHECK_THAT(strstr(err.message, "room.obj") && strstr(err.message, part), "%s", err.message);
    CHECK(mesh.triangle_count == 0 && !mesh.position && !mesh.index);
}

static void test_refused(void) {
    refused("", "no faces");
    refused("o\n", "no faces");
    refused(SQUARE, "no faces");
    refused(SQUARE "f 1 2\n", "no faces");
    refused("v 1 2\n", "line 1: three numbers");
    refused("v 1 2\nv", "line 1: three numbers");
    refused("v 0 0 0\nv 1 two 3\n", "line 2: there is a value that is not a number");
    refused("v 0x10 0 0\n", "line 1: there is a value that is not a number");
    refused("v 1 2 3.00000000000000000000000000000000000000000000000000000000000000000001\n", "not a number");
    refused(SQUARE "f 1 2 5\n", "line 5: the face refers to vertex 5, but there are 4 above it");
    refused(SQUARE "f 1 2 0\n", "vertex 0");
    refused(SQUARE "f 1 -5 2\n", "vertex -5");
    refused(SQUARE "f 1 2 99999999999999999999999\n", "vertex 9223372036854775807");
    refused(SQUARE "f 1/a 2 3\n", "line 5: a corner");
    refused(SQUARE "f 1 2 3/1/1/1\n", "line 5");
    refused(SQUARE "f a b c\n", "line 5: a corner");
    char *many = malloc(8192);
    size_t used = (size_t)sprintf(many, "%sf", SQUARE);
    for (int i = 0; i < 1025; i++)
        used += (size_t)sprintf(many + used, " %d", i % 4 + 1);
    refused(many, "more than 1024 corners");
    free(many);
}

static void test_limits(void) {
    struct mesh mesh;
    struct error err;
    static const char binary[] = SQUARE "f 1 2 3\n\0";
    CHECK(obj_parse(binary, sizeof binary, "room.obj", NULL, 9, &mesh, NULL, NULL, &err) == STATUS_INPUT);
    CHECK(strstr(err.message, "not text"));
    CHECK(obj_parse(SQUARE "f 1 2 3 4\n", sizeof SQUARE + 9, "room.obj", NULL, 1, &mesh, NULL, NULL, &err) ==
          STATUS_LIMIT);
    CHECK(mesh_file_read("/nowhere/room.obj", "room.obj", 9, &mesh, NULL, &err) == STATUS_NOT_FOUND);
    CHECK(mesh_file_read("/dev/null", "room.obj", 9, &mesh, NULL, &err) == STATUS_INPUT);
}

/* More than its points can be counted in: all of it is a hole but the beginning. */
static void test_large(void) {
    char path[] = "/tmp/unbake-test-obj-XXXXXX";
    struct mesh mesh;
    struct error err = {.message = ""};
    int fd = mkstemp(path);
    CHECK(fd >= 0 && write(fd, SQUARE, sizeof SQUARE) > 0);
    if (ftruncate(fd, (off_t)1 << 35) != 0)
        printf("no file of 32 GiB here, not even of holes\n");
    else
        CHECK_THAT(mesh_file_read(path, "room.obj", 9, &mesh, NULL, &err) == STATUS_LIMIT &&
                       strcmp(err.message, "room.obj is larger than 34359738352 bytes") == 0,
                   "%s", err.message);
    close(fd);
    unlink(path);
}

/* Files of other programs, where they are here. */
static void test_others(void) {
    static const struct {
        const char *file;
        size_t vertices, triangles, faces;
        int objects; /* 1: no ids */
        bool has_normals;
    } table[] = {
        {"WusonOBJ.obj", 2117, 3732, 3732, 1, true}, {"box_longline.obj", 8, 944, 6, 1, false},
        {"concave_polygon.obj", 64, 64, 1, 1, true}, {"cube_usemtl.obj", 24, 12, 12, 3, true},
        {"multiple_spaces.obj", 3, 1, 1, 1, false},  {"spider.obj", 918, 1368, 1368, 19, true},
        {"testmixed.obj", 8, 12, 6, 1, false},       {"regr01.obj", 2108, 2710, 2710, 55, false},
    };
    const char *root = getenv("UNBAKE_TEST_DATA");
    for (size_t i = 0; i < sizeof table / sizeof *table; i++) {
        char path[1024];
        struct mesh mesh;
        struct error err = {.message = ""};
        snprintf(path, sizeof path, "%s/vectors/assimp/OBJ/%s", root ? root : "../shared/data", table[i].file);
        if (access(path, R_OK) != 0)
            continue;
        CHECK_THAT(mesh_file_read(path, table[i].file, 1 << 20, &mesh, NULL, &err) == STATUS_OK, "%s", err.message);
        CHECK_THAT(mesh.vertex_count == table[i].vertices && mesh.triangle_count == table[i].triangles &&
                       mesh.face_count == table[i].faces && (mesh.normal != NULL) == table[i].has_normals,
                   "%s", table[i].file);
        int64_t last = 0;
        for (size_t t = 0; mesh.object_id && t < mesh.triangle_count; t++)
            last = mesh.object_id[t] > last ? mesh.object_id[t] : last;
        CHECK_THAT(last + 1 == table[i].objects, "%s: %ld", table[i].file, (long)last);
        mesh_release(&mesh);
    }
}

static void test_intern(void) {
    struct intern in;
    char text[16];
    intern_init(&in);
    for (uint32_t round = 0; round < 2; round++)
        for (uint32_t i = 0; i < 5000; i++)
            CHECK(intern_number(&in, text, (size_t)sprintf(text, "%u", i)) == i);
    CHECK(in.count == 5000 && intern_number(&in, "", 0) == 5000 && intern_number(&in, NULL, 0) == 5000);
    intern_release(&in);
}

int main(void) {
    test_taken();
    test_normals();
    test_careless();
    test_objects();
    test_refused();
    test_limits();
    test_large();
    test_others();
    test_intern();
    return check_result();
}
