/* test_bundle_bad.c -- a table of bad bundles that must each name the file and the place; and many problems at once. */
#include "tests/unit/bundle_rig.h"

#define ONE_OF_THREE(frame) "{" LENS ",\"frames\":[" frame "," FRAME("b.png") "," FRAME("c.exr") "," FRAME("a.exr") "]}"
#define MATRIX(rows) ONE_OF_THREE("{\"file_path\":\"d.exr\",\"transform_matrix\":" rows "}")

struct bad {
    const char *transforms;        /* NULL: the good one */
    const char *file, *content;    /* another file to replace; content NULL: remove it */
    const char *blamed, *sentence; /* what a problem must say */
};

static const struct bad bad_bundles[] = {
    {NULL, "transforms.json", NULL, "a.exr", "no cameras: there are photographs and a mesh, but no poses"},
    {"{\"frames\": [}", NULL, NULL, "transforms.json", "line 1"},
    {"[]", NULL, NULL, "transforms.json", "array \"frames\""},
    {"{\"frames\": 3}", NULL, NULL, "transforms.json", "array \"frames\""},
    {"{" LENS ",\"frames\":[]}", NULL, NULL, "transforms.json", "holds no poses"},
    {"{" LENS ",\"frames\":[" FRAME("a.exr") "," FRAME("b.png") "," FRAME("x.png") "]}", NULL, NULL, "transforms.json",
     "only 2 of its 3 frames"},
    {NULL, "mesh.ply", NULL, "mesh.ply", "no mesh"},
    {NULL, "mesh.ply", CLOUD, "mesh.ply", "point clouds"},
    {NULL, "second.ply", TURNED, "second.ply", "two meshes: mesh.ply and second.ply, and neither is finer"},
    {NULL, "mesh.ply", "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\n", "mesh.ply", "line 4"},
    {NULL, "mesh.ply", "", "mesh.ply", "empty"},
    {TOP("\"mesh\":\"nowhere.ply\","), NULL, NULL, "transforms.json", "nowhere.ply"},
    {TOP("\"mesh\":\"../mesh.ply\","), NULL, NULL, "transforms.json", "\"..\""},
    {TOP("\"mesh\":\"/etc/mesh.ply\","), NULL, NULL, "transforms.json", "absolute"},
    {TOP("\"camera_model\":\"EQUIRECTANGULAR\","), NULL, NULL, "transforms.json", "unknown camera_model \"EQUI"},
    {"{" LENS ",\"fl_x\":1,\"frames\":[]}", NULL, NULL, "transforms.json", "\"fl_x\" twice"},
    {"{\"w\":8,\"h\":6,\"fl_x\":0,\"frames\":[" THREE "]}", NULL, NULL, "transforms.json", "fl_x is 0"},
    {"{\"w\":8,\"h\":6,\"fl_x\":-5,\"frames\":[" THREE "]}", NULL, NULL, "transforms.json", "fl_x is -5"},
    {"{\"w\":8,\"h\":6,\"fl_x\":1e9,\"frames\":[" THREE "]}", NULL, NULL, "a.exr", "focal length of 1e+09"},
    {"{\"w\":8,\"h\":6,\"frames\":[" THREE "]}", NULL, NULL, "transforms.json", "frames[0] (a.exr): no focal length"},
    {"{\"w\":8.5,\"fl_x\":7,\"frames\":[" THREE "]}", NULL, NULL, "transforms.json", "w is 8.5"},
    {"{\"w\":\"8px\",\"fl_x\":7,\"frames\":[" THREE "]}", NULL, NULL, "transforms.json", "\"w\" must be a number"},
    {"{\"fl_x\":7,\"camera_angle_x\":60,\"frames\":[" THREE "]}", NULL, NULL, "transforms.json", "radians"},
    {"{\"fl_x\":7,\"cx\":5000,\"frames\":[" THREE "]}", NULL, NULL, "a.exr", "principal point"},
    {"{\"w\":9,\"h\":6,\"fl_x\":7,\"frames\":[" THREE "]}", NULL, NULL, "b.png",
     "8 x 6 pixels, but frames[1] says 9 x 6"},
    {MATRIX("[[1,0,0,0],[0,1,0,0],[1,1,0,0],[0,0,0,1]]"), NULL, NULL, "transforms.json",
     "frames[0] (d.exr): transform_matrix is singular"},
    {MATRIX("[[0,0,0,0],[0,0,0,0],[0,0,0,0],[0,0,0,1]]"), NULL, NULL, "transforms.json", "singular"},
    {MATRIX("[[-1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]]"), NULL, NULL, "transforms.json", "mirrors"},
    {MATRIX("[[1,0,0,0],[0,2,0,0],[0,0,1,0],[0,0,0,1]]"), NULL, NULL, "transforms.json", "not a rotation"},
    {MATRIX("[[1,0.2,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]]"), NULL, NULL, "transforms.json", "not a rotation"},
    {MATRIX("[[1,0,0,1e999],[0,1,0,0],[0,0,1,0],[0,0,0,1]]"), NULL, NULL, "transforms.json", "row 1, column 4"},
    {MATRIX("[[1,0,0,0],[0,1,\"zero\",0],[0,0,1,0],[0,0,0,1]]"), NULL, NULL, "transforms.json", "row 2, column 3"},
    {MATRIX("[[1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,2]]"), NULL, NULL, "transforms.json", "last row"},
    {MATRIX("[[1,0,0],[0,1,0],[0,0,1]]"), NULL, NULL, "transforms.json", "4 (or 3) rows of 4"},
    {MATRIX("7"), NULL, NULL, "transforms.json", "4 (or 3) rows of 4"},
    {ONE_OF_THREE("{" POSE "}"), NULL, NULL, "transforms.json", "frames[0]: no file_path"},
    {ONE_OF_THREE("7"), NULL, NULL, "transforms.json", "frames[0]: must be an object"},
    {ONE_OF_THREE("{\"file_path\":\"../../a.exr\"," OTHER_POSE "}"), NULL, NULL, "transforms.json",
     "frames[0] and frames[3] both name a.exr"},
    {ONE_OF_THREE("{\"file_path\":\"\"," POSE "}"), NULL, NULL, "transforms.json", "file_path is empty"},
    {ONE_OF_THREE(FRAME_ELSEWHERE("./a.exr")), NULL, NULL, "transforms.json",
     "frames[0] and frames[3] both name a.exr"},
    {ONE_OF_THREE(FRAME_ELSEWHERE("c")), NULL, NULL, "transforms.json", "frames[0] and frames[2] both name c.exr"},
    {ONE_OF_THREE("{\"file_path\":\"d\"," POSE ",\"split\":\"dev\"}"), NULL, NULL, "transforms.json", "split must be"},
    {ONE_OF_THREE("{\"file_path\":\"d\"," POSE ",\"exposure\":-1}"), NULL, NULL, "transforms.json", "exposure is -1"},
    {"{" LENS ",\"frames\":[{\"file_path\":\"a.exr\"," POSE
     ",\"mask_path\":\"m.png\"}," FRAME("b.png") "," FRAME("c.exr") "]}",
     NULL, NULL, "m.png", "the mask is not in the bundle"},
    {"{" LENS ",\"test_filenames\":[\"a.exr\",\"b.png\",\"c.exr\"],\"frames\":[" THREE "]}", NULL, NULL,
     "transforms.json", "held out"},
    {NULL, "b.png", "\x89PNG\r\n\x1a\n and then nothing", "b.png", "PNG"},
    {NULL, "a.exr", "v/1\x01 and then nothing", "a.exr", "EXR"},
    {NULL, "c.exr", "text", "c.exr", "not a picture"},
};

static void test_bad(void) {
    for (size_t i = 0; i < sizeof bad_bundles / sizeof *bad_bundles; i++) {
        const struct bad *bad = &bad_bundles[i];
        put_good();
        if (bad->transforms)
            put("transforms.json", bad->transforms);
        char *path = file_join(work, bad->file ? bad->file : "");
        if (bad->file && bad->content)
            put(bad->file, bad->content);
        else if (bad->file)
            CHECK(remove(path) == 0);
        mem_free(path);
        struct scene scene;
        struct error err;
        cJSON *problems, *problem;
        CHECK_THAT(load(&scene, &problems, &err) == STATUS_INPUT, "case %zu: %s", i, err.message);
        CHECK(scene.photograph == NULL && scene.mesh.index == NULL && err.message[0] != '\0');
        bool found = false;
        cJSON_ArrayForEach(problem, problems) {
            const char *file = cJSON_GetStringValue(cJSON_GetObjectItem(problem, "file"));
            const char *reason = cJSON_GetStringValue(cJSON_GetObjectItem(problem, "reason"));
            found = found || (strcmp(file, bad->blamed) == 0 && strstr(reason, bad->sentence));
            CHECK_THAT(!strstr(reason, work), "case %zu tells where the server keeps it: %s", i, reason);
        }
        char *text = json_text(problems);
        CHECK_THAT(found, "case %zu wants %s \"%s\": %s", i, bad->blamed, bad->sentence, text);
        mem_free(text);
        cJSON_Delete(problems);
    }
}

/* Everything at once, and more problems than are kept. */
static void test_many(void) {
    put_good();
    put("mesh.ply", "ply\nrubbish");
    put("b.png", "text");
    put("transforms.json", ONE_OF_THREE("{\"file_path\":\"d\",\"transform_matrix\":3}"));
    struct scene scene;
    struct error err;
    cJSON *problems;
    CHECK(load(&scene, &problems, &err) == STATUS_INPUT);
    CHECK(cJSON_GetArraySize(problems) == 4); /* that 2 of 4 frames are left is one, too */
    CHECK(strstr(err.message, "4 problems"));
    cJSON_Delete(problems);

    struct buf text;
    buf_init(&text, 1 << 20);
    buf_puts(&text, "{" LENS ",\"frames\":[");
    for (int i = 0; i < 300; i++)
        buf_printf(&text, "%s{\"file_path\":\"%d.png\"}", i ? "," : "", i);
    buf_puts(&text, "]}");
    put("transforms.json", buf_text(&text));
    buf_release(&text);
    CHECK(load(&scene, &problems, &err) == STATUS_INPUT);
    CHECK(cJSON_GetArraySize(problems) == 51 && strstr(err.message, "301 problems"));
    cJSON_Delete(problems);
}

int main(void) {
    bundle_rig_begin();
    test_bad();
    test_many();
    bundle_rig_end();
    return check_result();
}
