/* edge_light.h: a plane that a dim sky lights from the front and a bright one from behind. Around its edges half of
 * either arrives, which counts within reach of them, on a scan; reflection.h: what is as bright there is no lamp
 * then. */
#include "server/light/decision/edge_light.h"
#include "server/light/decision/reflection.h"
#include "server/scene/latlong.h"
#include "server/state/evidence.h"
#include "tests/unit/plane_rig.h"

#define FRONT 1.0f /* radiance of the sky before the plane, and behind it */
#define BEHIND 9.0f
#define SHOWN 4.0f
#define SKY_WIDTH 64
#define SKY_HEIGHT 32

static void make_sky(struct image *sky) {
    image_init_rgb(sky, SKY_WIDTH, SKY_HEIGHT);
    for (uint32_t i = 0; i < SKY_WIDTH * SKY_HEIGHT; i++)
        for (size_t c = 0; c < 3; c++) {
            vec3 towards = latlong_pixel(SKY_WIDTH, SKY_HEIGHT, i % SKY_WIDTH, i / SKY_WIDTH);
            sky->pixel[3 * i + c] = towards.z > 0.0f ? FRONT : BEHIND;
        }
}

static void fill_column(uint32_t texel[PLANE_SIDE], uint32_t column) {
    for (uint32_t y = 0; y < PLANE_SIDE; y++)
        texel[y] = y * PLANE_SIDE + column;
}

/* Of a column of texels, on a scan of such noise. */
static float ratio(struct plane_rig *rig, struct divide *divide, uint32_t column, float noise_m) {
    uint32_t texel[PLANE_SIDE];
    fill_column(texel, column);
    rig->r.mesh_noise_m = noise_m;
    return edge_light(&rig->r, divide, texel, PLANE_SIDE, 0);
}

/* Whether the column would count as a lamp if it were SHOWN times as bright as white Lambertian paint. */
static bool emits(struct plane_rig *rig, struct divide *divide, uint32_t column, float noise_m) {
    uint32_t texel[PLANE_SIDE];
    fill_column(texel, column);
    rig->r.mesh_noise_m = noise_m;
    evidence_set_radiance(&rig->r.evidence[0], rgb_gray(SHOWN * FRONT));
    evidence_set_lambert(&rig->r.evidence[0], rgb_gray(FRONT));
    reflection_find(&rig->r, divide, 0, texel, PLANE_SIDE, 0);
    return reflection_is_unlikely(&rig->r.evidence[0]);
}

int main(void) {
    struct plane_rig rig;
    struct image sky;
    rgb shown = rgb_gray(0.5f);
    make_sky(&sky);
    plane_rig_init(&rig, 1, 1);
    world_set_environment(&rig.r.world, &sky, rig.pool);
    plane_rig_add(&rig, (vec3){0, 0, 9}, (vec3){0, 0, 0}, 0.7f, plane_paint_one, &shown);
    plane_rig_look(&rig, 0.02f);
    uint16_t(*sent)[3] = mem_calloc(PLANE_TEXELS, sizeof *sent);
    struct light_field field = {&rig.r.world, (const uint16_t(*)[3])sent, NULL, NULL};
    struct probes probes;
    probes_init(&probes, 8, &rig.scene.mesh, &rig.r.atlas, &rig.r.inverse, &rig.r.fused);
    for (size_t i = 0; i < probes.count; i++)
        irradiance_add(&probes.probe[i].light, (vec3){0, 0, 1}, (vec3){0, 0, 1}, rgb_gray((float)PI * FRONT));
    static const struct sun_shadows no_shadows;
    struct divide divide = inputs_of_divide(&rig.r, &rig.views, &probes, &field, &no_shadows);
    divide.scratch = mem_alloc(sizeof *divide.scratch);

    float beside = ratio(&rig, &divide, 1, 0.02f); /* .47 m from the edge; reach .6 m */
    printf("beside the edge %.2f\n", (double)beside);
    CHECK_NEAR(beside, 0.5 * (FRONT + BEHIND) / FRONT, 0.5);
    CHECK_NEAR(ratio(&rig, &divide, PLANE_SIDE / 2, 0.02f), 1.0, 1e-6);
    CHECK_NEAR(ratio(&rig, &divide, 1, 0.01f), 1.0, 1e-6); /* reach .3 m */
    CHECK_NEAR(ratio(&rig, &divide, 1, 0.0f), 1.0, 1e-6);
    CHECK(!emits(&rig, &divide, 1, 0.02f));
    CHECK(emits(&rig, &divide, PLANE_SIDE / 2, 0.02f));
    CHECK(emits(&rig, &divide, 1, 0.0f));

    mem_free(divide.scratch);
    mem_free(sent);
    probes_release(&probes);
    plane_rig_release(&rig);
    image_release(&sky);
    return check_result();
}
