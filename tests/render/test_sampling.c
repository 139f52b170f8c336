/* Every sampling routine against its density (chi-square), energy and reciprocity of the
 * reflection model, and the sampler's uniformity and stratification. */
#include "common/mem.h"
#include "common/rng.h"
#include "server/render/bsdf.h"
#include "server/render/light.h"
#include "server/render/sampler.h"
#include "tests/render/box.h"
#include "tests/render/chi_square.h"

#define ROWS 24
#define COLUMNS 48
#define CELLS (ROWS * COLUMNS)
#define SAMPLES 200000

static float number(uint64_t stream, uint64_t i, uint64_t k) { return rng_to_float((uint32_t)rng_key(stream, i, k)); }

/* Cells of equal solid angle over the sphere: rows in z, columns in angle. */
static size_t cell_of(vec3 d) {
    int row = (int)((double)(d.z * 0.5f + 0.5f) * ROWS);
    double turn = atan2((double)d.y, (double)d.x) / (2.0 * PI);
    int column = (int)((turn - floor(turn)) * COLUMNS);
    row = row < 0 ? 0 : row >= ROWS ? ROWS - 1 : row;
    return (size_t)(row * COLUMNS + (column >= COLUMNS ? COLUMNS - 1 : column));
}

/* Integrates a density over every cell by `side` x `side` midpoints. */
static void integrate(double (*pdf)(const void *user, vec3 d), const void *user, int side, double *expected) {
    for (int row = 0; row < ROWS; row++) {
        for (int column = 0; column < COLUMNS; column++) {
            double sum = 0.0;
            for (int k = 0; k < side * side; k++) {
                double z = 2.0 * (row + (k / side + 0.5) / side) / ROWS - 1.0;
                double turn = 2.0 * PI * (column + (k % side + 0.5) / side) / COLUMNS;
                double r = sqrt(1.0 - z * z);
                sum += pdf(user, (vec3){(float)(r * cos(turn)), (float)(r * sin(turn)), (float)z});
            }
            expected[row * COLUMNS + column] = sum * 4.0 * PI / ((double)CELLS * side * side) * SAMPLES;
        }
    }
}

struct view {
    struct bsdf bsdf;
    vec3 wo;
};

static double bsdf_density(const void *user, vec3 d) {
    const struct view *v = user;
    return (double)bsdf_eval(&v->bsdf, v->wo, d).pdf;
}

static void check_bsdf(float roughness, float specular, float cosine) {
    static double found[CELLS], expected[CELLS];
    struct view v = {.wo = {sqrtf(1.0f - cosine * cosine) * 0.6f, sqrtf(1.0f - cosine * cosine) * 0.8f, cosine}};
    v.bsdf = bsdf_make(rgb_gray(0.4f), roughness, specular, cosine);
    memset(found, 0, sizeof found);
    double below = 0.0, inside = 0.0;
    for (uint64_t i = 0; i < SAMPLES; i++) {
        vec3 d = bsdf_sample(&v.bsdf, v.wo, number(1, i, 0), number(1, i, 1), number(1, i, 2));
        CHECK_NEAR(vec3_dot(d, d), 1.0, 1e-4);
        if (d.z > 0.0f)
            found[cell_of(d)] += 1.0;
        else
            below += 1.0;
    }
    integrate(bsdf_density, &v, roughness < 0.3f ? 96 : 24, expected);
    for (size_t i = 0; i < CELLS; i++)
        inside += expected[i];
    double z = chi_square(CELLS, found, expected);
    CHECK_THAT(z < 4.0, "roughness %g specular %g cosine %g: chi-square %.2f sigma", (double)roughness,
               (double)specular, (double)cosine, z);
    /* The weak white furnace: all of the density is above the horizon or was seen to fall below. */
    CHECK_NEAR((inside + below) / SAMPLES, 1.0, 5e-3);
}

/* Directions picked towards the box's lamp, against the density by solid angle. */
static double light_density(const void *user, vec3 d) {
    const struct box *b = user;
    vec3 from = {0.8f, 0.6f, 0.8f};
    struct accel_hit hit;
    if (!accel_intersect(b->world.accel, from, d, 0.0f, INFINITY, &hit))
        return 0.0;
    const struct world_triangle *t = &b->world.triangle[hit.triangle];
    float facing = -vec3_dot(t->normal, d);
    return facing > 0.0f ? (double)lights_pdf_segment(b->world.lights, t->segment, hit.distance_m, facing) : 0.0;
}

static void check_emitters(void) {
    static double found[CELLS], expected[CELLS];
    struct box b;
    box_init(&b);
    b.materials.emission[1] = (rgb){1.0f, 3.0f, 2.0f}; /* the slab too: it faces up */
    b.mesh.position[28] = (vec3){0.3f, 0.7f, 0.3f};    /* a tilted lamp of unequal triangles */
    b.mesh.position[29] = (vec3){0.5f, 0.95f, 0.3f};
    box_build(&b);
    vec3 from = {0.8f, 0.6f, 0.8f};
    memset(found, 0, sizeof found);
    for (uint64_t i = 0; i < SAMPLES; i++) {
        struct light_sample s;
        lights_sample(b.world.lights, from, number(2, i, 0), number(2, i, 1), number(2, i, 2), &s);
        if (!(s.pdf > 0.0f))
            continue;
        CHECK(s.segment == 1 || s.segment == 2);
        vec3 reached = vec3_mad(from, s.distance_m, s.direction);
        CHECK(vec3_length(vec3_sub(reached, s.point)) < 1e-5f);
        /* What lies behind other things counts neither here nor there. */
        if (!accel_occluded(b.world.accel, from, s.direction, 0.0f, s.distance_m * 0.999f))
            found[cell_of(s.direction)] += 1.0;
    }
    integrate(light_density, &b, 40, expected);
    double z = chi_square(CELLS, found, expected);
    CHECK_THAT(z < 4.0, "emitters: chi-square %.2f sigma", z);
    box_release(&b);
}

static double environment_density(const void *user, vec3 d) { return (double)lights_pdf_environment(user, d); }

/* A map of patches, about 32 around; where there is a reach, half of the directions are closed. */
static void check_environment(uint32_t width, uint32_t height, bool has_reach) {
    static double found[CELLS], expected[CELLS];
    struct image map = {.width = width, .height = height, .channel_count = 3};
    map.pixel = mem_array((size_t)map.width * map.height * 3, sizeof(float));
    for (uint32_t i = 0; i < map.width * map.height; i++) {
        uint32_t patch = i / width * 32 / width * 32 + i % width * 32 / width;
        for (uint32_t c = 0; c < 3; c++) {
            uint32_t which = 3 * patch + c;
            map.pixel[3 * i + c] = which % 5 == 0 ? 0.0f : 3.0f * powf(number(3, which, 0), 8.0f);
        }
    }
    struct lights *lights = lights_new(&map);
    struct visibility *visibility = mem_calloc(1, sizeof *visibility);
    visibility->area = 2.0;
    for (int y = 0; y < VISIBILITY_ROWS; y++)
        for (int x = 0; x < VISIBILITY_COLUMNS; x++)
            visibility->share[y][x] = x < VISIBILITY_COLUMNS / 2 ? 0.0f : 0.25f;
    if (has_reach)
        lights_set_environment(lights, &map, visibility);
    mem_free(visibility);
    CHECK(lights_any(lights) && lights->environment_chance == 1.0f);
    memset(found, 0, sizeof found);
    double sum = 0.0;
    for (uint64_t i = 0; i < SAMPLES; i++) {
        struct light_sample s;
        lights_sample(lights, (vec3){0, 0, 0}, number(4, i, 0), number(4, i, 1), number(4, i, 2), &s);
        CHECK(s.pdf > 0.0f && s.segment == LIGHT_ENVIRONMENT);
        found[cell_of(s.direction)] += 1.0;
        sum += (double)(s.radiance.g / s.pdf) / SAMPLES;
    }
    integrate(environment_density, lights, 24, expected);
    double z = chi_square(CELLS, found, expected), whole = 0.0, bright = 0.0;
    CHECK_THAT(z < 4.0, "environment of %u: chi-square %.2f sigma", width, z);
    for (uint64_t i = 0; i < SAMPLES; i++) {
        float up = 2.0f * number(5, i, 0) - 1.0f, turn = (float)(2.0 * PI) * number(5, i, 1);
        float r = sqrtf(1.0f - up * up);
        vec3 d = {r * cosf(turn), r * sinf(turn), up};
        whole += (double)lights_pdf_environment(lights, d) * 4.0 * PI / SAMPLES;
        bright += (double)lights_environment(lights, d).g * 4.0 * PI / SAMPLES;
    }
    CHECK_NEAR(whole, 1.0, 0.03);
    CHECK_NEAR(sum / bright, 1.0, 0.03);
    lights_free(lights);
    mem_free(map.pixel);
}

static void check_reciprocity(void) {
    for (uint64_t i = 0; i < 20000; i++) {
        vec3 d[2];
        for (uint64_t k = 0; k < 2; k++) {
            float z = 0.02f + 0.98f * number(6, i, 4 * k), turn = 6.2831853f * number(6, i, 4 * k + 1);
            float r = sqrtf(fmaxf(0.0f, 1.0f - z * z));
            d[k] = (vec3){r * cosf(turn), r * sinf(turn), z};
        }
        struct bsdf b = bsdf_make(rgb_gray(0.5f), number(6, i, 2), number(6, i, 3), d[0].z);
        struct bsdf_value there = bsdf_eval(&b, d[0], d[1]), back = bsdf_eval(&b, d[1], d[0]);
        CHECK_NEAR(there.diffuse / d[1].z, back.diffuse / d[0].z, 1e-5 + 1e-5 * (double)there.diffuse);
        double f = (double)(there.specular / d[1].z), g = (double)(back.specular / d[0].z);
        CHECK_NEAR(f, g, 1e-6 + 2e-4 * f);
    }
}

/* Numbers of one pair over many keys are uniform on the square; the first 64 samples of a key fall
 * one into each of 64 cells of every elementary shape. */
static void check_sampler(void) {
    enum { SIDE = 16 };
    double found[SIDE * SIDE], expected[SIDE * SIDE];
    for (uint32_t pair = 0; pair < 12; pair++) {
        for (uint32_t sample = 0; sample < 3; sample++) {
            memset(found, 0, sizeof found);
            for (uint32_t i = 0; i < 40000; i++) {
                vec2 p = sampler_pair(sampler_key(9, i, 4), sample, pair);
                CHECK(p.x >= 0.0f && p.x < 1.0f && p.y >= 0.0f && p.y < 1.0f);
                found[(int)(p.y * SIDE) * SIDE + (int)(p.x * SIDE)] += 1.0;
            }
            for (int i = 0; i < SIDE * SIDE; i++)
                expected[i] = 40000.0 / (SIDE * SIDE);
            double z = chi_square(SIDE * SIDE, found, expected);
            CHECK_THAT(z < 4.0, "pair %u sample %u: chi-square %.2f sigma", pair, sample, z);
        }
    }
    for (uint32_t key = 0; key < 50; key++) {
        for (int shape = 0; shape <= 6; shape++) {
            int across = 1 << shape, seen[64] = {0};
            for (uint32_t sample = 0; sample < 64; sample++) {
                vec2 p = sampler_pair(sampler_key(1, key, 0), sample, key % 7);
                seen[(int)(p.x * (float)across) + across * (int)(p.y * (float)(64 / across))]++;
            }
            for (int i = 0; i < 64; i++)
                CHECK_THAT(seen[i] == 1, "key %u: %d samples in cell %d of shape %d", key, seen[i], i, shape);
        }
    }
}

int main(void) {
    const float roughness[] = {0.15f, 0.4f, 1.0f}, cosine[] = {0.1f, 0.5f, 0.95f};
    for (int r = 0; r < 3; r++)
        for (int c = 0; c < 3; c++)
            check_bsdf(roughness[r], r == 1 ? 0.3f : 1.0f, cosine[c]);
    check_bsdf(0.5f, 0.0f, 0.5f);
    check_emitters();
    check_environment(32, 17, false);
    check_environment(32, 17, true);
    check_environment(1100, 400, true); /* blocks of cells, the last ones smaller */
    check_reciprocity();
    check_sampler();
    return check_result();
}
