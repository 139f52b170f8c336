/* formats_rig.h -- the demo room as an export of one view, for tests of the files that are made of it. */
#ifndef UNBAKE_TESTS_UNIT_FORMATS_RIG_H
#define UNBAKE_TESTS_UNIT_FORMATS_RIG_H

#include "common/file.h"
#include "common/image.h"
#include "common/mem.h"
#include "server/demo/room.h"
#include "server/export/formats.h"
#include "tests/check.h"

struct formats_rig {
    char dir[64]; /* in memory where possible; holds base_color.png */
    struct parallel *pool;
    struct room room;
    struct parts parts;
    struct camera camera;
    struct export_comparison comparison;
    struct export_input in; /* all of the above; y is up */
};

static inline void formats_rig_open(struct formats_rig *r) {
    struct error err;
    struct image picture;
    *r = (struct formats_rig){.pool = parallel_new(1)};
    snprintf(r->dir, sizeof r->dir, "%s/unbake-formats-XXXXXX", check_fast_dir());
    if (!mkdtemp(r->dir))
        exit(1);
    CHECK(room_init(&r->room, &(struct room_look){256, 15.0f, 15.0f, ROOM_LAMPS_FRAMED}, r->pool, &err) == STATUS_OK);
    r->room.materials.specular[ROOM_FLOOR] = 0.0f;
    image_init_rgb(&picture, 5, 3); /* odd, for the padding */
    char *png = file_join(r->dir, FORMATS_BASE_COLOR);
    CHECK(image_write_png(png, &picture, 1.0f, &err) == STATUS_OK);
    mem_free(png);
    image_release(&picture);
    r->camera = (struct camera){.width = 16, .height = 12, .fx = 20.0f, .fy = 21.0f, .cx = 8.0f, .cy = 6.0f};
    r->camera.world_from_camera = (struct rigid){{{0, 0, 1}, {1, 0, 0}, {0, 1, 0}}, {1.0f, 2.0f, 3.0f}};
    r->comparison = (struct export_comparison){"images/003.exr", NULL, NULL, &r->camera};
    r->in = (struct export_input){.title = "room",
                                  .mesh = &r->room.mesh,
                                  .segments = &r->room.segments,
                                  .atlas = &r->room.atlas,
                                  .materials = &r->room.materials,
                                  .up = {0.0f, 1.0f, 0.0f},
                                  .comparison_count = 1,
                                  .comparison = &r->comparison};
    CHECK(parts_make(&r->parts, &r->room.mesh, &r->room.segments, &r->room.atlas, &err) == STATUS_OK);
    CHECK(r->parts.count == ROOM_OBJECT_COUNT);
}

static inline void formats_rig_close(struct formats_rig *r) {
    parts_release(&r->parts);
    room_release(&r->room);
    CHECK(file_remove_tree(r->dir, NULL) == STATUS_OK);
    parallel_free(r->pool);
}

#endif
