/* test_atlas.c -- what atlas.h promises, checked texel by texel: charts keep their distance and
 * never lie over themselves or cross a segment, areas are kept within the stated bound, rooms
 * fill the texture, and what cannot fit is refused with a sentence. In the long form (UNBAKE_LONG) one more room. */
#include "server/scene/atlas.h"

#include "server/scene/adjacency.h"
#include "server/scene/atlas_chart.h"
#include "server/scene/coverage.h"
#include "tests/unit/room.h"

#define NONE UINT32_MAX

static struct coverage_triangle units_of(const struct atlas *atlas, size_t t) {
    struct coverage_triangle u;
    for (int c = 0; c < 3; c++) {
        float x = atlas->corner[t][c].x * COVERAGE_UNITS, y = atlas->corner[t][c].y * COVERAGE_UNITS;
        CHECK(x == rintf(x) && y == rintf(y)); /* whole units: coverage is exact */
        u.x[c] = (int32_t)x;
        u.y[c] = (int32_t)y;
    }
    return u;
}

/* The chart that covers each texel; two charts on one are a failure. */
static uint32_t *chart_map(const struct atlas *atlas, size_t triangle_count, size_t *covered) {
    uint32_t *map = mem_array((size_t)atlas->width * atlas->height, sizeof *map);
    memset(map, 0xff, (size_t)atlas->width * atlas->height * sizeof *map);
    size_t shared = 0, outside = 0;
    *covered = 0;
    for (size_t t = 0; t < triangle_count; t++) {
        struct coverage_triangle u = units_of(atlas, t);
        int32_t y0, y1, x0, x1;
        coverage_rows(&u, COVERAGE_UNITS, &y0, &y1);
        for (int32_t y = y0; y <= y1; y++) {
            coverage_columns(&u, COVERAGE_UNITS, y, &x0, &x1);
            for (int32_t x = x0; x <= x1; x++) {
                if (x < 0 || y < 0 || x >= (int32_t)atlas->width || y >= (int32_t)atlas->height) {
                    outside++;
                    continue;
                }
                uint32_t *at = &map[(size_t)y * atlas->width + (size_t)x];
                *covered += *at == NONE;
                shared += *at != NONE && *at != atlas->chart_of_triangle[t];
                *at = atlas->chart_of_triangle[t];
            }
        }
    }
    CHECK_THAT(shared == 0 && outside == 0, "%zu texels with two charts, %zu outside", shared, outside);
    return map;
}

static void check_padding(const struct atlas *atlas, const uint32_t *map) {
    size_t close = 0;
    int32_t w = (int32_t)atlas->width, h = (int32_t)atlas->height;
    for (int32_t y = 0; y < h; y++)
        for (int32_t x = 0; x < w; x++) {
            uint32_t chart = map[(size_t)y * atlas->width + (size_t)x];
            if (chart == NONE)
                continue;
            for (int32_t dy = 0; dy <= ATLAS_PADDING && y + dy < h; dy++)
                for (int32_t dx = -ATLAS_PADDING; dx <= ATLAS_PADDING; dx++) {
                    if (x + dx < 0 || x + dx >= w)
                        continue;
                    uint32_t other = map[(size_t)(y + dy) * atlas->width + (size_t)(x + dx)];
                    close += other != NONE && other != chart;
                }
        }
    CHECK_THAT(close == 0, "%zu pairs of texels of two charts are nearer than %d texels", close, ATLAS_PADDING);
}

/* No texel's centre may lie well inside two triangles. */
static void check_overlap(const struct atlas *atlas, size_t triangle_count) {
    unsigned char *taken = mem_calloc((size_t)atlas->width * atlas->height, 1);
    size_t twice = 0;
    for (size_t t = 0; t < triangle_count; t++) {
        const vec2 *c = atlas->corner[t];
        struct coverage_triangle u = units_of(atlas, t);
        int32_t y0, y1, x0, x1;
        coverage_rows(&u, COVERAGE_UNITS, &y0, &y1);
        for (int32_t y = y0; y <= y1; y++) {
            coverage_columns(&u, COVERAGE_UNITS, y, &x0, &x1);
            for (int32_t x = x0; x <= x1; x++) {
                int left = 0, right = 0;
                for (int i = 0; i < 3; i++) {
                    vec2 e = vec2_sub(c[(i + 1) % 3], c[i]);
                    double side = (double)e.x * (y + 0.5 - (double)c[i].y) - (double)e.y * (x + 0.5 - (double)c[i].x);
                    double inside = 0.03 * sqrt((double)e.x * (double)e.x + (double)e.y * (double)e.y);
                    left += side > inside;
                    right += side < -inside;
                }
                if (left == 3 || right == 3)
                    twice += taken[(size_t)y * atlas->width + (size_t)x]++ > 0;
            }
        }
    }
    CHECK_THAT(twice == 0, "%zu texels lie in two triangles", twice);
    mem_free(taken);
}

static void check_segments(const struct atlas *atlas, const struct mesh *mesh, const struct segments *segments) {
    uint32_t *segment = mem_array(atlas->chart_count, sizeof *segment);
    memset(segment, 0xff, atlas->chart_count * sizeof *segment);
    size_t crossed = 0, empty = 0;
    for (size_t t = 0; t < mesh->triangle_count; t++) {
        uint32_t chart = atlas->chart_of_triangle[t];
        CHECK(chart < atlas->chart_count);
        crossed += segment[chart] != NONE && segment[chart] != segments->of_triangle[t];
        segment[chart] = segments->of_triangle[t];
    }
    for (size_t c = 0; c < atlas->chart_count; c++)
        empty += segment[c] == NONE;
    CHECK_THAT(crossed == 0 && empty == 0, "%zu crossings, %zu empty charts", crossed, empty);
    mem_free(segment);
}

/* Areas shrink by at most the greatest lean, but for the rounding of corners; returns the ratio of
 * all areas together. */
static double check_areas(const struct atlas *atlas, const struct mesh *mesh) {
    double least = cos(CHART_MAX_LEAN_DEG * 3.14159265358979 / 180.0), flat = 0.0, true_area = 0.0;
    double scale = (double)atlas->texels_per_metre * (double)atlas->texels_per_metre;
    size_t wrong = 0;
    for (size_t t = 0; t < mesh->triangle_count; t++) {
        const vec2 *c = atlas->corner[t];
        vec2 a = vec2_sub(c[1], c[0]), b = vec2_sub(c[2], c[0]);
        double texels = 0.5 * fabs((double)a.x * (double)b.y - (double)a.y * (double)b.x);
        double wanted = (double)mesh_triangle_area(mesh, t) * scale;
        double around = (double)(sqrtf(a.x * a.x + a.y * a.y) + sqrtf(b.x * b.x + b.y * b.y));
        double rounding = 2.0 * around / COVERAGE_UNITS + 1e-4 * wanted;
        wrong += texels > wanted + rounding || texels < least * wanted - rounding;
        flat += texels;
        true_area += wanted;
    }
    CHECK_THAT(wrong == 0, "%zu triangles outside the bound", wrong);
    return flat / true_area;
}

/* Returns the ratio of areas. */
static double check_atlas(const struct atlas *atlas, const struct mesh *mesh, const struct segments *segments) {
    size_t covered;
    uint32_t *map = chart_map(atlas, mesh->triangle_count, &covered);
    CHECK_NEAR(atlas->utilisation, (double)covered / ((double)atlas->width * atlas->height), 1e-9);
    check_padding(atlas, map);
    check_overlap(atlas, mesh->triangle_count);
    check_segments(atlas, mesh, segments);
    mem_free(map);
    return check_areas(atlas, mesh);
}

static void check_same(const struct atlas *a, const struct atlas *b, size_t triangle_count) {
    CHECK(a->texels_per_metre == b->texels_per_metre && a->chart_count == b->chart_count);
    CHECK(memcmp(a->corner, b->corner, triangle_count * sizeof *a->corner) == 0);
    CHECK(memcmp(a->chart_of_triangle, b->chart_of_triangle, triangle_count * sizeof *a->chart_of_triangle) == 0);
}

static void test_room(const char *name, uint32_t size, double utilisation, double area_ratio) {
    struct mesh mesh;
    struct segments segments;
    struct atlas atlas, again;
    struct error err = {0};
    if (!room_load(name, &mesh))
        return;
    segments_from_object_id(&segments, &mesh);
    CHECK(atlas_make(&atlas, &mesh, &segments, size, 0.0f, ATLAS_PADDING, &err) == STATUS_OK);
    CHECK(atlas.width == size && atlas.height == size);
    double ratio = check_atlas(&atlas, &mesh, &segments);
    printf("%s at %u: %zu charts, %.1f texels a metre, utilisation %.4f, area kept %.4f\n", name, size,
           atlas.chart_count, (double)atlas.texels_per_metre, atlas.utilisation, ratio);
    CHECK_THAT(atlas.utilisation >= utilisation, "%.4f", atlas.utilisation);
    CHECK_THAT(ratio >= area_ratio, "%.4f", ratio);
    if (size <= 1024) {
        CHECK(atlas_make(&again, &mesh, &segments, size, 0.0f, ATLAS_PADDING, &err) == STATUS_OK);
        check_same(&atlas, &again, mesh.triangle_count);
        atlas_release(&again);
    }
    atlas_release(&atlas);
    segments_release(&segments);
    mesh_release(&mesh);
}

/* A ramp that winds around an axis: nowhere steep, but it lies over itself. */
static vec3 ramp(float u, float v, void *user) {
    (void)user;
    float angle = 20.0f * u, radius = 1.0f + v;
    return (vec3){radius * cosf(angle), radius * sinf(angle), 0.2f * angle};
}

static vec3 sphere(float u, float v, void *user) {
    (void)user;
    float around = 6.2831853f * u, down = 0.1f + 2.9f * v;
    return (vec3){sinf(down) * cosf(around), sinf(down) * sinf(around), -cosf(down)};
}

/* A sheet with noise of a tenth of its mesh width or more. */
static vec3 noisy_sheet(float u, float v, void *user) {
    (void)user;
    uint32_t seed = (uint32_t)lrintf(u * 1000.0f) * 7919u + (uint32_t)lrintf(v * 1000.0f);
    return (vec3){4.0f * u, 4.0f * v, 0.02f * (float)(seed * 2654435761u >> 8) * 0x1p-24f};
}

static void test_shape(vec3 (*place)(float, float, void *), uint32_t columns, uint32_t rows, size_t most_charts) {
    static const uint32_t sizes[] = {37, 200, 1024};
    struct mesh mesh = room_grid(columns, rows, place, NULL);
    struct segments segments;
    struct error err = {0};
    room_one_segment(&segments, &mesh);
    CHECK(mesh_check(&mesh, "shape", NULL, &err) == STATUS_OK);
    for (size_t i = 0; i < sizeof sizes / sizeof *sizes; i++) {
        struct atlas atlas;
        CHECK_THAT(atlas_make(&atlas, &mesh, &segments, sizes[i], 0.0f, ATLAS_PADDING, &err) == STATUS_OK, "%s",
                   err.message);
        check_atlas(&atlas, &mesh, &segments);
        CHECK_THAT(atlas.chart_count <= most_charts, "%zu charts of %u x %u quads at %u", atlas.chart_count, columns,
                   rows, sizes[i]);
        atlas_release(&atlas);
    }
    segments_release(&segments);
    mesh_release(&mesh);
}

static vec3 flat(float u, float v, void *user) {
    (void)user;
    return (vec3){3.0f * u, 2.0f * v, 0.0f};
}

/* A disc of thin triangles around one vertex. */
static vec3 fan(float u, float v, void *user) {
    (void)user;
    return (vec3){v * cosf(6.2831853f * u), v * sinf(6.2831853f * u), 0.0f};
}

/* Hundred kilometres by a millimetre, far from the origin. */
static vec3 thread(float u, float v, void *user) {
    (void)user;
    return (vec3){1e5f * u, 0.001f * v, 5e5f};
}

static void test_density(void) {
    struct mesh mesh = room_grid(3, 2, flat, NULL);
    struct segments segments;
    struct atlas atlas;
    struct error err = {0};
    room_one_segment(&segments, &mesh);
    CHECK(atlas_make(&atlas, &mesh, &segments, 0, 100.0f, ATLAS_PADDING, &err) == STATUS_OK);
    CHECK(atlas.width == 512 && atlas.height == 512); /* 300 x 200 texels */
    CHECK(atlas.texels_per_metre == 100.0f && atlas.chart_count == 1);
    CHECK_NEAR(check_atlas(&atlas, &mesh, &segments), 1.0, 1e-3);
    atlas_release(&atlas);
    /* 3 m at 6,000 texels a metre pass the largest size. */
    CHECK(atlas_make(&atlas, &mesh, &segments, 0, 6000.0f, ATLAS_PADDING, &err) == STATUS_INPUT);
    CHECK_THAT(strstr(err.message, "6000 texels per metre"), "%s", err.message);
    CHECK(atlas_make(&atlas, &mesh, &segments, 0, -1.0f, ATLAS_PADDING, &err) == STATUS_INPUT);
    CHECK(atlas_make(&atlas, &mesh, &segments, 0, NAN, ATLAS_PADDING, &err) == STATUS_INPUT);
    CHECK(atlas_make(&atlas, &mesh, &segments, 0, 0.0f, ATLAS_PADDING, &err) == STATUS_INPUT);
    CHECK(atlas_make(&atlas, &mesh, &segments, 16385, 0.0f, ATLAS_PADDING, &err) == STATUS_INPUT);
    /* One chart alone fills what its shape lets it. */
    CHECK(atlas_make(&atlas, &mesh, &segments, 3000, 0.0f, ATLAS_PADDING, &err) == STATUS_OK);
    CHECK_THAT(atlas.utilisation > 0.65 && atlas.width == 3000, "%g", atlas.utilisation);
    atlas_release(&atlas);
    segments_release(&segments);
    mesh_release(&mesh);
}

/* More pieces than a small texture has room for: the sentence names a size, and that size works. */
static void test_fragments(void) {
    enum { COUNT = 3000 };
    struct mesh mesh = room_new(3 * COUNT, COUNT);
    struct segments segments;
    struct atlas atlas;
    struct error err = {0};
    for (uint32_t t = 0; t < COUNT; t++)
        for (uint32_t c = 0; c < 3; c++) {
            mesh.position[3 * t + c] = (vec3){(float)t + (c == 1), (float)(c == 2), (float)(t % 7)};
            mesh.index[t][c] = 3 * t + c;
        }
    room_one_segment(&segments, &mesh);
    CHECK(atlas_make(&atlas, &mesh, &segments, 64, 0.0f, ATLAS_PADDING, &err) == STATUS_INPUT);
    CHECK_THAT(strstr(err.message, "3000 pieces") && strstr(err.message, "64 x 64"), "%s", err.message);
    unsigned size = 0;
    CHECK_THAT(sscanf(err.hint, "a texture_size of %u", &size) == 1, "%s", err.hint);
    CHECK(atlas_make(&atlas, &mesh, &segments, size, 0.0f, ATLAS_PADDING, &err) == STATUS_OK);
    CHECK(atlas.chart_count == COUNT);
    check_atlas(&atlas, &mesh, &segments);
    atlas_release(&atlas);
    segments_release(&segments);
    mesh_release(&mesh);
}

static double texel_area(const struct atlas *atlas, size_t t) {
    const vec2 *c = atlas->corner[t];
    vec2 a = vec2_sub(c[1], c[0]), b = vec2_sub(c[2], c[0]);
    return 0.5 * fabs((double)a.x * (double)b.y - (double)a.y * (double)b.x);
}

/* A chart gets the density of its densest triangle; what the others give up is the first one's. */
static void test_uneven(void) {
    struct mesh mesh = room_grid(2, 1, flat, NULL), two = room_new(12, 8);
    struct segments segments;
    struct atlas even, uneven;
    struct error err = {0};
    for (size_t i = 0; i < 12; i++) { /* two of it, one above the other */
        two.position[i] = mesh.position[i % 6];
        two.position[i].z += i < 6 ? 0.0f : 5.0f;
    }
    for (size_t t = 0; t < 8; t++)
        for (size_t c = 0; c < 3; c++)
            two.index[t][c] = mesh.index[t % 4][c] + (t < 4 ? 0 : 6);
    const float density[8] = {1.0f, 0.25f, 0.25f, 0.25f, 0.25f, 0.25f, 0.25f, 0.25f};
    room_one_segment(&segments, &two);
    CHECK(atlas_make(&even, &two, &segments, 512, 0.0f, ATLAS_PADDING, &err) == STATUS_OK);
    CHECK(atlas_make_uneven(&uneven, &two, &segments, 512, density, ATLAS_PADDING, &err) == STATUS_OK);
    CHECK(even.chart_count == 2 && uneven.chart_count == 2);
    size_t covered;
    uint32_t *map = chart_map(&uneven, 8, &covered);
    check_padding(&uneven, map);
    CHECK_NEAR(texel_area(&uneven, 0) / texel_area(&uneven, 3), 1.0, 0.02);
    CHECK_NEAR(texel_area(&uneven, 0) / texel_area(&uneven, 4), 16.0, 0.5);
    CHECK_NEAR(texel_area(&even, 0) / texel_area(&even, 4), 1.0, 0.02);
    CHECK(uneven.texels_per_metre > 1.2f * even.texels_per_metre);
    CHECK_NEAR(sqrt(texel_area(&uneven, 0) / 1.5), uneven.texels_per_metre, 1.0);
    mem_free(map);
    atlas_release(&even);
    atlas_release(&uneven);
    segments_release(&segments);
    mesh_release(&two);
    mesh_release(&mesh);
}

int main(void) {
    test_uneven();
    test_shape(flat, 1, 1, 1);
    test_shape(ramp, 400, 3, 8);
    test_shape(sphere, 60, 30, 24);
    test_shape(noisy_sheet, 100, 100, 1);
    test_shape(fan, 3000, 1, 1);
    test_shape(thread, 20, 1, 1);
    test_density();
    test_fragments();
    test_room("rooms/staircase2", 1024, 0.80, 0.98);
    if (getenv("UNBAKE_LONG"))
        test_room("rooms/staircase2", 2048, 0.80, 0.98);
    test_room("rooms/bathroom", 2048, 0.85, 0.95);
    return check_result();
}
