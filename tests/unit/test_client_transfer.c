/* The real client against a server that follows a script: what it fetches and sends in parts, where connections
 * break, replies are lost and other versions of a file come. */
#include "tests/unit/client_script.h"

/* --- get ----------------------------------------------------------------------------------- */

static const char content[] = "0123456789abcdefghij"; /* 20 bytes */
static char listing[1024], version[128];

static void check_file(const char *name, const char *wanted) {
    char text[256];
    char *path = mem_printf("%s/got/%s", root, name);
    bool there = access(path, F_OK) == 0;
    if (wanted)
        read_text(path, text, sizeof text);
    CHECK_THAT(there == (wanted != NULL), "%s", path);
    if (wanted && there)
        CHECK_STRING(text, wanted);
    mem_free(path);
}

static void list_outputs(struct script *s, const char *name, const char *of) {
    char sha256[SHA256_HEX_SIZE];
    sha256_of(of, strlen(of), sha256);
    snprintf(listing, sizeof listing, "{\"items\":[{\"name\":\"%s\",\"bytes\":%zu,\"sha256\":\"%s\"}]}", name,
             strlen(of), sha256);
    snprintf(version, sizeof version, "If-Range: \"sha256-%s\"", sha256);
    add_reply(s, "200 OK", "", listing, "GET /v1/jobs/7/outputs ", NULL, NULL);
}

static void clean(void) {
    char *path = mem_printf("%s/got", root);
    file_remove_tree(path, NULL);
    mem_free(path);
}

static void test_get_resumes(void) {
    struct script s = {0};
    clean();
    list_outputs(&s, "preview/a b.png", content);
    add_step(&s, "HTTP/1.1 200 OK\r\nContent-Length: 20\r\n\r\n01234567", "GET /v1/jobs/7/outputs/preview/a%20b.png ",
             "!Range:", NULL);
    add_step(&s, "", "Range: bytes=8-\r\n", version, NULL);
    add_reply(&s, "206 Partial", "Content-Range: bytes 8-19/20\r\n", content + 8, "Range: bytes=8-\r\n", version, NULL);
    script_start(&s);
    CHECK_EXIT(client(&s, "get 7 -o %s/got --json", root), 0);
    CHECK_PART(out_text, "\"action\":\"fetched\"");
    check_file("preview/a b.png", content);
    check_file("preview/a b.png.part", NULL);
    script_end(&s, "get, cut");

    /* A second time there is nothing to do. */
    list_outputs(&s, "preview/a b.png", content);
    script_start(&s);
    CHECK_EXIT(client(&s, "get 7 -o %s/got 'preview/*'", root), 0);
    CHECK_PART(out_text, "all there already");
    script_end(&s, "get, present");

    /* Half a file from an earlier run. */
    put_part("x.exr.part", "01234");
    list_outputs(&s, "x.exr", content);
    add_reply(&s, "206 Partial", "Content-Range: bytes 5-19/20\r\n", content + 5, "Range: bytes=5-\r\n", version, NULL);
    script_start(&s);
    CHECK_EXIT(client(&s, "get 7 x.exr -o %s/got --json", root), 0);
    CHECK_PART(out_text, "\"action\":\"resumed\"");
    check_file("x.exr", content);
    script_end(&s, "get, resumed");

    /* A server that sends the whole all the same: taken as such, at once. */
    put_part("w.exr.part", "01234");
    list_outputs(&s, "w.exr", content);
    add_reply(&s, "200 OK", "", content, "Range: bytes=5-\r\n", NULL, NULL);
    script_start(&s);
    CHECK_EXIT(client(&s, "get 7 w.exr -o %s/got --json", root), 0);
    CHECK_PART(out_text, "\"action\":\"fetched\"");
    check_file("w.exr", content);
    script_end(&s, "get, range ignored");

    /* A whole .part needs no request at all. */
    put_part("y.exr.part", content);
    list_outputs(&s, "y.exr", content);
    script_start(&s);
    CHECK_EXIT(client(&s, "get 7 -o %s/got", root), 0);
    check_file("y.exr", content);
    script_end(&s, "get, whole part");
}

static void test_get_distrusts(void) {
    struct script s = {0};
    clean();
    /* What the .part holds is wrong: fetched anew. */
    put_part("x.exr.part", "WRONG");
    list_outputs(&s, "x.exr", content);
    add_reply(&s, "206 Partial", "Content-Range: bytes 5-19/20\r\n", content + 5, "Range: bytes=5-\r\n", NULL, NULL);
    list_outputs(&s, "x.exr", content);
    add_reply(&s, "200 OK", "", content, "!Range:", NULL, NULL);
    script_start(&s);
    CHECK_EXIT(client(&s, "get 7 -o %s/got", root), 0);
    check_file("x.exr", content);
    script_end(&s, "get, wrong part");

    /* Longer than the file ever was. */
    put_part("z.exr.part", "0123456789abcdefghij and more");
    list_outputs(&s, "z.exr", content);
    add_reply(&s, "200 OK", "", content, "!Range:", NULL, NULL);
    script_start(&s);
    CHECK_EXIT(client(&s, "get 7 -o %s/got", root), 0);
    check_file("z.exr", content);
    script_end(&s, "get, part too long");

    /* The job replaces the file meanwhile: the server begins anew, and the list is read again. */
    put_part("v.exr.part", "01234");
    list_outputs(&s, "v.exr", content);
    add_reply(&s, "200 OK", "", "another version, longer", "Range: bytes=5-", NULL, NULL);
    list_outputs(&s, "v.exr", "another version, longer");
    add_reply(&s, "200 OK", "", "another version, longer", "!Range:", NULL, NULL);
    script_start(&s);
    CHECK_EXIT(client(&s, "get 7 -o %s/got", root), 0);
    check_file("v.exr", "another version, longer");
    script_end(&s, "get, new version");

    /* Damage that stays is an error, and no file. */
    list_outputs(&s, "bad.exr", content);
    add_reply(&s, "200 OK", "", "0123456789abcdefghiX", "GET", NULL, NULL);
    list_outputs(&s, "bad.exr", content);
    script_start(&s);
    CHECK_EXIT(client(&s, "get 7 -o %s/got", root), 7);
    CHECK_PART(err_text, "SHA-256");
    check_file("bad.exr", NULL);
    script_end(&s, "get, damaged");

    /* Names lead nowhere else. */
    list_outputs(&s, "../escaped", content);
    script_start(&s);
    CHECK_EXIT(client(&s, "get 7 -o %s/got", root), 7);
    CHECK_PART(err_text, "unsafe name");
    check_file("../escaped", NULL);
    script_end(&s, "get, unsafe");

    list_outputs(&s, "base_color.exr", content);
    script_start(&s);
    CHECK_EXIT(client(&s, "get 7 -o %s/got basecolor.exr", root), 3);
    CHECK_PART(err_text, "did you mean base_color.exr?");
    script_end(&s, "get, unknown");
}

/* --- submit -------------------------------------------------------------------------------- */

#define UNKNOWN_SCENE "{\"detail\":\"no\",\"invalid_params\":[{\"name\":\"scene\",\"reason\":\"unknown\"}]}"

static void test_submit(void) {
    struct script s = {0};
    put_part("room/mesh.ply", "ply\n");
    put_part("room/images/a.png", "png\n");
    add_reply(&s, "404 Not Found", "", "{\"detail\":\"no\"}", "GET /v1/scenes/", NULL, NULL);
    add_reply(&s, "422 Invalid", "", UNKNOWN_SCENE, "POST /v1/jobs?dry_run=1 ", NULL, NULL);
    add_reply(&s, "200 OK", "", "{\"items\":[],\"next\":null}", "GET /v1/uploads?sha256=", NULL, NULL);
    /* "room" and 64 hex digits */
    add_reply(&s, "201 Created", "Location: /v1/uploads/ab\r\n", "", "POST /v1/uploads ", "Upload-Length: 3072\r\n",
              "Upload-Metadata: name cm9vbQ==,sha256 ");
    add_step(&s, "", "PATCH /v1/uploads/ab ", "Upload-Offset: 0\r\n", "Content-Length: 3072\r\n"); /* broken off */
    add_reply(&s, "503 Busy", "Retry-After: 0\r\n", "", "HEAD /v1/uploads/ab ", NULL, NULL);
    add_reply(&s, "200 OK", "Upload-Offset: 1000\r\n", "", "HEAD /v1/uploads/ab ", NULL, NULL);
    add_reply(&s, "409 Conflict", "", "{\"detail\":\"no\"}", "PATCH", "Upload-Offset: 1000\r\n",
              NULL); /* it moved on */
    add_reply(&s, "200 OK", "Upload-Offset: 1500\r\n", "", "HEAD /v1/uploads/ab ", NULL, NULL);
    add_reply(&s, "204 No Content", "Upload-Offset: 2000\r\n", "", "PATCH", "Upload-Offset: 1500\r\n", NULL);
    add_reply(&s, "200 OK", "Upload-Offset: 2000\r\n", "", "HEAD /v1/uploads/ab ", NULL, NULL);
    add_step(&s, "", "PATCH", "Upload-Offset: 2000\r\n", "Content-Length: 1072\r\n"); /* only the reply is lost */
    add_reply(&s, "200 OK", "Upload-Offset: 3072\r\n", "", "HEAD /v1/uploads/ab ", NULL, NULL);
    add_reply(&s, "200 OK", "", "{\"state\":\"checking\",\"problems\":[]}", "GET /v1/scenes/", NULL, NULL);
    add_step(&s, "", "GET /v1/scenes/", NULL, NULL); /* away for a moment */
    add_reply(&s, "200 OK", "", "{\"state\":\"ready\",\"facts\":{\"warnings\":[\"it is dim\"]}}", "GET /v1/scenes/",
              NULL, NULL);
    add_reply(&s, "201 Created", "", "{\"id\":7,\"name\":\"room\",\"scene\":\"abcdef\"}", "POST /v1/jobs ",
              "Idempotency-Key: ", NULL);
    script_start(&s);
    CHECK_EXIT(client(&s, "submit %s/got/room/ --set texture_size=256 --label a=b", root), 0);
    CHECK_STRING(out_text, "job 7 is queued: room (scene abcdef)\n");
    CHECK_PART(err_text, "sent room (2 files");
    CHECK_PART(err_text, "warning: it is dim");
    script_end(&s, "submit");
}

/* Another process had begun: this one finds it and goes on; that it is gone is no end either. */
static void test_submit_resumed(void) {
    struct script s = {0};
    add_reply(&s, "404 Not Found", "", "{\"detail\":\"no\"}", "GET /v1/scenes/", NULL, NULL);
    add_reply(&s, "422 Invalid", "", UNKNOWN_SCENE, "POST /v1/jobs?dry_run=1 ", NULL, NULL);
    add_reply(&s, "200 OK", "",
              "{\"items\":[{\"length\":3072,\"scene\":\"ab\",\"links\":{\"self\":\"/v1/uploads/1\"}},"
              "{\"length\":3072,\"scene\":null,\"links\":{\"self\":\"/v1/uploads/2\"}}]}",
              "GET /v1/uploads?sha256=", NULL, NULL);
    add_reply(&s, "200 OK", "Upload-Offset: 512\r\n", "", "HEAD /v1/uploads/2 ", NULL, NULL);
    add_reply(&s, "404 Not Found", "", "{\"detail\":\"expired\"}", "PATCH /v1/uploads/2 ", "Upload-Offset: 512\r\n",
              NULL);
    add_reply(&s, "200 OK", "", "{\"items\":[]}", "GET /v1/uploads?sha256=", NULL, NULL);
    add_reply(&s, "201 Created", "Location: /v1/uploads/3\r\n", "", "POST /v1/uploads ", NULL, NULL);
    add_reply(&s, "204 No Content", "Upload-Offset: 3072\r\n", "", "PATCH /v1/uploads/3", "Upload-Offset: 0\r\n", NULL);
    add_reply(&s, "200 OK", "", "{\"state\":\"ready\"}", "GET /v1/scenes/", NULL, NULL);
    add_reply(&s, "201 Created", "", "{\"id\":8,\"name\":\"room\",\"scene\":\"abcdef\"}", "POST /v1/jobs ", NULL, NULL);
    script_start(&s);
    CHECK_EXIT(client(&s, "submit %s/got/room/", root), 0);
    CHECK_PART(err_text, "512 B of 3.0 KiB are on the server already");
    script_end(&s, "submit, going on");
}

/* A fault of a setting is told before anything is sent; that of the scene is none. */
static void test_submit_faults(void) {
    struct script s = {0};
    add_reply(&s, "404 Not Found", "", "{\"detail\":\"no\"}", "GET /v1/scenes/", NULL, NULL);
    add_reply(&s, "422 Invalid", "",
              "{\"detail\":\"no\",\"invalid_params\":[{\"name\":\"scene\",\"reason\":\"unknown\"},"
              "{\"name\":\"settings.x\",\"reason\":\"no such\"}]}",
              "POST /v1/jobs?dry_run=1 ", NULL, NULL);
    script_start(&s);
    CHECK_EXIT(client(&s, "submit %s/got/room --set x=1", root), 4);
    CHECK_PART(err_text, "  settings.x: no such\n");
    CHECK(!strstr(err_text, "scene: unknown"));
    script_end(&s, "submit, fault");

    add_reply(&s, "200 OK", "", "{\"state\":\"ready\"}", "GET /v1/scenes/", NULL, NULL);
    add_reply(&s, "200 OK", "", "{\"dry_run\":true,\"scene_state\":\"ready\"}", "POST /v1/jobs?dry_run=1 ", NULL, NULL);
    script_start(&s);
    CHECK_EXIT(client(&s, "submit %s/got/room --dry-run", root), 0);
    CHECK_PART(out_text, "is on the server (ready)");
    script_end(&s, "submit, dry run");

    script_start(&s);
    CHECK_EXIT(client(&s, "submit %s/nothing", root), 2);
    CHECK_EXIT(client(&s, "submit"), 2);
    CHECK_EXIT(client(&s, "submit %s/got/room --scene ab", root), 2);
    CHECK_EXIT(client(&s, "submit %s/got/room --set x", root), 2);
    CHECK_EXIT(client(&s, "submit %s/got/room --label =x", root), 2);
    CHECK_EXIT(client(&s, "show seven"), 2);
    CHECK_EXIT(client(&s, "list --state runing"), 2);
    CHECK_PART(err_text, "did you mean running?");
    CHECK_EXIT(client(&s, "frob"), 2);
    script_end(&s, "usage");
}

/* --- check --------------------------------------------------------------------------------- */

#define SCENE(facts) "{\"id\":\"abcdef\",\"state\":\"ready\",\"reading\":{\"scale\":2},\"facts\":" facts "}"
#define FITS "\"fit\":{\"verdict\":\"yes\"}"

static void test_check(void) {
    struct script s = {0};
    /* What an older server has checked is checked again, as it is read. */
    add_reply(&s, "200 OK", "", SCENE("{}"), "GET /v1/scenes/abcdef", NULL, NULL);
    add_reply(&s, "200 OK", "", "{\"id\":\"abcdef\",\"state\":\"checking\"}", "PATCH /v1/scenes/abcdef", NULL, NULL);
    add_reply(&s, "200 OK", "", SCENE("{" FITS ",\"reading\":{\"scale\":3}}"), "GET /v1/scenes/abcdef", NULL, NULL);
    script_start(&s);
    CHECK_EXIT(client(&s, "check --scene abcdef"), 0);
    CHECK_PART(out_text, "fit              yes");
    CHECK_PART(out_text, "scale=3"); /* what the check took, not what was given */
    script_end(&s, "check, no fit");
    /* Where that may not be, it is shown as it is. */
    add_reply(&s, "200 OK", "", SCENE("{}"), "GET /v1/scenes/abcdef", NULL, NULL);
    add_reply(&s, "403 Forbidden", "", "{\"detail\":\"no\"}", "PATCH /v1/scenes/abcdef", NULL, NULL);
    script_start(&s);
    CHECK_EXIT(client(&s, "check --scene abcdef"), 0);
    script_end(&s, "check, not again");

    /* A picture is asked for again while the server is busy; one that lies elsewhere is not asked for. */
    add_reply(&s, "200 OK", "",
              SCENE("{" FITS ",\"previews\":[{\"name\":\"a.png\",\"href\":\"/v1/scenes/abcdef/preview/a.png\"}]}"),
              "GET /v1/scenes/abcdef", NULL, NULL);
    add_reply(&s, "503 Busy", "Retry-After: 0\r\n", "", "GET /v1/scenes/abcdef/preview/a.png", NULL, NULL);
    add_reply(&s, "200 OK", "", "PNG", "GET /v1/scenes/abcdef/preview/a.png", NULL, NULL);
    script_start(&s);
    CHECK_EXIT(client(&s, "check --scene abcdef --pictures %s/got", root), 0);
    check_file("a.png", "PNG");
    script_end(&s, "check, picture");
    add_reply(&s, "200 OK", "", SCENE("{" FITS ",\"previews\":[{\"name\":\"b.png\",\"href\":\"//elsewhere/b.png\"}]}"),
              "GET /v1/scenes/abcdef", NULL, NULL);
    script_start(&s);
    CHECK_EXIT(client(&s, "check --scene abcdef --pictures %s/got", root), 7);
    CHECK_PART(err_text, "unsafe name");
    script_end(&s, "check, picture elsewhere");
}

int main(void) {
    if (!mkdtemp(root))
        return 1;
    test_get_resumes();
    test_get_distrusts();
    test_submit();
    test_submit_resumed();
    test_submit_faults();
    test_check();
    file_remove_tree(root, NULL);
    return check_result();
}
