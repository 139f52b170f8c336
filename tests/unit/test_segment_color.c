/* test_segment_color.c -- what on a wall of a scan has another colour: a wooden panel, a black frame; and what has not:
 * a shadow, light that fades, stripes of paper, noise. */
#include "server/scene/segment_color.h"

#include "common/rng.h"
#include "tests/unit/room.h"

#define COLUMNS 160 /* quads of 2.5 cm */
#define ROWS 120
#define LEAST_AREA 0.0024 /* m^2, of a wall of 4 x 3 m as of the whole mesh */

static vec3 wall_at(float u, float v, void *user) {
    (void)user;
    return (vec3){4.0f * u, 3.0f * v, 0.0f};
}

/* What the wall shows at (x, y). */
struct paint {
    rgb wall, panel; /* the panel: 1 to 2.2 m, .8 to 2 m */
    float fades;     /* part of the light that the right end lacks */
    float shadow;    /* part of the light that is left right of x = 3, within a penumbra of 10 cm */
    float noise;     /* standard deviation, of each triangle */
    float stripe_m;  /* width of stripes, half as much red */
    bool is_torn;    /* no photograph shows every third triangle */
    float hidden_m;  /* nor what is nearer to the panel's border; it counts for neither side */
};

static float noise(size_t t, uint64_t key) {
    float sum = 0.0f; /* of four, about normal */
    for (uint64_t i = 0; i < 4; i++)
        sum += rng_to_float((uint32_t)rng_key(t, key, i)) - 0.5f;
    return sum * sqrtf(3.0f);
}

static bool is_panel(vec3 p) { return p.x > 1.0f && p.x < 2.2f && p.y > 0.8f && p.y < 2.0f; }

static bool is_hidden(const struct paint *paint, vec3 p) {
    float off = fmaxf(fabsf(p.x - 1.6f) - 0.6f, fabsf(p.y - 1.4f) - 0.6f);
    return fabsf(off) < paint->hidden_m;
}

static rgb show(const struct paint *paint, vec3 p, size_t t) {
    rgb color = is_panel(p) ? paint->panel : paint->wall;
    float light = 1.0f - paint->fades * p.x / 4.0f;
    light *= 1.0f - (1.0f - paint->shadow) * clampf((p.x - 3.0f) / 0.1f, 0.0f, 1.0f);
    if (paint->stripe_m > 0.0f && fmodf(p.x, 2.0f * paint->stripe_m) < paint->stripe_m)
        color.r *= 0.5f;
    for (uint64_t k = 0; k < 3; k++)
        (&color.r)[k] *= fmaxf(0.0f, 1.0f + paint->noise * noise(t, k));
    return (paint->is_torn && t % 3 == 0) || is_hidden(paint, p) ? rgb_gray(-1.0f) : rgb_scale(color, light);
}

static void check_least(const char *what, struct paint paint, double least_area, size_t parts) {
    struct mesh mesh = room_grid(COLUMNS, ROWS, wall_at, NULL);
    struct adjacency adjacency;
    uint32_t *of_triangle = mem_calloc(mesh.triangle_count, sizeof *of_triangle);
    rgb *shown = mem_array(mesh.triangle_count, sizeof *shown);
    size_t wrong = 0;
    for (size_t t = 0; t < mesh.triangle_count; t++)
        shown[t] = show(&paint, mesh_point(&mesh, t, 1.0f / 3.0f, 1.0f / 3.0f), t);
    adjacency_make(&adjacency, &mesh);
    size_t count = segment_color_split(of_triangle, 1, &mesh, &adjacency, shown, least_area);
    for (size_t t = 0; t < mesh.triangle_count; t++) {
        vec3 p = mesh_point(&mesh, t, 1.0f / 3.0f, 1.0f / 3.0f);
        wrong += !is_hidden(&paint, p) && of_triangle[t] != (uint32_t)(parts > 0 && is_panel(p));
    }
    printf("%s: %zu parts, %zu triangles wrong\n", what, count - 1, wrong);
    CHECK_THAT(count == 1 + parts && wrong <= mesh.triangle_count / 200, "%s: %zu parts, %zu wrong", what, count - 1,
               wrong);
    adjacency_release(&adjacency);
    mem_free(shown);
    mem_free(of_triangle);
    mesh_release(&mesh);
}

static void check(const char *what, struct paint paint, size_t parts) { check_least(what, paint, LEAST_AREA, parts); }

/* Another segment between two halves of the same colour stays apart from both. */
static void test_segments_stay(void) {
    struct mesh mesh = room_grid(COLUMNS, ROWS, wall_at, NULL);
    struct adjacency adjacency;
    uint32_t *of_triangle = mem_calloc(mesh.triangle_count, sizeof *of_triangle);
    rgb *shown = mem_array(mesh.triangle_count, sizeof *shown);
    for (size_t t = 0; t < mesh.triangle_count; t++) {
        vec3 p = mesh_point(&mesh, t, 1.0f / 3.0f, 1.0f / 3.0f);
        of_triangle[t] = p.x > 2.0f;
        shown[t] = is_panel(p) ? rgb_make(0.5f, 0.3f, 0.15f) : rgb_gray(0.8f);
    }
    adjacency_make(&adjacency, &mesh);
    size_t count = segment_color_split(of_triangle, 2, &mesh, &adjacency, shown, LEAST_AREA), wrong = 0;
    CHECK(count == 4);
    uint32_t left = 0, right = 0;
    for (size_t t = 0; t < mesh.triangle_count; t++) {
        vec3 p = mesh_point(&mesh, t, 1.0f / 3.0f, 1.0f / 3.0f);
        bool is_right = p.x > 2.0f;
        if (is_panel(p) && (is_right ? right : left) == 0)
            *(is_right ? &right : &left) = of_triangle[t];
        wrong += of_triangle[t] != (is_panel(p) ? is_right ? right : left : is_right);
    }
    CHECK_THAT(wrong <= 10 && left >= 2 && right >= 2 && left != right, "%zu wrong, parts %u and %u", wrong, left,
               right);
    adjacency_release(&adjacency);
    mem_free(shown);
    mem_free(of_triangle);
    mesh_release(&mesh);
}

/* A beam of another segment crosses the wall, which stays one, be it seen or not. */
static void test_pieces(bool is_seen) {
    struct mesh mesh = room_grid(COLUMNS, ROWS, wall_at, NULL);
    struct adjacency adjacency;
    uint32_t *of_triangle = mem_calloc(mesh.triangle_count, sizeof *of_triangle);
    rgb *shown = mem_array(mesh.triangle_count, sizeof *shown);
    size_t wrong = 0;
    for (size_t t = 0; t < mesh.triangle_count; t++) {
        float x = mesh_point(&mesh, t, 1.0f / 3.0f, 1.0f / 3.0f).x;
        of_triangle[t] = x > 1.2f && x < 1.5f;
        shown[t] = rgb_gray(is_seen ? 0.8f : -1.0f);
    }
    adjacency_make(&adjacency, &mesh);
    size_t count = segment_color_split(of_triangle, 2, &mesh, &adjacency, shown, LEAST_AREA);
    for (size_t t = 0; t < mesh.triangle_count; t++) {
        float x = mesh_point(&mesh, t, 1.0f / 3.0f, 1.0f / 3.0f).x;
        wrong += of_triangle[t] != (uint32_t)(x > 1.2f && x < 1.5f);
    }
    CHECK_THAT(count == 2 && wrong == 0, "%zu segments, %zu triangles wrong", count, wrong);
    adjacency_release(&adjacency);
    mem_free(shown);
    mem_free(of_triangle);
    mesh_release(&mesh);
}

int main(void) {
    rgb white = {0.8f, 0.8f, 0.8f}, wood = {0.5f, 0.3f, 0.15f}, black = {0.05f, 0.05f, 0.05f};
    rgb pale = {0.8f, 0.75f, 0.72f};
    check("plain", (struct paint){.wall = white, .panel = white, .shadow = 1.0f}, 0);
    check("light fades", (struct paint){.wall = white, .panel = white, .shadow = 1.0f, .fades = 0.9f, .noise = 0.1f},
          0);
    check("a shadow", (struct paint){.wall = white, .panel = white, .shadow = 0.4f, .noise = 0.05f}, 0);
    check("noise", (struct paint){.wall = white, .panel = white, .shadow = 1.0f, .noise = 0.4f}, 0);
    check("stripes", (struct paint){.wall = white, .panel = white, .shadow = 1.0f, .stripe_m = 0.05f}, 0);
    check("another white", (struct paint){.wall = white, .panel = pale, .shadow = 1.0f, .noise = 0.05f}, 0);
    check("wood", (struct paint){.wall = white, .panel = wood, .shadow = 1.0f, .fades = 0.5f, .noise = 0.1f}, 1);
    check("black", (struct paint){.wall = white, .panel = black, .shadow = 1.0f, .noise = 0.1f}, 1);
    check("wood, a third not seen", (struct paint){.wall = white, .panel = wood, .shadow = 1.0f, .is_torn = true}, 1);
    check("wood, its border not seen", (struct paint){.wall = white, .panel = wood, .shadow = 1.0f, .hidden_m = 0.2f},
          1);
    check_least("wood, of less than is asked for", (struct paint){.wall = white, .panel = wood, .shadow = 1.0f}, 2.0,
                0);
    check("no light", (struct paint){.wall = {0.0f, 0.0f, 0.0f}, .panel = {0.0f, 0.0f, 0.0f}}, 0);
    check("paler red", (struct paint){.wall = white, .panel = {0.6f, 0.8f, 0.8f}, .shadow = 1.0f}, 1);
    test_segments_stay();
    test_pieces(true);
    test_pieces(false);
    return check_result();
}
