/* probes.h: what arrives from a rectangular lamp is what its form factor says, wherever a probe stands, and nothing
 * does behind what stands in the way; between probes it is interpolated by weights that come to 1, within a chart, by
 * likeness of normals and, for what is seen, by probes that are; more of them stand where light varies. */
#include "common/mem.h"
#include "server/gather/probes_refine.h"
#include "server/scene/materials.h"
#include "tests/check.h"

#define SIDE 64 /* texels of the plane */
#define TEXELS (2 * SIDE * SIDE)
#define METRES 4.0f
#define LAMP_HALF 0.5 /* metres; it hangs over the middle, one metre above */
#define SAMPLES 4096

/* The plane z = 0, the lamp that faces it; each is a chart and a segment, beside each other in the texture. */
static vec3 position[8] = {{-2, -2, 0},          {2, -2, 0},          {2, 2, 0},          {-2, 2, 0},
                           {-0.5f, -0.5f, 1.0f}, {-0.5f, 0.5f, 1.0f}, {0.5f, 0.5f, 1.0f}, {0.5f, -0.5f, 1.0f}};
static uint32_t indices[4][3] = {{0, 1, 2}, {0, 2, 3}, {4, 5, 6}, {4, 6, 7}}, of_triangle[4] = {0, 0, 1, 1};
static vec2 corner[4][3];
static const rgb radiance = {5.0f, 3.0f, 1.0f};

struct rig {
    struct parallel *pool;
    struct mesh mesh;
    struct segments segments;
    struct atlas atlas;
    struct inverse_uv inverse;
    struct materials materials;
    struct world world;
    struct fused fused; /* count alone */
    uint16_t (*sent)[3];
};

static void rig_init(struct rig *r) {
    struct error err;
    for (size_t t = 0; t < 4; t++)
        for (size_t k = 0; k < 3; k++) {
            vec3 p = position[indices[t][k]];
            float scale = t < 2 ? SIDE / METRES : SIDE;
            corner[t][k] = (vec2){p.x * scale + SIDE / 2 + (t < 2 ? 0 : SIDE), p.y * scale + SIDE / 2};
        }
    *r = (struct rig){.pool = parallel_new(1)};
    r->mesh = (struct mesh){.vertex_count = 8, .position = position, .triangle_count = 4, .index = indices};
    r->segments = (struct segments){.count = 2, .of_triangle = of_triangle};
    r->atlas = (struct atlas){.width = 2 * SIDE,
                              .height = SIDE,
                              .texels_per_metre = SIDE,
                              .chart_count = 2,
                              .chart_of_triangle = of_triangle,
                              .corner = corner};
    inverse_uv_make(&r->inverse, &r->atlas, 4, r->pool);
    materials_init(&r->materials, &r->inverse, 2, rgb_gray(0.5f), 1.0f, 0.0f);
    r->materials.emission[1] = radiance;
    CHECK(world_init(&r->world, &r->mesh, &r->segments, &r->atlas, &r->materials, NULL, r->pool, &err) == STATUS_OK);
    r->fused = (struct fused){.width = 2 * SIDE, .height = SIDE, .count = mem_calloc(TEXELS, sizeof *r->fused.count)};
    for (size_t i = 0; i < TEXELS; i++)
        r->fused.count[i] = 1.0f;
    r->sent = mem_calloc(TEXELS, sizeof *r->sent);
}

static void rig_release(struct rig *r) {
    mem_free(r->sent);
    mem_free(r->fused.count);
    world_release(&r->world);
    materials_release(&r->materials);
    inverse_uv_release(&r->inverse);
    parallel_free(r->pool);
}

/* Form factor of a rectangle a x b, parallel to a small surface one metre below its corner, to it (Howell's catalogue,
 * B-3); odd in both sides, so that sums of four make any rectangle. */
static double corner_factor(double a, double b) {
    double ra = sqrt(1.0 + a * a), rb = sqrt(1.0 + b * b);
    return (a / ra * atan(b / ra) + b / rb * atan(a / rb)) / (2.0 * PI);
}

static double lamp_factor(double x, double y) {
    double l = -LAMP_HALF - x, r = LAMP_HALF - x, d = -LAMP_HALF - y, u = LAMP_HALF - y;
    return corner_factor(r, u) - corner_factor(l, u) - corner_factor(r, d) + corner_factor(l, d);
}

static void test_irradiance(struct rig *r) {
    struct probes p;
    struct light_field field = {&r->world, (const uint16_t(*)[3])r->sent, NULL, NULL};
    double worst = 0.0;
    probes_init(&p, 16, &r->mesh, &r->atlas, &r->inverse, &r->fused);
    probes_gather(&p, &field, &r->mesh, &r->atlas, &r->inverse, 7, SAMPLES, 0, p.count, r->pool);
    size_t below = 0;
    for (size_t i = 0; i < p.count; i++) {
        const struct probe *probe = &p.probe[i];
        struct surface_point at;
        CHECK(surface_at_texel(&r->mesh, &r->atlas, &r->inverse, probe->texel, &at));
        for (size_t c = 0; c < 3 && probe->chart == 0; c++) {
            double wanted = PI * (double)(&radiance.r)[c] * lamp_factor((double)at.position.x, (double)at.position.y);
            worst = fmax(worst, fabs((double)probe->light.moment[0][c] / wanted - 1.0));
            CHECK(fabs((double)(&probe->light.noise.r)[c]) < 0.03 * wanted);
            below += c == 0;
        }
        if (probe->chart == 1) /* the lamp sees the black plane alone */
            CHECK(probe->light.moment[0][0] == 0.0f);
    }
    printf("%zu probes, off by %.4f at most\n", below, worst);
    CHECK(below == 16);
    CHECK_THAT(worst < 0.02, "%g", worst);
    probes_release(&p);
}

/* Light that differs from probe to probe: weights are told by what comes of it. */
static void test_mix(struct rig *r) {
    struct probes p;
    /* A block of the plane that no photograph sees. */
    for (uint32_t y = 0; y < 16; y++)
        for (uint32_t x = 16; x < 32; x++)
            r->fused.count[y * 2 * SIDE + x] = 0.0f;
    probes_init(&p, 16, &r->mesh, &r->atlas, &r->inverse, &r->fused);
    for (size_t i = 0; i < p.count; i++) {
        p.probe[i].light.moment[0][0] = p.probe[i].chart == 0 ? 1.0f : 100.0f;
        p.probe[i].light.moment[0][1] = (float)(p.probe[i].texel % (2 * SIDE));
        p.probe[i].light.moment[0][2] = p.probe[i].seen ? 0.0f : 1.0f;
        p.probe[i].light.noise = rgb_make(1.0f, (float)(p.probe[i].texel % (2 * SIDE)), 0.0f);
    }
    for (size_t i = 0; i < r->inverse.valid_count; i++) {
        uint32_t texel = r->inverse.valid[i], x = texel % (2 * SIDE);
        struct surface_point at;
        struct probe_mix mix;
        struct irradiance light;
        double sum = 0.0;
        CHECK(surface_at_texel(&r->mesh, &r->atlas, &r->inverse, texel, &at));
        probes_mix(&p, &r->atlas, &r->fused, texel, &at, &mix);
        CHECK(mix.count >= 1 && mix.count <= PROBES_AROUND);
        for (size_t k = 0; k < mix.count; k++)
            sum += (double)mix.weight[k];
        probes_irradiance(&p, &mix, &light);
        CHECK_NEAR(sum, 1.0, 1e-5);
        CHECK_NEAR(light.moment[0][0], x < SIDE ? 1.0f : 100.0f, 1e-3f);
        CHECK_NEAR(light.noise.r, 1.0, 1e-5);
        CHECK_NEAR(light.noise.g, light.moment[0][1], 1e-3f);
        CHECK_THAT(r->fused.count[texel] == 0.0f || light.moment[0][2] < 0.05f,
                   "texel %u, %u: %g of it by one that is unseen", x, texel / (2 * SIDE), (double)light.moment[0][2]);
        if (x >= 24 && x < SIDE - 24 && texel / (2 * SIDE) >= 32) /* a ramp stays about one */
            CHECK_NEAR(light.moment[0][1], x, 2.0);
    }
    probes_release(&p);
}

/* A probe around the bend hardly speaks. */
static void test_normals(struct rig *r) {
    struct probes p;
    struct surface_point at;
    struct probe_mix mix;
    uint32_t texel = 24 * 2 * SIDE + 31;
    for (size_t i = 0; i < TEXELS; i++)
        r->fused.count[i] = 1.0f;
    probes_init(&p, 16, &r->mesh, &r->atlas, &r->inverse, &r->fused);
    for (size_t i = 0; i < p.count; i++)
        if (p.probe[i].texel % (2 * SIDE) >= 32)
            p.probe[i].shading = (vec3){1.0f, 0.0f, 0.0f};
    CHECK(surface_at_texel(&r->mesh, &r->atlas, &r->inverse, texel, &at));
    probes_mix(&p, &r->atlas, &r->fused, texel, &at, &mix);
    for (size_t k = 0; k < mix.count; k++)
        CHECK(p.probe[mix.probe[k]].texel % (2 * SIDE) < 32 || mix.weight[k] < 1e-4f);
    probes_release(&p);
}

/* The shadow of an edge over the plane: light goes from 1 to .2 within a quarter of a block. */
static float shade(uint32_t texel) {
    float x = (float)(texel % (2 * SIDE));
    return 0.6f - 0.4f * tanhf((x - 37.0f) / 4.0f);
}

static void cast_shadow(struct probes *p) {
    for (size_t i = 0; i < p->count; i++)
        for (int c = 0; c < 3; c++)
            p->probe[i].light.moment[0][c] = p->probe[i].chart == 0 ? shade(p->probe[i].texel) : 1.0f;
}

/* Root mean square error of interpolated light on the plane. */
static double shadow_error(struct rig *r, const struct probes *p) {
    double square = 0.0, count = 0.0;
    for (size_t i = 0; i < r->inverse.valid_count; i++) {
        uint32_t texel = r->inverse.valid[i];
        struct surface_point at;
        struct probe_mix mix;
        struct irradiance light;
        double sum = 0.0;
        if (texel % (2 * SIDE) >= SIDE)
            continue;
        CHECK(surface_at_texel(&r->mesh, &r->atlas, &r->inverse, texel, &at));
        probes_mix(p, &r->atlas, &r->fused, texel, &at, &mix);
        for (size_t k = 0; k < mix.count; k++)
            sum += (double)mix.weight[k];
        CHECK_NEAR(sum, 1.0, 1e-5);
        probes_irradiance(p, &mix, &light);
        square += pow((double)(light.moment[0][0] - shade(texel)), 2.0);
        count += 1.0;
    }
    return sqrt(square / count);
}

/* Probes are added along the shadow, within their share, until cells cannot be halved any more; none for noise, and
 * none where no photograph looks. */
static void test_refine(struct rig *r) {
    struct probes p;
    const uint32_t unseen_row = 3;
    for (size_t i = 0; i < TEXELS; i++)
        r->fused.count[i] = i / (2 * SIDE) / 16 == unseen_row ? 0.0f : 1.0f;
    probes_init(&p, 16, &r->mesh, &r->atlas, &r->inverse, &r->fused);
    cast_shadow(&p);
    double error[3] = {shadow_error(r, &p)};
    size_t before = p.count;
    for (int i = 1; i < 3; i++) {
        probes_refine(&p, 0.75, &r->mesh, &r->atlas, &r->inverse, &r->fused);
        CHECK_THAT(p.count > before && (double)p.count <= 1.75 * (double)before, "%zu, %zu", before, p.count);
        before = p.count;
        cast_shadow(&p);
        error[i] = shadow_error(r, &p);
    }
    printf("%zu probes, interpolated light off by %.4f, %.4f, %.4f\n", p.count, error[0], error[1], error[2]);
    CHECK(error[1] < 0.8 * error[0] && error[2] < 0.6 * error[0]);
    for (uint32_t block = 0; block < p.columns * p.rows; block++) {
        bool shaded = block % p.columns >= 1 && block % p.columns <= 3 && block / p.columns != unseen_row;
        CHECK_THAT(shaded || p.halvings[block] == 0, "block %u, %u", block % p.columns, block / p.columns);
    }
    for (size_t i = 0; i < p.count; i++) { /* as different as their noise says */
        struct irradiance *light = &p.probe[i].light;
        for (int c = 0; c < 3; c++)
            light->moment[0][c] = 1.0f + (i % 2 == 0 ? 0.1f : -0.1f);
        light->noise = rgb_gray(0.15f);
    }
    before = p.count;
    probes_refine(&p, 0.75, &r->mesh, &r->atlas, &r->inverse, &r->fused);
    CHECK(p.count == before);
    probes_release(&p);
}

int main(void) {
    struct rig r;
    rig_init(&r);
    test_irradiance(&r);
    test_mix(&r);
    test_normals(&r);
    test_refine(&r);
    rig_release(&r);
    return check_result();
}
