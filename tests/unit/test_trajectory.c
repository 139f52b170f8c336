/* Poses as text: NICE-SLAM's Replica and ScanNet. */
#include "server/ingest/trajectory.h"

#include <fcntl.h>
#include <sys/stat.h>

#include "common/file.h"
#include "common/mem.h"
#include "tests/check.h"

#define POSE "1 0 0 0.5  0 0 -1 1.5  0 1 0 -2.5  0 0 0 1"
#define LOST "-inf -inf -inf -inf -inf -inf -inf -inf -inf -inf -inf -inf -inf -inf -inf -inf"

static char dir[64]; /* in memory where possible: there are many files */

static void put(const char *name, const char *text) {
    char *path = file_join(dir, name);
    CHECK(file_replace(path, text, strlen(text), NULL) == STATUS_OK);
    mem_free(path);
}

static void drop(const char *name) {
    char *path = file_join(dir, name);
    CHECK(file_remove_tree(path, NULL) == STATUS_OK);
    mem_free(path);
}

static void make_folder(const char *name) {
    char *path = file_join(dir, name);
    CHECK(file_make_dirs(path, NULL) == STATUS_OK);
    mem_free(path);
}

/* Reads the folder; what was found wrong as text, the caller's. */
static char *read_it(struct transforms *t, size_t *warning_count) {
    struct error err;
    struct findings f = {.problems = cJSON_CreateArray()};
    const char *found = trajectory_find(dir);
    CHECK(found && trajectory_read(dir, found, t, &f, &err) == STATUS_OK);
    char *text = json_text(f.problems);
    *warning_count = f.warning_count;
    CHECK(!strstr(text, dir));
    cJSON_Delete(f.problems);
    findings_release(&f);
    return text;
}

static void refused(const char *part) {
    struct transforms t;
    size_t warnings;
    char *text = read_it(&t, &warnings);
    CHECK_THAT(strstr(text, part) != NULL, "%s", text);
    transforms_release(&t);
    mem_free(text);
}

static void check_pose(const struct transforms_frame *frame) {
    const double *at = frame->world_from_camera.translation;
    CHECK(at[0] == 0.5 && at[1] == 1.5 && at[2] == -2.5);
    CHECK_NEAR(frame->world_from_camera.rotation[1][2], -1.0, 1e-6);
    CHECK(frame->exposure_source == EXPOSURE_UNKNOWN && !frame->is_test && !frame->mask);
}

static void test_replica(void) {
    struct transforms t;
    size_t warnings;
    CHECK(trajectory_find(dir) == NULL);
    put("traj.txt", POSE "\n\n" LOST "\r\n" POSE);
    CHECK(trajectory_find(dir) == NULL);
    put("cam_params.json",
        "{\"camera\":{\"w\":1200,\"h\":680,\"fx\":600,\"fy\":601,\"cx\":599.5,\"cy\":339.5,\"scale\":6553.5}}");
    char *text = read_it(&t, &warnings);
    CHECK_STRING(text, "[]");
    CHECK(t.frame_count == 2 && t.named_count == 3 && warnings == 1);
    if (t.frame_count == 2) {
        CHECK_STRING(t.frame[0].file, "results/frame000000");
        CHECK_STRING(t.frame[1].file, "results/frame000002");
        check_pose(&t.frame[1]);
        CHECK(t.frame[1].number == 2 && t.frame[1].lens.cx == 600.0 && t.frame[1].lens.cy == 340.0);
        CHECK(t.frame[1].lens.fl_y == 601.0 && t.frame[1].lens.width == 1200.0);
    }
    transforms_release(&t);
    mem_free(text);
    put("traj.txt", POSE "\n" POSE " 1\n");
    refused("traj.txt, line 2: expected the 16 numbers");
    put("traj.txt", POSE "\n1 2 3\n");
    refused("line 2");
    put("traj.txt", "1 0 0 0 0 0 0 0 0 0 1 0 0 0 0 1\n");
    refused("line 1: ");
    struct buf many;
    buf_init(&many, 1 << 22);
    for (int i = 0; i <= TRANSFORMS_MAX_FRAMES; i++)
        buf_puts(&many, POSE "\n");
    put("traj.txt", buf_text(&many));
    refused("\"traj.txt\",\"reason\":\"has more than 20000 poses\"");
    buf_release(&many);
    put("cam_params.json", "{\"camera\":{\"w\":1200,\"h\":680,\"fx\":600,\"cx\":599.5,\"cy\":339.5}}");
    refused("no fy");
    put("cam_params.json", "{\"camera\":{\"w\":\"wide\"}}");
    refused("\\\"w\\\"");
    put("cam_params.json", "nothing");
    refused("cam_params.json");
    drop("traj.txt");
}

static void test_scannet(void) {
    struct transforms t;
    size_t warnings;
    make_folder("pose");
    make_folder("intrinsic");
    put("intrinsic/intrinsic_color.txt", "1170 0 647.5 0\n0 1171 483.5 0\n0 0 1 0\n0 0 0 1\n");
    put("pose/10.txt", POSE);
    put("pose/2.txt", POSE "\n");
    put("pose/7.txt", LOST);
    put("pose/notes.txt", "no pose");
    char *text = read_it(&t, &warnings);
    CHECK_STRING(text, "[]");
    CHECK(t.frame_count == 2 && warnings == 1);
    if (t.frame_count == 2) {
        CHECK_STRING(t.frame[0].file, "color/2");
        CHECK_STRING(t.frame[1].file, "color/10");
        check_pose(&t.frame[0]);
        CHECK(t.frame[0].lens.fl_x == 1170.0 && t.frame[0].lens.cx == 648.0 && isnan(t.frame[0].lens.width));
    }
    transforms_release(&t);
    mem_free(text);
    put("pose/3.txt", "1 2");
    refused("\"pose/3.txt\",\"reason\":\"expected the 16 numbers");
    put("pose/3.txt", "2 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1");
    refused("pose/3.txt");
    char *large = mem_calloc(65538, 1);
    memset(large, ' ', 65537);
    put("pose/3.txt", large);
    refused("\"pose/3.txt\",\"reason\":\"is larger than 65536 bytes\"");
    mem_free(large);
    put("pose/007.txt", POSE); /* no name of ScanNet's */
    put("pose/3.txt", LOST);
    text = read_it(&t, &warnings);
    CHECK_STRING(text, "[]");
    CHECK(t.frame_count == 2);
    transforms_release(&t);
    mem_free(text);
    for (int i = 0; i <= TRANSFORMS_MAX_FRAMES; i++) {
        char *path = mem_printf("%s/pose/%d.txt", dir, i);
        int fd = open(path, O_WRONLY | O_CREAT, 0600);
        CHECK(fd >= 0);
        close(fd);
        mem_free(path);
    }
    refused("\"pose\",\"reason\":\"has more than 20000 poses\"");
    put("intrinsic/intrinsic_color.txt", "");
    refused("intrinsic/intrinsic_color.txt");
}

int main(void) {
    snprintf(dir, sizeof dir, "%s/unbake-trajectory-XXXXXX", check_fast_dir());
    CHECK(mkdtemp(dir) != NULL);
    test_replica();
    test_scannet();
    CHECK(file_remove_tree(dir, NULL) == STATUS_OK);
    return check_result();
}
