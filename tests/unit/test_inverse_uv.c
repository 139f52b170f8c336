/* test_inverse_uv.c -- there and back between surface and texels; ownership; order of the list;
 * the same bytes for any number of threads. */
#include "server/scene/inverse_uv.h"

#include "common/rng.h"
#include "server/scene/atlas_chart.h"
#include "tests/unit/room.h"

#define TILE 32

struct fixture {
    struct mesh mesh;
    struct segments segments;
    struct atlas atlas;
    struct inverse_uv inverse;
};

static void fixture_release(struct fixture *f) {
    inverse_uv_release(&f->inverse);
    atlas_release(&f->atlas);
    segments_release(&f->segments);
    mesh_release(&f->mesh);
}

/* Makes atlas and inverse; checks one thread against several. */
static void fixture_make(struct fixture *f, uint32_t size) {
    struct error err = {0};
    CHECK_THAT(atlas_make(&f->atlas, &f->mesh, &f->segments, size, 0.0f, ATLAS_PADDING, &err) == STATUS_OK, "%s",
               err.message);
    struct parallel *one = parallel_new(1), *five = parallel_new(5);
    struct inverse_uv other;
    inverse_uv_make(&f->inverse, &f->atlas, f->mesh.triangle_count, one);
    inverse_uv_make(&other, &f->atlas, f->mesh.triangle_count, five);
    CHECK(other.valid_count == f->inverse.valid_count);
    CHECK(memcmp(other.triangle, f->inverse.triangle, (size_t)size * size * sizeof *other.triangle) == 0);
    CHECK(memcmp(other.valid, f->inverse.valid, other.valid_count * sizeof *other.valid) == 0);
    inverse_uv_release(&other);
    parallel_free(one);
    parallel_free(five);
}

/* A random point of the surface lands on a valid texel, and the texel leads back to a place within
 * its own diagonal: in the atlas always, on the surface where it does not lie in folds. */
static void check_round_trip(const struct fixture *f, uint32_t sample_count) {
    size_t lost = 0, far_in_atlas = 0, far_on_surface = 0, exact = 0, n = f->mesh.triangle_count;
    double diagonal = sqrt(2.0) * 1.02, most_lean = cos(CHART_MAX_LEAN_DEG * 3.14159265358979 / 180.0);
    double reach_m = diagonal / most_lean / (double)f->atlas.texels_per_metre;
    for (uint32_t i = 0; i < sample_count; i++) {
        size_t t = (size_t)(rng_key(i, 1, 0) % n);
        float b1 = rng_to_float((uint32_t)rng_key(i, 2, 0));
        float b2 = rng_to_float((uint32_t)rng_key(i, 3, 0));
        if (b1 + b2 > 1.0f) {
            b1 = 1.0f - b1;
            b2 = 1.0f - b2;
        }
        if (i % 10 == 0) /* on an edge, at times on a corner */
            b2 = i % 20 == 0 ? 0.0f : 1.0f - b1;
        vec2 place = atlas_point(&f->atlas, t, b1, b2);
        uint32_t back;
        float c1, c2;
        if (!inverse_uv_lookup(&f->inverse, &f->atlas, place.x, place.y, &back, &c1, &c2)) {
            lost++;
            continue;
        }
        CHECK(c1 >= 0.0f && c2 >= 0.0f && c1 + c2 <= 1.000001f);
        vec2 moved = vec2_sub(atlas_point(&f->atlas, back, c1, c2), place);
        far_in_atlas += hypot((double)moved.x, (double)moved.y) > diagonal;
        vec3 from = mesh_point(&f->mesh, t, b1, b2), to = mesh_point(&f->mesh, back, c1, c2);
        double moved_m = (double)vec3_length(vec3_sub(to, from));
        far_on_surface += moved_m > reach_m;
        exact += moved_m < 0.02 / (double)f->atlas.texels_per_metre;
        CHECK(f->atlas.chart_of_triangle[back] == f->atlas.chart_of_triangle[t]);
    }
    printf("%u samples: %zu lost, %zu far in the atlas, %zu far on the surface, %zu exact\n", sample_count, lost,
           far_in_atlas, far_on_surface, exact);
    CHECK(lost == 0);
    CHECK(far_in_atlas == 0);
    CHECK(far_on_surface <= sample_count / 500);
}

static bool holds(const struct atlas *atlas, uint32_t t, double x, double y) {
    const vec2 *c = atlas->corner[t];
    int left = 0, right = 0;
    for (int i = 0; i < 3; i++) {
        vec2 e = vec2_sub(c[(i + 1) % 3], c[i]);
        double side = (double)e.x * (y - (double)c[i].y) - (double)e.y * (x - (double)c[i].x);
        left += side >= 0.0;
        right += side <= 0.0;
    }
    return left != right && (left == 3 || right == 3); /* equal: it has no area */
}

/* The list is complete and in order; a centre's own triangle, the least of several, is its
 * texel's. */
static void check_texels(const struct fixture *f) {
    size_t width = f->inverse.width, set = 0, unordered = 0, invalid = 0;
    uint64_t last = 0;
    for (size_t i = 0; i < width * f->inverse.height; i++)
        set += f->inverse.triangle[i] != INVERSE_UV_NONE;
    CHECK(set == f->inverse.valid_count);
    CHECK_NEAR(f->atlas.utilisation, (double)set / (double)(width * f->inverse.height), 1e-9);
    for (size_t i = 0; i < f->inverse.valid_count; i++) {
        uint32_t texel = f->inverse.valid[i];
        uint64_t x = texel % width, y = texel / width;
        uint64_t tile = y / TILE * ((width + TILE - 1) / TILE) + x / TILE;
        uint64_t key = tile * TILE * TILE + y % TILE * TILE + x % TILE;
        unordered += i > 0 && key <= last;
        last = key;
        invalid += f->inverse.triangle[texel] == INVERSE_UV_NONE;
    }
    CHECK(unordered == 0 && invalid == 0);

    uint32_t *owner = mem_array(width * f->inverse.height, sizeof *owner);
    memset(owner, 0xff, width * f->inverse.height * sizeof *owner);
    for (size_t t = f->mesh.triangle_count; t-- > 0;) {
        const vec2 *c = f->atlas.corner[t];
        float x0 = fminf(c[0].x, fminf(c[1].x, c[2].x)), x1 = fmaxf(c[0].x, fmaxf(c[1].x, c[2].x));
        float y0 = fminf(c[0].y, fminf(c[1].y, c[2].y)), y1 = fmaxf(c[0].y, fmaxf(c[1].y, c[2].y));
        if (!((x1 - x0) * (y1 - y0) > 0.0f))
            continue;
        for (size_t y = (size_t)y0; y <= (size_t)y1 && y < f->inverse.height; y++)
            for (size_t x = (size_t)x0; x <= (size_t)x1 && x < width; x++)
                if (holds(&f->atlas, (uint32_t)t, (double)x + 0.5, (double)y + 0.5))
                    owner[y * width + x] = (uint32_t)t;
    }
    size_t wrong = 0, centres = 0;
    for (size_t i = 0; i < width * f->inverse.height; i++) {
        wrong += owner[i] != INVERSE_UV_NONE && owner[i] != f->inverse.triangle[i];
        centres += owner[i] != INVERSE_UV_NONE;
    }
    CHECK_THAT(wrong == 0 && centres > 0, "%zu of %zu centres are another triangle's", wrong, centres);
    mem_free(owner);
}

/* A needle far thinner than a texel beside a square: it has texels of its own all along. */
static void test_needle(void) {
    struct fixture f = {0};
    static const vec3 position[7] = {{0, 0, 0}, {1, 0, 0},    {1, 1, 0},      {0, 1, 0},
                                     {0, 0, 2}, {1, 0.3f, 2}, {1, 0.3001f, 2}};
    static const uint32_t index[3][3] = {{0, 1, 2}, {0, 2, 3}, {4, 5, 6}};
    f.mesh = room_new(7, 3);
    memcpy(f.mesh.position, position, sizeof position);
    memcpy(f.mesh.index, index, sizeof index);
    room_one_segment(&f.segments, &f.mesh);
    fixture_make(&f, 100);
    size_t needle = 0;
    for (size_t i = 0; i < f.inverse.valid_count; i++)
        needle += f.inverse.triangle[f.inverse.valid[i]] == 2;
    CHECK_THAT((float)needle >= f.atlas.texels_per_metre, "%zu", needle);
    check_round_trip(&f, 20000);
    check_texels(&f);
    uint32_t t;
    float b1, b2;
    CHECK(!inverse_uv_lookup(&f.inverse, &f.atlas, -0.5f, 3.0f, &t, &b1, &b2));
    CHECK(!inverse_uv_lookup(&f.inverse, &f.atlas, 3.0f, 100.0f, &t, &b1, &b2));
    CHECK(!inverse_uv_lookup(&f.inverse, &f.atlas, NAN, 3.0f, &t, &b1, &b2));
    fixture_release(&f);
}

static vec3 vase(float u, float v, void *user) {
    (void)user;
    float radius = 0.3f + 0.1f * sinf(9.0f * v);
    return (vec3){radius * cosf(6.2831853f * u), radius * sinf(6.2831853f * u), v};
}

static void test_vase(uint32_t size) {
    struct fixture f = {.mesh = room_grid(60, 40, vase, NULL)};
    struct error err = {0};
    CHECK(mesh_check(&f.mesh, "vase", NULL, &err) == STATUS_OK);
    room_one_segment(&f.segments, &f.mesh);
    fixture_make(&f, size);
    check_round_trip(&f, 100000);
    check_texels(&f);
    fixture_release(&f);
}

static void test_room(const char *name, uint32_t size) {
    struct fixture f = {0};
    if (!room_load(name, &f.mesh))
        return;
    segments_from_object_id(&f.segments, &f.mesh);
    fixture_make(&f, size);
    check_round_trip(&f, 300000);
    check_texels(&f);
    fixture_release(&f);
}

int main(void) {
    test_needle();
    test_vase(64);
    test_vase(700); /* no whole number of tiles */
    test_room("rooms/staircase2", 1024);
    test_room("rooms/bathroom", 1024);
    return check_result();
}
