/* light_point.h: what a sky sends to points through a hole in the ceiling, against closed forms: all of it and by cell,
 * of the sky and of a box around the room; nothing behind a wall; and the joint fit finds the sky's radiance from these
 * responses, which noise would make too small. sky_doubt.h: half of that sky, of bright texels alone. */
#include "server/light/joint_fit.h"
#include "server/light/decision/sky_doubt.h"
#include "server/scene/rgb_half.h"
#include "tests/render/light_response_rig.h"

#define HOLE 1.0f /* side of the hole in the ceiling, from (.5, 3, 1) on */
#define SKY 8.0f
#define PARTS 40 /* of the hole along each side, in the closed form by cell */

/* --- a sky through a hole ------------------------------------------------------------------------------------ */

/* The ceiling but for the hole; the other walls are those of start_room. */
static void make_room_with_hole(struct mesh *m) {
    start_room(m, 16);
    m->vertex_count -= 12, m->triangle_count -= 6; /* all but the floor again */
    vec3 x = {4, 0, 0}, y = {0, 3, 0}, z = {0, 0, 3};
    add_quad(m, 2, (vec3){0, 0, 0}, y, z);
    add_quad(m, 3, x, z, y);
    add_quad(m, 5, (vec3){0, 0, 0}, x, y);
    add_quad(m, 5, z, y, x);
    add_quad(m, 1, y, (vec3){0.5f, 0, 0}, z);
    add_quad(m, 1, (vec3){0.5f + HOLE, 3, 0}, (vec3){3.5f - HOLE, 0, 0}, z);
    add_quad(m, 1, (vec3){0.5f, 3, 0}, (vec3){HOLE, 0, 0}, (vec3){0, 0, 1});
    add_quad(m, 1, (vec3){0.5f, 3, 1.0f + HOLE}, (vec3){HOLE, 0, 0}, (vec3){0, 0, 2.0f - HOLE});
    add_quad(m, WALL, (vec3){WALL_AT, 0, 0}, z, y);
    add_lamp(m);
    for (size_t i = 0; i < 4; i++) /* out of the way */
        m->position[m->vertex_count - 1 - i].y = -1.0f;
}

/* Adds the form factors from a floor point to the parts of the hole that lie in each cell; returns their sum. */
static double hole_factors(vec3 p, double cell[SKY_CELLS]) {
    double sum = 0.0, area = (double)(HOLE * HOLE) / (PARTS * PARTS);
    for (int i = 0; i < PARTS * PARTS; i++) {
        vec3 at = {0.5f + HOLE * ((float)(i % PARTS) + 0.5f) / PARTS, 3.0f,
                   1.0f + HOLE * ((float)(i / PARTS) + 0.5f) / PARTS};
        vec3 way = vec3_sub(at, p);
        double square = (double)vec3_dot(way, way);
        double factor = (double)irradiance_matt(way.y / sqrtf((float)square)) * area * (double)(way.y * way.y) /
                        (PI * square * square);
        struct sky_corners c = sky_cells_around(vec3_normalize(way));
        for (int k = 0; k < 4; k++)
            cell[c.cell[k]] += factor * (double)c.weight[k];
        sum += factor;
    }
    return sum;
}

/* The same for the cells of a box. */
static double hole_parts(vec3 p, const struct surround *surround, double cell[SURROUND_CELLS]) {
    double sum = 0.0, area = (double)(HOLE * HOLE) / (PARTS * PARTS);
    for (int i = 0; i < PARTS * PARTS; i++) {
        vec3 at = {0.5f + HOLE * ((float)(i % PARTS) + 0.5f) / PARTS, 3.0f,
                   1.0f + HOLE * ((float)(i / PARTS) + 0.5f) / PARTS};
        vec3 way = vec3_sub(at, p);
        double square = (double)vec3_dot(way, way), factor = area * (double)(way.y * way.y) / (PI * square * square);
        cell[surround_cell(surround, p, vec3_normalize(way))] += factor;
        sum += factor;
    }
    return sum;
}

/* The sky's radiance, from what a floor of albedo .5 shows under the closed form's light. */
static double fit_sky(const struct rig *g, const struct light_points *points) {
    struct joint_point *joint = mem_array(points->count, sizeof *joint);
    float *lit = mem_array(points->count, sizeof *lit);
    struct joint_fit fit;
    for (size_t i = 0; i < points->count; i++) {
        const struct light_point *p = &points->point[i];
        double cell[SKY_CELLS] = {0};
        float light = p->at.position.x > WALL_AT ? 0.0f : SKY * (float)hole_factors(p->at.position, cell);
        joint[i] = (struct joint_point){p->segment, p->patch, 0.5f * (0.1f + light), 0.1f, 0.05f, false, false};
        lit[i] = p->escaping;
    }
    joint_fit_init(&fit, joint, points->count, 2, g->pool);
    joint_fit_add(&fit, &(struct joint_source){.deviation = 2.0, .least = -INFINITY}, lit);
    joint_fit_solve(&fit);
    double found = exp(fit.source[1].value);
    joint_fit_release(&fit);
    mem_free(lit);
    mem_free(joint);
    return found;
}

static void compare_sky(const struct light_points *points) {
    double cell[2][SKY_CELLS] = {{0}}, sum[2] = {0.0, 0.0};
    for (size_t i = 0; i < points->count; i++) {
        const struct light_point *p = &points->point[i];
        if (p->at.position.x > WALL_AT + 0.3f) {
            CHECK_THAT(p->escaping == 0.0f, "%g behind the wall", (double)p->escaping);
            continue;
        }
        sum[0] += (double)p->escaping;
        for (size_t k = 0; k < SKY_CELLS && p->sky; k++)
            cell[0][k] += (double)p->sky[k];
        if (p->at.position.x < WALL_AT)
            sum[1] += hole_factors(p->at.position, cell[1]);
    }
    CHECK_NEAR(sum[0] / sum[1], 1.0, 0.02);
    for (size_t k = 0; k < SKY_CELLS; k++)
        CHECK_THAT(fabs(cell[0][k] - cell[1][k]) < 0.03 * cell[1][k] + 0.003 * sum[1], "cell %zu: %g, %g", k,
                   cell[0][k], cell[1][k]);
}

static void test_sky(void) {
    struct rig g = {0};
    struct survey survey;
    struct light_sky sky;
    struct light_points points;
    make_room_with_hole(&g.scene.mesh);
    rig_init(&g);
    light_sky_init(&sky, &g.r.environment);
    survey_init(&survey, &g.r, NULL, NULL, NULL, false, 1600);
    light_points_init(&points, &survey, &sky, NULL, 0.1f);
    survey_release(&survey);
    CHECK(points.count > 300);
    compare_sky(&points);
    double found = fit_sky(&g, &points);
    printf("sky of %g: %.2f\n", (double)SKY, found);
    CHECK_NEAR(found, (double)SKY, 0.05 * (double)SKY);
    light_points_release(&points);
    light_sky_release(&sky);
    rig_release(&g);
}

/* --- doubt about a sky that no photograph shows -------------------------------------------------------------- */

/* Of the floor between two places along x: mean radiance of white texels by the half of a sky of radiance SKY towards
 * -x, by the closed form and by sky_doubt; the other half was seen. */
static double doubt_between(const struct rig *g, float from, float to, double *wanted) {
    uint32_t *texel = mem_array(g->model.inverse.valid_count + 1, sizeof *texel);
    size_t count = 0, bright = 0;
    *wanted = 0.0;
    for (size_t i = 0; i < g->model.inverse.valid_count; i++) {
        struct surface_point at;
        uint32_t t = g->model.inverse.valid[i];
        if (!(g->r.fused.count[t] > 0.0f) || !surface_at_texel(&g->scene.mesh, &g->r.atlas, &g->r.inverse, t, &at) ||
            at.position.x < from || at.position.x > to)
            continue;
        texel[count++] = t;
        const struct emitter_evidence *evidence = &g->r.evidence[reconstruction_segment(&g->r, t)];
        if (!evidence_is_as_bright(evidence, fused_radiance(&g->r.fused, t)))
            continue;
        double area = (double)(HOLE * HOLE) / (PARTS * PARTS);
        for (int k = 0; k < PARTS * PARTS; k++) {
            vec3 way = vec3_sub((vec3){0.5f + HOLE * ((float)(k % PARTS) + 0.5f) / PARTS, 3.0f,
                                       1.0f + HOLE * ((float)(k / PARTS) + 0.5f) / PARTS},
                                at.position);
            double square = (double)vec3_dot(way, way);
            *wanted += way.x < 0.0f ? (double)SKY * area * (double)(way.y * way.y) / (PI * square * square) : 0.0;
        }
        bright++;
    }
    *wanted /= fmax((double)bright, 1.0);
    double found = (double)sky_doubt(&g->r, texel, count);
    mem_free(texel);
    return found;
}

/* Texels near the wall are bright, as a lamp is; what the sky may send to all others does not count. */
static void test_doubt(void) {
    struct rig g = {0};
    struct environment *e = &g.r.environment;
    make_room_with_hole(&g.scene.mesh);
    rig_init(&g);
    environment_make_empty(e, 64);
    for (size_t i = 0; i < environment_pixel_count(e); i++) {
        for (size_t c = 0; c < 3; c++)
            e->map.pixel[3 * i + c] = SKY;
        e->confidence.pixel[2 * i] = environment_pixel_direction(e, i).x > 0.0f;
    }
    world_set_environment(&g.r.world, &e->map, g.pool);
    g.r.evidence = mem_calloc(g.r.segments.count, sizeof *g.r.evidence);
    for (size_t s = 0; s < g.r.segments.count; s++)
        evidence_set_radiance(&g.r.evidence[s], rgb_gray(1.0f));
    for (size_t i = 0; i < g.model.inverse.valid_count; i++) {
        struct surface_point at;
        uint32_t texel = g.model.inverse.valid[i];
        if (surface_at_texel(&g.scene.mesh, &g.r.atlas, &g.r.inverse, texel, &at) && at.position.x > 1.6f)
            rgb_to_half(g.r.fused.radiance[texel], rgb_gray(1.0f));
    }
    double wanted, all;
    double near_wall = doubt_between(&g, 0.0f, WALL_AT - 0.1f, &wanted), left = doubt_between(&g, 0.0f, 1.0f, &all);
    printf("doubt: %.3f (%.3f), beyond the hole %.3f\n", near_wall, wanted, left);
    CHECK_NEAR(near_wall, wanted, 0.15 * wanted);
    CHECK_THAT(left < 0.5 * near_wall, "%g, %g: the test is too easy", left, near_wall);
    CHECK(doubt_between(&g, WALL_AT + 0.3f, 4.0f, &wanted) == 0.0);
    mem_free(g.r.evidence);
    environment_release(e);
    rig_release(&g);
}

/* --- a box around the room with the hole ---------------------------------------------------------------------- */

/* A cell of the box's upper side, just above the ceiling, sends through its part of the hole. */
static void test_surround(void) {
    struct rig g = {0};
    struct survey survey;
    struct light_sky sky;
    struct light_points points;
    struct surround surround;
    struct views views = {.scene = &g.scene};
    make_room_with_hole(&g.scene.mesh);
    for (size_t i = 0; i < 4; i++) /* the lamp, which lies below the room */
        g.scene.mesh.position[g.scene.mesh.vertex_count - 1 - i].y = 0.0f;
    rig_init(&g);
    surround_init(&surround, &views);
    light_sky_init(&sky, &g.r.environment);
    sky.surround = &surround;
    survey_init(&survey, &g.r, NULL, NULL, NULL, false, 1600);
    light_points_init(&points, &survey, &sky, NULL, 0.1f);
    survey_release(&survey);
    double found[SURROUND_CELLS] = {0}, wanted[SURROUND_CELLS] = {0}, sum = 0.0;
    for (size_t i = 0; i < points.count; i++) {
        const struct light_point *p = &points.point[i];
        if (p->at.position.x > WALL_AT)
            continue;
        for (size_t k = 0; k < SURROUND_CELLS && p->sky; k++)
            found[k] += (double)p->sky[k];
        sum += hole_parts(p->at.position, &surround, wanted);
    }
    for (size_t k = 0; k < SURROUND_CELLS; k++)
        CHECK_THAT(fabs(found[k] - wanted[k]) < 0.03 * wanted[k] + 0.003 * sum, "cell %zu: %g, %g", k, found[k],
                   wanted[k]);
    light_points_release(&points);
    light_sky_release(&sky);
    rig_release(&g);
}

int main(void) {
    test_sky();
    test_doubt();
    test_surround();
    return check_result();
}
