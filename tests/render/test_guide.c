/* The guide of light samples: densities that agree with the picks, parts that cover their triangle,
 * the same radiance with and without it, less variance. */
#include "server/render/shade.h"
#include "tests/render/box.h"
#include "tests/render/chi_square.h"

#define SAMPLES 64000 /* a multiple of LANES */

static float number(uint64_t which, uint64_t i, uint64_t dimension) {
    return rng_to_float((uint32_t)(rng_key(which, i, dimension) >> 32));
}

/* A box whose lamp is large and half hidden by a wall; the slab shines a little too. */
static void make(struct box *b) {
    box_init(b);
    b->materials.emission[1] = (rgb){1.0f, 0.5f, 0.2f};
    b->mesh.position[29] = (vec3){0.9f, 0.95f, 0.3f};
    b->mesh.position[30] = (vec3){0.9f, 0.95f, 0.9f};
    b->mesh.position[31] = (vec3){0.3f, 0.95f, 0.9f};
    box_quad(b, (vec3){0.45f, 0.5f, 0}, (vec3){0, 0.5f, 0}, (vec3){0, 0, 1}, 0, 33, 33, 14);
    box_build(b);
    CHECK(b->world.guide != NULL);
}

/* Every point of a triangle lies in the part that lights_part names. */
static void check_parts(const struct box *b) {
    const struct lights *lights = b->world.lights;
    size_t cut = 0;
    for (size_t t = 0; t < b->mesh.triangle_count; t++) {
        if (rgb_is_black(b->materials.emission[b->segments.of_triangle[t]]))
            continue;
        for (uint64_t i = 0; i < 2000; i++) {
            float root = sqrtf(number(1, i, 0)), along = number(1, i, 1);
            float b1 = root * (1.0f - along), b2 = root * along;
            const struct light_triangle *part = &lights->triangle[lights_part(lights, (uint32_t)t, b1, b2)];
            vec3 normal = vec3_cross(part->edge1, part->edge2);
            vec3 from = vec3_sub(mesh_point(&b->mesh, t, b1, b2), part->corner);
            float over = 1.0f / vec3_dot(normal, normal);
            float u = over * vec3_dot(normal, vec3_cross(from, part->edge2));
            float v = over * vec3_dot(normal, vec3_cross(part->edge1, from));
            CHECK(u > -1e-3f && v > -1e-3f && u + v < 1.001f);
            CHECK(vec3_dot(normal, mesh_cross(&b->mesh, t)) > 0.0f);
            cut += part->level > 0;
        }
    }
    CHECK(cut > 0);
}

/* Light triangles picked, against the density that their points are given. */
static void check_density(const struct box *b, size_t row) {
    const struct lights *lights = b->world.lights;
    double *found = mem_calloc(lights->triangle_count, sizeof *found);
    double *expected = mem_calloc(lights->triangle_count, sizeof *expected), total = 0.0;
    struct shade_block *s = mem_calloc_large(1, sizeof *s);
    for (uint64_t i = 0; i < SAMPLES; i += LANES) {
        for (uint32_t lane = 0; lane < LANES; lane++) {
            s->guide_row[lane] = (uint32_t)row;
            s->pick[lane] = number(2, i + lane, row);
        }
        shade_pick(s, b->world.guide, lights);
        for (int lane = 0; lane < LANES; lane++) {
            uint32_t entry = (uint32_t)s->light[lane];
            CHECK_NEAR(s->density_factor[lane], guide_density_factor(b->world.guide, row, entry), 0.0);
            found[entry] += 1.0;
        }
    }
    mem_free(s);
    for (size_t i = 0; i < lights->triangle_count; i++) {
        const struct light_triangle *t = &lights->triangle[i];
        double area = 0.5 * (double)vec3_length(vec3_cross(t->edge1, t->edge2));
        expected[i] = SAMPLES * area * (double)(t->density * guide_density_factor(b->world.guide, row, (uint32_t)i));
        total += expected[i];
    }
    CHECK_NEAR(total / SAMPLES, 1.0, 1e-5);
    double z = chi_square(lights->triangle_count, found, expected);
    CHECK_THAT(z < 4.0, "row %zu: chi-square %.2f sigma", row, z);
    mem_free(found);
    mem_free(expected);
}

/* Mean of what paths bring, and its variance along one and the same camera ray. */
static void estimate(const struct box *b, double *mean, double *variance) {
    enum { BATCH = 2000, RAY = 100 }; /* paths each */
    static struct ray ray[BATCH];
    static struct path_key key[BATCH];
    static rgb radiance[BATCH];
    struct path_settings settings = {.max_depth = 5, .roulette_depth = 3, .seed = 6};
    struct path_batch *batch = path_batch_new(BATCH, 5);
    double sum = 0.0, within = 0.0;
    for (uint32_t first = 0; first < SAMPLES; first += BATCH) {
        for (uint32_t i = 0; i < BATCH; i++) {
            ray[i] = box_ray((first + i) / RAY);
            key[i] = (struct path_key){first + i, 0, 0};
        }
        path_batch_trace(batch, &b->world, &settings, BATCH, ray, key, radiance);
        for (uint32_t i = 0; i < BATCH; i += RAY) {
            double own = 0.0, square = 0.0;
            for (uint32_t k = i; k < i + RAY; k++) {
                double value = (double)radiance[k].g;
                own += value;
                square += value * value;
            }
            sum += own;
            within += square - own * own / RAY;
        }
    }
    path_batch_free(batch);
    *mean = sum / SAMPLES;
    *variance = within / SAMPLES;
}

int main(void) {
    struct box b;
    make(&b);
    check_parts(&b);
    for (size_t row = 0; row < b.world.guide->row_count; row += 1 + b.world.guide->row_count / 8)
        check_density(&b, row);
    struct parallel *three = parallel_new(3);
    struct guide *same = guide_new(b.world.lights, &b.mesh, b.world.accel, three);
    CHECK(memcmp(same->transfer, b.world.guide->transfer, same->row_count * same->patch_count * sizeof(float)) == 0);
    guide_free(same);
    parallel_free(three);
    /* Emission changed, and taken over. */
    b.materials.emission[1] = (rgb){0.5f, 2.0f, 0.1f};
    world_update_lights(&b.world);
    check_density(&b, 1);

    double mean[2], variance[2];
    estimate(&b, &mean[0], &variance[0]);
    guide_free(b.world.guide);
    b.world.guide = NULL;
    estimate(&b, &mean[1], &variance[1]);
    double error = sqrt((variance[0] + variance[1]) / SAMPLES);
    printf("guided %.4f, by power %.4f +- %.4f; variance %.3f of that by power\n", mean[0], mean[1], error,
           variance[0] / variance[1]);
    CHECK(fabs(mean[0] - mean[1]) < 4.0 * error);
    CHECK(variance[0] < 0.9 * variance[1]);
    box_release(&b);
    return check_result();
}
