/* environment.h: of photographs that look out and agree each weighs by its exposure; one that saturates bounds what it
 * shows; a direction of the map is the one in which they look. */
#include "server/capture/distant/environment_gather.h"
#include "server/scene/latlong.h"
#include "tests/unit/plane_rig.h"

#define PHOTOGRAPHS 8
#define LONG_SHOWS 1.0f
#define SHORT_SHOWS 1.04f /* no outlier */
#define SHORT 0.125f      /* exposure, of the others 1 */

/* Brighter to the right of x = 0, and in the upper half, by whole factors. */
static float times(vec3 d) { return (d.x > 0.0f ? 2.0f : 1.0f) * (d.y > 0.0f ? 4.0f : 1.0f); }

/* All look along +z, away from the plane. */
static void photograph_sky(struct plane_rig *rig, float short_clip) {
    rgb black = {0.0f, 0.0f, 0.0f};
    plane_rig_init(rig, PHOTOGRAPHS, 1);
    for (int i = 0; i < PHOTOGRAPHS; i++) {
        vec3 from = {0.1f * (float)i, 0.0f, 1.0f}, d = {0.0f, 0.0f, 1.0f};
        bool is_short = i % 2 == 1;
        struct photograph *photo =
            plane_rig_add(rig, from, vec3_add(from, (vec3){0.0f, 0.0f, 1.0f}), 0.1f, plane_paint_one, &black);
        photo->exposure = is_short ? SHORT : 1.0f;
        if (is_short && short_clip > 0.0f)
            photo->is_hdr = false, photo->clip = short_clip;
        for (size_t k = 0; k < PLANE_PIXELS * PLANE_PIXELS; k++) {
            CHECK(camera_direction(&photo->camera, (float)(k % PLANE_PIXELS) + 0.5f, (float)(k / PLANE_PIXELS) + 0.5f,
                                   &d));
            float value = times(d) * (is_short ? SHORT * SHORT_SHOWS : LONG_SHOWS);
            for (size_t c = 0; c < 3; c++)
                photo->pixel[k][c] =
                    image_half_from_float(short_clip > 0.0f && is_short ? fminf(value, short_clip) : value);
        }
    }
    plane_rig_look(rig, 0.02f);
}

static float shown(const struct environment *e, vec3 d) {
    return e->map.pixel[3 * environment_cell(e, vec3_normalize(d)) + 1];
}

static void check_map(float short_clip, float wanted) {
    struct plane_rig rig;
    struct environment e;
    photograph_sky(&rig, short_clip);
    CHECK(environment_gather(&e, &rig.views, 0.0f, rig.pool));
    for (int k = 0; k < 4; k++) {
        vec3 d = {k & 1 ? 0.4f : -0.4f, k & 2 ? 0.4f : -0.4f, 1.0f};
        CHECK(environment_is_measured(&e, vec3_normalize(d)));
        CHECK_THAT(fabsf(shown(&e, d) / (wanted * times(d)) - 1.0f) < 2e-3f, "%g %g: %g", (double)d.x, (double)d.y,
                   (double)shown(&e, d));
    }
    CHECK(!environment_is_seen(&e, (vec3){0.0f, 0.0f, -1.0f}) && !environment_is_seen(&e, (vec3){0.0f, 1.0f, 0.0f}));
    /* Cells whose middles are within the picture. */
    double cells = 0.0, wide = atan(0.8);
    for (uint32_t y = 0; y < e.map.height; y++)
        for (uint32_t x = 0; x < e.map.width; x++)
            if (e.confidence.pixel[2 * (y * e.map.width + x)] > 0.0f)
                cells += latlong_pixel_angle(e.map.width, e.map.height, y);
    double exact = 4.0 * asin(sin(wide) * sin(wide)); /* of a square pyramid */
    CHECK_NEAR(e.seen_share * 4.0 * PI, cells, 1e-6);
    CHECK_NEAR(cells / exact, 1.0, 0.15);
    environment_release(&e);
    plane_rig_release(&rig);
}

int main(void) {
    check_map(0.0f, (LONG_SHOWS + SHORT * SHORT_SHOWS) / (1.0f + SHORT));
    check_map(0.0625f, LONG_SHOWS); /* the short ones saturate at .5: bounds that are below what the others tell */
    return check_result();
}
