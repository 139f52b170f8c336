/* test_segment.c -- segments from ids; automatic ones on a noisy sheet with a box, on smooth and
 * creased shapes, and on the rooms, whose objects are known. */
#include "server/scene/segment.h"

#include "common/rng.h"
#include "tests/unit/room.h"

static float noise(uint64_t key) { return rng_to_float((uint32_t)rng_key(key, 11, 0)) - 0.5f; }

/* A floor of 4 x 4 m with a box of 1 x 1 x 0.5 m on it, as a height field fused from depth: quads
 * of 4 cm, noise of up to 5 mm in every direction. */
static vec3 scanned_floor(float u, float v, void *user) {
    (void)user;
    uint64_t key = (uint64_t)lrintf(u * 10000.0f) << 32 | (uint64_t)lrintf(v * 10000.0f);
    float x = 4.0f * u, y = 4.0f * v;
    bool box = x > 1.5f && x < 2.5f && y > 1.5f && y < 2.5f;
    return (vec3){x + 0.01f * noise(key), y + 0.01f * noise(key + 1), (box ? 0.5f : 0.0f) + 0.01f * noise(key + 2)};
}

static uint32_t segment_at(const struct mesh *mesh, const struct segments *segments, float x, float y) {
    float least = INFINITY;
    uint32_t found = 0;
    for (size_t t = 0; t < mesh->triangle_count; t++) {
        vec3 p = mesh_point(mesh, t, 1.0f / 3.0f, 1.0f / 3.0f);
        float distance = (p.x - x) * (p.x - x) + (p.y - y) * (p.y - y);
        if (distance < least) {
            least = distance;
            found = segments->of_triangle[t];
        }
    }
    return found;
}

static void check_well_formed(const struct segments *segments, size_t triangle_count) {
    unsigned char *used = mem_calloc(segments->count, 1);
    for (size_t t = 0; t < triangle_count; t++) {
        CHECK(segments->of_triangle[t] < segments->count);
        used[segments->of_triangle[t]] = 1;
    }
    for (size_t s = 0; s < segments->count; s++)
        CHECK_THAT(used[s], "segment %zu has no triangle", s);
    mem_free(used);
}

static void test_ids(void) {
    struct mesh mesh = room_new(3, 5);
    static const int64_t id[5] = {70000, -1, 70000, INT64_MIN, -1};
    mesh.object_id = mem_array(5, sizeof *mesh.object_id);
    memcpy(mesh.object_id, id, sizeof id);
    struct segments s;
    segments_from_object_id(&s, &mesh);
    CHECK(s.count == 3 && s.id[0] == INT64_MIN && s.id[1] == -1 && s.id[2] == 70000);
    static const uint32_t wanted[5] = {2, 1, 2, 0, 1};
    CHECK(memcmp(s.of_triangle, wanted, sizeof wanted) == 0);
    segments_release(&s);
    mesh_release(&mesh);
}

static void test_scan(void) {
    struct mesh mesh = room_grid(100, 100, scanned_floor, NULL);
    struct segments s, again;
    segments_automatic(&s, &mesh);
    check_well_formed(&s, mesh.triangle_count);
    uint32_t floor_segment = segment_at(&mesh, &s, 0.5f, 0.5f), top = segment_at(&mesh, &s, 2.0f, 2.0f);
    CHECK(floor_segment != top);
    CHECK(segment_at(&mesh, &s, 3.5f, 3.5f) == floor_segment);
    CHECK(segment_at(&mesh, &s, 1.7f, 2.3f) == top);
    CHECK_THAT(s.count <= 16, "%zu segments", s.count);
    segments_automatic(&again, &mesh);
    CHECK(again.count == s.count &&
          memcmp(again.of_triangle, s.of_triangle, mesh.triangle_count * sizeof *s.of_triangle) == 0);
    segments_release(&again);
    segments_release(&s);
    mesh_release(&mesh);
}

/* A corridor of quads of very different sizes: two walls and a floor. */
static vec3 corridor(float u, float v, void *user) {
    (void)user;
    float y = 3.0f * v * v; /* uneven: no scan */
    return u < 0.4f   ? (vec3){-1.0f, y, 1.0f - u * 2.5f}
           : u < 0.6f ? (vec3){-1.0f + (u - 0.4f) * 10.0f, y, 0.0f}
                      : (vec3){1.0f, y, (u - 0.6f) * 2.5f};
}

static vec3 ball(float u, float v, void *user) {
    (void)user;
    float around = 6.2831853f * u, down = 0.1f + 2.9f * v;
    return (vec3){sinf(down) * cosf(around), sinf(down) * sinf(around), -cosf(down)};
}

static void test_shapes(void) {
    struct segments s;
    struct mesh mesh = room_grid(10, 40, corridor, NULL);
    segments_automatic(&s, &mesh);
    check_well_formed(&s, mesh.triangle_count);
    CHECK_THAT(s.count == 3, "corridor: %zu segments", s.count);
    segments_release(&s);
    mesh_release(&mesh);

    mesh = room_grid(60, 30, ball, NULL); /* smooth all over: one */
    segments_automatic(&s, &mesh);
    CHECK_THAT(s.count == 1, "ball: %zu segments", s.count);
    segments_release(&s);
    mesh_release(&mesh);
}

/* The corridor's walls are one object, its floor another, of which a sliver of the left wall is part; its segments are
 * the left wall, the floor, the right wall in this order. */
static void test_names(void) {
    static const struct {
        const char *of_object[2];
        float floor_from_u; /* the floor is u from .4 to .6 */
        const char *wanted[3];
    } table[] = {
        {{"walls", "floor"}, 0.4f, {"walls (1)", "floor", "walls (2)"}},
        {{"walls", ""}, 0.4f, {"walls (1)", NULL, "walls (2)"}},
        {{"", ""}, 0.4f, {NULL, NULL, NULL}},
        {{"walls", "floor"}, 0.38f, {"walls (1)", "floor", "walls (2)"}}, /* 1/20 of the left wall is called floor */
        {{"walls", "floor"}, 0.25f, {NULL, "floor", "walls"}},            /* 3/8 of it: it has no name */
    };
    struct mesh mesh = room_grid(100, 40, corridor, NULL);
    mesh.object_id = mem_array(mesh.triangle_count, sizeof *mesh.object_id);
    mesh.name = mem_array(2, sizeof *mesh.name);
    mesh.name_count = 2;
    for (size_t i = 0; i < sizeof table / sizeof *table; i++) {
        for (size_t t = 0; t < mesh.triangle_count; t++) {
            float u = ((float)(t / 2 % 100) + 0.5f) / 100.0f;
            mesh.object_id[t] = u > table[i].floor_from_u && u < 0.6f;
        }
        for (int k = 0; k < 2; k++)
            mesh.name[k] = mem_printf("%s", table[i].of_object[k]);
        struct segments s;
        segments_automatic(&s, &mesh);
        CHECK(s.count == 3);
        for (size_t k = 0; k < 3; k++) {
            const char *name = segments_name(&s, &mesh, k), *wanted = table[i].wanted[k];
            CHECK_THAT(wanted ? name && strcmp(name, wanted) == 0 : !name, "row %zu, segment %zu: %s", i, k,
                       name ? name : "no name");
        }
        s.id = mem_realloc_array(s.id, 4,
                                 sizeof *s.id); /* a part is split off the last one, as light/decision/split.c does */
        s.id[s.count++] = s.id[2];
        CHECK(segments_name(&s, &mesh, 3) == segments_name(&s, &mesh, 2));
        CHECK(segments_known_part(&s, 3, (bool[]){true, true, true, false}) == 2);
        CHECK(segments_known_part(&s, 3, (bool[]){true, true, false, false}) == 3);
        CHECK(segments_known_part(&s, 0, (bool[]){true, true, false, false}) == 0);
        segments_release(&s);
        for (int k = 0; k < 2; k++)
            mem_free(mesh.name[k]);
    }
    mesh.name_count = 0;
    mesh_release(&mesh);
}

/* Share of the area whose segment's main object is its own. */
static double purity(const struct mesh *mesh, const struct segments *s, const struct segments *truth) {
    double *shared = mem_calloc(s->count * truth->count, sizeof *shared);
    double total = 0.0, pure = 0.0;
    for (size_t t = 0; t < mesh->triangle_count; t++)
        shared[s->of_triangle[t] * truth->count + truth->of_triangle[t]] += (double)mesh_triangle_area(mesh, t);
    for (size_t i = 0; i < s->count; i++) {
        double most = 0.0;
        for (size_t j = 0; j < truth->count; j++) {
            total += shared[i * truth->count + j];
            most = fmax(most, shared[i * truth->count + j]);
        }
        pure += most;
    }
    mem_free(shared);
    return pure / total;
}

static void test_room(const char *name, double least_purity, size_t most_segments) {
    struct mesh mesh;
    struct segments s, truth;
    if (!room_load(name, &mesh))
        return;
    segments_from_object_id(&truth, &mesh);
    segments_automatic(&s, &mesh);
    check_well_formed(&s, mesh.triangle_count);
    double found = purity(&mesh, &s, &truth);
    printf("%s: %zu objects, %zu segments, purity %.4f\n", name, truth.count, s.count, found);
    CHECK_THAT(found >= least_purity, "%.4f", found);
    CHECK_THAT(s.count <= most_segments, "%zu", s.count);
    segments_release(&s);
    segments_release(&truth);
    mesh_release(&mesh);
}

/* A real fused mesh in 5,973 pieces: neither one segment nor thousands. */
static void test_kitchen(void) {
    struct mesh mesh;
    struct segments s;
    if (!room_load("redkitchen", &mesh))
        return;
    segments_automatic(&s, &mesh);
    check_well_formed(&s, mesh.triangle_count);
    double *area = mem_calloc(s.count, sizeof *area), largest = 0.0;
    for (size_t t = 0; t < mesh.triangle_count; t++)
        area[s.of_triangle[t]] += (double)mesh_triangle_area(&mesh, t);
    for (size_t i = 0; i < s.count; i++)
        largest = fmax(largest, area[i] / mesh_area(&mesh));
    printf("redkitchen: %zu segments, the largest is %.3f of the area\n", s.count, largest);
    CHECK_THAT(s.count >= 50 && s.count <= 600, "%zu", s.count);
    CHECK_THAT(largest < 0.3, "%g", largest);
    mem_free(area);
    segments_release(&s);
    mesh_release(&mesh);
}

int main(void) {
    test_ids();
    test_scan();
    test_shapes();
    test_names();
    test_room("rooms/staircase2", 0.95, 400);
    test_room("rooms/bathroom", 0.98, 1500);
    test_kitchen();
    return check_result();
}
