/* relight_rig.h -- renders of a small lit room from its middle. */
#ifndef UNBAKE_TESTS_RENDER_RELIGHT_RIG_H
#define UNBAKE_TESTS_RENDER_RELIGHT_RIG_H

#include "common/file.h"
#include "tests/check.h"
#include "tests/relit_room.h"

/* Looks from the middle along -z; y is up. */
#define CENTRE_VIEW                                                                                                    \
    "{\"w\":16,\"h\":16,\"fl_x\":10,\"fl_y\":10,\"cx\":8,\"cy\":8,\"frames\":[{"                                       \
    "\"file_path\":\"a\","                                                                                             \
    "\"transform_matrix\":[[1,0,0,0.2],[0,1,0,0.1],[0,0,1,0.3],[0,0,0,1]]}]}"

static struct parallel *pool;

static inline void picture(const char *dir, const char *settings, struct image *image) {
    struct error err = {.message = ""};
    CHECK_THAT(relit_picture(dir, settings, pool, image, &err) == STATUS_OK, "%s: %s", settings, err.message);
    if (!image->pixel)
        image_init_rgb(image, 1, 1);
}

/* A room of coloured walls with two lamps: its ceiling, and a wall. */
static inline char *lit_room(const char *views) {
    struct relit_quad walls[6];
    relit_cube(walls, rgb_make(0.6f, 0.5f, 0.4f), rgb_gray(0.0f));
    walls[1].emission = rgb_make(1.0f, 1.0f, 0.5f);
    walls[2].emission = rgb_make(0.0f, 0.2f, 0.5f);
    return relit_outputs(walls, 6, views);
}

#endif
