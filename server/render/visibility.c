/* visibility.c -- see visibility.h. */
#include "server/render/visibility.h"

#include <math.h>
#include <string.h>

#include "common/mem.h"
#include "common/rng.h"
#include "server/scene/area_sample.h"

#define POINTS 256 /* surface points per bin */
#define SEED UINT64_C(0x7265616368)

struct visibility_bins {
    struct area_sampler area;
    const struct accel *accel;
    float share[VISIBILITY_ROWS][VISIBILITY_COLUMNS];
};

/* Number `which`, in [0, 1), of sample `i` of a bin. */
static float number(size_t bin, size_t i, uint64_t which) {
    return rng_to_float((uint32_t)(rng_key(SEED + which, bin, i) >> 32));
}

/* Surface points are stratified by area; directions are random within the bin. */
static void measure_bin(void *user, size_t bin, int thread) {
    (void)thread;
    struct visibility_bins *m = user;
    const struct mesh *mesh = m->area.mesh;
    double total = m->area.until[mesh->triangle_count - 1];
    float sum = 0.0f;
    for (size_t i = 0; i < POINTS; i++) {
        double column = (double)(bin % VISIBILITY_COLUMNS) + (double)number(bin, i, 0);
        double row = (double)(bin / VISIBILITY_COLUMNS) + (double)number(bin, i, 1);
        vec3 direction = latlong_direction(column / VISIBILITY_COLUMNS, row / VISIBILITY_ROWS);
        size_t t = area_sampler_triangle(&m->area, total * ((double)i + (double)number(bin, i, 2)) / POINTS);
        vec3 normal = vec3_normalize(mesh_cross(mesh, t));
        float cosine = vec3_dot(normal, direction);
        if (!(cosine > 0.0f))
            continue;
        float root = sqrtf(number(bin, i, 3)), along = number(bin, i, 4);
        vec3 point = mesh_point(mesh, t, root * (1.0f - along), root * along);
        vec3 origin = accel_offset(point, normal, direction);
        if (!accel_occluded(m->accel, origin, direction, 0.0f, INFINITY))
            sum += cosine;
    }
    m->share[bin / VISIBILITY_COLUMNS][bin % VISIBILITY_COLUMNS] = sum / POINTS;
}

/* Average with the neighbouring bins: few rays find a small opening. */
static float blurred(const struct visibility_bins *m, int row, int column) {
    float sum = 0.0f;
    for (int y = row - 1; y <= row + 1; y++) {
        for (int x = column - 1; x <= column + 1; x++) {
            int inside = y < 0 ? 0 : y < VISIBILITY_ROWS ? y : VISIBILITY_ROWS - 1;
            sum += m->share[inside][(x + VISIBILITY_COLUMNS) % VISIBILITY_COLUMNS];
        }
    }
    return sum / 9.0f;
}

void visibility_measure(struct visibility *visibility, const struct mesh *mesh, const struct accel *accel,
                        struct parallel *pool) {
    struct visibility_bins *m = mem_calloc(1, sizeof *m);
    m->accel = accel;
    area_sampler_init(&m->area, mesh);
    parallel_for(pool, (size_t)VISIBILITY_ROWS * VISIBILITY_COLUMNS, measure_bin, m);
    for (int y = 0; y < VISIBILITY_ROWS; y++)
        for (int x = 0; x < VISIBILITY_COLUMNS; x++)
            visibility->share[y][x] = blurred(m, y, x);
    visibility->area = m->area.until[mesh->triangle_count - 1];
    area_sampler_release(&m->area);
    mem_free(m);
}
