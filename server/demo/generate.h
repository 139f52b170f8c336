/* generate.h -- photographs the demo room: a bundle as a user would upload it, and its truth.
 *
 * DIR/transforms.json    nerfstudio's conventions, `split` train or test
 * DIR/mesh.ply           positions, normals, per-face object_id
 * DIR/images/NNN.exr     half R G B, linear radiance; or, as ordinary photographs,
 * DIR/images/NNN.png     8-bit sRGB, `exposure` cycling over three values, clipped at 1
 * DIR/truth/objects.json per object: name, roughness, specular, emission, mean base colour
 * DIR/truth/NNN.exr      per test view: base_color.R G B, roughness, specular, emission.R G B,
 *                        object_id, depth */
#ifndef UNBAKE_DEMO_GENERATE_H
#define UNBAKE_DEMO_GENERATE_H

#include <stdbool.h>
#include <stdint.h>

#include "common/error.h"
#include "common/parallel.h"
#include "server/demo/room.h"

struct demo_settings {
    uint32_t width, height; /* pixels of a photograph */
    uint32_t train_count, test_count;
    uint32_t spp, test_spp; /* paths per pixel */
    uint32_t max_depth;     /* segments of a path */
    float wall_radiance, ceiling_radiance;
    bool sdr;
    enum room_lamps lamps;
    uint64_t seed;
    uint32_t texture_size; /* texels, of the room's own textures */
};

struct demo_settings demo_default_settings(void);

/* Creates the folder if needed. `progress` (may be NULL) is called after each view. */
enum status demo_generate(const char *dir, const struct demo_settings *settings, struct parallel *pool,
                          void (*progress)(void *user, uint32_t done, uint32_t total), void *user, struct error *err);

#endif
