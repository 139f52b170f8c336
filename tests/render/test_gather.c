/* Light gathered at a point (incident.h, highlight.h) against the path tracer, which is itself held
 * against an independent renderer: what a white diffuse surface and what the specular lobes send to
 * a viewer, under a lamp and walls that send out a given light, or mirror it. Fixed seeds; the bounds are several
 * standard errors of both sides. */
#include "server/gather/highlight.h"
#include "server/gather/incident.h"
#include "server/gather/irradiance.h"
#include "server/render/bsdf.h"
#include "server/render/path.h"
#include "server/render/sampler.h"
#include "tests/check.h"
#include "tests/render/small_room.h"

#define PATHS 32768
#define GATHERED 32768

struct fixture {
    struct mesh mesh;
    struct segments segments;
    struct atlas atlas;
    struct inverse_uv inverse;
    struct materials materials;
    struct world world;
    struct parallel *pool;
    uint16_t (*radiance)[3]; /* of the walls, as measured */
    struct surface_point at; /* on the floor */
};

/* Of f->mesh. */
static void fixture_init(struct fixture *f) {
    struct error err = {0};
    f->pool = parallel_new(0);
    segments_from_object_id(&f->segments, &f->mesh);
    CHECK(atlas_make(&f->atlas, &f->mesh, &f->segments, 128, 0.0f, ATLAS_PADDING, &err) == STATUS_OK);
    inverse_uv_make(&f->inverse, &f->atlas, f->mesh.triangle_count, f->pool);
    materials_init(&f->materials, &f->inverse, OBJECTS, rgb_gray(0.0f), 1.0f, 0.0f);
    f->materials.emission[LAMP] = lamp_radiance;
    CHECK(world_init(&f->world, &f->mesh, &f->segments, &f->atlas, &f->materials, NULL, f->pool, &err) == STATUS_OK);
    f->radiance = mem_calloc((size_t)f->atlas.width * f->atlas.height, sizeof *f->radiance);
    for (size_t i = 0; i < f->inverse.valid_count; i++) {
        uint32_t texel = f->inverse.valid[i];
        struct surface_point p;
        CHECK(surface_at_texel(&f->mesh, &f->atlas, &f->inverse, texel, &p));
        if (p.position.y == 0.0f && p.position.x > 1.0f && p.position.x < 1.3f && p.position.z > 1.0f &&
            p.position.z < 1.3f)
            f->at = p;
    }
    CHECK(f->at.normal.y == 1.0f);
}

static void fixture_release(struct fixture *f) {
    mem_free(f->radiance);
    world_release(&f->world);
    materials_release(&f->materials);
    inverse_uv_release(&f->inverse);
    atlas_release(&f->atlas);
    segments_release(&f->segments);
    mesh_release(&f->mesh);
    parallel_free(f->pool);
}

/* Walls that emit send out what the field says of them: then one bounce is the whole of the light. */
static void light_walls(struct fixture *f) {
    static const rgb wall_radiance[OBJECTS] = {{0, 0, 0},       {0.5f, 0.4f, 0.3f}, {1, 0, 0}, {0, 1, 0.2f},
                                               {0.1f, 0.1f, 2}, {0, 0, 0},          {9, 8, 6}};
    for (int o = 0; o < OBJECTS; o++)
        f->materials.emission[o] = wall_radiance[o];
    world_update_lights(&f->world);
}

/* What the floor at f->at shows to a viewer in direction wo, by paths of one bounce or more. */
static rgb trace_depth(struct fixture *f, vec3 wo, int max_depth) {
    struct path_batch *batch = path_batch_new(1024, max_depth);
    struct path_settings settings = {.max_depth = max_depth, .roulette_depth = 32, .seed = 5};
    rgb sum = {0, 0, 0};
    vec3 eye = vec3_mad(f->at.position, 0.3f, wo);
    for (uint32_t first = 0; first < PATHS; first += 1024) {
        struct ray ray[1024];
        struct path_key key[1024];
        rgb radiance[1024];
        for (uint32_t i = 0; i < 1024; i++) {
            ray[i] = (struct ray){eye, vec3_neg(wo)};
            key[i] = (struct path_key){1, 0, first + i};
        }
        path_batch_trace(batch, &f->world, &settings, 1024, ray, key, radiance);
        for (uint32_t i = 0; i < 1024; i++)
            sum = rgb_mad(sum, 1.0f / PATHS, radiance[i]);
    }
    path_batch_free(batch);
    return rgb_sub(sum, f->materials.emission[0]);
}

static rgb trace(struct fixture *f, vec3 wo) { return trace_depth(f, wo, 2); }

static void check_close(rgb a, rgb b, float relative, const char *what, float parameter) {
    const float *p = &a.r, *q = &b.r;
    for (int c = 0; c < 3; c++)
        CHECK_THAT(fabsf(p[c] - q[c]) < relative * q[c] + 1e-4f, "%s %.3f, channel %d: gathered %.5f, traced %.5f",
                   what, (double)parameter, c, (double)p[c], (double)q[c]);
}

static vec3 viewer(float cosine) {
    float sine = sqrtf(1.0f - cosine * cosine);
    return (vec3){0.6f * sine, cosine, 0.8f * sine};
}

static void set_floor(struct fixture *f, float base, float roughness, float specular) {
    for (size_t i = 0; i < f->inverse.valid_count; i++) {
        float *texel = f->materials.base_color.texel[f->inverse.valid[i]];
        texel[0] = texel[1] = texel[2] = base;
    }
    f->materials.roughness[0] = roughness;
    f->materials.specular[0] = specular;
}

static void test_diffuse(struct fixture *f) {
    struct light_field field = {&f->world, (const uint16_t(*)[3])f->radiance, NULL, NULL};
    struct incident *scratch = mem_alloc(sizeof *scratch);
    struct irradiance light;
    irradiance_gather(&light, scratch, &field, &f->at, sampler_key(1, 2, 3), GATHERED);
    for (float roughness = 0.0f; roughness <= 1.0f; roughness += 0.5f) {
        for (float cosine = 0.15f; cosine < 1.0f; cosine += 0.4f) {
            set_floor(f, 1.0f, roughness, 0.0f);
            rgb gathered = irradiance_diffuse(&light, f->at.shading, roughness, viewer(cosine));
            check_close(gathered, trace(f, viewer(cosine)), 0.01f, "diffuse, roughness", roughness);
        }
    }
    mem_free(scratch);
}

/* The mean over viewers is that of many of them. */
static void test_viewers(struct fixture *f) {
    struct light_field field = {&f->world, (const uint16_t(*)[3])f->radiance, NULL, NULL};
    struct incident *scratch = mem_alloc(sizeof *scratch);
    struct irradiance light;
    vec3 frame[3] = {[2] = f->at.shading};
    vec3_frame(frame[2], &frame[0], &frame[1]);
    irradiance_gather(&light, scratch, &field, &f->at, sampler_key(1, 2, 3), GATHERED);
    for (float roughness = 0.0f; roughness <= 1.0f; roughness += 0.25f) {
        rgb sum = rgb_gray(0.0f);
        for (uint32_t i = 0; i < 4096; i++) {
            vec3 wo = incident_cosine_direction(frame, sampler_pair(sampler_key(4, 0, 0), i, 0));
            sum = rgb_mad(sum, 1.0f / 4096, irradiance_diffuse(&light, f->at.shading, roughness, wo));
        }
        check_close(irradiance_diffuse_mean(&light, f->at.shading, roughness), sum, 2e-3f, "viewers, roughness",
                    roughness);
    }
    mem_free(scratch);
}

/* Under an even light: by a sum over directions of light, in place of the lobe's own ones. */
static void test_albedo(void) {
    for (float roughness = 0.5f; roughness <= 1.0f; roughness += 0.25f) {
        double sum = 0.0;
        const int count = 1 << 16;
        for (int i = 0; i < count; i++) {
            uint32_t key = sampler_key(8, 0, 0);
            vec2 o = sampler_pair(key, (uint32_t)i, 0), d = sampler_pair(key, (uint32_t)i, 1);
            vec2 around = bsdf_circle(d.x);
            vec3 wo = {sqrtf(o.x), 0.0f, sqrtf(1.0f - o.x)};
            vec3 wi = {sqrtf(d.y) * around.x, sqrtf(d.y) * around.y, sqrtf(1.0f - d.y)};
            struct bsdf b = bsdf_make(rgb_gray(0.0f), roughness, 0.5f, wo.z);
            if (wi.z > 1e-4f && wo.z > 1e-4f)
                sum += (double)(bsdf_eval(&b, wo, wi).specular / wi.z * BSDF_PI);
        }
        CHECK_NEAR(highlight_albedo(roughness, 0.5f), sum / count, 0.03 * sum / count);
    }
    CHECK(highlight_albedo(0.5f, 0.0f) == 0.0f);
}

static void test_highlights(struct fixture *f) {
    static const struct highlight_levels levels = {4, 2, {0.1f, 0.3f, 0.5f, 1.0f}, {0.25f, 1.0f}};
    struct light_field field = {&f->world, (const uint16_t(*)[3])f->radiance, NULL, NULL};
    struct incident *scratch = mem_alloc(sizeof *scratch);
    for (float cosine = 0.3f; cosine < 1.0f; cosine += 0.5f) {
        struct highlight mean = {0}, one;
        for (uint32_t i = 0; i < 64; i++) {
            highlight_gather(&one, scratch, &field, &f->at, viewer(cosine), &levels, sampler_key(7, i, 0), 384, 128);
            for (size_t k = 0; k < 4; k++)
                for (size_t m = 0; m < 2; m++)
                    mean.radiance[k][m] = rgb_mad(mean.radiance[k][m], 1.0f / 64, one.radiance[k][m]);
        }
        for (size_t k = 0; k < 4; k++) {
            for (size_t m = 0; m < 2; m++) {
                set_floor(f, 0.0f, levels.roughness[k], levels.specular[m]);
                check_close(mean.radiance[k][m], trace(f, viewer(cosine)), 0.02f, "highlight, roughness",
                            levels.roughness[k]);
            }
        }
    }
    mem_free(scratch);
}

/* Walls are no lights any more, their texels send out the same. */
static void hand_to_field(struct fixture *f) {
    for (size_t i = 0; i < f->inverse.valid_count; i++) {
        uint32_t texel = f->inverse.valid[i];
        const rgb *e = &f->materials.emission[f->segments.of_triangle[f->inverse.triangle[texel]]];
        f->radiance[texel][0] = image_half_from_float(e->r);
        f->radiance[texel][1] = image_half_from_float(e->g);
        f->radiance[texel][2] = image_half_from_float(e->b);
    }
    for (int o = 0; o < LAMP; o++)
        f->materials.emission[o] = rgb_gray(0.0f);
    world_update_lights(&f->world);
}

/* The same light from what the texels are said to send out, with the lamp alone as an emitter. */
static void test_field(struct fixture *f) {
    struct incident *scratch = mem_alloc(sizeof *scratch);
    struct irradiance emitted, measured;
    struct light_field field = {&f->world, (const uint16_t(*)[3])f->radiance, NULL, NULL};
    irradiance_gather(&emitted, scratch, &field, &f->at, sampler_key(1, 2, 3), GATHERED);
    hand_to_field(f);
    irradiance_gather(&measured, scratch, &field, &f->at, sampler_key(1, 2, 4), GATHERED);
    check_close(irradiance_diffuse(&measured, f->at.shading, 0.5f, viewer(0.7f)),
                irradiance_diffuse(&emitted, f->at.shading, 0.5f, viewer(0.7f)), 0.01f, "measured light", 0.0f);
    mem_free(scratch);
}

/* A sheet that hangs over the floor with its front upwards: what its back sends down is about what the path tracer
 * says, to whom it is not quite Lambertian. */
static void test_back(void) {
    struct fixture g = {0};
    make_mesh(&g.mesh);
    /* The lamp, turned to the ceiling, hangs low and shines no more; black walls do. */
    vec3 *corner = &g.mesh.position[4 * LAMP];
    corner[0] = (vec3){0.5f, 0.6f, 0.5f}, corner[1] = (vec3){0.5f, 0.6f, 2.0f};
    corner[2] = (vec3){2.0f, 0.6f, 2.0f}, corner[3] = (vec3){2.0f, 0.6f, 0.5f};
    fixture_init(&g);
    static const rgb wall_radiance[OBJECTS] = {{0, 0, 0},       {0.5f, 0.4f, 0.3f}, {1, 0, 0}, {0, 1, 0.2f},
                                               {0.1f, 0.1f, 2}, {0.3f, 0.3f, 0.3f}, {0, 0, 0}};
    for (int o = 0; o < OBJECTS; o++)
        g.materials.emission[o] = wall_radiance[o];
    world_update_lights(&g.world);
    set_floor(&g, 0.8f, 0.5f, 0.0f);
    for (size_t i = 0; i < g.inverse.valid_count; i++) {
        uint32_t texel = g.inverse.valid[i], object = g.segments.of_triangle[g.inverse.triangle[texel]];
        if (object != 0 && object != LAMP)
            memset(g.materials.base_color.texel[texel], 0, 3 * sizeof(float));
    }
    struct light_field field = {&g.world, (const uint16_t(*)[3])g.radiance, NULL, NULL};
    struct incident *scratch = mem_alloc(sizeof *scratch);
    struct irradiance light;
    irradiance_gather(&light, scratch, &field, &g.at, sampler_key(1, 2, 3), GATHERED);
    rgb gathered = rgb_scale(irradiance_diffuse(&light, g.at.shading, 0.5f, viewer(0.7f)), 0.8f);
    check_close(gathered, trace_depth(&g, viewer(0.7f), 3), 0.05f, "under a back", 0.0f);
    mem_free(scratch);
    fixture_release(&g);
}

/* Makes the floor white about f->at, where it is looked at, and all else black. */
static void set_spot(struct fixture *f) {
    set_floor(f, 0.0f, 0.5f, 0.0f);
    for (size_t i = 0; i < f->inverse.valid_count; i++) {
        uint32_t texel = f->inverse.valid[i];
        struct surface_point p;
        surface_at_texel(&f->mesh, &f->atlas, &f->inverse, texel, &p);
        float *color = f->materials.base_color.texel[texel];
        if (vec3_length(vec3_sub(p.position, f->at.position)) < 0.15f)
            color[0] = color[1] = color[2] = 1.0f;
    }
}

#define MIRRORS 2

static rgb gather_diffuse(const struct fixture *f, const struct light_field *field) {
    struct incident *scratch = mem_alloc(sizeof *scratch);
    struct irradiance light;
    irradiance_gather(&light, scratch, field, &f->at, sampler_key(1, 2, 3), GATHERED);
    mem_free(scratch);
    return irradiance_diffuse(&light, f->at.shading, 0.5f, viewer(0.7f));
}

/* Two black, polished walls mirror what all others send out, and each other: as lights, if lobes are as wide as they
 * are taken to be for those, and else as their texels are said to. */
static void test_mirrors(struct fixture *f, float roughness, bool are_lights) {
    static const uint32_t mirror[MIRRORS] = {1, 3};
    struct incident_lobe lobe[OBJECTS] = {0};
    struct light_field field = {&f->world, (const uint16_t(*)[3])f->radiance, lobe, NULL};
    set_spot(f);
    for (int i = 0; i < MIRRORS; i++) {
        f->materials.emission[mirror[i]] = rgb_gray(0.0f);
        f->materials.roughness[mirror[i]] = roughness;
        f->materials.specular[mirror[i]] = 1.0f;
    }
    f->materials.emission[LAMP] = rgb_gray(0.0f);
    world_update_lights(&f->world);
    rgb traced = rgb_sub(trace_depth(f, viewer(0.7f), 6), trace(f, viewer(0.7f)));
    if (!are_lights)
        hand_to_field(f);
    rgb matt = gather_diffuse(f, &field);
    for (int i = 0; i < MIRRORS; i++)
        lobe[mirror[i]] = (struct incident_lobe){roughness, 1.0f};
    rgb mirrored = rgb_sub(gather_diffuse(f, &field), matt);
    printf("%.4f and, mirrored, %.4f (%.4f)\n", (double)rgb_mean(matt), (double)rgb_mean(mirrored),
           (double)rgb_mean(traced));
    check_close(mirrored, traced, 0.04f, "mirrored, roughness", roughness);
    for (int i = 0; i < MIRRORS; i++) {
        f->materials.roughness[mirror[i]] = 1.0f;
        f->materials.specular[mirror[i]] = 0.0f;
    }
    light_walls(f);
}

/* The room turned inside out around its floor, which is then inside a body: whatever is said of the floor itself,
 * nothing arrives there. */
static void test_inside(void) {
    struct fixture g = {0};
    make_mesh(&g.mesh);
    for (size_t t = 0; t < g.mesh.triangle_count; t++) {
        uint32_t *corner = g.mesh.index[t], first = corner[1];
        if (g.mesh.object_id[t] == 0)
            continue;
        corner[1] = corner[2];
        corner[2] = first;
    }
    fixture_init(&g);
    g.materials.emission[LAMP] = rgb_gray(0.0f);
    world_update_lights(&g.world);
    set_floor(&g, 0.9f, 1.0f, 0.0f);
    for (size_t i = 0; i < g.inverse.valid_count; i++)
        for (int c = 0; c < 3; c++)
            g.radiance[g.inverse.valid[i]][c] = image_half_from_float(3.0f);
    struct light_field field = {&g.world, (const uint16_t(*)[3])g.radiance, NULL, NULL};
    struct incident *scratch = mem_alloc(sizeof *scratch);
    struct irradiance light;
    irradiance_gather(&light, scratch, &field, &g.at, sampler_key(1, 2, 3), GATHERED);
    CHECK(rgb_is_black(irradiance_diffuse(&light, g.at.shading, 1.0f, viewer(0.7f))));
    mem_free(scratch);
    fixture_release(&g);
}

int main(void) {
    struct fixture f = {0};
    make_mesh(&f.mesh);
    fixture_init(&f);
    light_walls(&f);
    test_diffuse(&f);
    test_viewers(&f);
    test_albedo();
    test_back();
    test_inside();
    test_mirrors(&f, 0.5f, true);
    test_mirrors(&f, 0.2f, false);
    test_highlights(&f);
    test_field(&f);
    fixture_release(&f);
    return check_result();
}
