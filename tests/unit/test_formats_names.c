/* test_formats_names.c -- names of the input in the files of an export, with the segment's number. */
#include "common/buf.h"
#include "common/utf8.h"
#include "tests/unit/formats_rig.h"

/* Labels have the characters of a name that are safe in all formats, and bounded length. Changes name[1] for a
 * while. */
static void check_labels(const struct segments *named, struct segments *automatic, const struct mesh *room,
                         char *name[3]) {
    char label[PARTS_LABEL_BYTES];
    CHECK(named->id[0] == 0 && named->id[1] == 1);
    parts_label(named, room, 2, label);
    CHECK_STRING(label, "segment_2_\xe5\xa2\x99");
    name[1] = "a\xff" /* no UTF-8 */ "b\xe2\x80\x8f\xe2\x80\xa8"
              "c";
    parts_label(named, room, 1, label);
    CHECK_STRING(label, "segment_1_a_b_c");
    char longest[61 + 3 * 32] = {0};
    memset(longest, 'x', 60);
    for (int i = 0; i < 12; i++)
        memcpy(longest + 60 + 3 * i, "\xe5\xa2\x99", 3);
    name[1] = longest;
    parts_label(named, room, 1, label);
    CHECK_THAT(utf8_valid(label, strlen(label), NULL) && strlen(label) > PARTS_LABEL_BYTES - 5, "%s", label);
    name[1] = "";
    CHECK(segments_name(named, room, 1) == NULL && segments_name(automatic, room, 0) == NULL);
    automatic->name = (char *[]){"wall (2)"};
    automatic->name_count = 1;
    parts_label(automatic, room, 0, label);
    CHECK_STRING(label, "segment_0_wall_2");
    parts_label(automatic, room, 1, label);
    CHECK_STRING(label, "segment_1");
}

/* Names of the input go into every file, with the segment's number. */
static void test_named(const char *dir, struct export_input *in, struct mesh *room, const struct parts *parts) {
    static const struct {
        const char *file, *text;
    } table[] = {
        {"scene.obj", "\no segment_0_wall_north-side_1\nusemtl segment_0_wall_north-side_1\n"},
        {"scene.obj", "\no segment_1\n"},
        {"scene.mtl", "newmtl segment_0_wall_north-side_1\n"},
        {"scene.xml", "<shape type=\"serialized\" id=\"segment_0_wall_north-side_1\">"},
        {"scene.obj", "\no segment_2_\xe5\xa2\x99\n"},
        {"scene.usda", "displayName = \"wall/north-side 1\"\n        )\n        {\n            uniform token sub"},
        {"scene.usda", "displayName = \"wall/north-side 1\"\n        )\n        {\n            token outputs:surface"},
        {"scene.usda", "def Mesh \"segment_2\" ("},
        {"scene.glb", "\"name\":\"\xe5\xa2\x99\""},
        {"scene.glb", "\"name\":\"wall/north-side 1\""},
        {"scene.glb", "\"name\":\"segment 1\""},
        {"scene.glb", "\"extras\":{\"segment\":0,\"object_id\":0}"},
    };
    char *name[] = {"wall/north-side 1", "", "\xe5\xa2\x99"};
    struct segments named = *in->segments, *before = (struct segments *)in->segments;
    room->name = name;
    room->name_count = 3;
    struct segments automatic = named;
    automatic.is_given = false;
    named.is_given = true;
    in->segments = &named;
    check_labels(&named, &automatic, room, name);
    for (size_t i = 0; i < sizeof table / sizeof *table; i++) {
        struct error err = {.message = ""};
        struct buf file;
        char *path = file_join(dir, table[i].file);
        for (size_t f = 0; f < FORMATS_COUNT; f++)
            CHECK(strcmp(formats[f].name, table[i].file) != 0 || formats[f].write(dir, in, parts, &err) == STATUS_OK);
        buf_init(&file, 1 << 26);
        CHECK(file_read(path, &file, &err) == STATUS_OK);
        CHECK_THAT(memmem(file.data, file.length, table[i].text, strlen(table[i].text)), "%s: %s", table[i].file,
                   table[i].text);
        buf_release(&file);
        mem_free(path);
    }
    in->segments = before;
    room->name = NULL;
    room->name_count = 0;
}

int main(void) {
    struct formats_rig r;
    formats_rig_open(&r);
    test_named(r.dir, &r.in, &r.room.mesh, &r.parts);
    formats_rig_close(&r);
    return check_result();
}
