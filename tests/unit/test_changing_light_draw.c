/* changing_light.h: of many photographs that show a place lit, a few are asked whether it may be a highlight. They are
 * drawn from all: where the first ones of a film mirror a light and the later ones do not, the place is found to
 * change. */
#include "server/light/decision/changing_light.h"
#include "server/scene/latlong.h"
#include "tests/unit/plane_rig.h"

#define MIRRORS 4 /* photographs, the first ones */
#define BLACKS 4
#define PHOTOGRAPHS 24
#define WHITE 1.0f /* what white paint would show */
#define SKY_RADIANCE 20.0f
#define DISC_COSINE 0.95f
#define TEXELS_A_SIDE 10

static vec3 to_disc(void) { return vec3_normalize((vec3){0.8f, 0.0f, 1.0f}); }

static void make_sky(struct image *sky) {
    image_init_rgb(sky, 64, 32);
    for (uint32_t i = 0; i < 64 * 32; i++)
        for (size_t c = 0; c < 3; c++)
            if (vec3_dot(latlong_pixel(64, 32, i % 64, i / 64), to_disc()) > DISC_COSINE)
                sky->pixel[3 * i + c] = SKY_RADIANCE;
}

/* The share of places that changed, if so many of the photographs that show them lit are where they mirror the disc. */
static float changes(const struct image *sky, int mirrors) {
    struct plane_rig rig;
    struct probes probes;
    rgb lit = rgb_gray(0.8f * WHITE), black = rgb_gray(0.05f * WHITE);
    plane_rig_init(&rig, PHOTOGRAPHS, 1);
    struct reconstruction *r = &rig.r;
    world_set_environment(&r->world, sky, rig.pool);
    for (int i = 0; i < PHOTOGRAPHS; i++) {
        vec3 d = to_disc(), from = {i < mirrors ? -d.x * 8.0f : 1.0f, 0.3f * (float)(i % 4), 8.0f * d.z};
        plane_rig_add(&rig, from, (vec3){0.1f, 0.1f, 0.0f}, 0.45f, plane_paint_one,
                      i >= PHOTOGRAPHS - BLACKS ? &black : &lit);
    }
    plane_rig_look(&rig, 0.02f);
    probes_init(&probes, 8, &rig.scene.mesh, &r->atlas, &r->inverse, &r->fused);
    for (size_t i = 0; i < probes.count; i++)
        irradiance_add(&probes.probe[i].light, (vec3){0, 0, 1}, (vec3){0, 0, 1}, rgb_gray((float)PI * WHITE));
    uint16_t(*sent)[3] = mem_calloc(PLANE_TEXELS, sizeof *sent);
    struct light_field field = {&r->world, (const uint16_t(*)[3])sent, NULL, NULL};
    struct incident *scratch = mem_alloc(sizeof *scratch);
    static const struct sun_shadows no_shadows;
    struct divide divide = inputs_of_divide(r, &rig.views, &probes, &field, &no_shadows);
    divide.scratch = scratch;
    uint32_t texel[TEXELS_A_SIDE * TEXELS_A_SIDE];
    for (uint32_t i = 0; i < TEXELS_A_SIDE * TEXELS_A_SIDE; i++)
        texel[i] = PLANE_MIDDLE + i % TEXELS_A_SIDE - TEXELS_A_SIDE / 2 + PLANE_SIDE * (i / TEXELS_A_SIDE) -
                   PLANE_SIDE * (TEXELS_A_SIDE / 2);
    float share = changing_light(&divide, texel, TEXELS_A_SIDE * TEXELS_A_SIDE, 0);
    mem_free(scratch);
    mem_free(sent);
    probes_release(&probes);
    plane_rig_release(&rig);
    return share;
}

int main(void) {
    struct image sky;
    make_sky(&sky);
    float first = changes(&sky, MIRRORS), all = changes(&sky, PHOTOGRAPHS - BLACKS), none = changes(&sky, 0);
    printf("changed where the first photographs mirror: %.2f, all: %.2f, none: %.2f\n", (double)first, (double)all,
           (double)none);
    CHECK(all == 0.0f && none == 1.0f);
    CHECK(first > 0.9f);
    image_release(&sky);
    return check_result();
}
