/* test_segment_relief.c -- what stands off a wall of a scan: a panel as scans round it, a wall that bows or is rough
 * and has none, one that has several, and a ball. */
#include "server/scene/segment_relief.h"

#include "common/rng.h"
#include "tests/unit/room.h"

#define TURN 6.2831853f
#define COLUMNS 160 /* quads of 2.5 cm */
#define ROWS 120

static float noise(uint64_t key) { return 2.0f * rng_to_float((uint32_t)rng_key(key, 5, 0)) - 1.0f; }

/* 1 within the rectangle, 0 outside of it, a slope of 5 cm between. */
static float inside(float x, float y, float left, float low, float right, float high) {
    float off = fminf(fminf(x - left, right - x), fminf(y - low, high - y));
    float t = clampf(off / 0.05f + 0.5f, 0.0f, 1.0f);
    return t * t * (3.0f - 2.0f * t);
}

struct wall {
    float waves_m, bow_m, bump_m, panel_m, picture_m;
};

/* A wall of 4 x 3 m with waves of 40 cm, as depth maps leave, a bow over its width, a bump of 1 m, and noise. */
static vec3 wall_at(float u, float v, void *user) {
    const struct wall *w = user;
    float x = 4.0f * u, y = 3.0f * v, waves = w->waves_m * sinf(TURN * x / 0.4f) * sinf(TURN * y / 0.4f + 1.0f);
    uint64_t key = (uint64_t)lrintf(x * 1000.0f) << 32 | (uint64_t)lrintf(y * 1000.0f);
    float bump = w->bump_m * expf(-((x - 1.6f) * (x - 1.6f) + (y - 1.4f) * (y - 1.4f)) / 0.18f);
    float z = waves + bump + w->bow_m * sinf(0.5f * TURN * u) + w->panel_m * inside(x, y, 1.0f, 0.8f, 2.2f, 2.0f) +
              w->picture_m * inside(x, y, 2.8f, 1.2f, 3.3f, 1.6f) + 0.0003f * noise(key);
    return (vec3){x, y, z};
}

static uint32_t segment_at(const struct segments *s, float x, float y) {
    uint32_t column = (uint32_t)(x / 4.0f * COLUMNS), row = (uint32_t)(y / 3.0f * ROWS);
    return s->of_triangle[2 * (row * COLUMNS + column)];
}

static void check_wall(struct wall wall, size_t parts) {
    struct mesh mesh = room_grid(COLUMNS, ROWS, wall_at, &wall);
    struct segments s;
    segments_automatic(&s, &mesh);
    CHECK_THAT(s.count == 1 + parts, "waves %g, bow %g, panel %g: %zu segments", (double)wall.waves_m,
               (double)wall.bow_m, (double)wall.panel_m, s.count);
    uint32_t own = segment_at(&s, 0.5f, 0.5f);
    CHECK(segment_at(&s, 3.8f, 2.8f) == own && segment_at(&s, 2.5f, 1.4f) == own);
    CHECK((segment_at(&s, 1.6f, 1.4f) != own) == (parts > 0));
    CHECK((segment_at(&s, 3.0f, 1.4f) != own) == (parts > 1));
    for (size_t i = 0; i < s.count; i++)
        CHECK(s.id[i] == (int64_t)i);
    size_t wrong = 0; /* triangles whose centre lies 2.5 cm or more from the border, on the wrong side */
    for (size_t t = 0; t < mesh.triangle_count && parts > 0; t++) {
        vec3 p = mesh_point(&mesh, t, 1.0f / 3.0f, 1.0f / 3.0f);
        float share = inside(p.x, p.y, 1.0f, 0.8f, 2.2f, 2.0f);
        wrong += share == 1.0f ? s.of_triangle[t] != segment_at(&s, 1.6f, 1.4f)
                               : share == 0.0f && s.of_triangle[t] == segment_at(&s, 1.6f, 1.4f);
    }
    CHECK_THAT(wrong == 0, "%zu triangles", wrong);
    segments_release(&s);
    mesh_release(&mesh);
}

/* All but its poles. */
static vec3 ball(float u, float v, void *user) {
    (void)user;
    float around = TURN * u, down = 0.1f + 2.9f * v;
    return (vec3){sinf(down) * cosf(around), sinf(down) * sinf(around), -cosf(down)};
}

/* Half of a ball and all of it lie in no plane; nor does a single triangle. */
static void test_round(void) {
    struct mesh mesh = room_grid(60, 30, ball, NULL);
    const size_t counts[] = {1, mesh.triangle_count / 2, mesh.triangle_count};
    for (int i = 0; i < 3; i++) {
        struct adjacency adjacency;
        struct mesh part = mesh;
        part.triangle_count = counts[i];
        uint32_t *of_triangle = mem_calloc(part.triangle_count, sizeof *of_triangle);
        adjacency_make(&adjacency, &part);
        size_t count = segment_relief_split(of_triangle, 1, &part, &adjacency, 0.0);
        CHECK_THAT(count == 1, "%zu triangles: %zu segments", part.triangle_count, count);
        adjacency_release(&adjacency);
        mem_free(of_triangle);
    }
    mesh_release(&mesh);
}

int main(void) {
    check_wall((struct wall){.waves_m = 0.002f}, 0);
    check_wall((struct wall){.waves_m = 0.002f, .panel_m = 0.02f}, 1);
    check_wall((struct wall){.waves_m = 0.002f, .panel_m = -0.02f}, 1);
    check_wall((struct wall){.waves_m = 0.002f, .panel_m = 0.025f, .picture_m = 0.02f}, 2);
    check_wall((struct wall){.waves_m = 0.002f, .bow_m = 0.06f}, 0);
    check_wall((struct wall){.waves_m = 0.002f, .bump_m = 0.04f}, 0);
    check_wall((struct wall){.waves_m = 0.006f, .panel_m = 0.02f}, 0); /* as high as 5 deviations of its waves */
    test_round();
    return check_result();
}
