/* gradient_reduce against a plain sum, and the same bits for any number of threads. */
#include "common/mem.h"
#include "common/rng.h"
#include "server/render/gradient.h"
#include "tests/check.h"

#define LOGS 9
#define SEGMENTS 5

/* Random entries over a texture whose sides are no multiples of a tile's, many at tile edges. */
static struct gradient_log *random_log(int number, uint32_t width, uint32_t height) {
    struct gradient_log *log = gradient_log_new(SEGMENTS);
    size_t count = (size_t)number * 700;
    for (size_t i = 0; i < count; i++) {
        uint64_t bits = rng_key(3, (uint64_t)number, i);
        uint32_t x = rng_below((uint32_t)bits, width), y = rng_below((uint32_t)(bits >> 32), height);
        if (i % 3 == 0)
            x = (x | 31) < width ? x | 31 : x;
        if (i % 4 == 0)
            y = (y | 31) < height ? y | 31 : y;
        struct gradient_entry *e = gradient_log_reserve(log, 1);
        e->x = (uint16_t)x;
        e->y = (uint16_t)y;
        float sum = 0.0f;
        for (uint32_t k = 0; k < 4; k++) {
            bool inside = x + k % 2 < width && y + k / 2 < height;
            e->weight[k] = inside && rng_key(4, i, k) % 4 ? rng_to_float((uint32_t)rng_key(6, i, k)) : 0.0f;
            sum += e->weight[k];
        }
        for (uint32_t k = 0; k < 4 && sum > 0.0f; k++)
            e->weight[k] /= sum;
        e->d = (rgb){rng_to_float((uint32_t)rng_key(7, i, 0)) - 0.5f, (float)(i % 7), -1.0f};
        log->entry_count++;
        log->segment[i % SEGMENTS].d_roughness += (double)e->d.r;
        log->segment[i % SEGMENTS].d_specular += 1.0;
        log->segment[i % SEGMENTS].d_emission[i % 3] += (double)e->d.g;
    }
    return log;
}

static void check_sums(const struct gradient *g, struct gradient_log *const *log) {
    size_t texels = (size_t)g->width * g->height;
    double(*sum)[4] = mem_calloc(texels, sizeof *sum);
    double segments[SEGMENTS][2] = {{0}};
    for (int l = 0; l < LOGS; l++) {
        for (size_t i = 0; i < log[l]->entry_count; i++) {
            const struct gradient_entry *e = &log[l]->entry[i];
            for (uint32_t k = 0; k < 4; k++) {
                if (e->weight[k] == 0.0f)
                    continue;
                double *to = sum[e->x + k % 2 + (e->y + k / 2) * g->width];
                to[0] += (double)(e->weight[k] * e->d.r);
                to[1] += (double)(e->weight[k] * e->d.g);
                to[2] += (double)(e->weight[k] * e->d.b);
                to[3] += (double)e->weight[k];
            }
        }
        for (int s = 0; s < SEGMENTS; s++) {
            segments[s][0] += log[l]->segment[s].d_roughness;
            segments[s][1] += log[l]->segment[s].d_emission[1];
        }
    }
    size_t touched = 0;
    for (size_t i = 0; i < texels; i++)
        touched += sum[i][3] > 0.0;
    CHECK_THAT(touched == g->texel_count, "%zu texels touched, %zu reported", touched, g->texel_count);
    for (size_t i = 0; i < g->texel_count; i++) {
        const double *wanted = sum[g->texel[i]];
        double rounding = 1e-5 * (1.0 + wanted[3]);
        CHECK_NEAR(g->d_base_color[i].r, wanted[0], rounding);
        CHECK_NEAR(g->d_base_color[i].g, wanted[1], 7.0 * rounding);
        CHECK_NEAR(g->d_base_color[i].b, wanted[2], rounding);
        CHECK_NEAR(g->weight[i], wanted[3], rounding);
    }
    for (int s = 0; s < SEGMENTS; s++) {
        CHECK_NEAR(g->d_roughness[s], segments[s][0], 1e-9);
        CHECK_NEAR(g->d_emission[s][1], segments[s][1], 1e-9);
    }
    mem_free(sum);
}

static void check_size(uint32_t width, uint32_t height) {
    struct gradient_log *log[LOGS];
    for (int i = 0; i < LOGS; i++)
        log[i] = random_log(i, width, height);
    struct gradient *first = gradient_new(width, height, SEGMENTS);
    struct parallel *one = parallel_new(1);
    gradient_reduce(first, log, LOGS, one);
    check_sums(first, log);
    const int threads[] = {2, 3, 7};
    for (int t = 0; t < 3; t++) {
        struct gradient *again = gradient_new(width, height, SEGMENTS);
        struct parallel *pool = parallel_new(threads[t]);
        gradient_reduce(again, log, 2, pool); /* other content before */
        gradient_reduce(again, log, LOGS, pool);
        CHECK(again->texel_count == first->texel_count);
        size_t n = first->texel_count;
        CHECK(memcmp(again->texel, first->texel, n * sizeof *first->texel) == 0);
        CHECK(memcmp(again->d_base_color, first->d_base_color, n * sizeof *first->d_base_color) == 0);
        CHECK(memcmp(again->weight, first->weight, n * sizeof *first->weight) == 0);
        CHECK(memcmp(again->d_roughness, first->d_roughness, SEGMENTS * sizeof(double)) == 0);
        gradient_free(again);
        parallel_free(pool);
    }
    gradient_reduce(first, log, 1, one); /* the first log is empty */
    CHECK(first->texel_count == 0);
    gradient_free(first);
    parallel_free(one);
    for (int i = 0; i < LOGS; i++)
        gradient_log_free(log[i]);
}

int main(void) {
    check_size(100, 70);
    check_size(32, 32);
    check_size(2500, 2100); /* tiles of 128 x 128 */
    return check_result();
}
