/* source_view.h -- one view of the demo room, written as each tool has it, must be read as the pose that
 * transforms.json of the room has. The texts of the tests were computed from that pose by the formulas that the tools
 * document (named in the readers), apart from this program. */
#ifndef UNBAKE_TESTS_UNIT_SOURCE_VIEW_H
#define UNBAKE_TESTS_UNIT_SOURCE_VIEW_H

#include "tests/unit/source_rig.h"

/* The pose in question with our camera axes: the columns of transforms.json's y and z turned around. */
static const double wanted[3][4] = {
    {0.37578195333480835, 0.030915768817067146, -0.9261922240257263, 4.270786285400391},
    {0.0, -0.9994432926177979, -0.03336084634065628, 1.7705957889556885},
    {-0.9267081618309021, 0.012536403723061085, -0.37557274103164673, 3.1797852516174316}};

static struct source_rig rig;

static inline void put(const char *name, const char *text) { source_rig_put(&rig, name, text); }

/* Reads what was put and checks frame `number`: its pose, its photograph, and that so many frames are there. */
static inline const struct frame *check(size_t number, size_t count, const char *photograph) {
    CHECK(source_rig_read(&rig));
    CHECK_STRING(rig.problems, "[]");
    CHECK_THAT(rig.t.frame_count == count, "%s: %zu frames", rig.name, rig.t.frame_count);
    if (rig.t.frame_count <= number)
        exit(1);
    const struct frame *frame = &rig.t.frame[number];
    CHECK_STRING(frame->file, photograph);
    for (int i = 0; i < 3; i++) {
        for (int j = 0; j < 3; j++)
            CHECK_NEAR(frame->world_from_camera.rotation[i][j], wanted[i][j], 1e-7);
        CHECK_NEAR(frame->world_from_camera.translation[i], wanted[i][3], 2e-6);
    }
    return frame;
}

static inline void check_lens(const struct lens *lens, double fx, double cx, double cy, double k1, double p1,
                              double p2) {
    CHECK_NEAR(lens->fl_x, fx, 1e-9);
    CHECK_NEAR(lens->cx, cx, 1e-9);
    CHECK_NEAR(lens->cy, cy, 1e-9);
    CHECK_NEAR(lens->k[0], k1, 1e-12);
    CHECK_NEAR(lens->p[0], p1, 1e-12);
    CHECK_NEAR(lens->p[1], p2, 1e-12);
}

#endif
