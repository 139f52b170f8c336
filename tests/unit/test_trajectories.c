/* Poses as text: NICE-SLAM's Replica and ScanNet. */
#include "common/buf.h"
#include "tests/unit/source_rig.h"

#define POSE "1 0 0 0.5  0 0 -1 1.5  0 1 0 -2.5  0 0 0 1"
#define LOST "-inf -inf -inf -inf -inf -inf -inf -inf -inf -inf -inf -inf -inf -inf -inf -inf"

static struct source_rig rig;

static void put(const char *name, const char *text) { source_rig_put(&rig, name, text); }
static void refused(const char *part) { source_rig_refused(&rig, part); }

static void check_pose(const struct frame *frame) {
    const double *at = frame->world_from_camera.translation;
    CHECK(at[0] == 0.5 && at[1] == 1.5 && at[2] == -2.5);
    CHECK_NEAR(frame->world_from_camera.rotation[1][2], -1.0, 1e-6);
    CHECK(frame->exposure_source == EXPOSURE_UNKNOWN && !frame->is_test && !frame->mask);
}

static void test_replica(void) {
    const struct frames *t = &rig.t;
    source_rig_start(&rig, "NICE-SLAM's Replica");
    CHECK(!source_rig_read(&rig));
    put("traj.txt", POSE "\n\n" LOST "\r\n" POSE);
    CHECK(!source_rig_read(&rig));
    put("results/frame000002.jpg", "");
    put("results/depth000000.png", "");
    put("cam_params.json",
        "{\"camera\":{\"w\":1200,\"h\":680,\"fx\":600,\"fy\":601,\"cx\":599.5,\"cy\":339.5,\"scale\":6553.5}}");
    CHECK(source_rig_read(&rig));
    CHECK_STRING(rig.problems, "[]");
    CHECK(t->frame_count == 2 && t->named_count == 3 && rig.findings.warning_count == 1);
    if (t->frame_count == 2) {
        CHECK_STRING(t->frame[0].file, "results/frame000000");
        CHECK_STRING(t->frame[1].file, "results/frame000002.jpg");
        check_pose(&t->frame[1]);
        CHECK(t->frame[1].number == 2 && t->frame[1].lens.cx == 600.0 && t->frame[1].lens.cy == 340.0);
        CHECK(t->frame[1].lens.fl_y == 601.0 && t->frame[1].lens.width == 1200.0);
    }
    put("traj.txt", POSE "\n" POSE " 1\n");
    refused("traj.txt, line 2: expected the 16 numbers");
    put("traj.txt", POSE "\n1 2 3\n");
    refused("line 2");
    put("traj.txt", "1 0 0 0 0 0 0 0 0 0 1 0 0 0 0 1\n");
    refused("line 1: ");
    struct buf many;
    buf_init(&many, 1 << 22);
    for (int i = 0; i <= FRAMES_MAX; i++)
        buf_puts(&many, POSE "\n");
    put("traj.txt", buf_text(&many));
    refused("\"traj.txt\",\"reason\":\"has more than 20000 frames\"");
    buf_release(&many);
    put("cam_params.json", "{\"camera\":{\"w\":1200,\"h\":680,\"fx\":600,\"cx\":599.5,\"cy\":339.5}}");
    refused("no fy");
    put("cam_params.json", "{\"camera\":{\"w\":\"wide\"}}");
    refused("\\\"w\\\"");
    put("cam_params.json", "nothing");
    refused("cam_params.json");
    source_rig_stop(&rig);
}

static void test_scannet(void) {
    const struct frames *t = &rig.t;
    source_rig_start(&rig, "ScanNet");
    put("intrinsic/intrinsic_color.txt", "1170 0 647.5 0\n0 1171 483.5 0\n0 0 1 0\n0 0 0 1\n");
    put("pose/10.txt", POSE);
    put("pose/2.txt", POSE "\n");
    put("pose/7.txt", LOST);
    put("pose/notes.txt", "no pose");
    CHECK(source_rig_read(&rig));
    CHECK_STRING(rig.problems, "[]");
    CHECK(t->frame_count == 2 && rig.findings.warning_count == 1);
    if (t->frame_count == 2) {
        CHECK_STRING(t->frame[0].file, "color/2");
        CHECK_STRING(t->frame[1].file, "color/10");
        check_pose(&t->frame[0]);
        CHECK(t->frame[0].lens.fl_x == 1170.0 && t->frame[0].lens.cx == 648.0 && isnan(t->frame[0].lens.width));
    }
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
    CHECK(source_rig_read(&rig));
    CHECK_STRING(rig.problems, "[]");
    CHECK(t->frame_count == 2);
    put("intrinsic/intrinsic_color.txt", "");
    refused("intrinsic/intrinsic_color.txt");
    source_rig_stop(&rig);
}

int main(void) {
    test_replica();
    test_scannet();
    return check_result();
}
